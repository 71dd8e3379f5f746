//! Translation of distant scenes to the origin: far from the origin, `f32` is too coarse for their shape.
//!
//! Images depend only on relative positions.

use super::{Node, Scene, Track, Transform};
use crate::scene::Interpolation;
use glam::Vec3;

/// Minimum ratio of the center's distance from the origin to half the scene's size for a far scene. At this ratio, the
/// spacing of `f32` positions is 8·10⁻⁶ of the size.
const FAR: f32 = 64.0;

impl Scene {
    /// Moves a scene that is far from the origin to the origin. Returns the translation, zero for other scenes.
    pub(super) fn move_to_origin(&mut self) -> Vec3 {
        let bounds = self.bounds(&self.pose(0.0));
        let Some(middle) = bounds.and_then(|(min, max)| far_middle(min.into(), max.into())) else { return Vec3::ZERO };
        // Center far meshes in their local space, where `f32` is also too coarse.
        self.move_far_meshes();
        for (index, node) in self.nodes.iter_mut().enumerate() {
            // A node that hides a skinned mesh keeps its transform, because the joints move instead.
            if node.parent.is_none() && self.curtains.binary_search(&index).is_err() {
                node.rest.translation -= middle;
            }
        }
        // Move the keys of animated root nodes, which replace the rest translation.
        for channel in self.channels.iter_mut().filter(|channel| self.nodes[channel.node].parent.is_none()) {
            let Track::Translation(keys) = &mut channel.track else { continue };
            // Each key of a spline is an in-tangent, a value and an out-tangent.
            let (first, step) = if channel.interpolation == Interpolation::CubicSpline { (1, 3) } else { (0, 1) };
            for key in keys.iter_mut().skip(first).step_by(step) {
                *key -= middle;
            }
        }
        -middle
    }

    /// Inserts a node with an offset above each mesh with vertices far from the mesh's own origin. Deforming meshes
    /// stay unchanged: their joints or weights belong to their node.
    fn move_far_meshes(&mut self) {
        // Center the vertices of each far mesh.
        let mut moved: Vec<Option<Vec3>> = vec![None; self.meshes.len()];
        for (mesh, moved) in self.meshes.iter_mut().zip(&mut moved) {
            if mesh.skinning.is_some() || !mesh.morph_targets.is_empty() {
                continue;
            }
            let min = mesh.positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
            let max = mesh.positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
            *moved = far_middle(min, max);
            if let Some(middle) = *moved {
                mesh.positions.iter_mut().for_each(|position| *position -= middle);
            }
        }
        // Restore the positions by an offset node above each instance of a centered mesh.
        for instance in &mut self.instances {
            if let Some(translation) = moved[instance.mesh] {
                let rest = Transform { translation, ..Transform::IDENTITY };
                self.nodes.push(Node { name: String::new(), parent: Some(instance.node), rest });
                instance.node = self.nodes.len() - 1;
            }
        }
    }
}

/// Returns the center of a box that is far from the origin, or `None` if the box is near.
fn far_middle(min: Vec3, max: Vec3) -> Option<Vec3> {
    let (middle, half) = ((min + max) / 2.0, (max - min) / 2.0);
    let is_far = half.is_finite() && middle.abs().max_element() > FAR * half.max_element();
    (is_far && half.max_element() > 0.0).then_some(middle)
}
