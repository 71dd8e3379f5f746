//! Microfacets: GGX normals and height-correlated Smith shadowing.
//!
//! Directions are unit vectors in the frame of the shading normal, which is +z; all point away from the surface.

use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Minimum α. A lobe of this width looks like a mirror, but its peak, 1/(4πα²) at normal incidence, is finite.
const SMALLEST_ALPHA: f32 = 1e-3;

/// GGX distribution of microfacet normals \[Walter07\], with a width along x and a width along y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ggx {
    alpha: Vec2,
}

impl Ggx {
    /// Builds the distribution from the perceptual roughness. α is the square of the roughness (glTF 2.0, appendix
    /// B.2).
    pub(super) fn from_roughness(roughness: f32) -> Self {
        Self { alpha: Vec2::splat((roughness * roughness).clamp(SMALLEST_ALPHA, 1.0)) }
    }

    /// Builds the distribution of a grooved surface, with the wider lobe along x.
    ///
    /// ```text
    /// α_x = α + (1 − α) strength²        α_y = α        α = roughness²   (`KHR_materials_anisotropy`)
    /// ```
    pub(super) fn anisotropic(roughness: f32, strength: f32) -> Self {
        let alpha = Self::from_roughness(roughness).alpha;
        Self { alpha: Vec2::new(alpha.x + (1.0 - alpha.x) * strength * strength, alpha.y) }
    }

    /// Returns the perceptual roughness of the isotropic distribution with about the same albedo: the one of the mean
    /// α. Over all azimuths, its albedo is at most 0.034 too small.
    pub(super) fn mean_roughness(self) -> f32 {
        if self.alpha.x == self.alpha.y { self.alpha.x.sqrt() } else { (self.alpha.element_sum() / 2.0).sqrt() }
    }

    /// Returns the fraction of repeated scattering that the albedo of the mean roughness accounts for: 1 if isotropic,
    /// down to 0.75 for grooves. A larger fraction would reflect more light than arrives.
    pub(super) fn regularity(self) -> f32 {
        1.0 - 0.25 * (1.0 - self.alpha.min_element() / self.alpha.max_element())
    }

    /// Returns the distribution with `alpha2` added to α².
    pub(super) fn widened(self, alpha2: f32) -> Self {
        Self { alpha: (self.alpha * self.alpha + alpha2).map(f32::sqrt).min(Vec2::ONE) }
    }

    /// Returns the density of microfacet normals, D(h).
    ///
    /// ```text
    /// D = 1 / (π α_x α_y ((h_x/α_x)² + (h_y/α_y)² + h_z²)²)
    /// ```
    /// Uses the sine instead of 1 − cos², because 1 − cos² loses all precision in a narrow lobe.
    fn density(self, h: Vec3) -> f32 {
        let t = (h.truncate() / self.alpha).length_squared() + h.z * h.z;
        1.0 / (PI * self.alpha.x * self.alpha.y * t * t)
    }

    /// Returns Smith's Λ (\[Heitz14\], eq. 72).
    fn lambda(self, w: Vec3) -> f32 {
        let slope2 = (w.truncate() * self.alpha).length_squared() / (w.z * w.z);
        ((1.0 + slope2).sqrt() - 1.0) / 2.0
    }

    /// Returns G₂/G₁(ω_o): the weight of a visible-normal sample, relative to a perfectly mirroring facet.
    pub(super) fn masking_ratio(self, wo: Vec3, wi: Vec3) -> f32 {
        let seen = 1.0 + self.lambda(wo);
        seen / (seen + self.lambda(wi))
    }

    /// Returns the BRDF without the Fresnel term, D·G₂ / (4 cos θ_o cos θ_i) \[sr⁻¹\].
    pub(super) fn reflectance(self, wo: Vec3, wi: Vec3, h: Vec3) -> f32 {
        self.density(h) / (4.0 * wo.z * wi.z * (1.0 + self.lambda(wo) + self.lambda(wi)))
    }

    /// Returns the BTDF without Fresnel term and Jacobian, D·G₂ / (cos θ_o |cos θ_i|), for ω_i below the surface.
    pub(super) fn transmittance(self, wo: Vec3, wi: Vec3, h: Vec3) -> f32 {
        self.density(h) / (wo.z * -wi.z * (1.0 + self.lambda(wo) + self.lambda(wi)))
    }

    /// Returns the density of [`Ggx::sample_normal`] over microfacet normals, D·G₁(ω_o) (ω_o·h) / cos θ_o \[sr⁻¹\].
    pub(super) fn normal_pdf(self, wo: Vec3, h: Vec3) -> f32 {
        self.density(h) * wo.dot(h).max(0.0) / (wo.z * (1.0 + self.lambda(wo)))
    }

    /// Returns the density of [`Ggx::sample`] over directions, D·G₁(ω_o) / (4 cos θ_o) \[sr⁻¹\].
    pub(super) fn pdf(self, wo: Vec3, h: Vec3) -> f32 {
        self.density(h) / (4.0 * wo.z * (1.0 + self.lambda(wo)))
    }

    /// Reflects `wo` at a random microfacet visible from `wo`, using the spherical caps of \[Dupuy23\]. The result may
    /// point below the surface.
    pub(super) fn sample(self, wo: Vec3, u: Vec2) -> Vec3 {
        let h = self.sample_normal(wo, u);
        (h * (2.0 * wo.dot(h)) - wo).normalize()
    }

    /// Draws a microfacet normal visible from `wo`.
    pub(super) fn sample_normal(self, wo: Vec3, u: Vec2) -> Vec3 {
        // Stretch space, so that the visible facets become a hemisphere.
        let stretch = self.alpha.extend(1.0);
        let v = (wo * stretch).normalize();
        // Draw a direction uniformly from the visible cap; its half vector with v is the facet's normal.
        let z = (1.0 - u.y) * (1.0 + v.z) - v.z;
        let (sin, angle) = ((1.0 - z * z).max(0.0).sqrt(), TAU * u.x);
        ((Vec3::new(sin * angle.cos(), sin * angle.sin(), z) + v) * stretch).normalize_or(Vec3::Z)
    }
}
