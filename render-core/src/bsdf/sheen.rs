//! Sheen: fibers that stand off the surface and reflect light at grazing angles \[Estevez17\].
//!
//! ```text
//! f = color · D(h) V(ω_o, ω_i)
//!   D = (2 + 1/α) sin(θ_h)^(1/α) / (2π)           V = 1 / ((1 + Λ(θ_o) + Λ(θ_i)) 4 cos θ_o cos θ_i)
//! ```
//! Where the integral of the lobe exceeds 1, the lobe is divided by it. α is the square of the perceptual roughness. The fit of Λ is the one of `KHR_materials_sheen`, "Sheen visibility".

use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::LazyLock;

/// Minimum perceptual roughness. The lobe of a smoother sheen has no visible width.
const SMOOTHEST: f32 = 0.07;

/// Fibers over a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fibers {
    /// Linear RGB reflectance.
    color: Vec3,
    alpha: f32,
    /// Row of the table, and the weight of the next row.
    row: (usize, f32),
}

impl Fibers {
    /// Builds the fibers with a linear RGB color and a perceptual roughness, each in 0…1.
    pub(super) fn new(color: Vec3, roughness: f32) -> Self {
        let place = roughness.clamp(0.0, 1.0) * (STEPS - 1) as f32;
        let row = (place as usize).min(STEPS - 2);
        Self { color, alpha: roughness.clamp(SMOOTHEST, 1.0).powi(2), row: (row, place - row as f32) }
    }

    /// Returns the BRDF for two directions above the surface.
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let most = self.raw_albedo(wo.z).max(self.raw_albedo(wi.z)).max(1.0);
        self.color * (lobe(wo, wi, self.alpha) / most)
    }

    /// Returns the directional albedo, linear RGB.
    pub(super) fn albedo(&self, cos: f32) -> Vec3 {
        self.color * self.reflected(cos)
    }

    /// Returns the fraction of light that the layers below receive. It is the same for all channels, so that colored
    /// fibers do not color the base.
    pub(super) fn through(&self, cos: f32) -> f32 {
        1.0 - self.color.max_element() * self.reflected(cos)
    }

    /// Returns the density of directions drawn by [`Fibers::sample`] \[sr⁻¹\].
    pub(super) fn pdf() -> f32 {
        1.0 / TAU
    }

    /// Returns the directional albedo of white fibers.
    fn reflected(&self, cos: f32) -> f32 {
        self.raw_albedo(cos).min(1.0)
    }

    /// Returns the integral of the lobe, which exceeds 1 for smooth fibers at grazing angles.
    fn raw_albedo(&self, cos: f32) -> f32 {
        let place = cos.clamp(0.0, 1.0).sqrt() * (STEPS - 1) as f32;
        let column = (place as usize).min(STEPS - 2);
        let along = |row: &[f32; STEPS]| row[column] + (row[column + 1] - row[column]) * (place - column as f32);
        let (row, blend) = self.row;
        along(&TABLE[row]) * (1.0 - blend) + along(&TABLE[row + 1]) * blend
    }
}

/// Returns the BRDF of white fibers.
fn lobe(wo: Vec3, wi: Vec3, alpha: f32) -> f32 {
    let h = (wo + wi).normalize();
    let sine2 = h.truncate().length_squared().min(1.0);
    let density = (2.0 + 1.0 / alpha) * sine2.powf(0.5 / alpha) * (FRAC_1_PI / 2.0);
    let shadowing = 1.0 + lambda(wo.z, alpha) + lambda(wi.z, alpha);
    density * (1.0 / (shadowing * 4.0 * wo.z * wi.z)).min(1.0)
}

/// Returns Λ, the ratio of hidden to visible fibers.
fn lambda(cos: f32, alpha: f32) -> f32 {
    // Each coefficient is interpolated between α = 1 and α = 0.
    let t = (1.0 - alpha) * (1.0 - alpha);
    let mix = |rough: f32, smooth: f32| rough + (smooth - rough) * t;
    let (a, b, c) = (mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801));
    let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
    let fit = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
    if cos < 0.5 { fit(cos).exp() } else { (2.0 * fit(0.5) - fit(1.0 - cos)).exp() }
}

/// Number of steps along each axis of the table: roughness, and the square root of the cosine.
const STEPS: usize = 32;

/// Directional albedo of white fibers.
static TABLE: LazyLock<Box<[[f32; STEPS]; STEPS]>> = LazyLock::new(|| {
    let bytes = include_bytes!("sheen.bin");
    let number = |at: usize| f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    Box::new(std::array::from_fn(|row| std::array::from_fn(|column| number(4 * (row * STEPS + column)))))
});

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrates the lobe over the hemisphere at the midpoints of a grid that is finer near the horizon.
    fn integrate(cos: f32, alpha: f32) -> f32 {
        const ROWS: usize = 256;
        const COLUMNS: usize = 128;
        let cos = cos.max(1e-3);
        let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let mut sum = 0.0f64;
        for row in 0..ROWS {
            // z = s², dz = 2 s ds.
            let s = (row as f32 + 0.5) / ROWS as f32;
            let (z, weight) = (s * s, 2.0 * s / ROWS as f32);
            let sine = (1.0 - z * z).sqrt();
            for column in 0..COLUMNS {
                let angle = std::f32::consts::PI * (column as f32 + 0.5) / COLUMNS as f32;
                let wi = Vec3::new(sine * angle.cos(), sine * angle.sin(), z);
                sum += f64::from(lobe(wo, wi, alpha) * z * weight * TAU / COLUMNS as f32);
            }
        }
        sum as f32
    }

    /// The stored entries are the integrals. `WRITE_ALBEDO=1` writes the table again.
    #[test]
    fn stored_entries_are_the_integrals() {
        let step = |i: usize| i as f32 / (STEPS - 1) as f32;
        let entry = |i: usize| integrate(step(i % STEPS).powi(2), step(i / STEPS).max(SMOOTHEST).powi(2));
        let computed: Vec<f32> = (0..STEPS * STEPS).map(entry).collect();
        if std::env::var_os("WRITE_ALBEDO").is_some() {
            let bytes: Vec<u8> = computed.into_iter().flat_map(f32::to_le_bytes).collect();
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/sheen.bin"), bytes).unwrap();
            return;
        }
        for (stored, computed) in TABLE.as_flattened().iter().zip(computed) {
            assert!((stored - computed).abs() < 1e-4, "{stored} instead of {computed}");
        }
    }

    #[test]
    fn interpolation_is_close_to_the_integral() {
        for roughness in [0.2f32, 0.37, 0.6, 0.95] {
            for cos in [0.01, 0.1, 0.33, 0.7, 0.99] {
                let table = Fibers::new(Vec3::ONE, roughness).raw_albedo(cos);
                let integral = integrate(cos, roughness * roughness);
                assert!((table - integral).abs() < 0.01, "roughness {roughness}, cosine {cos}: {table} for {integral}");
            }
        }
    }
}
