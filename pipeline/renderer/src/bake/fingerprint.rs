//! Fingerprint of a scene: a hash of all data that affects baked light.
//!
//! Values are hashed as little-endian bytes by 64-bit XXH3, which is stable across machines and versions. The length of
//! each list precedes its items. Both zeros hash equally, and so do all NaNs.
//!
//! Cameras, the motion of cameras, and names are excluded. A node is included if a lit surface, a light or a joint
//! descends from it. Included nodes are renumbered in order, so camera nodes between them have no effect.

use glam::{Affine3A, Vec2, Vec3, Vec4};
use render_core::scene::{
    Alpha, Channel, Influence, Interpolation, LightChannel, Material, MaterialChannel, MaterialFactors, MaterialLobes,
    Mesh, MorphTarget, MorphedNode, Node, PunctualKind, PunctualLight, Scene, SceneSettings, Skin, Skinning,
    SpecularFactors, TextureSlot, Track, Transform,
};
use xxhash_rust::xxh3::Xxh3;

/// Version of the hashed data and its order.
const VERSION: usize = 1;
/// Number of list items hashed per update.
const BATCH: usize = 256;

/// Returns the hash of all data in `scene` that affects baked light.
///
/// # Panics
/// If the scene refers to a node that does not exist.
#[must_use]
pub fn fingerprint(scene: &Scene) -> u64 {
    // Destructure all fields, so that a new field requires a decision whether it affects light.
    let Scene {
        nodes: _,
        meshes,
        materials,
        textures,
        instances,
        skins,
        morphed_nodes,
        punctual_lights,
        cameras: _,
        channels: _,
        camera_channels: _,
        light_channels,
        material_channels,
        curtains,
        sky,
        displacement: _,
        background: _,
        ground: _,
        settings,
        warnings: _,
        origin: _,
    } = scene;
    let SceneSettings {
        tone_mapping: _,
        sky: _,
        studio: _,
        sun,
        camera: _,
        animation: _,
        variant: _,
        strokes: _,
        light: _,
        video: _,
        importance: _,
    } = settings;
    let mut hash = SceneHash { hash: Xxh3::new(), batch: Vec::new(), numbers: numbers(scene) };
    hash.number(VERSION);

    // Hash the surfaces.
    hash.each(meshes, SceneHash::mesh);
    hash.each(materials, SceneHash::material);
    hash.number(textures.len());
    textures.iter().for_each(|texture| texture.visit_bytes(&mut |bytes| hash.hash.update(bytes)));

    // Hash the nodes and their motion.
    hash.nodes(scene);
    hash.number(instances.len());
    for instance in instances {
        hash.node(instance.node);
        hash.number(instance.mesh);
    }
    hash.each(skins, SceneHash::skin);
    hash.number(morphed_nodes.len());
    for MorphedNode { node, weights } in morphed_nodes {
        hash.node(*node);
        hash.floats(weights);
    }

    // Hash the lights.
    hash.each(punctual_lights, SceneHash::light);
    if !light_channels.is_empty() {
        hash.each(light_channels, SceneHash::light_channel);
    }
    if !material_channels.is_empty() {
        hash.each(material_channels, SceneHash::material_channel);
    }
    curtains.iter().for_each(|&node| hash.node(node));
    hash.floats(&[sun.angular_diameter]);
    hash.number(usize::from(sky.is_some()));
    if let Some(sky) = sky {
        sky.visit_numbers(&mut |numbers| hash.floats(numbers));
    }
    hash.hash.digest()
}

/// Returns the new number of each node that affects light, `None` for other nodes.
fn numbers(scene: &Scene) -> Vec<Option<usize>> {
    // Mark the nodes of instances, lights, morph targets and joints.
    let mut counts = vec![false; scene.nodes.len()];
    scene.instances.iter().for_each(|instance| counts[instance.node] = true);
    scene.punctual_lights.iter().for_each(|light| counts[light.node] = true);
    scene.morphed_nodes.iter().for_each(|morphed| counts[morphed.node] = true);
    scene.skins.iter().flat_map(|skin| &skin.joints).for_each(|&joint| counts[joint] = true);

    // Mark their ancestors, which move them. Parents precede their children in the list, so one backward pass suffices.
    for index in (0..scene.nodes.len()).rev() {
        if let Some(parent) = scene.nodes[index].parent.filter(|_| counts[index]) {
            counts[parent] = true;
        }
    }
    // Renumber the marked nodes in order.
    let mut next = 0..;
    counts.into_iter().map(|counts| if counts { next.next() } else { None }).collect()
}

/// Returns the bits of a number, with equal bits for both zeros and for all NaNs.
fn bits(x: f32) -> u32 {
    if x.is_nan() { 0x7fc0_0000 } else { (x + 0.0).to_bits() }
}

