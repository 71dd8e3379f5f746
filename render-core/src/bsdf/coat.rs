//! Coat: GGX facets over a Lambert base, with the light that is scattered repeatedly between facets.

use super::albedo::AlbedoRow;
use super::ggx::Ggx;
use super::schlick::Fresnel;
use crate::luminance;
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

/// Minimum divisor. Smaller losses or transmissions of a perfect mirror are rounding errors.
pub(super) const NOTHING: f32 = 1e-6;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coat<F> {
    fresnel: F,
    pub(super) ggx: Ggx,
    albedos: AlbedoRow,
    /// Loss of the coat's single scattering with F = 1, 1 − E_avg.
    lost_mean: f32,
    /// Factor of multiple scattering, M / (1 − E_avg).
    multiple: Vec3,
    /// Mean transmission of the coat, 1 − C_avg.
    pub(super) through_mean: Vec3,
    /// Albedo of the base divided by 1 − C_avg.
    base: Vec3,
}

impl<F: Fresnel> Coat<F> {
    /// Builds the coat of facets `ggx` over a base of reflectance `albedo`.
    pub(super) fn new(albedo: Vec3, fresnel: F, ggx: Ggx) -> Self {
        // Read the coat's albedo with F = 1, which determines the light lost by single scattering.
        let albedos = AlbedoRow::new(ggx.mean_roughness());
        let mean = albedos.mean();
        let f_mean = fresnel.mean();
        let lost_mean = (1.0 - mean.facing).max(NOTHING);
        let bouncing_on = f_mean * f_mean * mean.facing / (Vec3::ONE - f_mean * lost_mean) * ggx.regularity();
        // The base receives the light that both scatterings in the coat transmit.
        let single_mean = fresnel.mean_albedo(albedos);
        let through_mean = (Vec3::ONE - single_mean - bouncing_on * lost_mean).max(Vec3::splat(NOTHING));
        let (multiple, base) = (bouncing_on / lost_mean, albedo / through_mean);
        Self { fresnel, ggx, albedos, lost_mean, multiple, through_mean, base }
    }

    /// Returns the coat with `alpha2` added to α² of its facets.
    pub(super) fn widened(self, alpha2: f32) -> Self {
        Self { ggx: self.ggx.widened(alpha2), ..self }
    }

    /// Returns the BRDF of single scattering.
    pub(super) fn single(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let h = (wo + wi).normalize();
        self.fresnel.at(wo.dot(h)) * self.ggx.reflectance(wo, wi, h)
    }

    /// Returns the directional albedo of single scattering.
    pub(super) fn single_albedo(&self, cos: f32) -> Vec3 {
        self.fresnel.albedo(self.albedos.at(cos))
    }

    /// Returns the weight of a direction drawn from the visible facets: F·G₂/G₁.
    pub(super) fn single_weight(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.fresnel.at(wo.dot((wo + wi).normalize())) * self.ggx.masking_ratio(wo, wi)
    }

    /// Returns the loss of single scattering towards a direction, 1 − E, and the transmission of the coat, 1 − C.
    pub(super) fn left_over(&self, cos: f32) -> (f32, Vec3) {
        // Add multiple scattering to the coat's albedo; the remainder reaches the base.
        let albedo = self.albedos.at(cos);
        let lost = (1.0 - albedo.facing).max(0.0);
        let coat = self.fresnel.albedo(albedo) + self.multiple * (lost * self.lost_mean);
        (lost, (Vec3::ONE - coat).max(Vec3::ZERO))
    }

    /// Returns the BRDF of multiple scattering.
    pub(super) fn multiple(&self, cos_o: f32, cos_i: f32) -> Vec3 {
        self.multiple * (self.left_over(cos_o).0 * self.left_over(cos_i).0) * FRAC_1_PI
    }

    /// Returns the directional albedo of [`Coat::multiple`].
    pub(super) fn multiple_albedo(&self, cos: f32) -> Vec3 {
        self.multiple * (self.left_over(cos).0 * self.lost_mean)
    }

    /// Returns the BRDF of multiple scattering and base. Both are broad, so one cosine lobe samples both.
    pub(super) fn diffuse(&self, cos_o: f32, cos_i: f32) -> Vec3 {
        let ((lost_o, through_o), (lost_i, through_i)) = (self.left_over(cos_o), self.left_over(cos_i));
        (self.multiple * (lost_o * lost_i) + self.base * through_o * through_i) * FRAC_1_PI
    }

    /// Returns the directional albedo of [`Coat::diffuse`].
    pub(super) fn diffuse_albedo(&self, cos: f32) -> Vec3 {
        let (lost, through) = self.left_over(cos);
        self.multiple * (lost * self.lost_mean) + self.base * through * self.through_mean
    }

    /// Returns the probability of sampling the coat's single scattering: its fraction of the reflected light.
    pub(super) fn single_share(&self, cos: f32) -> f32 {
        // Compare luminances, because one direction serves all three channels.
        let single = luminance(self.single_albedo(cos));
        let diffuse = luminance(self.diffuse_albedo(cos));
        single / (single + diffuse)
    }
}
