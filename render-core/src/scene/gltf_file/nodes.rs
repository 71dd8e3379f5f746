//! Loader of the node hierarchy, with its cameras and lights.

use super::copies::hidden_nodes;
use super::{LoadError, Loader};
use crate::scene::light::STRONGEST;
use crate::scene::{Camera, DepthRange, Node, Projection, PunctualKind, PunctualLight, Scene, Transform};
use glam::{Mat3, Mat4, Quat, Vec3};
use std::collections::{BTreeSet, HashMap};

/// Maximum number of nodes with an animated visibility from the root to a node. Each of them adds one extra node to
/// each mesh below.
const MOST_HIDING: usize = 64;

/// Scene indices of the glTF nodes in the scene.
#[derive(Default)]
pub(super) struct NodeOf {
    places: HashMap<usize, usize>,
    /// Whether each scene node's mesh and light are visible.
    shown: Vec<bool>,
    /// Indices of the glTF nodes with an animated visibility from the root to each scene node.
    hidden_by: Vec<Vec<usize>>,
    /// Scene cameras of each glTF camera.
    cameras: HashMap<usize, Vec<usize>>,
    /// Scene lights of each glTF light.
    lights: HashMap<usize, Vec<usize>>,
    /// Nodes that show the mesh of a node instead of the node itself, by node.
    showing: HashMap<usize, Vec<usize>>,
    /// Scene nodes with a scale that represents a glTF node's visibility, by glTF node.
    hiding: HashMap<usize, Vec<usize>>,
    /// Copies of materials for points and lines, by index of the material.
    pub unlit: HashMap<usize, usize>,
}

impl NodeOf {
    /// Returns the scene index of a glTF node.
    pub fn get(&self, index: &usize) -> Option<&usize> {
        self.places.get(index)
    }

    /// Returns whether the mesh of a scene node is visible.
    pub fn shows(&self, node: usize) -> bool {
        self.shown[node]
    }

    /// Returns the scene cameras of a glTF camera.
    pub fn cameras(&self, index: usize) -> Vec<usize> {
        self.cameras.get(&index).cloned().unwrap_or_default()
    }

    /// Returns the scene lights of a glTF light.
    pub fn lights(&self, index: usize) -> Vec<usize> {
        self.lights.get(&index).cloned().unwrap_or_default()
    }

    /// Returns the scene nodes that show the mesh of a scene node.
    pub fn showing(&self, node: usize) -> Vec<usize> {
        self.showing.get(&node).cloned().unwrap_or_else(|| vec![node])
    }

    /// Returns the scene nodes with a scale that represents the visibility of a glTF node.
    pub fn hiding(&self, index: usize) -> Vec<usize> {
        self.hiding.get(&index).cloned().unwrap_or_default()
    }

    /// Returns the scene lights of a glTF node or its descendants, each with its glTF light.
    pub fn lights_below(&self, index: usize, scene: &Scene) -> Vec<(usize, usize)> {
        let mut below = Vec::new();
        for (&source, lights) in &self.lights {
            let hides = |light: &&usize| self.hidden_by[scene.punctual_lights[**light].node].contains(&index);
            below.extend(lights.iter().filter(hides).map(|&light| (light, source)));
        }
        // Sort the lights, because the map has no fixed order.
        below.sort_unstable();
        below
    }

    /// Replaces nodes that show the mesh of `node` by children that scale the mesh to zero while it is hidden. For a
    /// skinned mesh, these children are roots instead, because joints position the mesh.
    pub fn hide(&mut self, node: usize, shown: Vec<usize>, is_skinned: bool, scene: &mut Scene) -> Vec<usize> {
        // Nest one scaling node for each animated visibility above the mesh.
        let mut shown = shown;
        for (level, &index) in self.hidden_by[node].iter().enumerate() {
            for place in &mut shown {
                let is_apart = is_skinned && level == 0;
                let name = if is_apart { scene.nodes[node].name.clone() } else { String::new() };
                let parent = (!is_apart).then_some(*place);
                scene.nodes.push(Node { name, parent, rest: Transform::IDENTITY });
                *place = scene.nodes.len() - 1;
                self.hiding.entry(index).or_default().push(*place);
            }
        }
        if is_skinned && !self.hidden_by[node].is_empty() {
            // New nodes have the highest indices, so the list stays ascending.
            scene.curtains.extend(&shown);
        }
        self.showing.insert(node, shown.clone());
        shown
    }
}

