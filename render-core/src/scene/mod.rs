//! Scene and its pose at a time: nodes, meshes, materials, lights, cameras.

mod animation;
mod backdrop;
mod camera;
mod clipped;
mod deform;
mod encoding;
mod far;
mod files;
mod framing;
mod gltf_file;
mod light;
mod lobes;
mod material;
mod material_animation;
mod mesh;
mod setting;
mod settings;
mod settings_error;
mod sky;
mod studio;
mod studio_settings;
mod texture;
mod texture_slot;
mod typed_setting;
mod viewpoint;

pub use crate::environment::Gradient;
pub use animation::{Channel, Interpolation, Track};
pub use camera::{Camera, CameraChannel, CameraProperty, DepthRange, Projected, Projection, View};
pub use deform::{DeformedMesh, MorphedNode, Skin};
pub use encoding::Encoding;
pub(crate) use encoding::NORMAL_ROUNDING;
pub use files::{Origin, Reach};
pub use gltf_file::{EXTENSIONS, Extension, GltfSource, LoadError, Support, extension_table, load, load_with};
pub use light::{LightChannel, LightProperty, PunctualKind, PunctualLight};
pub use lobes::{
    Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, MaterialLobes, Sheen, SpecularFactors, Transmission,
    Volume,
};
pub use material::{Alpha, Material};
pub use material_animation::{MaterialChannel, MaterialFactors, MaterialProperty, SlotName};
pub(crate) use mesh::interpolate as mesh_interpolate;
pub use mesh::{Influence, Mesh, MorphTarget, Skinning};
pub use setting::Setting;
pub use settings::{Gaze, LightSettings, SceneSettings, parse_frame_rate};
pub use settings_error::SettingsError;
pub use sky::SkySettings;
pub use studio::{Ground, STUDIO_GROUND};
pub use studio_settings::{StudioKind, StudioSettings};
pub use texture::{Filtered, Texture, Wrap};
pub use texture_slot::{TextureSlot, UV_SETS};
pub use viewpoint::{CameraChoice, Orbit, OrbitDistance};

use crate::environment::Environment;
use crate::steps;
use glam::{Affine3A, BVec3A, Mat3A, Quat, Vec3, Vec3A};
use std::sync::Arc;

/// Node of the hierarchy with its rest transform.
#[derive(Clone, Debug)]
pub struct Node {
    /// Name in the file, or an empty string.
    pub name: String,
    /// Index of the parent, always smaller than the node's own index.
    pub parent: Option<usize>,
    /// Scale, rotation and translation of the rest pose relative to the parent.
    pub rest: Transform,
}

/// Translation, rotation and scale: the properties that glTF animates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Translation, applied after scale and rotation \[m\].
    pub translation: Vec3,
    /// Rotation as a unit quaternion.
    pub rotation: Quat,
    /// Scale factor along each axis.
    pub scale: Vec3,
}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Transform {
    /// Identity transform.
    pub const IDENTITY: Self = Self { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };

    /// Returns the transform as an affine map.
    #[must_use]
    pub fn matrix(&self) -> Affine3A {
        Affine3A::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// Mesh attached to a node.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// Index of the node in [`Scene::nodes`].
    pub node: usize,
    /// Index of the mesh in [`Scene::meshes`].
    pub mesh: usize,
}

/// Scene as loaded: static data and animation tracks.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Nodes of the hierarchy. Parents precede their children.
    pub nodes: Vec<Node>,
    /// Meshes, one per glTF primitive, each with one material.
    pub meshes: Vec<Mesh>,
    /// Materials of the meshes. Never empty if the scene has a mesh.
    pub materials: Vec<Material>,
    /// Textures of the materials.
    pub textures: Vec<Texture>,
    /// Instances: meshes attached to nodes.
    pub instances: Vec<Instance>,
    /// Skins that deform meshes.
    pub skins: Vec<Skin>,
    /// Nodes with meshes that have morph targets.
    pub morphed_nodes: Vec<MorphedNode>,
    /// Point, spot and directional lights.
    pub punctual_lights: Vec<PunctualLight>,
    /// Cameras of the file.
    pub cameras: Vec<Camera>,
    /// Animated transforms and morph weights of the nodes.
    pub channels: Vec<Channel>,
    /// Animated properties of lenses.
    pub camera_channels: Vec<CameraChannel>,
    /// Animated properties of punctual lights.
    pub light_channels: Vec<LightChannel>,
    /// Animated properties of materials.
    pub material_channels: Vec<MaterialChannel>,
    /// Nodes with a scale that hides skinned meshes, in ascending order. No other node's transform affects a skinned
    /// mesh.
    pub curtains: Vec<usize>,
    /// Environment light, if the scene has any.
    pub sky: Option<Environment>,
    /// Translation from the file's coordinates to the scene's \[m\], zero unless the file is far from its origin.
    pub displacement: Vec3,
    /// Radiance that camera rays show in place of the sky \[W·m⁻²·sr⁻¹\]. Other rays hit the sky.
    pub background: Option<Vec3>,
    /// Ground of a studio.
    pub ground: Option<Ground>,
    /// Settings from the TOML file next to the scene.
    pub settings: SceneSettings,
    /// Warnings for the user, one line each, about content that was read but is not rendered.
    pub warnings: Vec<String>,
    /// Files from which the scene was read.
    pub origin: Origin,
}

