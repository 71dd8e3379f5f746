//! Reflection of surfaces: a Lambert base under a GGX coat, as in glTF's metallic-roughness materials.
//!
//! ```text
//! f = F·D·G₂ / (4 cos θ_o cos θ_i)                                            single scattering in the coat
//!   + M (1 − E(θ_o)) (1 − E(θ_i)) / (π (1 − E_avg))                           multiple scattering \[Kulla17\]
//!   + albedo (1 − C(θ_o)) (1 − C(θ_i)) / (π (1 − C_avg))                      the base below it \[Kelemen01\]
//!
//!   F  Schlick's Fresnel term          E  directional albedo of the coat with F = 1
//!   D  GGX                             C  directional albedo of the coat, both scatterings
//!   G₂ height-correlated Smith         M  F_avg² E_avg / (1 − F_avg (1 − E_avg)): light scattered repeatedly in the coat
//! ```
//!
//! In each direction, the light that the coat reflects and the light that it transmits to the base sum to the incident
//! light. A white base is white under any coat. A coat with F₀ = 1 is white at any roughness. Each term is symmetric in
//! ω_o and ω_i. Without a coat, f = albedo/π.
//!
//! Directions are unit vectors in the frame of the shading normal, which is +z; all point away from the surface.

mod albedo;
mod ggx;

use crate::luminance;
use crate::sampling::cosine_hemisphere;
use albedo::AlbedoRow;
use ggx::{Ggx, grazing_share};
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Minimum divisor. Smaller losses or transmissions of a perfect mirror are rounding errors.
const NOTHING: f32 = 1e-6;

/// Reflection at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bsdf {
    albedo: Vec3,
    coat: Option<Coat>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Coat {
    f0: Vec3,
    ggx: Ggx,
    albedos: AlbedoRow,
    /// Loss of the coat's single scattering with F = 1, 1 − E_avg.
    lost_mean: f32,
    /// Factor of multiple scattering, M / (1 − E_avg).
    multiple: Vec3,
    /// Mean transmission of the coat, 1 − C_avg.
    through_mean: Vec3,
    /// Albedo of the base divided by 1 − C_avg.
    base: Vec3,
}

/// Direction sampled from a [`Bsdf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Sampled direction above the surface, a unit vector.
    pub direction: Vec3,
    /// Weight of the light from the sampled direction: BRDF times cosine divided by density.
    pub weight: Vec3,
    /// Density of the sampled direction, [`Bsdf::pdf`] \[sr⁻¹\].
    pub pdf: f32,
}

impl Bsdf {
    /// Builds the BSDF. The diffuse reflectance, the coat's reflectance at normal incidence (zero for no coat) and the
    /// perceptual roughness are in 0…1.
    #[must_use]
    pub fn new(albedo: Vec3, specular: Vec3, roughness: f32) -> Self {
        let coat = (specular != Vec3::ZERO).then(|| Coat::new(albedo, specular, roughness));
        Self { albedo, coat }
    }

