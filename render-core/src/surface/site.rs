//! The textures of a material, looked up at a hit.

use crate::scene::{Filtered, Material, Mesh, Scene, TextureSlot, mesh_interpolate as interpolate};
use glam::{Vec2, Vec3, Vec3A, Vec4, Vec4Swizzles};

/// A point of a triangle, and how much of it a ray sees.
pub(super) struct TrianglePoint<'a> {
    pub(super) scene: &'a Scene,
    pub(super) mesh: &'a Mesh,
    /// Vertices of the triangle.
    pub(super) indices: [u32; 3],
    /// Barycentric weight of the second corner.
    pub(super) u: f32,
    /// Barycentric weight of the third corner.
    pub(super) v: f32,
    /// World space, meters.
    pub(super) corners: [Vec3A; 3],
    /// Unit normal of the side that the file calls the front.
    pub(super) outward: Vec3A,
    /// The part of the surface that look-ups are blurred to.
    pub(super) footprint: Footprint,
}

/// The part of a surface that a ray stands for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Footprint {
    /// A disk of this diameter, meters. One look-up serves rays whose light is only one of many at a place.
    Disk(f32),
    /// The ellipse with these two perpendicular diameters, world space, meters: the cross section of a pixel's cone.
    Ellipse([Vec3A; 2]),
}

/// Diameters are at most this number of times longer than those of the cone: a grazing ray sees no endless strip.
const MOST_SLANT: f32 = 50.0;

impl Footprint {
    /// The disk that a cone in the unit `direction`, `width` meters across, is taken to meet on a surface with this `normal`.
    pub(super) fn disk(direction: Vec3A, normal: Vec3A, width: f32) -> Self {
        Self::Disk(width / normal.dot(direction).abs().max(0.1))
    }

    /// The ellipse that the same cone meets: stretched by 1 / cos along the direction's projection onto the surface.
    pub(super) fn ellipse(direction: Vec3A, normal: Vec3A, width: f32) -> Self {
        let cosine = normal.dot(direction);
        let along = (direction - normal * cosine).try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        Self::Ellipse([along * (width / cosine.abs().max(1.0 / MOST_SLANT)), normal.cross(along) * width])
    }
}

impl TrianglePoint<'_> {
    /// Coordinates of the triangle's corners for `slot`, transformed.
    pub(super) fn coordinates(&self, slot: &TextureSlot) -> Option<[Vec2; 3]> {
        let uvs = &self.mesh.uvs[slot.uv_set];
        (!uvs.is_empty()).then(|| self.indices.map(|vertex| slot.map(uvs[vertex as usize])))
    }

    /// Linear RGB and opacity; `None` where the mesh has no coordinates for it.
    pub(super) fn look_up(&self, slot: &TextureSlot) -> Option<Filtered> {
        let [p, q, r] = self.coordinates(slot)?;
        let texture = &self.scene.textures[slot.texture];
        let uv = p * (1.0 - self.u - self.v) + q * self.u + r * self.v;
        let (along_u, along_v) = ((q - p) * texture.size(), (r - p) * texture.size());
        let [a, b, c] = self.corners;
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        Some(match self.footprint {
            Footprint::Disk(width) => {
                let meters = normal.length();
                let texels = along_u.perp_dot(along_v).abs();
                texture.sample(uv, if meters > 0.0 { width * (texels / meters).sqrt() } else { 1.0 })
            }
            Footprint::Ellipse(diameters) => {
                // d = s e₁ + t e₂ in the triangle's plane:  s = (d × e₂) · n / |n|²,  t = (e₁ × d) · n / |n|².
                let inverse = normal.length_squared().recip();
                let texels = diameters.map(|d| {
                    let (s, t) = (d.cross(e2).dot(normal) * inverse, e1.cross(d).dot(normal) * inverse);
                    along_u * s + along_v * t
                });
                texture.sample_ellipse(uv, texels)
            }
        })
    }

    fn color(&self, slot: &Option<TextureSlot>) -> Vec3 {
        slot.as_ref().and_then(|slot| self.look_up(slot)).map_or(Vec3::ONE, |found| found.color)
    }

    /// Linear RGB, 0…1: factor, vertex color and texture.
    pub(super) fn base_color(&self, material: &Material) -> Vec3 {
        let vertex = interpolate(&self.mesh.colors, self.indices, self.u, self.v).unwrap_or(Vec4::ONE).xyz();
        (material.base_color * vertex * self.color(&material.base_color_texture)).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Opacity, 0…1: factor, vertex color and texture.
    pub(super) fn opacity(&self, material: &Material) -> f32 {
        let vertex = interpolate(&self.mesh.colors, self.indices, self.u, self.v).map_or(1.0, |color| color.w);
        let texture = material.base_color_texture.as_ref().and_then(|slot| self.look_up(slot));
        (material.opacity * vertex * texture.map_or(1.0, |found| found.opacity)).clamp(0.0, 1.0)
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
