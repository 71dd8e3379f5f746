//! Light that a texel's coat reflects in all directions, from one set of rays.
//!
//! ```text
//! M(ω_o) = Σ w_k L_k / Σ w_k        w_k = f(ω_o, ω_k) cos θ_k        L(ω_o) = C(ω_o) M(ω_o)
//!   f  BRDF of the coat      θ_k  angle between ω_k and the normal      C  albedo of the coat
//! ```
//! The rays ω_k are evenly distributed over the hemisphere and represent equal solid angles, so their density cancels.
//! Their radiance L_k is the radiance that reflection rays of rough coats find: surfaces, the sky, and emission except
//! direct sources.
//!
//! All directions use the same rays, and so do all texels of a flat surface, so no noise appears between them. The
//! surfaces that the rays hit have baked irradiance already.

use super::Reflections;
use super::coated::Coated;
use super::reflections::{KnownIrradiance, ReflectedRay};
use crate::frame::Frame;
use glam::{Vec3, Vec3A};
use lighttree::Scratch;
use render_core::{LightPoints, ShadingPoint, Surface, luminance};
use std::f32::consts::{PI, TAU};

/// Minimum number of rays per texel. Larger maps use one ray per direction, so that lobes of any width contain equally
/// many rays. In a Cornell box with metal of roughness 0.4, four times as many rays change the mean by 0.5 %.
const LEAST_RAYS: usize = 256;
/// Minimum cosine between the surface normal and a mirror direction. Cells below the horizon contain the light at the
/// horizon: samples just above the horizon read them.
const HORIZON: f32 = 0.02;

/// Frame in which the rays of texels are traced, and the known irradiance of its surfaces.
#[derive(Clone, Copy)]
pub(crate) struct KnownScene<'a> {
    pub frame: &'a Frame<'a>,
    pub known: KnownIrradiance<'a>,
}

/// Coat of a texel, with rays of the light that arrives at it.
pub(crate) struct TexelCoat {
    coated: Coated,
    /// Directions of the rays in the shading frame.
    rays: Vec<Vec3>,
    /// Radiance along each ray \[W·m⁻²·sr⁻¹\].
    light: Vec<Vec3>,
}

impl TexelCoat {
    /// Traces rays from `surface`, lit at `receiver`, for a map with `directions` directions. Returns `None` for a
    /// surface without a coat.
    pub fn trace(
        scene: KnownScene,
        receiver: ShadingPoint,
        surface: &Surface,
        directions: usize,
        scratch: &mut Scratch,
    ) -> Option<Self> {
        // Return without tracing rays if the surface has no coat.
        if surface.specular == Vec3::ZERO {
            return None;
        }
        let coated = Coated::at(receiver, surface);
        let rays = hemisphere(LEAST_RAYS.max(directions));
        let light = light_along(scene, &coated, &rays, scratch);
        Some(Self { coated, rays, light })
    }

    /// Returns the cosine-weighted mean radiance that arrives at the coat.
    pub fn mean_of_all(&self) -> Vec3 {
        let sum: Vec3 = self.rays.iter().zip(&self.light).map(|(ray, &light)| ray.z * light).sum();
        // Divide by the mean cosine over the hemisphere, 1/2.
        2.0 * sum / self.rays.len() as f32
    }

    /// Returns M(ω_o) for the unit mirror direction `mirrored`.
    pub fn mean_radiance(&self, mirrored: Vec3) -> Vec3 {
        // Mirror the direction: the viewer is opposite to the mirror direction.
        let mut towards = self.coated.to_frame(Vec3A::from(mirrored));
        towards.z = towards.z.max(HORIZON);
        let outgoing = Vec3::new(-towards.x, -towards.y, towards.z).normalize();

        // Make lobes at least as wide as the spacing of the rays.
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

/// Returns the indirect light that arrives at a matte surface: `count` unit directions, each with its radiance
/// \[W·m⁻²·sr⁻¹\]. The directions are even over the hemisphere. The surface is lit at the given point.
pub(crate) fn arriving_light(
    scene: KnownScene,
    receiver: ShadingPoint,
    surface: &Surface,
    count: usize,
    scratch: &mut Scratch,
) -> impl Iterator<Item = (Vec3A, Vec3)> {
    // A rough surface omits the emission of lamps that direct light samples.
    let coated = Coated::at(receiver, &Surface { roughness: 1.0, lobes: None, ..surface.clone() });
    let rays = hemisphere(count);
    let light = light_along(scene, &coated, &rays, scratch);
    rays.into_iter().zip(light).map(move |(ray, light)| (coated.unclipped(ray), light))
}

/// Returns the radiance that arrives along `rays`, even directions in the shading frame of `coated`
/// \[W·m⁻²·sr⁻¹\].
fn light_along(scene: KnownScene, coated: &Coated, rays: &[Vec3], scratch: &mut Scratch) -> Vec<Vec3> {
    // Average textures over the solid angle of a ray. No light arrives from directions below the triangle.
    let count = rays.len() as u32;
    let (spread, share) = ((TAU / count as f32).sqrt(), luminance(coated.albedo()));
    let KnownScene { frame, known } = scene;
    let mut reflections =
        Reflections { prepared: frame, scratch, points: LightPoints::All, shadow_rays: 0, known: Some(known) };
    let mut light = Vec::with_capacity(rays.len());
    for &local in rays {
        light.push(match coated.to_world(local) {
            Some(direction) => {
                let ray = ReflectedRay { direction, spread, share, rays: count, is_kept: true, is_faint: false };
                reflections.along(coated, ray).0
            }
            None => Vec3::ZERO,
        });
    }
    light
}

/// Returns evenly distributed directions about +z: `count` points of a spherical Fibonacci lattice \[Keinert15\].
fn hemisphere(count: usize) -> Vec<Vec3> {
    // Rotate consecutive points by the golden angle.
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
            // Expect ∫ cos θ dω = π and ∫ cos² θ dω = 2π/3; x and y have zero mean.
            let mean = rays.iter().sum::<Vec3>() / count as f32;
            let squares = rays.iter().map(|ray| *ray * *ray).sum::<Vec3>() / count as f32;
            assert!((mean - Vec3::new(0.0, 0.0, 0.5)).length() < 0.01, "{mean}");
            assert!((squares - Vec3::splat(1.0 / 3.0)).length() < 0.01, "{squares}");
        }
    }
}
