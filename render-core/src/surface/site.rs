//! The textures of a material, looked up at a hit.

use crate::scene::{Material, Mesh, Scene, TextureSlot, mesh_interpolate as interpolate};
use glam::{Vec2, Vec3, Vec3A, Vec4, Vec4Swizzles};

/// A point of a triangle, and how much of it a ray sees.
pub(super) struct Site<'a> {
    pub(super) scene: &'a Scene,
    pub(super) mesh: &'a Mesh,
    /// Vertices of the triangle.
    pub(super) indices: [u32; 3],
    /// Barycentric weight of the second corner.
    pub(super) u: f32,
    /// Barycentric weight of the third corner.
    pub(super) v: f32,
    /// World space, metres.
    pub(super) corners: [Vec3A; 3],
    /// Unit normal of the side that the file calls the front.
    pub(super) outward: Vec3A,
    /// Metres along the surface that look-ups are blurred to.
    pub(super) width: f32,
}

impl Site<'_> {
    /// Coordinates of the triangle's corners for `slot`, transformed.
    pub(super) fn coordinates(&self, slot: &TextureSlot) -> Option<[Vec2; 3]> {
        let uvs = &self.mesh.uvs[slot.uv_set];
        (!uvs.is_empty()).then(|| self.indices.map(|vertex| slot.map(uvs[vertex as usize])))
    }

    /// Linear RGB and opacity; `None` where the mesh has no coordinates for it.
    pub(super) fn look_up(&self, slot: &TextureSlot) -> Option<(Vec3, f32)> {
        let [p, q, r] = self.coordinates(slot)?;
        let texture = &self.scene.textures[slot.texture];
        let texels = ((q - p) * texture.size()).perp_dot((r - p) * texture.size()).abs();
        let [a, b, c] = self.corners;
        let metres = (b - a).cross(c - a).length();
        let footprint = if metres > 0.0 { self.width * (texels / metres).sqrt() } else { 1.0 };
        let uv = p * (1.0 - self.u - self.v) + q * self.u + r * self.v;
        Some(texture.sample(uv, footprint))
    }

    fn color(&self, slot: &Option<TextureSlot>) -> Vec3 {
        slot.as_ref().and_then(|slot| self.look_up(slot)).map_or(Vec3::ONE, |(color, _)| color)
    }

    /// Linear RGB, 0…1: factor, vertex color and texture.
    pub(super) fn base_color(&self, material: &Material) -> Vec3 {
        let vertex = interpolate(&self.mesh.colors, self.indices, self.u, self.v).unwrap_or(Vec4::ONE).xyz();
        (material.base_color * vertex * self.color(&material.base_color_texture)).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Metalness and perceptual roughness, 0…1.
    pub(super) fn metallic_roughness(&self, material: &Material) -> (f32, f32) {
        let texel = self.color(&material.metallic_roughness_texture);
        (material.metallic * texel.z, material.roughness * texel.y)
    }

    /// Radiance \[W·m⁻²·sr⁻¹\].
    pub(super) fn emission(&self, material: &Material) -> Vec3 {
        material.emission * self.color(&material.emission_texture)
    }
}