impl Loader<'_> {
    /// Adds the hierarchy to the scene, parents first. `lamps` is the factor on candela and lux. `blinking` nodes have
    /// an animated visibility.
    pub(super) fn nodes(
        &self,
        document: &gltf::Document,
        lamps: f32,
        blinking: &BTreeSet<usize>,
        scene: &mut Scene,
    ) -> Result<NodeOf, LoadError> {
        // Show the default scene, otherwise the first scene.
        let Some(root) = document.default_scene().or_else(|| document.scenes().next()) else {
            return self.bad("the file has no scene; export one");
        };

        // Traverse depth first with an explicit stack. A second visit means a cycle or two parents.
        let hidden = hidden_nodes(document, blinking);
        let mut node_of = NodeOf::default();
        let mut stack: Vec<(gltf::Node, Option<usize>)> = root.nodes().map(|node| (node, None)).collect();
        stack.reverse();
        while let Some((node, parent)) = stack.pop() {
            let index = scene.nodes.len();
            if node_of.places.insert(node.index(), index).is_some() {
                return self.bad(format!("node {} has two parents or is its own ancestor", node.index()));
            }

            // Visibility is inherited from the parent.
            let shown = !hidden[node.index()] && parent.is_none_or(|parent| node_of.shown[parent]);
            node_of.shown.push(shown);
            let mut hidden_by = parent.map_or_else(Vec::new, |parent| node_of.hidden_by[parent].clone());
            hidden_by.extend(blinking.contains(&node.index()).then_some(node.index()));
            if hidden_by.len() > MOST_HIDING {
                return self.bad(format!(
                    "node {}: the visibility of more than {MOST_HIDING} nodes above it is animated; export fewer",
                    node.index()
                ));
            }
            node_of.hidden_by.push(hidden_by);

            // Add the node with its camera and its light.
            let rest = transform(&node.transform());
            if !rest.matrix().is_finite() {
                return self.bad(format!("node {} has a transform that is not finite", node.index()));
            }
            let name = node.name().unwrap_or_default().to_owned();
            if let Some(camera) = node.camera() {
                node_of.cameras.entry(camera.index()).or_default().push(scene.cameras.len());
                scene.cameras.push(self.camera(&camera, &name, index)?);
            }
            if let Some(light) = node.light().filter(|_| shown) {
                node_of.lights.entry(light.index()).or_default().push(scene.punctual_lights.len());
                scene.punctual_lights.push(self.light(&light, lamps, index)?);
            }

            // Push children in reverse, so that they are visited in order.
            let children = stack.len();
            stack.extend(node.children().map(|child| (child, Some(index))));
            stack[children..].reverse();
            scene.nodes.push(Node { name, parent, rest });
        }
        Ok(node_of)
    }

    fn camera(&self, camera: &gltf::Camera, node_name: &str, node: usize) -> Result<Camera, LoadError> {
        // Read the projection with its aspect ratio and depth range.
        let (projection, aspect, depths) = match camera.projection() {
            gltf::camera::Projection::Perspective(p) => {
                let depths = DepthRange { near: p.znear(), far: p.zfar().unwrap_or(f32::INFINITY) };
                (Projection::Perspective { yfov: p.yfov() }, p.aspect_ratio(), depths)
            }
            gltf::camera::Projection::Orthographic(o) => {
                let depths = DepthRange { near: o.znear(), far: o.zfar() };
                (Projection::Orthographic { ymag: o.ymag() }, Some(o.xmag() / o.ymag()), depths)
            }
        };
        // Check the size of the view: 0 < angle < π, or a positive height.
        let size = match projection {
            Projection::Perspective { yfov } if yfov < std::f32::consts::PI => yfov,
            Projection::Perspective { .. } => f32::NAN,
            Projection::Orthographic { ymag } => ymag,
        };
        if !(size > 0.0 && size.is_finite()) {
            return self.bad(format!("camera {} has an impossible field of view", camera.index()));
        }
        let name = if node_name.is_empty() { camera.name().unwrap_or_default() } else { node_name };
        // Ignore invalid aspect ratios and empty depth ranges.
        let aspect = aspect.map(f32::abs).filter(|aspect| (1e-3..=1e3).contains(aspect));
        let depths = if depths.near >= 0.0 && depths.far > depths.near { depths } else { DepthRange::ALL };
        Ok(Camera { name: name.to_owned(), node, projection, aspect, depths })
    }

    /// Returns the light of a node, with the factor `scale` on its intensity.
    fn light(
        &self,
        light: &gltf::khr_lights_punctual::Light,
        scale: f32,
        node: usize,
    ) -> Result<PunctualLight, LoadError> {
        use gltf::khr_lights_punctual::Kind;
        let kind = match light.kind() {
            Kind::Directional => PunctualKind::Directional,
            Kind::Point => PunctualKind::Point,
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                PunctualKind::Spot { inner: inner_cone_angle, outer: outer_cone_angle }
            }
        };
        // Check the color after scaling, because the product may overflow.
        let color = Vec3::from(light.color()) * light.intensity() * scale;
        if !color.is_finite() || color.min_element() < 0.0 {
            return self.bad(format!("light {} has an impossible color or intensity", light.index()));
        }
        if color.max_element() > STRONGEST {
            return self.bad(format!(
                "light {} shines with {:e}; at most {STRONGEST:e} is allowed",
                light.index(),
                color.max_element()
            ));
        }
        Ok(PunctualLight { node, color, kind })
    }
}

