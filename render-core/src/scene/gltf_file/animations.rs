//! Loader of the animations to play.

use super::accessor::Buffers;
use super::lenient::PointerChannel;
use super::materials::{self, SPECULAR_GLOSSINESS};
use super::nodes::NodeOf;
use super::pointers::{self, Target};
use super::{DocumentSource, LoadError, Loader};
use crate::scene::{
    CameraChannel, Channel, Interpolation, LightChannel, LightProperty, MaterialChannel, MaterialFactors,
    MaterialProperty, Scene, SlotName, Track,
};
use glam::{Quat, Vec3};
use gltf::animation::Property;
use std::collections::HashSet;

impl Loader<'_> {
    /// Returns the animation called `name`, or the first animation, since others may be alternatives. The name "all"
    /// selects all animations that animate different properties.
    pub(super) fn clips<'d>(
        &self,
        document: &'d gltf::Document,
        pointers: &[PointerChannel],
        name: Option<&str>,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<gltf::Animation<'d>>, LoadError> {
        // Ignore clips that animate nothing.
        let mut clips: Vec<gltf::Animation> = document.animations().collect();
        clips.retain(|clip| !moved_by(clip, pointers).is_empty());
        // Select the clip by name, or all compatible clips.
        if let Some(name) = name {
            return match clips.iter().position(|clip| clip.name() == Some(name)) {
                Some(place) => Ok(vec![clips.swap_remove(place)]),
                None if name == "all" => Ok(all_together(clips, pointers, warnings)),
                None => {
                    let names = clips.iter().filter_map(gltf::Animation::name).collect::<Vec<_>>().join("\", \"");
                    self.bad(format!("there is no animation \"{name}\"; the file has \"{names}\""))
                }
            };
        }
        // Note the omitted clips.
        if clips.len() > 1 {
            warnings.push(format!(
                "only the first of {} animations plays; choose another by --animation NAME, or all by --animation all",
                clips.len()
            ));
        }
        clips.truncate(1);
        Ok(clips)
    }

    /// Reads the tracks of an animation, including the targets of `KHR_animation_pointer`.
    pub(super) fn channels(
        &self,
        clip: &gltf::Animation,
        source: DocumentSource,
        node_of: &NodeOf,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        // Collect the targets of plain channels and of pointers.
        let mut targets = Vec::new();
        for channel in clip.channels() {
            let (node, property) = (channel.target().node().index(), channel.target().property());
            targets.push((Target::Node(node, property), channel.sampler()));
        }
        let pointers = || source.pointers.iter().filter(|pointer| pointer.animation == clip.index());
        scene.warnings.extend(pointers::note(pointers().map(|pointer| pointer.pointer.as_str())));
        for pointer in pointers() {
            let Some(sampler) = clip.samplers().nth(pointer.sampler) else {
                return self.bad(format!("animation {} has no sampler {}", clip.index(), pointer.sampler));
            };
            targets.extend(pointers::target(&pointer.pointer).map(|target| (target, sampler)));
        }

        // Read the keys of each target, for every scene object that it affects.
        let morphed_places = scene.morphed_places();
        let weights_of = |node| morphed_places.get(&node).map(|&place| scene.morphed_nodes[place].weights.len());
        let (mut channels, mut lenses, mut lights, mut materials) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (target, sampler) in targets {
            let keys = Keys { place: target.to_string(), sampler, buffers: source.buffers };
            match target {
                // Nodes outside the scene have no effect.
                Target::Node(index, property) => {
                    let Some(&node) = node_of.get(&index) else { continue };
                    // Copies of a mesh, and the nodes that hide it, have the same weights as the mesh.
                    let nodes = match property {
                        Property::MorphTargetWeights => node_of.showing(node),
                        _ => vec![node],
                    };
                    for node in nodes {
                        channels.extend(self.channel(node, &keys, property, weights_of(node))?);
                    }
                }
                // Visibility scales meshes, and switches lights off.
                Target::Visible(index) => {
                    for node in node_of.hiding(index) {
                        channels.extend(self.visibility(node, &keys)?);
                    }
                    for (light, of_file) in node_of.lights_below(index, scene) {
                        let Some(channel) = self.visibility(scene.punctual_lights[light].node, &keys)? else {
                            continue;
                        };
                        let Some(rest) = source.light(of_file) else { continue };
                        let keys = as_numbers(channel);
                        lights.push(LightChannel { light, property: LightProperty::Visibility, rest, keys });
                    }
                }
                Target::Hint => {}
                // Copies of a material for strokes follow its animation.
                Target::Material(index, property) => {
                    let Some(channel) = self.material_channel(index, property, source, &keys)? else { continue };
                    let copy = copy_for_strokes(&channel, node_of);
                    materials.push(channel);
                    materials.extend(copy);
                }
                Target::Light(index, property) => {
                    // Read colors as translations and numbers as weights.
                    let kind = match property {
                        LightProperty::Color => Property::Translation,
                        _ => Property::MorphTargetWeights,
                    };
                    let keys = self.channel(0, &keys, kind, Some(1))?;
                    let (Some(keys), Some(rest)) = (keys, source.light(index)) else { continue };
                    // Each node with the light has a copy of the channel.
                    for light in node_of.lights(index) {
                        let keys = Channel { node: scene.punctual_lights[light].node, ..keys.clone() };
                        lights.push(LightChannel { light, property, rest, keys });
                    }
                }
                Target::Camera(index, property) => {
                    let keys = self.channel(0, &keys, Property::MorphTargetWeights, Some(1))?;
                    let Some(keys) = keys else { continue };
                    // Each node with the camera has a copy of the channel.
                    for camera in node_of.cameras(index) {
                        let keys = Channel { node: scene.cameras[camera].node, ..keys.clone() };
                        lenses.push(CameraChannel { camera, property, keys });
                    }
                }
            }
        }
        // Store the channels after all targets are read, because reading borrows the scene.
        scene.channels.extend(channels);
        scene.camera_channels.extend(lenses);
        scene.light_channels.extend(lights);
        scene.material_channels.extend(materials);
        Ok(())
    }

    /// Returns the keys of a material's property, or `None` if the material does not exist.
    fn material_channel(
        &self,
        index: usize,
        property: MaterialProperty,
        source: DocumentSource,
        keys: &Keys,
    ) -> Result<Option<MaterialChannel>, LoadError> {
        let Some(material) = source.document.materials().nth(index) else { return Ok(None) };
        // `KHR_materials_pbrSpecularGlossiness` replaces these factors.
        let is_older = material.extension_value(SPECULAR_GLOSSINESS).is_some();
        let is_replaced = matches!(
            property,
            MaterialProperty::BaseColor
                | MaterialProperty::Metallic
                | MaterialProperty::Roughness
                | MaterialProperty::Offset(SlotName::BaseColor | SlotName::MetallicRoughness)
                | MaterialProperty::Rotation(SlotName::BaseColor | SlotName::MetallicRoughness)
                | MaterialProperty::Scale(SlotName::BaseColor | SlotName::MetallicRoughness)
        );
        if is_older && is_replaced {
            return Ok(None);
        }
        // Read as many numbers per key as the property has components.
        let (output, buffers) = (keys.sampler.output(), keys.buffers);
        let numbers: Option<Vec<f32>> = match property.width() {
            1 => buffers.floats::<1>(&output).map(|list| list.concat()),
            2 => buffers.floats::<2>(&output).map(|list| list.concat()),
            3 => buffers.floats::<3>(&output).map(|list| list.concat()),
            _ => buffers.floats::<4>(&output).map(|list| list.concat()),
        };
        let Some(numbers) = numbers else {
            return self.bad(format!("{} needs keys of {} numbers each", keys.place, property.width()));
        };
        let keys = self.timed(0, keys, Track::Weights(numbers), property.width())?;
        Ok(Some(MaterialChannel { material: index, property, rest: materials::factors(&material), keys }))
    }

    /// Returns the visibility of a node as the scale of a node that hides it: 1 or 0, constant until the next key.
    fn visibility(&self, node: usize, keys: &Keys) -> Result<Option<Channel>, LoadError> {
        let Keys { place, sampler, buffers } = keys;
        // "The output accessor of a boolean property is of unsigned bytes": zero is false.
        let (times, values) = (buffers.floats::<1>(&sampler.input()), buffers.floats::<1>(&sampler.output()));
        let (Some(times), Some(values)) = (times, values) else {
            return self.bad(format!("{place} has no keys"));
        };
        // Check the order of the times, which a binary search requires.
        let times: Vec<f32> = times.into_iter().flatten().collect();
        let scales = values.iter().map(|[value]| if *value == 0.0 { Vec3::ZERO } else { Vec3::ONE }).collect();
        let ascending = times.windows(2).all(|pair| pair[0] <= pair[1]) && times.iter().all(|t| t.is_finite());
        if times.is_empty() || values.len() < times.len() || !ascending {
            return self.bad(format!("{place}: keys must be finite, ascending in time, with one value each"));
        }
        Ok(Some(Channel { node, times, track: Track::Scale(scales), interpolation: Interpolation::Step }))
    }

    /// Returns a track of keys for a node with this number of `weights`, or `None` for weights of a node without morph
    /// targets.
    fn channel(
        &self,
        node: usize,
        keys: &Keys,
        property: Property,
        weights: Option<usize>,
    ) -> Result<Option<Channel>, LoadError> {
        let Keys { place, sampler, buffers } = keys;
        // Convert the keys to the property's type.
        let output = sampler.output();
        let vectors = || buffers.floats::<3>(&output).map(|keys| keys.into_iter().map(Vec3::from).collect());
        let track = match property {
            Property::Translation => vectors().map(Track::Translation),
            Property::Scale => vectors().map(Track::Scale),
            Property::Rotation => buffers
                .floats::<4>(&output)
                .map(|keys| Track::Rotation(keys.into_iter().map(Quat::from_array).collect())),
            Property::MorphTargetWeights => {
                buffers.floats::<1>(&output).map(|keys| Track::Weights(keys.into_iter().flatten().collect()))
            }
        };
        let Some(track) = track else { return self.bad(format!("{place} has no keys")) };
        // Keys of weights list all morph targets; other keys are single values.
        let width = match &track {
            Track::Weights(_) => match weights {
                Some(weights) => weights,
                None => return Ok(None),
            },
            _ => 1,
        };
        self.timed(node, keys, track, width).map(Some)
    }

    /// Returns a track with the times of its keys, after validation. Each key has `width` weights.
    fn timed(&self, node: usize, keys: &Keys, track: Track, width: usize) -> Result<Channel, LoadError> {
        let Keys { place, sampler, buffers } = keys;
        let interpolation = match sampler.interpolation() {
            gltf::animation::Interpolation::Step => Interpolation::Step,
            gltf::animation::Interpolation::Linear => Interpolation::Linear,
            gltf::animation::Interpolation::CubicSpline => Interpolation::CubicSpline,
        };
        let Some(times) = buffers.floats::<1>(&sampler.input()) else {
            return self.bad(format!("{place} has no keys"));
        };
        let times: Vec<f32> = times.into_iter().flatten().collect();
        // Count the keys, and check that all numbers are finite.
        let (keys, finite) = match &track {
            Track::Translation(keys) | Track::Scale(keys) => (keys.len(), keys.iter().all(|k| k.is_finite())),
            Track::Rotation(keys) => (keys.len(), keys.iter().all(|k| k.is_finite())),
            Track::Weights(keys) => (keys.len() / width, keys.iter().all(|k| k.is_finite())),
        };
        // Splines have two tangents per key. Keys must be ascending for the binary search.
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let ascending = times.windows(2).all(|pair| pair[0] <= pair[1]) && times.iter().all(|t| t.is_finite());
        if times.is_empty() || keys < times.len() * per_key || !finite || !ascending {
            return self.bad(format!("{place}: keys must be finite, ascending in time, with one value each"));
        }
        Ok(Channel { node, times, track, interpolation })
    }
}

