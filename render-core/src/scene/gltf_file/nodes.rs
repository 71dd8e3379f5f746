//! The hierarchy, with the cameras and lights that hang from it.

use super::{LoadError, Loader};
use crate::scene::light::STRONGEST;
use crate::scene::{Camera, Node, Projection, PunctualKind, PunctualLight, Scene, Transform};
use glam::{Quat, Vec3};
use std::collections::HashMap;

/// Our index of each glTF node that is in the scene.
pub(super) type NodeOf = HashMap<usize, usize>;

impl Loader<'_> {
    /// Fills in the hierarchy, parents first.
    pub(super) fn nodes(&self, document: &gltf::Document, scene: &mut Scene) -> Result<NodeOf, LoadError> {
        let Some(root) = document.default_scene().or_else(|| document.scenes().next()) else {
            return self.bad("the file has no scene; export one");
        };
        let mut node_of = HashMap::new();
        let mut stack: Vec<(gltf::Node, Option<usize>)> = root.nodes().map(|node| (node, None)).collect();
        stack.reverse();
        while let Some((node, parent)) = stack.pop() {
            let index = scene.nodes.len();
            if node_of.insert(node.index(), index).is_some() {
                return self.bad(format!("node {} has two parents or is its own ancestor", node.index()));
            }
            let (translation, rotation, scale) = node.transform().decomposed();
            let rest = Transform {
                translation: translation.into(),
                rotation: Quat::from_array(rotation).normalize(),
                scale: scale.into(),
            };
            if !rest.matrix().is_finite() {
                return self.bad(format!("node {} has a transform that is not finite", node.index()));
            }
            let name = node.name().unwrap_or_default().to_owned();
            if let Some(camera) = node.camera() {
                scene.cameras.push(self.camera(&camera, &name, index)?);
            }
            if let Some(light) = node.light() {
                scene.punctual_lights.push(self.light(&light, index)?);
            }
            let children = stack.len();
            stack.extend(node.children().map(|child| (child, Some(index))));
            stack[children..].reverse();
            scene.nodes.push(Node { name, parent, rest });
        }
        Ok(node_of)
    }

    fn camera(&self, camera: &gltf::Camera, node_name: &str, node: usize) -> Result<Camera, LoadError> {
        let projection = match camera.projection() {
            gltf::camera::Projection::Perspective(p) => Projection::Perspective { yfov: p.yfov() },
            gltf::camera::Projection::Orthographic(o) => Projection::Orthographic { ymag: o.ymag() },
        };
        let size = match projection {
            Projection::Perspective { yfov } if yfov < std::f32::consts::PI => yfov,
            Projection::Perspective { .. } => f32::NAN,
            Projection::Orthographic { ymag } => ymag,
        };
        if !(size > 0.0 && size.is_finite()) {
            return self.bad(format!("camera {} has an impossible field of view", camera.index()));
        }
        let name = if node_name.is_empty() { camera.name().unwrap_or_default() } else { node_name };
        Ok(Camera { name: name.to_owned(), node, projection })
    }

    fn light(&self, light: &gltf::khr_lights_punctual::Light, node: usize) -> Result<PunctualLight, LoadError> {
        use gltf::khr_lights_punctual::Kind;
        let kind = match light.kind() {
            Kind::Directional => PunctualKind::Directional,
            Kind::Point => PunctualKind::Point,
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                PunctualKind::Spot { inner: inner_cone_angle, outer: outer_cone_angle }
            }
        };
        let color = Vec3::from(light.color()) * light.intensity();
        if !color.is_finite() || color.min_element() < 0.0 {
            return self.bad(format!("light {} has an impossible color or intensity", light.index()));
        }
        if color.max_element() > STRONGEST {
            return self.bad(format!(
                "light {} shines with {:e}; {STRONGEST:e} is the most",
                light.index(),
                color.max_element()
            ));
        }
        Ok(PunctualLight { node, color, kind })
    }
}
