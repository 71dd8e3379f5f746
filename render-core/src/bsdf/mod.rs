//! Reflection and transmission of surfaces.
//!
//! Most surfaces are a Lambert base under a GGX coat, as in glTF's metallic-roughness materials (`coat.rs`). Material
//! extensions add clearcoat, sheen, thin films, grooves, glass and diffuse transmission (`stack.rs` combines them, with
//! a file for each lobe). For base and coat:
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
//! Directions are unit vectors in the frame of the shading normal, which is +z; all point away from the surface. ω_o is
//! above the surface.

mod albedo;
mod clearcoat;
mod coat;
mod film;
mod fresnel;
mod ggx;
mod glass;
mod glass_albedo;
mod lobes;
mod quadrature;
mod schlick;
mod sheen;
mod stack;

pub use lobes::{GlassLobe, SurfaceLobes};

/// Returns the reflectance of an interface between dielectrics for unpolarised light. `eta` is the index of refraction
/// on the far side divided by the index on the near side.
pub(crate) fn dielectric_reflectance(cos: f32, eta: f32) -> f32 {
    fresnel::dielectric(cos, eta).0
}

use crate::sampling::cosine_hemisphere;
use coat::Coat;
use ggx::Ggx;
use glam::{Vec2, Vec3};
use schlick::Schlick;
use stack::Stack;
use std::f32::consts::FRAC_1_PI;

/// Reflection and transmission at a point of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Bsdf {
    albedo: Vec3,
    coat: Option<Coat<Schlick>>,
    /// All lobes of a surface with material extensions, in place of `albedo` and `coat`.
    stack: Option<Box<Stack>>,
}

/// Direction sampled from a [`Bsdf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Sampled direction, a unit vector. It is below the surface only if the surface transmits light.
    pub direction: Vec3,
    /// Weight of the light from the sampled direction: BSDF times cosine divided by density.
    pub weight: Vec3,
    /// Density of the sampled direction, [`Bsdf::pdf`] \[sr⁻¹\].
    pub pdf: f32,
}

impl Bsdf {
    /// Builds the BSDF of a base and a coat. The diffuse reflectance, the coat's reflectance at normal incidence (zero
    /// for no coat) and the perceptual roughness are in 0…1.
    #[must_use]
    pub fn new(albedo: Vec3, specular: Vec3, roughness: f32) -> Self {
        let coat = (specular != Vec3::ZERO).then(|| {
            let fresnel = Schlick { f0: specular, f90: 1.0 };
            Coat::new(albedo, fresnel, Ggx::from_roughness(roughness))
        });
        Self { albedo, coat, stack: None }
    }

    /// Builds the BSDF of a surface with material extensions. `axes` are the axes of the shading frame
    /// ([`SurfaceLobes::axes`]), and `eta` is the index of refraction below the surface divided by the index above.
    #[must_use]
    pub fn layered(lobes: &SurfaceLobes, axes: [Vec3; 3], eta: f32) -> Self {
        Self { albedo: lobes.base, coat: None, stack: Some(Box::new(Stack::new(lobes, axes, eta))) }
    }

