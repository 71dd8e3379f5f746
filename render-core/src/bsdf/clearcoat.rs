//! Clearcoat: a transparent layer of index 1.5 over all other lobes, with its own normals.

use super::coat::Coat;
use super::ggx::Ggx;
use super::schlick::Schlick;
use crate::sampling::frame;
use glam::{Mat3, Vec2, Vec3};

/// Reflectance at normal incidence of a layer of index 1.5 (`KHR_materials_clearcoat`).
const F0: f32 = 0.04;

/// Layer over a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Varnish {
    /// Fraction of the surface with the layer.
    factor: f32,
    facets: Coat<Schlick>,
    /// Transform from the frame of the surface to the frame of the layer's normal.
    to_layer: Mat3,
}

impl Varnish {
    /// Builds the layer. `normal` is the layer's unit normal in the frame of the surface.
    pub(super) fn new(factor: f32, roughness: f32, normal: Vec3) -> Self {
        let (x, y) = frame(normal);
        let fresnel = Schlick { f0: Vec3::splat(F0), f90: 1.0 };
        let facets = Coat::new(Vec3::ZERO, fresnel, Ggx::from_roughness(roughness));
        Self { factor, facets, to_layer: Mat3::from_cols(x, y, normal).transpose() }
    }

    /// Returns the BRDF for light from a disc of `half_angle` radians.
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        let (wo, wi) = (self.to_layer * wo, self.to_layer * wi);
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Vec3::ZERO;
        }
        let facets = if half_angle > 0.0 { self.facets.widened(half_angle * half_angle / 4.0) } else { self.facets };
        facets.single(wo, wi) * self.factor
    }

    /// Returns the directional albedo toward `wo`.
    pub(super) fn albedo(&self, wo: Vec3) -> f32 {
        let cos = (self.to_layer * wo).z;
        self.factor * self.facets.single_albedo(cos).x
    }

    /// Returns the fraction of light that the layers below receive from or send to the direction `w`.
    pub(super) fn through(&self, w: Vec3) -> f32 {
        1.0 - self.albedo(w)
    }

    /// Returns the same for a direction with this cosine to an untilted layer.
    pub(super) fn mean_through(&self, cos: f32) -> f32 {
        1.0 - self.factor * self.facets.single_albedo(cos).x
    }

    /// Draws an incident direction from the facets. It may point below the surface.
    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let local = self.to_layer * wo;
        if local.z <= 0.0 {
            return None;
        }
        let wi = self.facets.ggx.sample(local, u);
        (wi.z > 0.0).then(|| self.to_layer.transpose() * wi)
    }

    /// Returns the density of [`Varnish::sample`] \[sr⁻¹\].
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (wo, wi) = (self.to_layer * wo, self.to_layer * wi);
        if wo.z <= 0.0 || wi.z <= 0.0 { 0.0 } else { self.facets.ggx.pdf(wo, (wo + wi).normalize()) }
    }
}
