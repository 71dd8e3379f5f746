//! How a surface reflects: a Lambert base under a GGX coat, as glTF's metallic-roughness materials describe.
//!
//! ```text
//! f = F·D·G₂ / (4 cos θ_o cos θ_i)                                            single scattering in the coat
//!   + M (1 − E(θ_o)) (1 − E(θ_i)) / (π (1 − E_avg))                           multiple scattering \[Kulla17\]
//!   + albedo (1 − C(θ_o)) (1 − C(θ_i)) / (π (1 − C_avg))                      the base below it \[Kelemen01\]
//!
//!   F  Schlick's Fresnel term          E  directional albedo of the coat with F = 1
//!   D  GGX                             C  of the coat as it is, both scatterings
//!   G₂ height-correlated Smith         M  F_avg² E_avg / (1 − F_avg (1 − E_avg)): light that bounces in the coat on
//! ```
//!
//! Light that the coat reflects and light that it transmits to the base add up to the arriving light, in each direction. A
//! white base is white under any coat, and a coat with F₀ = 1 at any roughness. Each term is symmetric in ω_o and ω_i.
//! Without a coat the whole is albedo/π.
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

/// Divisors are at least this large: what a perfect mirror loses, or lets through, is rounding.
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
    /// 1 − E_avg.
    lost_mean: f32,
    /// M / (1 − E_avg).
    multiple: Vec3,
    /// 1 − C_avg.
    through_mean: Vec3,
    /// Albedo of the base over 1 − C_avg.
    base: Vec3,
}

/// A direction drawn from a [`Bsdf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit vector, above the surface.
    pub direction: Vec3,
    /// Reflectance times cosine by density: what the light from there counts.
    pub weight: Vec3,
    /// [`Bsdf::pdf`] of the direction \[sr⁻¹\].
    pub pdf: f32,
}

impl Bsdf {
    /// From what [`crate::Surface`] says: diffuse reflectance, coat's reflectance at normal incidence (zero for none), and
    /// perceptual roughness; all 0…1.
    #[must_use]
    pub fn new(albedo: Vec3, specular: Vec3, roughness: f32) -> Self {
        let coat = (specular != Vec3::ZERO).then(|| Coat::new(albedo, specular, roughness));
        Self { albedo, coat }
    }

    /// Whether nothing is reflected.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.albedo == Vec3::ZERO && self.coat.is_none()
    }

    /// BRDF f(ω_o, ω_i) \[sr⁻¹\], without a cosine; zero unless both directions are above the surface.
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

    /// Directional albedo, 0…1: what is sent towards a direction, given by its cosine to the normal, under light that is
    /// 1 from everywhere.
    #[must_use]
    pub fn directional_albedo(&self, cos: f32) -> Vec3 {
        match &self.coat {
            None => self.albedo,
            Some(coat) => coat.albedos.at(cos).with(coat.f0) + coat.diffuse_albedo(cos),
        }
    }

    /// The part of [`Bsdf::directional_albedo`] that is not the coat's single scattering: the base below the coat, and light
    /// that bounces on within it. Both are broad; without a coat it is the albedo to the last bit.
    #[must_use]
    pub fn diffuse_albedo(&self, cos: f32) -> Vec3 {
        match &self.coat {
            None => self.albedo,
            Some(coat) => coat.diffuse_albedo(cos),
        }
    }

    /// Excess of the BRDF of base and multiple scattering, for light from one direction, over [`Bsdf::diffuse_albedo`] / π
    /// \[sr⁻¹\]: coats let more light through from above than from the side. Zero in the mean over even light, and without a coat.
    #[must_use]
    pub fn diffuse_excess(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match &self.coat {
            Some(coat) if wo.z > 0.0 && wi.z > 0.0 => coat.diffuse(wo.z, wi.z) - coat.diffuse_albedo(wo.z) * FRAC_1_PI,
            _ => Vec3::ZERO,
        }
    }

    /// The part of [`Bsdf::directional_albedo`] that is the coat's single scattering; zero without a coat.
    #[must_use]
    pub fn coat_albedo(&self, cos: f32) -> Vec3 {
        self.coat.as_ref().map_or(Vec3::ZERO, |coat| coat.albedos.at(cos).with(coat.f0))
    }

    /// BRDF of the coat's single scattering \[sr⁻¹\], without a cosine, for light from a small disc of `half_angle` radians
    /// around ω_i; zero without a coat.
    ///
    /// ```text
    /// α'² = α² + half_angle² / 4
    /// ```
    /// To first order that is the mean over the disc at the top of the lobe: D falls there by 2t²/α² at a microfacet turned by t,
    /// and t² is half_angle²/8 in the mean, since microfacets turn half as far as directions.
    #[must_use]
    pub fn evaluate_coat(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        match &self.coat {
            Some(coat) if wo.z > 0.0 && wi.z > 0.0 => {
                Coat { ggx: coat.ggx.widened(half_angle * half_angle / 4.0), ..*coat }.single(wo, wi)
            }
            _ => Vec3::ZERO,
        }
    }

    /// Draws the direction that light comes from to the coat's single scattering, by the microfacets that ω_o sees.
    ///
    /// `None` without a coat, and where the drawn direction points into the surface: such a sample counts as zero.
    #[must_use]
    pub fn sample_coat(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let direction = self.coat.as_ref()?.ggx.sample(wo, u);
        (wo.z > 0.0 && direction.z > 0.0).then_some(direction)
    }

    /// Weight of light from a direction of [`Bsdf::sample_coat`]: F·G₂/G₁, 0…1.
    #[must_use]
    pub fn coat_weight(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.coat
            .as_ref()
            .map_or(Vec3::ZERO, |coat| coat.fresnel(wo.dot((wo + wi).normalize())) * coat.ggx.masking_ratio(wo, wi))
    }

    /// Density over solid angle \[sr⁻¹\] with which [`Bsdf::sample`] draws ω_i.
    #[must_use]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return 0.0;
        }
        let diffuse = wi.z * FRAC_1_PI;
        match &self.coat {
            None => diffuse,
            Some(coat) => {
                let share = coat.single_share(wo.z);
                share * coat.ggx.pdf(wo, (wo + wi).normalize()) + (1.0 - share) * diffuse
            }
        }
    }

    /// Draws the direction that light comes from, about in proportion to what it contributes.
    ///
    /// `u` are in 0…1; the first chooses between coat and base. `None` where nothing is reflected, or where the drawn
    /// direction points into the surface: such a sample counts as zero.
    #[must_use]
    pub fn sample(&self, wo: Vec3, choice: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 || self.is_black() {
            return None;
        }
        let direction = match &self.coat {
            Some(coat) if choice < coat.single_share(wo.z) => coat.ggx.sample(wo, u),
            _ => cosine_hemisphere(Vec3::Z, u),
        };
        if direction.z <= 0.0 {
            return None;
        }
        let pdf = self.pdf(wo, direction);
        // Lambert's weight is its albedo to the last digit.
        let weight = match &self.coat {
            None => self.albedo,
            Some(_) => self.evaluate(wo, direction) * (direction.z / pdf),
        };
        (pdf > 0.0 && weight.is_finite()).then_some(BsdfSample { direction, weight, pdf })
    }
}

