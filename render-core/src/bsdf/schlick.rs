//! Reflectance of microfacets by angle: the interface of all terms, and Schlick's term.

use super::albedo::{Albedo, AlbedoRow, grazing_share};
use glam::Vec3;

/// Reflectance of microfacets by the cosine between light and facet normal.
pub(super) trait Fresnel: Copy {
    /// Returns the reflectance at a cosine, linear RGB.
    fn at(&self, cos: f32) -> Vec3;

    /// Returns the cosine-weighted mean over the hemisphere.
    fn mean(&self) -> Vec3;

    /// Returns the directional albedo of facets, given their albedo `split` along Schlick's term.
    fn albedo(&self, split: Albedo) -> Vec3;

    /// Returns the cosine-weighted mean of [`Fresnel::albedo`] over the hemisphere.
    fn mean_albedo(&self, row: AlbedoRow) -> Vec3;
}

/// Schlick's term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Schlick {
    /// Linear RGB reflectance at normal incidence, F₀.
    pub(super) f0: Vec3,
    /// Reflectance at grazing incidence, F₉₀.
    pub(super) f90: f32,
}

impl Fresnel for Schlick {
    fn at(&self, cos: f32) -> Vec3 {
        let grazing = grazing_share(cos);
        self.f0 * (1.0 - grazing) + Vec3::splat(self.f90 * grazing)
    }

    fn mean(&self) -> Vec3 {
        // The cosine-weighted mean of (1 − cos θ)⁵ is 1/21.
        self.f0 + (Vec3::splat(self.f90) - self.f0) / 21.0
    }

    fn albedo(&self, split: Albedo) -> Vec3 {
        split.with(self.f0, self.f90)
    }

    fn mean_albedo(&self, row: AlbedoRow) -> Vec3 {
        row.mean().with(self.f0, self.f90)
    }
}
