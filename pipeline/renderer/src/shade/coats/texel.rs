//! Light that the coat of a texel reflects in all directions, by the same rays.
//!
//! ```text
//! M(ω_o) = Σ w_k L_k / Σ w_k        w_k = f(ω_o, ω_k) cos θ_k        L(ω_o) = C(ω_o) M(ω_o)
//!                                                                     C  albedo of the coat
//! ```
//! Rays ω_k are spread evenly over the hemisphere and stand for equal solid angles, so that their density cancels. They bring what
//! reflection rays of rough coats bring: surfaces, the sky, and what glows and is no source of direct light. Being the same for all
//! directions and, on flat surfaces, for all texels, they leave no noise between these. Surfaces that they meet have irradiance
//! that is known by then: that of their texels.

use super::Reflections;
use super::coated::Coated;
use super::reflections::{KnownIrradiance, ReflectedRay};
use crate::frame::Frame;
use glam::{Vec3, Vec3A};
use lighttree::Scratch;
use render_core::{ShadingPoint, Surface, luminance};
use std::f32::consts::{PI, TAU};

/// Rays of a texel, at least; with larger maps, one for each direction of the map: as many in a lobe whatever its width. In a
/// Cornell box with metal of roughness 0.4, four times as many change its mean by half a percent.
const LEAST_RAYS: usize = 256;
/// Least cosine between the surface's normal and a mirrored direction. Cells of a map beyond have the light at the horizon: look-ups
/// just above it read them.
const HORIZON: f32 = 0.02;

/// The frame that rays of texels are traced in, and the irradiance that is known of its surfaces.
#[derive(Clone, Copy)]
pub(crate) struct KnownScene<'a> {
    pub frame: &'a Frame<'a>,
    pub known: KnownIrradiance<'a>,
}

/// A texel's coat, and the rays that found its light.
pub(crate) struct TexelCoat {
    coated: Coated,
    /// In the shading frame.
    rays: Vec<Vec3>,
    /// Radiance that each ray brings \[W·m⁻²·sr⁻¹\].
    light: Vec<Vec3>,
}

impl TexelCoat {
    /// Traces rays from `surface`, lit at `receiver`, for a map with this number of `directions`. A surface without a coat gives
    /// none.
    pub fn trace(
        scene: KnownScene,
        receiver: ShadingPoint,
        surface: &Surface,
        directions: usize,
        scratch: &mut Scratch,
    ) -> Option<Self> {
        if surface.specular == Vec3::ZERO {
            return None;
        }
        let coated = Coated::at(receiver, surface);
        let rays = hemisphere(LEAST_RAYS.max(directions));
        let count = rays.len() as u32;

        // Textures are averaged over the share of the hemisphere that a ray stands for. What leads into the triangle brings nothing.
        let (spread, share) = ((TAU / count as f32).sqrt(), luminance(coated.albedo()));
        let KnownScene { frame, known } = scene;
        let mut reflections = Reflections { prepared: frame, scratch, shadow_rays: 0 };
        let mut light = Vec::with_capacity(rays.len());
        for &local in &rays {
            light.push(match coated.to_world(local) {
                Some(direction) => {
                    let ray = ReflectedRay { direction, spread, share, rays: count, known: Some(known) };
                    reflections.along(&coated, ray).0
                }
                None => Vec3::ZERO,
            });
        }
        Some(Self { coated, rays, light })
    }

    /// Mean radiance that arrives at the coat, by the cosine.
    pub fn mean_of_all(&self) -> Vec3 {
        let sum: Vec3 = self.rays.iter().zip(&self.light).map(|(ray, &light)| ray.z * light).sum();
        // The mean cosine over the hemisphere is a half.
        2.0 * sum / self.rays.len() as f32
    }

    /// M(ω_o) where a mirror would show the viewer the world in the unit direction `mirrored`.
    pub fn mean_radiance(&self, mirrored: Vec3) -> Vec3 {
        // The viewer stands where the mirrored direction comes from.
        let mut towards = self.coated.to_frame(Vec3A::from(mirrored));
        towards.z = towards.z.max(HORIZON);
        let outgoing = Vec3::new(-towards.x, -towards.y, towards.z).normalize();

        // Lobes are as wide as the rays are apart, at least.
        let half_angle = (2.0 / self.rays.len() as f32).sqrt();
        let (mut sum, mut weights) = (Vec3::ZERO, Vec3::ZERO);
        for (&ray, &light) in self.rays.iter().zip(&self.light) {
            let weight = self.coated.bsdf.evaluate_coat(outgoing, ray, half_angle) * ray.z;
            sum += weight * light;
            weights += weight;
        }
        sum / weights.max(Vec3::splat(f32::MIN_POSITIVE))
    }
}

/// Directions about +z, evenly spread: `count` points of a spherical Fibonacci lattice \[Keinert15\].
fn hemisphere(count: usize) -> Vec<Vec3> {
    // The golden section of a turn, from point to point.
    let turn = PI * (3.0 - 5f64.sqrt() as f32);
    let mut directions = Vec::with_capacity(count);
    for k in 0..count {
        let z = (k as f32 + 0.5) / count as f32;
        let (sin, cos) = ((k as f32 * turn) % TAU).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        directions.push(Vec3::new(radius * cos, radius * sin, z));
    }
    directions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_even_over_the_hemisphere() {
        for count in [256, 1024] {
            let rays = hemisphere(count);
            // ∫ cos θ dω = π and ∫ cos² θ dω = 2π/3; x and y have no mean.
            let mean = rays.iter().sum::<Vec3>() / count as f32;
            let squares = rays.iter().map(|ray| *ray * *ray).sum::<Vec3>() / count as f32;
            assert!((mean - Vec3::new(0.0, 0.0, 0.5)).length() < 0.01, "{mean}");
            assert!((squares - Vec3::splat(1.0 / 3.0)).length() < 0.01, "{squares}");
        }
    }
}