    /// Returns whether the surface reflects no light.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.albedo == Vec3::ZERO && self.coat.is_none()
    }

    /// Returns the BRDF f(ω_o, ω_i) \[sr⁻¹\], without the cosine. It is zero unless both directions are above the
    /// surface.
    #[must_use]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Vec3::ZERO;
        }
        match &self.coat {
            None => self.albedo * FRAC_1_PI,
            Some(coat) => coat.single(wo, wi) + coat.diffuse(wo.z, wi.z),
        }
    }

    /// Returns the directional albedo, 0…1: the radiance reflected under uniform light of radiance 1. `cos` is the
    /// cosine between the direction and the normal.
    #[must_use]
    pub fn directional_albedo(&self, cos: f32) -> Vec3 {
        match &self.coat {
            None => self.albedo,
            Some(coat) => coat.albedos.at(cos).with(coat.f0) + coat.diffuse_albedo(cos),
        }
    }

    /// Returns [`Bsdf::directional_albedo`] without the coat's single scattering: the base below the coat, and multiple
    /// scattering in the coat. Both lobes are broad. Without a coat, the result is exactly the albedo.
    #[must_use]
    pub fn diffuse_albedo(&self, cos: f32) -> Vec3 {
        match &self.coat {
            None => self.albedo,
            Some(coat) => coat.diffuse_albedo(cos),
        }
    }

    /// Returns the excess of the BRDF of base and multiple scattering over [`Bsdf::diffuse_albedo`] / π \[sr⁻¹\], for
    /// light from one direction. Coats transmit more light at normal incidence than at grazing incidence. The excess
    /// averages to zero in uniform light and is zero without a coat.
    #[must_use]
    pub fn diffuse_excess(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match &self.coat {
            Some(coat) if wo.z > 0.0 && wi.z > 0.0 => coat.diffuse(wo.z, wi.z) - coat.diffuse_albedo(wo.z) * FRAC_1_PI,
            _ => Vec3::ZERO,
        }
    }

    /// Returns the contribution of the coat's single scattering to [`Bsdf::directional_albedo`], zero without a coat.
    #[must_use]
    pub fn coat_albedo(&self, cos: f32) -> Vec3 {
        self.coat.as_ref().map_or(Vec3::ZERO, |coat| coat.albedos.at(cos).with(coat.f0))
    }

    /// Returns the BRDF of the coat's single scattering \[sr⁻¹\], without the cosine, for light from a small disc of
    /// `half_angle` radians around ω_i. The result is zero without a coat.
    ///
    /// ```text
    /// α'² = α² + half_angle² / 4
    /// ```
    /// To first order, the lobe with α' is the mean over the disc at the lobe's peak. At the peak, D falls by 2t²/α² at
    /// a microfacet tilted by t. The mean of t² is half_angle²/8, since microfacets tilt half as far as directions.
    #[must_use]
    pub fn evaluate_coat(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        match &self.coat {
            Some(coat) if wo.z > 0.0 && wi.z > 0.0 => {
                Coat { ggx: coat.ggx.widened(half_angle * half_angle / 4.0), ..*coat }.single(wo, wi)
            }
            _ => Vec3::ZERO,
        }
    }

    /// Draws the incident direction of the coat's single scattering from the microfacets visible from ω_o.
    ///
    /// Returns `None` without a coat. Also returns `None` if the drawn direction points into the surface: such a sample
    /// counts as zero.
    #[must_use]
    pub fn sample_coat(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let direction = self.coat.as_ref()?.ggx.sample(wo, u);
        (wo.z > 0.0 && direction.z > 0.0).then_some(direction)
    }

    /// Returns the weight of light from a direction drawn by [`Bsdf::sample_coat`]: F·G₂/G₁, 0…1.
    #[must_use]
    pub fn coat_weight(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.coat
            .as_ref()
            .map_or(Vec3::ZERO, |coat| coat.fresnel(wo.dot((wo + wi).normalize())) * coat.ggx.masking_ratio(wo, wi))
    }

    /// Returns the density over solid angle with which [`Bsdf::sample`] draws ω_i \[sr⁻¹\].
    #[must_use]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return 0.0;
        }
        // Mix the densities of both lobes by the probability of each.
        let diffuse = wi.z * FRAC_1_PI;
        match &self.coat {
            None => diffuse,
            Some(coat) => {
                let share = coat.single_share(wo.z);
                share * coat.ggx.pdf(wo, (wo + wi).normalize()) + (1.0 - share) * diffuse
            }
        }
    }

    /// Draws an incident direction with a density roughly proportional to its contribution.
    ///
    /// `choice` and `u` are in 0…1. `choice` selects coat or base. Returns `None` if the surface reflects no light, or
    /// if the drawn direction points into the surface: such a sample counts as zero.
    #[must_use]
    pub fn sample(&self, wo: Vec3, choice: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 || self.is_black() {
            return None;
        }
        // Draw from one of the two lobes, but weight with the density of both.
        let direction = match &self.coat {
            Some(coat) if choice < coat.single_share(wo.z) => coat.ggx.sample(wo, u),
            _ => cosine_hemisphere(Vec3::Z, u),
        };
        if direction.z <= 0.0 {
            return None;
        }
        let pdf = self.pdf(wo, direction);
        // The weight of a Lambert surface is exactly its albedo.
        let weight = match &self.coat {
            None => self.albedo,
            Some(_) => self.evaluate(wo, direction) * (direction.z / pdf),
        };
        (pdf > 0.0 && weight.is_finite()).then_some(BsdfSample { direction, weight, pdf })
    }
}

