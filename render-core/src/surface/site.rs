//! Sampling of a material's textures at a hit.

use crate::scene::{Filtered, Material, Mesh, Scene, TextureSlot, mesh_interpolate as interpolate};
use glam::{Vec2, Vec3, Vec3A, Vec4, Vec4Swizzles};

/// Point of a triangle, with the footprint of a ray.
pub(super) struct TrianglePoint<'a> {
    pub(super) scene: &'a Scene,
    pub(super) mesh: &'a Mesh,
    /// Indices of the triangle's vertices.
    pub(super) indices: [u32; 3],
    /// Barycentric weight of the second corner.
    pub(super) u: f32,
    /// Barycentric weight of the third corner.
    pub(super) v: f32,
    /// Corners of the triangle in world space \[m\].
    pub(super) corners: [Vec3A; 3],
    /// Normal of the front, as the file defines it, a unit vector.
    pub(super) outward: Vec3A,
    /// Region of the surface over which texture samples are filtered.
    pub(super) footprint: Footprint,
}

/// Region of a surface that a ray represents.
#[derive(Clone, Copy, Debug)]
pub(super) enum Footprint {
    /// Disk of this diameter \[m\]. One sample suffices for rays that are only one of many contributions.
    Disk(f32),
    /// Ellipse with these two perpendicular diameters in world space \[m\]: the section of a pixel's cone.
    Ellipse([Vec3A; 2]),
}

/// Maximum ratio of a diameter to the cone's width, which limits the footprints of grazing rays.
const MOST_SLANT: f32 = 50.0;

impl Footprint {
    /// Returns the disk that approximates the section of a cone in the unit `direction`, `width` meters wide, on a
    /// surface with this `normal`.
    pub(super) fn disk(direction: Vec3A, normal: Vec3A, width: f32) -> Self {
        Self::Disk(width / normal.dot(direction).abs().max(0.1))
    }

    /// Returns the elliptical section of the cone, stretched by 1 / cos along the direction's projection onto the
    /// surface.
    pub(super) fn ellipse(direction: Vec3A, normal: Vec3A, width: f32) -> Self {
        // Stretch along the slant. Without slant, any direction along the surface serves.
        let cosine = normal.dot(direction);
        let along = (direction - normal * cosine).try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        Self::Ellipse([along * (width / cosine.abs().max(1.0 / MOST_SLANT)), normal.cross(along) * width])
    }
}

impl TrianglePoint<'_> {
    /// Returns the transformed coordinates of the triangle's corners for `slot`.
    pub(super) fn coordinates(&self, slot: &TextureSlot) -> Option<[Vec2; 3]> {
        let uvs = &self.mesh.uvs[slot.uv_set];
        (!uvs.is_empty()).then(|| self.indices.map(|vertex| slot.map(uvs[vertex as usize])))
    }

    /// Samples linear RGB and opacity. Returns `None` if the mesh has no coordinates for the slot.
    pub(super) fn look_up(&self, slot: &TextureSlot) -> Option<Filtered> {
        let [p, q, r] = self.coordinates(slot)?;
        // Interpolate the coordinates, and compute their change along both sides of the triangle in texels.
        let texture = &self.scene.textures[slot.texture];
        let uv = p * (1.0 - self.u - self.v) + q * self.u + r * self.v;
        let (along_u, along_v) = ((q - p) * texture.size(), (r - p) * texture.size());
        let [a, b, c] = self.corners;
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        Some(match self.footprint {
            Footprint::Disk(width) => {
                // Convert the diameter by the square root of the ratio of areas, which ignores stretching.
                let meters = normal.length();
                let texels = along_u.perp_dot(along_v).abs();
                texture.sample(uv, if meters > 0.0 { width * (texels / meters).sqrt() } else { 1.0 })
            }
            Footprint::Ellipse(diameters) => {
                // For d = s e₁ + t e₂ in the triangle's plane, s = (d × e₂) · n / |n|² and t = (e₁ × d) · n / |n|².
                let inverse = normal.length_squared().recip();
                let texels = diameters.map(|d| {
                    let (s, t) = (d.cross(e2).dot(normal) * inverse, e1.cross(d).dot(normal) * inverse);
                    along_u * s + along_v * t
                });
                texture.sample_ellipse(uv, texels)
            }
        })
    }

    /// Samples the linear RGB color of a slot, or returns white without a texture.
    pub(super) fn color(&self, slot: &Option<TextureSlot>) -> Vec3 {
        slot.as_ref().and_then(|slot| self.look_up(slot)).map_or(Vec3::ONE, |found| found.color)
    }

    /// Returns the linear RGB base color, 0…1: the product of factor, vertex color and texture.
    pub(super) fn base_color(&self, material: &Material) -> Vec3 {
        let vertex = interpolate(&self.mesh.colors, self.indices, self.u, self.v).unwrap_or(Vec4::ONE).xyz();
        (material.base_color * vertex * self.color(&material.base_color_texture)).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Returns the opacity, 0…1: the product of factor, vertex opacity and texture.
    pub(super) fn opacity(&self, material: &Material) -> f32 {
        let vertex = interpolate(&self.mesh.colors, self.indices, self.u, self.v).map_or(1.0, |color| color.w);
        let texture = material.base_color_texture.as_ref().and_then(|slot| self.look_up(slot));
        (material.opacity * vertex * texture.map_or(1.0, |found| found.opacity)).clamp(0.0, 1.0)
    }

    /// Returns the metalness and the perceptual roughness, each in 0…1.
    pub(super) fn metallic_roughness(&self, material: &Material) -> (f32, f32) {
        let texel = self.color(&material.metallic_roughness_texture);
        (material.metallic * texel.z, material.roughness * texel.y)
    }

    /// Returns the emitted radiance \[W·m⁻²·sr⁻¹\].
    pub(super) fn emission(&self, material: &Material) -> Vec3 {
        material.emission * self.color(&material.emission_texture)
    }
}