/// An unfinished hash.
struct SceneHash {
    hash: Xxh3,
    /// Buffer for the bytes of many items, which are hashed together.
    batch: Vec<u8>,
    /// New numbers of the included nodes; see [`numbers`].
    numbers: Vec<Option<usize>>,
}

impl SceneHash {
    fn number(&mut self, number: usize) {
        self.hash.update(&(number as u64).to_le_bytes());
    }

    /// Hashes a list of items, each of `N` words.
    fn list<T: Copy, const N: usize>(&mut self, list: &[T], words: impl Fn(T) -> [u32; N]) {
        self.number(list.len());
        // Collect the bytes of many items: the hash is faster on long inputs.
        for part in list.chunks(BATCH) {
            self.batch.clear();
            for word in part.iter().flat_map(|&item| words(item)) {
                self.batch.extend_from_slice(&word.to_le_bytes());
            }
            self.hash.update(&self.batch);
        }
    }

    fn floats(&mut self, list: &[f32]) {
        self.list(list, |x| [bits(x)]);
    }

    fn points(&mut self, list: &[Vec3]) {
        self.list(list, |point| point.to_array().map(bits));
    }

    fn vectors(&mut self, list: &[Vec4]) {
        self.list(list, |vector| vector.to_array().map(bits));
    }

    /// Hashes the length of a list, and each item with `item`.
    fn each<T>(&mut self, list: &[T], item: fn(&mut Self, &T)) {
        self.number(list.len());
        list.iter().for_each(|one| item(self, one));
    }

    fn node(&mut self, node: usize) {
        self.number(self.numbers[node].expect("an included node"));
    }

    fn mesh(&mut self, mesh: &Mesh) {
        let Mesh { name: _, positions, normals, tangents, uvs, colors, triangles, material, morph_targets, skinning } =
            mesh;
        // Hash vertices and triangles.
        self.points(positions);
        self.points(normals);
        self.vectors(tangents);
        uvs.iter().for_each(|uvs| self.list(uvs, |uv: Vec2| uv.to_array().map(bits)));
        self.vectors(colors);
        self.list(triangles, |triangle| triangle);
        self.number(*material);

        // Hash skin and morph targets.
        self.number(morph_targets.len());
        for MorphTarget { positions, normals, tangents } in morph_targets {
            [positions, normals, tangents].into_iter().for_each(|list| self.points(list));
        }
        self.number(usize::from(skinning.is_some()));
        if let Some(Skinning { skin, per_vertex, influences }) = skinning {
            self.number(*skin);
            self.number(*per_vertex);
            self.list(influences, |Influence { joint, weight }| [joint, bits(weight)]);
        }
    }

    fn skin(&mut self, Skin { joints, inverse_bind }: &Skin) {
        self.number(joints.len());
        joints.iter().for_each(|&joint| self.node(joint));
        self.list(inverse_bind, |matrix: Affine3A| matrix.to_cols_array().map(bits));
    }

    fn material(&mut self, material: &Material) {
        let Material {
            name: _,
            base_color,
            base_color_texture,
            metallic,
            roughness,
            metallic_roughness_texture,
            normal_texture,
            dielectric_f0,
            opacity,
            alpha,
            emission,
            emission_texture,
            double_sided,
            unlit,
            lobes,
        } = material;
        self.points(&[*base_color, *dielectric_f0, *emission]);
        self.floats(&[*metallic, *roughness, *opacity]);
        // Number the alpha modes here: the hash must not depend on the order of variants.
        let (alpha, cutoff) = match alpha {
            Alpha::Opaque => (0, 0.0),
            Alpha::Mask { cutoff } => (1, *cutoff),
            Alpha::Blend => (2, 0.0),
        };
        self.number(alpha);
        self.floats(&[cutoff]);
        [*double_sided, *unlit].into_iter().for_each(|is_so| self.number(usize::from(is_so)));

        // Hash the textures.
        for slot in [base_color_texture, metallic_roughness_texture, emission_texture] {
            self.slot(slot.as_ref());
        }
        self.slot(normal_texture.as_ref().map(|(slot, _)| slot));
        self.floats(&[normal_texture.map_or(0.0, |(_, factor)| factor)]);
        // Plain materials have the same hash as before extensions were read.
        if let Some(lobes) = lobes {
            self.lobes(lobes);
        }
    }

