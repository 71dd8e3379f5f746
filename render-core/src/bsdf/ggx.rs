//! Microfacet coat: GGX normals, height-correlated Smith shadowing, Schlick's Fresnel term.
//!
//! Directions are unit vectors in the frame of the shading normal, which is +z; all point away from the surface.

use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Minimum α. A lobe of this width looks like a mirror, but its peak, 1/(4πα²) at normal incidence, is finite.
const SMALLEST_ALPHA: f32 = 1e-3;

/// GGX distribution of microfacet normals \[Walter07\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ggx {
    alpha: f32,
}

impl Ggx {
    /// Builds the distribution from the perceptual roughness. α is the square of the roughness (glTF 2.0, appendix
    /// B.2).
    pub(super) fn from_roughness(roughness: f32) -> Self {
        Self { alpha: (roughness * roughness).clamp(SMALLEST_ALPHA, 1.0) }
    }

    /// Returns the distribution with `alpha2` added to α².
    pub(super) fn widened(self, alpha2: f32) -> Self {
        Self { alpha: (self.alpha * self.alpha + alpha2).sqrt().min(1.0) }
    }

    /// Returns the density of microfacet normals, D(h).
    ///
    /// ```text
    /// D = 1 / (π α² ((h_x² + h_y²)/α² + h_z²)²)
    /// ```
    /// Uses the sine instead of 1 − cos², because 1 − cos² loses all precision in a narrow lobe.
    fn density(self, h: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        let t = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
        1.0 / (PI * a2 * t * t)
    }

    /// Returns Smith's Λ (\[Heitz14\], eq. 72).
    fn lambda(self, w: Vec3) -> f32 {
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0) / 2.0
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

    /// Returns the density of [`Ggx::sample`] over directions, D·G₁(ω_o) / (4 cos θ_o) \[sr⁻¹\].
    pub(super) fn pdf(self, wo: Vec3, h: Vec3) -> f32 {
        self.density(h) / (4.0 * wo.z * (1.0 + self.lambda(wo)))
    }

    /// Reflects `wo` at a random microfacet visible from `wo`, using the spherical caps of \[Dupuy23\]. The result may
    /// point below the surface.
    pub(super) fn sample(self, wo: Vec3, u: Vec2) -> Vec3 {
        // Stretch space, so that the visible facets become a hemisphere.
        let stretch = Vec3::new(self.alpha, self.alpha, 1.0);
        let v = (wo * stretch).normalize();
        // Draw a direction uniformly from the visible cap; its half vector with v is the facet's normal.
        let z = (1.0 - u.y) * (1.0 + v.z) - v.z;
        let (sin, angle) = ((1.0 - z * z).max(0.0).sqrt(), TAU * u.x);
        let h = ((Vec3::new(sin * angle.cos(), sin * angle.sin(), z) + v) * stretch).normalize_or(Vec3::Z);
        (h * (2.0 * wo.dot(h)) - wo).normalize()
    }
}

/// Returns (1 − cos θ)⁵, the weight of the grazing reflectance (1) in F = F₀ + (1 − F₀)(1 − cos θ)⁵ \[Schlick94\].
pub(super) fn grazing_share(cos: f32) -> f32 {
    (1.0 - cos).clamp(0.0, 1.0).powi(5)
}