impl Coat {
    fn new(albedo: Vec3, f0: Vec3, roughness: f32) -> Self {
        // Read the coat's albedo with F = 1, which determines the light lost by single scattering.
        let albedos = AlbedoRow::new(roughness);
        let mean = albedos.mean();
        // The cosine-weighted mean of Schlick's term is F₀ + (1 − F₀)/21.
        let f_mean = f0 + (Vec3::ONE - f0) / 21.0;
        let lost_mean = (1.0 - mean.facing).max(NOTHING);
        let bouncing_on = f_mean * f_mean * mean.facing / (Vec3::ONE - f_mean * lost_mean);
        // The base receives the light that both scatterings in the coat transmit.
        let through_mean = (Vec3::ONE - mean.with(f0) - bouncing_on * lost_mean).max(Vec3::splat(NOTHING));
        Self {
            f0,
            ggx: Ggx::from_roughness(roughness),
            albedos,
            lost_mean,
            multiple: bouncing_on / lost_mean,
            through_mean,
            base: albedo / through_mean,
        }
    }

    fn single(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let h = (wo + wi).normalize();
        self.fresnel(wo.dot(h)) * self.ggx.reflectance(wo, wi, h)
    }

    /// Returns Schlick's term for a microfacet, given the cosine between the light and the microfacet's normal.
    fn fresnel(&self, cos: f32) -> Vec3 {
        let grazing = grazing_share(cos);
        self.f0 * (1.0 - grazing) + Vec3::splat(grazing)
    }

    /// Returns the loss of single scattering towards a direction, 1 − E, and the transmission of the coat, 1 − C.
    fn left_over(&self, cos: f32) -> (f32, Vec3) {
        // Add multiple scattering to the coat's albedo; the remainder reaches the base.
        let albedo = self.albedos.at(cos);
        let lost = (1.0 - albedo.facing).max(0.0);
        let coat = albedo.with(self.f0) + self.multiple * (lost * self.lost_mean);
        (lost, (Vec3::ONE - coat).max(Vec3::ZERO))
    }

    /// Returns the BRDF of multiple scattering and base. Both are broad, so one cosine lobe samples both.
    fn diffuse(&self, cos_o: f32, cos_i: f32) -> Vec3 {
        let ((lost_o, through_o), (lost_i, through_i)) = (self.left_over(cos_o), self.left_over(cos_i));
        (self.multiple * (lost_o * lost_i) + self.base * through_o * through_i) * FRAC_1_PI
    }

    /// Returns the directional albedo of [`Coat::diffuse`].
    fn diffuse_albedo(&self, cos: f32) -> Vec3 {
        let (lost, through) = self.left_over(cos);
        self.multiple * (lost * self.lost_mean) + self.base * through * self.through_mean
    }

    /// Returns the probability of sampling the coat's single scattering: its fraction of the reflected light.
    fn single_share(&self, cos: f32) -> f32 {
        // Compare luminances, because one direction serves all three channels.
        let single = luminance(self.albedos.at(cos).with(self.f0));
        let diffuse = luminance(self.diffuse_albedo(cos));
        single / (single + diffuse)
    }
}

#[cfg(test)]
mod tests;