impl Scene {
    /// Builds a scene of one mesh at the origin with `material` and without lights. Replaces the mesh's own material
    /// index.
    #[must_use]
    pub fn of_mesh(mesh: Mesh, material: Material) -> Self {
        Self {
            nodes: vec![Node { name: String::new(), parent: None, rest: Transform::IDENTITY }],
            meshes: vec![Mesh { material: 0, ..mesh }],
            materials: vec![material],
            instances: vec![Instance { node: 0, mesh: 0 }],
            ..Self::default()
        }
    }
}

/// Transforms and shapes of a scene at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// World-from-local transforms, one per node.
    pub world: Vec<Affine3A>,
    /// Deformed meshes, one per instance. Empty if no mesh has a skin or morph targets.
    deformed: Vec<Option<Arc<DeformedMesh>>>,
    /// Cameras of the scene. Empty if no lens is animated.
    cameras: Vec<Camera>,
    /// Punctual lights of the scene. Empty if no light is animated.
    lights: Vec<PunctualLight>,
    /// Materials of the scene. Empty if no material is animated.
    materials: Arc<[Material]>,
}

impl Pose {
    /// Returns the deformed meshes, one per instance. The list is empty if no mesh has a skin or morph targets.
    pub(crate) fn all_deformed(&self) -> &[Option<Arc<DeformedMesh>>] {
        &self.deformed
    }

    /// Returns the punctual lights of `scene` at the time of the pose.
    #[must_use]
    pub fn punctual_lights<'a>(&'a self, scene: &'a Scene) -> &'a [PunctualLight] {
        if self.lights.is_empty() { &scene.punctual_lights } else { &self.lights }
    }

    /// Returns the materials of the scene at the time of the pose. The list is empty if no material is animated.
    pub(crate) fn animated_materials(&self) -> &Arc<[Material]> {
        &self.materials
    }

    /// Returns the vertices of an instance with a skin or morph targets, or `None` if the instance uses the vertices of
    /// its mesh.
    #[must_use]
    pub fn deformed(&self, instance: usize) -> Option<&Arc<DeformedMesh>> {
        self.deformed.get(instance)?.as_ref()
    }
}

impl Scene {
    /// Computes the transforms of all nodes and the deformed meshes at `time` seconds.
    #[must_use]
    pub fn pose(&self, time: f32) -> Pose {
        // Animate the local transforms.
        let mut local: Vec<Transform> = self.nodes.iter().map(|node| node.rest).collect();
        for channel in &self.channels {
            channel.apply(time, &mut local[channel.node]);
        }
        // Multiply along the hierarchy: parents precede their children.
        let mut world: Vec<Affine3A> = Vec::with_capacity(self.nodes.len());
        for (node, transform) in self.nodes.iter().zip(&local) {
            let matrix = transform.matrix();
            world.push(node.parent.map_or(matrix, |parent| world[parent] * matrix));
        }
        let deformed = self.deformed_meshes(&world, time);
        let (cameras, lights) = (self.cameras_at(time), self.lights_at(time));
        Pose { world, deformed, cameras, lights, materials: self.materials_at(time) }
    }