/// Converts a node's visibility from scales to weights.
fn as_numbers(channel: Channel) -> Channel {
    let track = match channel.track {
        Track::Scale(keys) => Track::Weights(keys.into_iter().map(|scale| scale.x).collect()),
        track => track,
    };
    Channel { track, ..channel }
}

impl DocumentSource<'_> {
    /// Returns the color and intensity of a light in the file, and the factor on their product.
    fn light(&self, index: usize) -> Option<(Vec3, f32, f32)> {
        let light = self.document.lights()?.nth(index)?;
        Some((Vec3::from(light.color()), light.intensity(), self.lamps))
    }
}

/// Returns the same channel for the copy of the material that points and lines use, if the copy exists.
fn copy_for_strokes(channel: &MaterialChannel, node_of: &NodeOf) -> Option<MaterialChannel> {
    let material = *node_of.unlit.get(&channel.material)?;
    let rest = MaterialFactors { shows_sum: true, ..channel.rest };
    Some(MaterialChannel { material, rest, ..channel.clone() })
}

/// Keys of a track.
struct Keys<'d> {
    /// Description of the animation and its target, for messages.
    place: String,
    sampler: gltf::animation::Sampler<'d>,
    buffers: &'d Buffers,
}

/// Returns the properties that a clip animates, as JSON pointers.
fn moved_by(clip: &gltf::Animation, pointers: &[PointerChannel]) -> HashSet<String> {
    let mut moved = HashSet::new();
    // Plain channels animate transforms and weights of nodes.
    for channel in clip.channels() {
        let path = match channel.target().property() {
            Property::Translation => "translation",
            Property::Rotation => "rotation",
            Property::Scale => "scale",
            Property::MorphTargetWeights => "weights",
        };
        moved.insert(format!("/nodes/{}/{path}", channel.target().node().index()));
    }
    // Pointer channels name their property themselves.
    let own = pointers.iter().filter(|pointer| pointer.animation == clip.index());
    moved.extend(own.map(|pointer| pointer.pointer.clone()));
    moved
}

/// Returns all clips except clips with a property that an earlier clip animates. A note names the omitted clips.
fn all_together<'d>(
    clips: Vec<gltf::Animation<'d>>,
    pointers: &[PointerChannel],
    notes: &mut Vec<String>,
) -> Vec<gltf::Animation<'d>> {
    // Keep a clip only if no earlier clip animates any of its properties.
    let (mut moved, mut together, mut others) = (HashSet::new(), Vec::new(), Vec::new());
    for clip in clips {
        let own = moved_by(&clip, pointers);
        if own.is_disjoint(&moved) {
            moved.extend(own);
            together.push(clip);
        } else {
            others.push(clip.name().unwrap_or("without a name").to_owned());
        }
    }
    if !others.is_empty() {
        let others = others.join("\", \"");
        notes.push(format!("animations of properties that an earlier one moves are left out: \"{others}\""));
    }
    together
}