/// Decomposes a transform. A matrix may flatten its node: an axis of length zero is set to a direction perpendicular to
/// the others.
fn transform(given: &gltf::scene::Transform) -> Transform {
    // Decompose flat matrices separately: the crate's decomposition divides by the lengths of axes.
    if let gltf::scene::Transform::Matrix { matrix } = given {
        let columns = Mat4::from_cols_array_2d(matrix);
        let axes = [columns.x_axis, columns.y_axis, columns.z_axis].map(|axis| axis.truncate());
        if axes.iter().any(|axis| axis.length_squared() == 0.0) {
            return flat_transform(axes, columns.w_axis.truncate());
        }
    }
    let (translation, rotation, scale) = given.clone().decomposed();
    // A quaternion of length zero means no rotation.
    let rotation = Quat::from_array(rotation);
    let rotation = if rotation.length_squared() == 0.0 { Quat::IDENTITY } else { rotation.normalize() };
    Transform { translation: translation.into(), rotation, scale: scale.into() }
}

/// Decomposes a matrix with these axes, some of which have length zero.
fn flat_transform(axes: [Vec3; 3], translation: Vec3) -> Transform {
    // Complete the axes of length zero with perpendicular directions.
    let mut directions = axes.map(Vec3::normalize_or_zero);
    for k in 0..3 {
        if directions[k] == Vec3::ZERO {
            let (next, last) = (directions[(k + 1) % 3], directions[(k + 2) % 3]);
            directions[k] = match (next == Vec3::ZERO, last == Vec3::ZERO) {
                (false, false) => next.cross(last).normalize_or(next.any_orthonormal_vector()),
                (false, true) => next.any_orthonormal_vector(),
                (true, false) => last.any_orthonormal_vector(),
                (true, true) => Vec3::AXES[k],
            };
        }
    }
    let [x, y, z] = directions;
    let mut scale = Vec3::from_array(axes.map(Vec3::length));
    // A rotation has determinant 1. Mirroring becomes a negative scale.
    let sign = if x.cross(y).dot(z) < 0.0 { -1.0 } else { 1.0 };
    scale.x *= sign;
    let rotation = Quat::from_mat3(&Mat3::from_cols(x * sign, y, z)).normalize();
    Transform { translation, rotation, scale }
}