    /// Returns the transform from the space of an instance's vertices to world space. A skinned mesh is positioned by
    /// joints only; the transform of its node is ignored (glTF 2.0, 3.7.3.1).
    #[must_use]
    pub fn instance_world(&self, pose: &Pose, instance: usize) -> Affine3A {
        self.carrier(instance).map_or(Affine3A::IDENTITY, |node| pose.world[node])
    }

    /// Returns the node that positions an instance, or `None` for a skinned mesh that no node hides.
    pub(crate) fn carrier(&self, instance: usize) -> Option<usize> {
        let Instance { node, mesh } = self.instances[instance];
        let is_placed = self.meshes[mesh].skinning.is_none() || self.curtains.binary_search(&node).is_ok();
        is_placed.then_some(node)
    }

    /// Returns, for each node, whether its world transform, lens or light changes over time.
    #[must_use]
    pub fn moving_nodes(&self) -> Vec<bool> {
        // Mark the nodes with an animated transform.
        let mut moving = vec![false; self.nodes.len()];
        let moves = |channel: &&Channel| channel.changes() && !matches!(channel.track, Track::Weights(_));
        for channel in self.channels.iter().filter(moves) {
            moving[channel.node] = true;
        }
        // A changing lens changes the image in the same way as a moving node.
        for channel in self.camera_channels.iter().filter(|channel| channel.keys.changes()) {
            moving[channel.keys.node] = true;
        }
        // A changing light counts as a moving node.
        for channel in self.light_channels.iter().filter(|channel| channel.keys.changes()) {
            moving[channel.keys.node] = true;
        }
        // Propagate motion to descendants: parents precede their children.
        for index in 0..self.nodes.len() {
            moving[index] |= self.nodes[index].parent.is_some_and(|parent| moving[parent]);
        }
        moving
    }

    /// Returns, for each instance, whether its transform, shape or material changes over time.
    #[must_use]
    pub fn moving_instances(&self) -> Vec<bool> {
        let (moving, deforming, changing) =
            (self.moving_nodes(), self.deforming_instances(), self.changing_materials());
        // A material counts as motion, because it changes the light that the instance emits or reflects.
        let mut moves = Vec::with_capacity(deforming.len());
        for (index, deforms) in deforming.into_iter().enumerate() {
            let is_attached = self.carrier(index).is_some_and(|node| moving[node]);
            moves.push(deforms || is_attached || changing[self.meshes[self.instances[index].mesh].material]);
        }
        moves
    }

    /// Returns the time of the animation's last key \[s\], or 0 without animation.
    #[must_use]
    pub fn duration(&self) -> f32 {
        let lenses = self.camera_channels.iter().map(|channel| &channel.keys);
        let lights = self.light_channels.iter().map(|channel| &channel.keys);
        let materials = self.material_channels.iter().map(|channel| &channel.keys);
        // Find the last key over all channels, each with its times in ascending order.
        let mut longest = 0.0f32;
        for channel in self.channels.iter().chain(lenses).chain(lights).chain(materials) {
            if let Some(&time) = channel.times.last() {
                longest = longest.max(time);
            }
        }
        longest
    }

