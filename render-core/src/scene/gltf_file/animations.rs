//! The clip that plays.

use super::accessor::Buffers;
use super::nodes::NodeOf;
use super::{LoadError, Loader};
use crate::scene::{Channel, Interpolation, Scene, Track};
use glam::{Quat, Vec3};
use gltf::animation::Property;

impl Loader<'_> {
    /// The animation of that `name`, or the first: a file's others are alternatives, not parts.
    pub(super) fn clip<'d>(
        &self,
        document: &'d gltf::Document,
        name: Option<&str>,
        warnings: &mut Vec<String>,
    ) -> Result<Option<gltf::Animation<'d>>, LoadError> {
        let mut clips: Vec<gltf::Animation> = document.animations().collect();
        if let Some(name) = name {
            return match clips.iter().position(|clip| clip.name() == Some(name)) {
                Some(place) => Ok(Some(clips.swap_remove(place))),
                None => {
                    let names = clips.iter().filter_map(gltf::Animation::name).collect::<Vec<_>>().join("\", \"");
                    self.bad(format!("there is no animation \"{name}\"; there are \"{names}\""))
                }
            };
        }
        if clips.len() > 1 {
            warnings.push(format!(
                "of {} animations the first plays; name another as [animation] name = \"…\" in the settings beside the scene",
                clips.len()
            ));
        }
        Ok(clips.into_iter().next())
    }

    /// Reads the tracks of an animation.
    pub(super) fn channels(
        &self,
        clip: &gltf::Animation,
        buffers: &Buffers,
        node_of: &NodeOf,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        let morphed_places = scene.morphed_places();
        let weights_of = |node| morphed_places.get(&node).map(|&place| scene.morphed_nodes[place].weights.len());
        let mut channels = Vec::new();
        for channel in clip.channels() {
            let Some(&node) = node_of.get(&channel.target().node().index()) else { continue };
            channels.extend(self.channel(&channel, node, buffers, weights_of(node))?);
        }
        scene.channels.extend(channels);
        Ok(())
    }

    /// A track of keys for a node with so many `weights`; `None` for weights of a node that has nothing to morph.
    fn channel(
        &self,
        channel: &gltf::animation::Channel,
        node: usize,
        buffers: &Buffers,
        weights: Option<usize>,
    ) -> Result<Option<Channel>, LoadError> {
        let place = format!("animation of node {}", channel.target().node().index());
        let sampler = channel.sampler();
        let interpolation = match sampler.interpolation() {
            gltf::animation::Interpolation::Step => Interpolation::Step,
            gltf::animation::Interpolation::Linear => Interpolation::Linear,
            gltf::animation::Interpolation::CubicSpline => Interpolation::CubicSpline,
        };
        let output = sampler.output();
        let vectors = || buffers.floats::<3>(&output).map(|keys| keys.into_iter().map(Vec3::from).collect());
        let track = match channel.target().property() {
            Property::Translation => vectors().map(Track::Translation),
            Property::Scale => vectors().map(Track::Scale),
            Property::Rotation => buffers
                .floats::<4>(&output)
                .map(|keys| Track::Rotation(keys.into_iter().map(Quat::from_array).collect())),
            Property::MorphTargetWeights => {
                buffers.floats::<1>(&output).map(|keys| Track::Weights(keys.into_iter().flatten().collect()))
            }
        };
        let (Some(times), Some(track)) = (buffers.floats::<1>(&sampler.input()), track) else {
            return self.bad(format!("{place} has no keys"));
        };
        let times: Vec<f32> = times.into_iter().flatten().collect();
        let width = match &track {
            Track::Weights(_) => match weights {
                Some(weights) => weights,
                None => return Ok(None),
            },
            _ => 1,
        };
        let (keys, finite) = match &track {
            Track::Translation(keys) | Track::Scale(keys) => (keys.len(), keys.iter().all(|k| k.is_finite())),
            Track::Rotation(keys) => (keys.len(), keys.iter().all(|k| k.is_finite())),
            Track::Weights(keys) => (keys.len() / width, keys.iter().all(|k| k.is_finite())),
        };
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let ascending = times.windows(2).all(|pair| pair[0] <= pair[1]) && times.iter().all(|t| t.is_finite());
        if times.is_empty() || keys < times.len() * per_key || !finite || !ascending {
            return self.bad(format!("{place}: keys must be finite, ascending in time, and one value each"));
        }
        Ok(Some(Channel { node, times, track, interpolation }))
    }
}