impl Coat {
    fn new(albedo: Vec3, f0: Vec3, roughness: f32) -> Self {
        let albedos = AlbedoRow::new(roughness);
        let mean = albedos.mean();
        // Cosine-weighted mean of Schlick's term.
        let f_mean = f0 + (Vec3::ONE - f0) / 21.0;
        let lost_mean = (1.0 - mean.facing).max(NOTHING);
        let bouncing_on = f_mean * f_mean * mean.facing / (Vec3::ONE - f_mean * lost_mean);
        // What both scatterings in the coat leave is for the base.
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

    /// Schlick's term for a microfacet at whose normal light arrives with this cosine.
    fn fresnel(&self, cos: f32) -> Vec3 {
        let grazing = grazing_share(cos);
        self.f0 * (1.0 - grazing) + Vec3::splat(grazing)
    }

    /// Loss of single scattering towards a direction, 1 − E, and transmission of the coat, 1 − C.
    fn left_over(&self, cos: f32) -> (f32, Vec3) {
        let albedo = self.albedos.at(cos);
        let lost = (1.0 - albedo.facing).max(0.0);
        let coat = albedo.with(self.f0) + self.multiple * (lost * self.lost_mean);
        (lost, (Vec3::ONE - coat).max(Vec3::ZERO))
    }

    /// Multiple scattering and base: both are broad, and one cosine lobe draws for both.
    fn diffuse(&self, cos_o: f32, cos_i: f32) -> Vec3 {
        let ((lost_o, through_o), (lost_i, through_i)) = (self.left_over(cos_o), self.left_over(cos_i));
        (self.multiple * (lost_o * lost_i) + self.base * through_o * through_i) * FRAC_1_PI
    }

    /// Directional albedo of [`Coat::diffuse`].
    fn diffuse_albedo(&self, cos: f32) -> Vec3 {
        let (lost, through) = self.left_over(cos);
        self.multiple * (lost * self.lost_mean) + self.base * through * self.through_mean
    }

    /// Probability of drawing from the coat's single scattering: its share of the light that is sent back.
    fn single_share(&self, cos: f32) -> f32 {
        let single = luminance(self.albedos.at(cos).with(self.f0));
        let diffuse = luminance(self.diffuse_albedo(cos));
        single / (single + diffuse)
    }
}

#[cfg(test)]
mod tests;