    /// Returns the corners of the box around all meshes in `pose`, or `None` if no mesh has vertices.
    #[must_use]
    pub fn bounds(&self, pose: &Pose) -> Option<(Vec3A, Vec3A)> {
        let mut around = PointBox::NOTHING;
        // Bound each mesh once in local space.
        let mut of_mesh: Vec<Option<PointBox>> = vec![None; self.meshes.len()];
        for (index, instance) in self.instances.iter().enumerate() {
            let world = self.instance_world(pose, index);
            let mesh = &self.meshes[instance.mesh].positions;
            let positions = pose.deformed(index).map_or(mesh, |shape| &shape.positions);

            // Skip meshes with a bounding box inside `around`. Rounding is monotonic, so their rounded vertices also
            // stay inside.
            if pose.deformed(index).is_none() {
                let own = of_mesh[instance.mesh].get_or_insert_with(|| PointBox::of(mesh.iter().map(|&p| p.into())));
                let image = PointBox::of(own.corners().into_iter().map(|corner| world.transform_point3a(corner)));
                if around.holds(&image) {
                    continue;
                }
            }
            for &position in positions {
                around.add(world.transform_point3a(position.into()));
            }
        }
        around.low.cmple(around.high).all().then_some((around.low, around.high))
    }

    /// Returns, for each instance, whether its node or one of the node's ancestors has this name.
    #[must_use]
    pub fn instances_under(&self, name: &str) -> Vec<bool> {
        // Parents precede their children.
        let mut is_under: Vec<bool> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            is_under.push(node.name == name || node.parent.is_some_and(|parent| is_under[parent]));
        }
        self.instances.iter().map(|instance| is_under[instance.node]).collect()
    }

    /// Returns the camera with this name or index, counted from 0.
    #[must_use]
    pub fn camera(&self, name: &str) -> Option<&Camera> {
        self.cameras.get(self.camera_number(name)?)
    }

    /// Returns the index of the camera with this name or index.
    fn camera_number(&self, name: &str) -> Option<usize> {
        let named = self.cameras.iter().position(|camera| camera.name == name);
        named.or_else(|| name.parse().ok().filter(|&number| number < self.cameras.len()))
    }

    /// Returns the filming camera: the camera that the settings name, otherwise the first moving camera, otherwise the
    /// first camera.
    #[must_use]
    pub fn filming_camera(&self) -> Option<&Camera> {
        self.cameras.get(self.filming_camera_number()?)
    }

    /// Returns the index of the filming camera.
    fn filming_camera_number(&self) -> Option<usize> {
        let named = self.settings.camera.name.as_deref();
        let moving = self.moving_nodes();
        named
            .and_then(|name| self.camera_number(name))
            .or_else(|| self.cameras.iter().position(|camera| moving[camera.node]))
            .or((!self.cameras.is_empty()).then_some(0))
    }

    /// Returns the filming camera's view in `pose`. A scene without a camera is shown whole, from the front.
    #[must_use]
    pub fn view(&self, pose: &Pose, width: usize, height: usize) -> View {
        let number = self.filming_camera_number();
        match number.and_then(|number| pose.cameras.get(number).or(self.cameras.get(number))) {
            Some(camera) => View::of(camera, pose.world[camera.node], width, height),
            None => {
                let rest = self.pose(0.0);
                let (min, max) = self.bounds(&rest).unwrap_or((Vec3A::splat(-1.0), Vec3A::ONE));
                View::around(min, max, width, height)
            }
        }
    }

    /// Returns the radiance of a camera ray in the unit `direction` that hits no surface \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn background(&self, direction: Vec3) -> Vec3 {
        let sky = || self.sky.as_ref().map_or(Vec3::ZERO, |sky| sky.radiance(direction));
        self.background.unwrap_or_else(sky)
    }

    /// Returns the factor on the light that a camera receives from an instance.
    #[must_use]
    pub fn camera_gain(&self, instance: u32) -> Vec3 {
        let ground = self.ground.filter(|ground| ground.instance == instance);
        ground.map_or(Vec3::ONE, |ground| ground.gain)
    }

    /// Returns the number of triangles of all instances.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh].triangles.len()).sum()
    }
}

/// Bounding box of points.
#[derive(Clone, Copy)]
struct PointBox {
    low: Vec3A,
    high: Vec3A,
}

impl PointBox {
    const NOTHING: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    fn of(points: impl Iterator<Item = Vec3A>) -> Self {
        let mut around = Self::NOTHING;
        points.for_each(|point| around.add(point));
        around
    }

