//! Estimated cost of a bake, without baking: number of texels times prices.
//!
//! ```text
//! t = c_photon P + N (c_texel T^0.25 + s c_coat)
//!
//!   N  texels      T  triangles      P  photons      s  fraction of the texels with baked coats
//! ```
//! Prices are from bakes of the shipped scenes with default settings; `docs/BENCHMARKS.md` compares estimates with
//! measurements.

use crate::BAKED_ROUGHNESS;
use crate::settings::RenderSettings;
use render_core::scene::Scene;
use render_core::{Atlas, Surfaces, TexelEstimate};

/// Price of a photon \[CPU s\], as in films.
const PHOTON: f64 = 1.3e-6;
/// Price of a texel, for a scene of one triangle \[CPU s\].
const TEXEL: f64 = 6.3e-5;
/// Exponent of the number of triangles in the price of a texel. A texel takes 0.18 ms in `cornell-box` (32 triangles), 0.92
/// ms in `conference` (38 754) and 1.3 ms in `nave` (137 978).
const DETAIL: f64 = 0.25;
/// Price of the coat of a texel \[CPU s\], from McGuire's Cornell box with a glossy floor.
const COAT: f64 = 3.8e-3;

/// Estimated cost of a bake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BakeEstimate {
    /// Number of texels at the automatic density.
    pub texels: usize,
    /// CPU time \[s\], for each key time if lamps move.
    pub seconds: f64,
}

/// Estimates the cost of baking `scene`; `None` if no surface is static and reflects light.
#[must_use]
pub fn estimate(scene: &Scene, settings: &RenderSettings) -> Option<BakeEstimate> {
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let has_baked_coat = |instance: usize| {
        let material = surfaces.material(instance);
        material.may_have_coat() && material.roughness >= BAKED_ROUGHNESS
    };
    let is_lit = |instance: usize| !surfaces.moving()[instance] && !surfaces.material(instance).unlit;
    if !(0..scene.instances.len()).any(is_lit) {
        return None;
    }
    let TexelEstimate { texels, counted: coated } = Atlas::estimate(&surfaces, &has_baked_coat);
    let of_texel = TEXEL * (scene.triangle_count() as f64).powf(DETAIL) + coated * COAT;
    Some(BakeEstimate { texels, seconds: PHOTON * settings.photons as f64 + texels as f64 * of_texel })
}