    /// Returns whether the surface reflects no light and transmits none.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.albedo == Vec3::ZERO && self.coat.is_none() && self.stack.is_none()
    }

    /// Returns whether light passes through the surface.
    #[must_use]
    pub fn transmits(&self) -> bool {
        self.stack.as_ref().is_some_and(|stack| stack.transmits())
    }

    /// Returns the contribution of refraction to [`Bsdf::directional_albedo`], including light that passes straight
    /// through. It is zero without glass.
    #[must_use]
    pub fn refracted_albedo(&self, cos: f32) -> Vec3 {
        self.stack.as_ref().filter(|_| cos > 0.0).map_or(Vec3::ZERO, |stack| stack.refracted_albedo(at_cosine(cos)))
    }

    /// Returns the contribution of diffuse transmission to [`Bsdf::directional_albedo`].
    #[must_use]
    pub fn below_albedo(&self, cos: f32) -> Vec3 {
        self.stack.as_ref().filter(|_| cos > 0.0).map_or(Vec3::ZERO, |stack| stack.below_albedo(at_cosine(cos)))
    }

    /// Returns the direction below the surface from which refracted light arrives: at the mean surface, or at a facet
    /// drawn with `u`. Returns `None` without glass and at total reflection.
    #[must_use]
    pub fn refract(&self, wo: Vec3, u: Option<Vec2>) -> Option<Vec3> {
        self.stack.as_ref().filter(|_| wo.z > 0.0)?.refract(wo, u)
    }

    /// Returns the fraction of light that passes straight through a clear thin wall, in addition to
    /// [`Bsdf::evaluate`]. `cos` is the cosine between the direction and the normal.
    #[must_use]
    pub fn straight(&self, cos: f32) -> Vec3 {
        self.stack.as_ref().filter(|_| cos > 0.0).map_or(Vec3::ZERO, |stack| stack.straight(at_cosine(cos)))
    }

    /// Returns the BSDF f(ω_o, ω_i) \[sr⁻¹\], without the cosine. It is zero unless ω_o is above the surface. Below the
    /// surface, it is zero unless the surface [transmits](Self::transmits) light.
    #[must_use]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if wo.z <= 0.0 || wi.z == 0.0 {
            return Vec3::ZERO;
        }
        if let Some(stack) = &self.stack {
            return stack.evaluate(wo, wi);
        }
        if wi.z < 0.0 {
            return Vec3::ZERO;
        }
        match &self.coat {
            None => self.albedo * FRAC_1_PI,
            Some(coat) => coat.single(wo, wi) + coat.diffuse(wo.z, wi.z),
        }
    }

    /// Returns the directional albedo, 0…1: the radiance reflected and transmitted under uniform light of radiance 1.
    /// `cos` is the cosine between the direction and the normal.
    #[must_use]
    pub fn directional_albedo(&self, cos: f32) -> Vec3 {
        match (&self.stack, &self.coat) {
            (Some(stack), _) => stack.directional_albedo(at_cosine(cos)),
            (None, None) => self.albedo,
            (None, Some(coat)) => coat.single_albedo(cos) + coat.diffuse_albedo(cos),
        }
    }

    /// Returns [`Bsdf::directional_albedo`] without single reflections and without transmission: the base below the
    /// coat, and multiple scattering in the coat. Both lobes are broad. Without a coat, the result is exactly the albedo.
    #[must_use]
    pub fn diffuse_albedo(&self, cos: f32) -> Vec3 {
        match (&self.stack, &self.coat) {
            (Some(stack), _) => stack.diffuse_albedo(at_cosine(cos)),
            (None, None) => self.albedo,
            (None, Some(coat)) => coat.diffuse_albedo(cos),
        }
    }

    /// Returns the excess of the BRDF of base and multiple scattering over [`Bsdf::diffuse_albedo`] / π \[sr⁻¹\], for
    /// light from one direction. Coats transmit more light at normal incidence than at grazing incidence. The excess
    /// averages to zero in uniform light and is zero without a coat.
    #[must_use]
    pub fn diffuse_excess(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Vec3::ZERO;
        }
        match (&self.stack, &self.coat) {
            (Some(stack), _) => stack.diffuse(wo, wi) - stack.diffuse_albedo(wo) * FRAC_1_PI,
            (None, Some(coat)) => coat.diffuse(wo.z, wi.z) - coat.diffuse_albedo(wo.z) * FRAC_1_PI,
            (None, None) => Vec3::ZERO,
        }
    }

    /// Returns the contribution of a clearcoat to [`Bsdf::directional_albedo`]. [`Bsdf::coat_albedo`] does not include
    /// it.
    #[must_use]
    pub fn clearcoat_albedo(&self, wo: Vec3) -> f32 {
        self.stack.as_ref().filter(|_| wo.z > 0.0).map_or(0.0, |stack| stack.varnish_albedo(wo))
    }

    /// Returns the BRDF of a clearcoat \[sr⁻¹\], for light from a disc of `half_angle` radians around ω_i.
    /// [`Bsdf::evaluate_coat`] does not include it.
    #[must_use]
    pub fn evaluate_clearcoat(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        match &self.stack {
            Some(stack) if wo.z > 0.0 && wi.z > 0.0 => stack.evaluate_varnish(wo, wi, half_angle),
            _ => Vec3::ZERO,
        }
    }

    /// Draws the incident direction of a reflection at the clearcoat. Returns `None` without a clearcoat, or if the
    /// direction points into the surface.
    #[must_use]
    pub fn sample_clearcoat(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let direction = self.stack.as_ref().filter(|_| wo.z > 0.0)?.sample_varnish(wo, u)?;
        (direction.z > 0.0).then_some(direction)
    }

    /// Returns the contribution of single reflections to [`Bsdf::directional_albedo`], zero without a coat.
    #[must_use]
    pub fn coat_albedo(&self, cos: f32) -> Vec3 {
        match &self.stack {
            Some(stack) => stack.gloss_albedo(at_cosine(cos)),
            None => self.coat.as_ref().map_or(Vec3::ZERO, |coat| coat.single_albedo(cos)),
        }
    }

    /// Returns the BRDF of single reflections \[sr⁻¹\], without the cosine, for light from a small disc of `half_angle`
    /// radians around ω_i. The result is zero without a coat.
    ///
    /// ```text
    /// α'² = α² + half_angle² / 4
    /// ```
    /// To first order, the lobe with α' is the mean over the disc at the lobe's peak. At the peak, D falls by 2t²/α² at
    /// a microfacet tilted by t. The mean of t² is half_angle²/8, since microfacets tilt half as far as directions.
    #[must_use]
    pub fn evaluate_coat(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Vec3::ZERO;
        }
        match (&self.stack, &self.coat) {
            (Some(stack), _) => stack.gloss(wo, wi, half_angle),
            (None, Some(coat)) => coat.widened(half_angle * half_angle / 4.0).single(wo, wi),
            (None, None) => Vec3::ZERO,
        }
    }

    /// Draws the incident direction of a single reflection, for a coat from the microfacets visible from ω_o.
    ///
    /// Returns `None` without a coat. Also returns `None` if the drawn direction points into the surface: such a sample
    /// counts as zero.
    #[must_use]
    pub fn sample_coat(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let direction = match (&self.stack, &self.coat) {
            (Some(stack), _) => stack.sample_gloss(wo, u)?,
            (None, coat) => coat.as_ref()?.ggx.sample(wo, u),
        };
        (wo.z > 0.0 && direction.z > 0.0).then_some(direction)
    }

    /// Returns the weight of light from a direction drawn by [`Bsdf::sample_coat`]: F·G₂/G₁, 0…1, for a coat alone.
    #[must_use]
    pub fn coat_weight(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match &self.stack {
            Some(stack) => stack.gloss(wo, wi, 0.0) * (wi.z / stack.gloss_pdf(wo, wi).max(f32::MIN_POSITIVE)),
            None => self.coat.as_ref().map_or(Vec3::ZERO, |coat| coat.single_weight(wo, wi)),
        }
    }

    /// Returns the density over solid angle with which [`Bsdf::sample`] draws ω_i \[sr⁻¹\].
    #[must_use]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z <= 0.0 || wi.z == 0.0 {
            return 0.0;
        }
        if let Some(stack) = &self.stack {
            return stack.pdf(wo, wi);
        }
        if wi.z < 0.0 {
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
    /// `choice` and `u` are in 0…1. `choice` selects the lobe. Returns `None` if the surface reflects no light, or if
    /// the drawn direction is on the wrong side of the surface: such a sample counts as zero.
    #[must_use]
    pub fn sample(&self, wo: Vec3, choice: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 || self.is_black() {
            return None;
        }
        // Draw from one of the lobes, but weight with the density of all.
        let direction = match (&self.stack, &self.coat) {
            (Some(stack), _) => stack.sample(wo, choice, u)?,
            (None, Some(coat)) if choice < coat.single_share(wo.z) => coat.ggx.sample(wo, u),
            _ => cosine_hemisphere(Vec3::Z, u),
        };
        if direction.z == 0.0 || direction.z < 0.0 && self.stack.is_none() {
            return None;
        }
        let pdf = self.pdf(wo, direction);
        // The weight of a Lambert surface is exactly its albedo.
        let weight = match (&self.stack, &self.coat) {
            (None, None) => self.albedo,
            _ => self.evaluate(wo, direction) * (direction.z.abs() / pdf),
        };
        (pdf > 0.0 && weight.is_finite()).then_some(BsdfSample { direction, weight, pdf })
    }
}

/// Returns a direction with this cosine to the normal.
fn at_cosine(cos: f32) -> Vec3 {
    Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos)
}

#[cfg(test)]
mod tests;
