//! Light of the first sample that further samples reuse.

use crate::shade::coats::is_rough_coat;
use glam::Vec3;
use plane::Plane;
use rayon::prelude::*;
use render_core::{GBuffer, PixelSurface};

/// Minimum albedo from which irradiance is derived.
const LEAST_REFLECTANCE: f32 = 0.05;
/// Minimum reflectance of a coat from which its light is transferred: half of glass.
const LEAST_SPECULAR: f32 = 0.02;
/// Maximum factor from one coat's light to another.
const MOST_TINT: f32 = 2.0;

/// First sample of a frame: surfaces at pixel centers, and their light.
pub(in crate::shade) struct FirstSample<'a> {
    /// Surfaces, with the albedo below their coats.
    pub matte: &'a GBuffer,
    /// Indirect light of these surfaces.
    pub indirect: &'a Plane<Vec3>,
    /// Light of their coats; `None` in scenes without coats.
    pub coats: Option<&'a Plane<Vec3>>,
}

impl FirstSample<'_> {
    /// Returns the `wanted` pixels with smooth coats, and the ones with rough coats.
    pub fn by_coat(&self, surfaces: &GBuffer, wanted: &Plane<bool>) -> [Plane<bool>; 2] {
        let with_coat = |is_rough: bool| {
            let mut chosen = wanted.clone();
            for (chosen, surface) in chosen.samples_mut().iter_mut().zip(surfaces.pixels.samples()) {
                *chosen &= self.coats.is_some() && is_rough_coat(surface) == is_rough;
            }
            chosen
        };
        [with_coat(false), with_coat(true)]
    }

    /// Adds the light of nearby centers' coats to the pixels of `light` with `rough` coats.
    pub fn add_coats(&self, surfaces: &GBuffer, rough: &Plane<bool>, light: &mut Plane<Vec3>) {
        let (Some(coats), width) = (self.coats, rough.width()) else { return };
        for index in (0..rough.samples().len()).filter(|&index| rough.samples()[index]) {
            let surface = &surfaces.pixels.samples()[index];
            let source = self.matte.irradiance_source(index % width, index / width, surface).unwrap_or(index);
            let reflectance = Vec3::from(self.matte.pixels.samples()[source].specular);
            let tint = Vec3::from(surface.specular) / reflectance.max(Vec3::splat(LEAST_SPECULAR));
            light.samples_mut()[index] += coats.samples()[source] * tint.min(Vec3::splat(MOST_TINT));
        }
    }

    /// Returns the indirect light that the `wanted` surfaces of a further sample reflect \[W·m⁻²·sr⁻¹\].
    pub fn indirect_of(&self, surfaces: &GBuffer, wanted: &Plane<bool>) -> Plane<Vec3> {
        let of_pixel = |(index, surface): (usize, &PixelSurface)| match wanted.samples()[index] && surface.reflects() {
            true => self.reflected(index, surface),
            false => Vec3::ZERO,
        };
        let light = surfaces.pixels.samples().par_iter().enumerate().map(of_pixel).collect();
        Plane::from_vec(wanted.width(), wanted.height(), light)
    }

    /// Returns the indirect light that `surface` reflects in the pixel `index` \[W·m⁻²·sr⁻¹\].
    fn reflected(&self, index: usize, surface: &PixelSurface) -> Vec3 {
        let width = self.indirect.width();
        let source = self.matte.irradiance_source(index % width, index / width, surface).unwrap_or(index);
        let albedo = Vec3::from(self.matte.pixels.samples()[source].albedo).max(Vec3::splat(LEAST_REFLECTANCE));
        self.indirect.samples()[source] / albedo * Vec3::from(surface.albedo)
    }
}