    fn add(&mut self, point: Vec3A) {
        steps::count(1);
        (self.low, self.high) = (self.low.min(point), self.high.max(point));
    }

    /// Returns the eight corners of the box.
    fn corners(&self) -> [Vec3A; 8] {
        let pick = |i: usize| BVec3A::new(i & 1 == 0, i & 2 == 0, i & 4 == 0);
        std::array::from_fn(|i| Vec3A::select(pick(i), self.low, self.high))
    }

    /// Returns whether the box contains all of `other`, or `false` if `other` has a NaN.
    fn holds(&self, other: &Self) -> bool {
        (self.low.cmple(other.low) & self.high.cmpge(other.high)).all()
    }
}

/// Returns the matrix for normals: the inverse transpose, computed with cofactors so that singular maps have finite
/// results.
pub(crate) fn normal_matrix(world: &Affine3A) -> Mat3A {
    let m = world.matrix3;
    let cofactors = Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    // Mirroring flips the cross products. Flip them back, so that normals stay on the side that the file defines.
    if m.determinant() < 0.0 { cofactors * -1.0 } else { cofactors }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Builds a ball of 400 points, shown by `times` nodes in a row. An animation of weights deforms the
    /// ball if `bends` is true.
    fn row(times: usize, bends: bool) -> Scene {
        let mut mesh = Mesh { triangles: vec![[0, 1, 2]], ..Mesh::default() };
        for k in 0..400 {
            let direction = Quat::from_rotation_y(k as f32) * Quat::from_rotation_x(0.1 * k as f32) * Vec3::Z;
            mesh.positions.push(direction);
        }
        if bends {
            mesh.morph_targets.push(MorphTarget { positions: mesh.positions.clone(), ..MorphTarget::default() });
        }
        let mut scene = Scene::of_mesh(mesh, Material::default());
        scene.instances.clear();
        for k in 0..times {
            // Order the nodes from the ends to the middle, so that the first two set the box.
            let x = if k % 2 == 0 { k as f32 } else { (2 * times - k) as f32 };
            let node = scene.nodes.len();
            let rest = Transform { translation: Vec3::X * x, ..Transform::IDENTITY };
            scene.nodes.push(Node { name: String::new(), parent: None, rest });
            scene.instances.push(Instance { node, mesh: 0 });
            if bends {
                let track = Track::Weights(vec![0.0, 1.0]);
                let interpolation = Interpolation::Linear;
                scene.morphed_nodes.push(MorphedNode { node, weights: vec![0.0] });
                scene.channels.push(Channel { node, times: vec![0.0, 1.0], track, interpolation });
            }
        }
        scene
    }

    #[test]
    fn the_box_is_that_of_all_points_and_few_are_looked_at() {
        let scene = row(1000, false);
        let pose = scene.pose(0.0);
        let mut corners = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for (index, instance) in scene.instances.iter().enumerate() {
            for &position in &scene.meshes[instance.mesh].positions {
                let point = scene.instance_world(&pose, index).transform_point3a(position.into());
                corners = (corners.0.min(point), corners.1.max(point));
            }
        }
        let steps = steps::taken(|| assert_eq!(scene.bounds(&pose), Some(corners)));
        // Each instance costs eight steps for the corners of its box, and a few instances cost a step per point.
        assert!(steps < 1000 * 16 + 20 * 400, "{steps} steps");
    }

    #[test]
    fn work_for_weights_grows_as_nodes_and_channels_do() {
        let steps = |times| {
            let scene = row(times, true);
            let all = steps::taken(|| assert!(scene.deforming_instances().iter().all(|&bends| bends)));
            all + steps::taken(|| drop(scene.pose(0.5)))
        };
        // Nodes with equal weights share one deformed mesh.
        let (few, many) = (steps(100), steps(1600));
        assert!(many <= 16 * few, "{few} and {many} steps");
        let scene = row(3, true);
        let pose = scene.pose(0.5);
        assert!(Arc::ptr_eq(pose.deformed(0).unwrap(), pose.deformed(2).unwrap()));
    }
}