    fn lobes(&mut self, lobes: &MaterialLobes) {
        let MaterialLobes {
            ior,
            specular,
            anisotropy,
            clearcoat,
            sheen,
            iridescence,
            transmission,
            diffuse_transmission,
        } = lobes;
        let coat_scale = clearcoat.normal_texture.map_or(0.0, |(_, scale)| scale);
        let [thinnest, thickest] = iridescence.thickness;
        self.floats(&[*ior, specular.factor, anisotropy.strength, anisotropy.rotation, clearcoat.factor]);
        self.floats(&[clearcoat.roughness, coat_scale, sheen.roughness, iridescence.factor, iridescence.ior]);
        self.floats(&[thinnest, thickest, transmission.factor, transmission.dispersion, diffuse_transmission.factor]);
        self.points(&[sheen.color, diffuse_transmission.color]);
        self.number(usize::from(transmission.volume.is_some()));
        self.points(&[transmission.volume.map_or(Vec3::ZERO, |volume| volume.attenuation)]);
        // Hash which slots exist, then the slots.
        let SpecularFactors { texture, color_texture, .. } = specular;
        let slots = [
            *texture,
            *color_texture,
            anisotropy.texture,
            clearcoat.texture,
            clearcoat.roughness_texture,
            clearcoat.normal_texture.map(|(slot, _)| slot),
            sheen.color_texture,
            sheen.roughness_texture,
            iridescence.texture,
            iridescence.thickness_texture,
            transmission.texture,
            diffuse_transmission.texture,
            diffuse_transmission.color_texture,
        ];
        slots.iter().for_each(|slot| self.slot(slot.as_ref()));
    }

    fn slot(&mut self, slot: Option<&TextureSlot>) {
        self.number(usize::from(slot.is_some()));
        let Some(TextureSlot { texture, uv_set, transform }) = slot else { return };
        self.number(*texture);
        self.number(*uv_set);
        self.number(usize::from(transform.is_some()));
        if let Some((offset, rotation, scale)) = transform {
            self.floats(&[offset.x, offset.y, *rotation, scale.x, scale.y]);
        }
    }

    fn light(&mut self, PunctualLight { node, color, kind }: &PunctualLight) {
        self.node(*node);
        self.points(&[*color]);
        match kind {
            PunctualKind::Directional => self.number(0),
            PunctualKind::Point => self.number(1),
            PunctualKind::Spot { inner, outer } => {
                self.number(2);
                self.floats(&[*inner, *outer]);
            }
            // Hash the debug text of unknown kinds.
            kind => {
                self.number(3);
                self.list(format!("{kind:?}").as_bytes(), |byte| [u32::from(byte)]);
            }
        }
    }

    fn light_channel(&mut self, LightChannel { light, property, rest, keys }: &LightChannel) {
        self.number(*light);
        self.list(format!("{property:?}").as_bytes(), |byte| [u32::from(byte)]);
        self.points(&[rest.0]);
        self.floats(&[rest.1, rest.2]);
        self.channel(keys);
    }

    fn material_channel(&mut self, MaterialChannel { material, property, rest, keys }: &MaterialChannel) {
        let MaterialFactors { base_color, emission, ior, specular, shows_sum } = rest;
        self.number(*material);
        self.list(format!("{property:?}").as_bytes(), |byte| [u32::from(byte)]);
        self.points(&[*base_color, emission.0, specular.1]);
        self.floats(&[emission.1, *ior, specular.0]);
        self.number(usize::from(*shows_sum));
        self.channel(keys);
    }

    /// Hashes the included nodes and their animation.
    fn nodes(&mut self, scene: &Scene) {
        // Hash the included nodes, renumbered.
        self.number(self.numbers.iter().flatten().count());
        for (index, Node { name: _, parent, rest }) in scene.nodes.iter().enumerate() {
            if self.numbers[index].is_none() {
                continue;
            }
            self.number(usize::from(parent.is_some()));
            parent.iter().for_each(|&parent| self.node(parent));
            let Transform { translation, rotation, scale } = rest;
            self.points(&[*translation, *scale]);
            self.floats(&rotation.to_array());
        }

        // Hash the animation of the included nodes.
        let counts = |channel: &&Channel| self.numbers[channel.node].is_some();
        let channels: Vec<&Channel> = scene.channels.iter().filter(counts).collect();
        self.number(channels.len());
        channels.into_iter().for_each(|channel| self.channel(channel));
    }

    fn channel(&mut self, Channel { node, times, track, interpolation }: &Channel) {
        self.node(*node);
        self.floats(times);
        self.number(match interpolation {
            Interpolation::Step => 0,
            Interpolation::Linear => 1,
            Interpolation::CubicSpline => 2,
        });
        // Hash the kind before the keys: translations and scales have equal layouts.
        let kind = match track {
            Track::Translation(_) => 0,
            Track::Rotation(_) => 1,
            Track::Scale(_) => 2,
            Track::Weights(_) => 3,
        };
        self.number(kind);
        match track {
            Track::Translation(keys) | Track::Scale(keys) => self.points(keys),
            Track::Rotation(keys) => self.list(keys, |key| key.to_array().map(bits)),
            Track::Weights(keys) => self.floats(keys),
        }
    }
}

#[cfg(test)]
mod tests;
