//! Back faces of sheets, moved slightly behind their fronts. A sheet is a surface without thickness.
//!
//! Rasterizing viewers cull back faces and show the correct one of two coincident faces. Ray tracers, including this
//! program, may hit either face; a small gap makes the order unique.

use super::split::Split;
use glam::Vec3;
use render_core::scene::Mesh;
use render_core::{Surfaces, Units};

/// Returns the gap in the space of a mesh that `instances` share. On each instance, it is at least the offset of ray
/// origins.
pub(super) fn gap(surfaces: &Surfaces, instances: &[usize]) -> f32 {
    let epsilon = Units::of(surfaces.scene()).epsilon;
    let mut widest = 0.0f32;
    for &instance in instances {
        // Use the cube root of the volume: the mean scale over all directions.
        let scale = surfaces.world(instance).matrix3.determinant().abs().cbrt();
        let width = epsilon / scale;
        widest = widest.max(if width.is_finite() { width } else { 0.0 });
    }
    widest
}

/// Returns the vertex positions of `split`, each moved by `gap` against the mean normal of its triangles.
pub(super) fn behind(mesh: &Mesh, split: &Split, gap: f32) -> Vec<Vec3> {
    // Sum the normals of adjacent triangles, weighted by area.
    let mut normals = vec![Vec3::ZERO; split.vertices.len()];
    for (index, triangle) in split.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(index);
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|&vertex| normals[vertex as usize] += normal);
    }
    let mut positions = Vec::with_capacity(split.vertices.len());
    for (&vertex, normal) in split.vertices.iter().zip(normals) {
        positions.push(mesh.positions[vertex as usize] - normal.normalize_or_zero() * gap);
    }
    positions
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::scene::{Material, Scene};

    #[test]
    fn a_back_lies_behind_its_front_by_what_rays_can_tell() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() };
        let split = Split { vertices: vec![0, 1, 2], triangles: vec![[0, 1, 2]] };
        assert_eq!(behind(&mesh, &split, 0.25)[1], Vec3::new(1.0, 0.0, -0.25));
        let mut scene = Scene::of_mesh(mesh, Material::default());
        scene.nodes[0].rest.scale = Vec3::splat(0.5);
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        let width = gap(&surfaces, &[0]);
        assert!((width - 2.0 * Units::of(&scene).epsilon).abs() < 1e-3 * width, "{width}");
    }
}
