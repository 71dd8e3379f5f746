//! Light that a record gathers from the texels by rays.
//!
//! ```text
//! E(x) ≈ π/N Σ ρ(yᵢ)/π E(yᵢ)          yᵢ  end of ray i, N cosine-distributed rays
//! ```

use super::lattice::MoverChange;
use super::texel_light::{GATHER_RAYS, TexelLight, reflectance};
use crate::shade::gradient_sum::GradientSum;
use crate::shade::layer::{GatheredLight, KnownLight, Visible};
use crate::texels::BakedTexels;
use glam::Vec3;
use lighttree::IrradianceTerm;
use plane::Plane;
use render_core::{Hit, ShadingPoint, Surface, Timed};
use std::f32::consts::PI;

/// Minimum cosine in derivatives. At grazing angles, derivatives would not be finite.
const LEAST_COSINE: f32 = 0.05;

impl KnownLight for TexelLight<'_> {
    fn irradiance(&self, hit: &Hit, surface: &Surface) -> Vec3 {
        self.irradiance_at(hit, surface)
    }

    fn texels(&self) -> &BakedTexels {
        self.texels
    }

    fn changes(&self) -> bool {
        !self.is_constant
    }

    fn gather(&self, receiver: &ShadingPoint, key: u64) -> GatheredLight {
        let &ShadingPoint { position, normal, geometric_normal } = receiver;
        let (mut light, mut nearest) = (GradientSum::ZERO, f32::INFINITY);
        let (mut inverse_distances, mut above) = (0.0, 0.0f32);
        let weight = PI / GATHER_RAYS as f32;
        for direction in self.directions.around(normal, key) {
            if direction.dot(geometric_normal) <= 0.0 {
                continue;
            }
            above += 1.0;
            let Some(hit) = self.frame.accelerator.closest(position, direction) else { continue };
            inverse_distances += 1.0 / hit.distance;
            nearest = nearest.min(hit.distance);

            // Let each ray represent the region up to the neighboring rays. Emission and sky are in the light tree.
            let surface = self.frame.surfaces.at_indirect(&hit, direction, hit.distance * weight.sqrt());
            if !surface.front && !surface.double_sided {
                continue;
            }
            let radiance = reflectance(&surface, direction) / PI * self.irradiance_at(&hit, &surface);

            // Take derivatives of cos θ cos θ_y / r² for a fixed end of the ray: both cosines contain the direction.
            let facing = surface.geometric_normal;
            let towards = direction.dot(facing).min(-LEAST_COSINE);
            let slope = (direction * 4.0 - facing / towards) / hit.distance;
            let slope = slope - normal * slope.dot(normal);
            light.add(
                radiance,
                &IrradianceTerm {
                    value: weight,
                    by_normal: (direction * (weight / normal.dot(direction).max(LEAST_COSINE))).into(),
                    by_position: (slope * weight).into(),
                },
            );
        }
        GatheredLight { light, harmonic_mean: above / inverse_distances, nearest }
    }

    fn change(&self, visible: &Visible<'_>, still: &Plane<Option<[f32; 3]>>) -> Option<Timed<Plane<[f32; 3]>>> {
        let has_movers = !self.movers.spheres.is_empty();
        has_movers.then(|| MoverChange { light: self, visible }.all(still))
    }
}
