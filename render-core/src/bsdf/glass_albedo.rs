//! Directional albedo of single scattering at rough interfaces between dielectrics.

use super::albedo::AlbedoRow;
use super::quadrature::tabulated_mean;
#[cfg(test)]
use super::{fresnel::dielectric, ggx::Ggx};
#[cfg(test)]
use crate::sampling::hammersley;
#[cfg(test)]
use glam::Vec3;
use std::sync::LazyLock;

/// Number of steps along roughness, and along the square root of the cosine.
const STEPS: usize = 24;
/// Number of indices of refraction, spaced evenly in √(index − 1).
const INDICES: usize = 8;
/// Maximum index of refraction.
const LARGEST: f32 = 3.0;

/// Albedos by cosine, for one roughness.
type Row = [f32; STEPS];

/// Table of albedos: from outside and from inside, by index of refraction, roughness and cosine.
static TABLE: LazyLock<Vec<Row>> = LazyLock::new(|| {
    let bytes: &[u8; 4 * STEPS * ROWS] = include_bytes!("glass.bin");
    let number = |at: usize| f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    (0..ROWS).map(|row| std::array::from_fn(|column| number(4 * (row * STEPS + column)))).collect()
});
/// Number of rows in the table.
const ROWS: usize = 2 * INDICES * STEPS;

/// Row of the table at one index of refraction and one roughness: albedos for all directions on one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GlassRow {
    albedos: Row,
    mean: f32,
}

impl GlassRow {
    /// Returns the albedos seen from above an interface. `eta` is the index below divided by the index above.
    pub(super) fn new(eta: f32, roughness: f32) -> Self {
        // Interpolate between two indices and two roughnesses.
        let index = eta.max(1.0 / eta).min(LARGEST);
        let side = usize::from(eta < 1.0);
        let (i, along_index) = step(((index - 1.0) / (LARGEST - 1.0)).sqrt(), INDICES);
        let (r, along_roughness) = step(roughness, STEPS);
        let row = |i: usize, r: usize| &TABLE[(side * INDICES + i) * STEPS + r];
        let albedos = std::array::from_fn(|c| {
            let at = |i: usize| row(i, r)[c] + (row(i, r + 1)[c] - row(i, r)[c]) * along_roughness;
            at(i) + (at(i + 1) - at(i)) * along_index
        });
        Self::with_mean(albedos)
    }

    /// Returns the albedos of a thin wall, whose reflection and transmission sum to a coat with F = 1.
    pub(super) fn thin(roughness: f32) -> Self {
        let row = AlbedoRow::new(roughness);
        Self::with_mean(std::array::from_fn(|c| row.at((c as f32 / (STEPS - 1) as f32).powi(2)).facing))
    }

    fn with_mean(albedos: Row) -> Self {
        Self { albedos, mean: tabulated_mean(&albedos) }
    }

    /// Returns the light lost by single scattering, 1 − E, at a cosine.
    pub(super) fn lost(&self, cos: f32) -> f32 {
        let (column, along) = step(cos.clamp(0.0, 1.0).sqrt(), STEPS);
        let [a, b] = [self.albedos[column], self.albedos[column + 1]];
        (1.0 - (a + (b - a) * along)).clamp(0.0, 1.0)
    }

    /// Returns the cosine-weighted mean albedo.
    pub(super) fn mean(&self) -> f32 {
        self.mean
    }
}

/// Returns the interval of a place in 0…1 on an axis with this number of `steps`, and the position in the interval.
fn step(place: f32, steps: usize) -> (usize, f32) {
    let place = place.clamp(0.0, 1.0) * (steps - 1) as f32;
    let step = (place as usize).min(steps - 2);
    (step, place - step as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrates over visible facets. Reflection and refraction of each facet contribute G₂/G₁, unless they leave on
    /// the wrong side.
    fn integrate(cos: f32, eta: f32, roughness: f32) -> f32 {
        const FACETS: usize = 4096;
        let cos = cos.max(1e-3);
        let (ggx, wo) = (Ggx::from_roughness(roughness), Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos));
        let mut sum = 0.0f64;
        for i in 0..FACETS {
            let h = ggx.sample_normal(wo, hammersley(i, FACETS));
            let cos = wo.dot(h);
            let (reflectance, refracted) = dielectric(cos, eta);
            let (up, down) = (h * (2.0 * cos) - wo, h * (cos / eta - refracted) - wo / eta);
            if up.z > 0.0 {
                sum += f64::from(reflectance * ggx.masking_ratio(wo, up));
            }
            if down.z < 0.0 && reflectance < 1.0 {
                sum += f64::from((1.0 - reflectance) * ggx.masking_ratio(wo, down));
            }
        }
        (sum / FACETS as f64) as f32
    }

    /// The stored entries are the integrals. `WRITE_ALBEDO=1` writes the table again.
    #[test]
    fn stored_entries_are_the_integrals() {
        let place = |i: usize, steps: usize| i as f32 / (steps - 1) as f32;
        let entry = |i: usize| {
            let (cos, roughness) = (place(i % STEPS, STEPS).powi(2), place(i / STEPS % STEPS, STEPS));
            let index = 1.0 + (LARGEST - 1.0) * place(i / STEPS / STEPS % INDICES, INDICES).powi(2);
            let eta = if i < ROWS * STEPS / 2 { index } else { 1.0 / index };
            integrate(cos, eta, roughness)
        };
        let computed: Vec<f32> = (0..ROWS * STEPS).map(entry).collect();
        if std::env::var_os("WRITE_ALBEDO").is_some() {
            let bytes: Vec<u8> = computed.into_iter().flat_map(f32::to_le_bytes).collect();
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/glass.bin"), bytes).unwrap();
            return;
        }
        for (stored, computed) in TABLE.as_flattened().iter().zip(computed) {
            assert!((stored - computed).abs() < 1e-4, "{stored} instead of {computed}");
        }
    }

    #[test]
    fn interpolation_is_close_to_the_integral() {
        for eta in [1.1f32, 1.5, 2.2, 1.0 / 1.33, 1.0 / 1.8] {
            for roughness in [0.05, 0.3, 0.55, 0.9] {
                for cos in [0.05, 0.3, 0.7, 0.97] {
                    let table = 1.0 - GlassRow::new(eta, roughness).lost(cos);
                    let integral = integrate(cos, eta, roughness);
                    assert!(
                        (table - integral).abs() < 0.02,
                        "η {eta}, roughness {roughness}, {cos}: {table}, {integral}"
                    );
                }
            }
        }
    }
}
