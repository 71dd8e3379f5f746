//! Reflectance of a base below a thin film, by angle \[Belcour17\].
//!
//! The equations and constants are the ones of `KHR_materials_iridescence`, "Implementation":
//!
//! ```text
//! I(λ) = C₀ + Σ_{m=1}^{2} 2 C_m S(m Δ, m φ)        C₀ = R₁₂ + R_s       C_m = (R_s − T₁₂) √(R₁₂ R₂₃)^m
//!   Δ = 2 η₂ d cos θ₂        R_s = T₁₂² R₂₃ / (1 − R₁₂ R₂₃)        S  response of the three color channels
//! ```

use super::albedo::grazing_share;
use super::quadrature::cosine_mean;
use super::schlick::{Fresnel, Schlick};
use glam::{Mat3, Vec3};
use std::f32::consts::{PI, TAU};

/// Number of tabulated cosines, equidistant in 0…1. The fringes of films up to 2 µm are several steps wide.
const STEPS: usize = 16;

/// Tabulated reflectance of a base below a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ThinFilm {
    reflectance: [Vec3; STEPS],
    mean: Vec3,
}

/// ThinFilm over the fraction `factor` of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FilmShape {
    pub(super) factor: f32,
    /// Index of refraction, at least 1.
    pub(super) ior: f32,
    /// Thickness \[nm\].
    pub(super) thickness: f32,
}

impl ThinFilm {
    /// Tabulates the reflectance of a film on a base.
    pub(super) fn new(shape: FilmShape, base: Schlick) -> Self {
        let cosine = |i: usize| i as f32 / (STEPS - 1) as f32;
        let reflectance = std::array::from_fn(|i| {
            base.at(cosine(i)).lerp(reflectance(cosine(i), shape, base.f0) * base.f90, shape.factor)
        });
        let film = Self { reflectance, mean: Vec3::ZERO };
        Self { mean: cosine_mean(|cos| film.at(cos)), ..film }
    }

    pub(super) fn at(&self, cos: f32) -> Vec3 {
        let place = cos.clamp(0.0, 1.0) * (STEPS - 1) as f32;
        let step = (place as usize).min(STEPS - 2);
        self.reflectance[step].lerp(self.reflectance[step + 1], place - step as f32)
    }

    pub(super) fn mean(&self) -> Vec3 {
        self.mean
    }
}

/// Returns the reflectance of a film on a base of reflectance `f0`, 0…1, linear RGB.
fn reflectance(cos: f32, shape: FilmShape, f0: Vec3) -> Vec3 {
    // A film thinner than an atom fades into the outside, as in the extension.
    let blend = (shape.thickness / 0.03).clamp(0.0, 1.0);
    let eta = 1.0 + (shape.ior - 1.0) * blend * blend * (3.0 - 2.0 * blend);
    let refracted2 = 1.0 - (1.0 - cos * cos) / (eta * eta);
    if refracted2 < 0.0 {
        return Vec3::ONE;
    }
    let refracted = refracted2.sqrt();

    // Outer interface, with the phase shift of light reflected at it from below.
    let schlick = |f0: f32, cos: f32| f0 + (1.0 - f0) * grazing_share(cos);
    let r12 = schlick(((eta - 1.0) / (eta + 1.0)).powi(2), cos);
    let (t12, phase21) = (1.0 - r12, PI);

    // Inner interface: derive the index of the base from its reflectance.
    let index = f0.clamp(Vec3::ZERO, Vec3::splat(0.9999)).map(|f| (1.0 + f.sqrt()) / (1.0 - f.sqrt()));
    let r23 = index.map(|index| schlick(((index - eta) / (index + eta)).powi(2), refracted));
    let phase23 = index.map(|index| if index < eta { PI } else { 0.0 });

    // Sum the orders of interference.
    let difference = 2.0 * eta * shape.thickness * refracted;
    let r123 = (r23 * r12).clamp(Vec3::splat(1e-5), Vec3::splat(0.9999));
    let rs = r23 * (t12 * t12) / (Vec3::ONE - r123);
    let mut sum = r23.map(|_| r12) + rs;
    let mut order = rs - t12;
    for m in 1..=2 {
        order *= r123.map(f32::sqrt);
        let m = m as f32;
        sum += order * 2.0 * response(m * difference, (phase23 + phase21) * m);
    }
    sum.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Returns the response of the color channels to light with a path difference \[nm\] and a phase shift \[rad\].
fn response(difference: f32, shift: Vec3) -> Vec3 {
    // Gaussians fitted to the CIE color matching functions in the frequency domain.
    const VALUE: Vec3 = Vec3::new(5.4856e-13, 4.4201e-13, 5.2481e-13);
    const POSITION: Vec3 = Vec3::new(1.6810e6, 1.7953e6, 2.2084e6);
    const VARIANCE: Vec3 = Vec3::new(4.3278e9, 9.3046e9, 6.6121e9);
    const RED: [f32; 3] = [9.7470e-14, 2.2399e6, 4.5282e9];
    /// Linear RGB of the sRGB primaries from CIE XYZ, by columns.
    const RGB_OF_XYZ: Mat3 = Mat3::from_cols_array(&[
        3.240_454_2,
        -0.969_266,
        0.055_643_4,
        -1.537_138_5,
        1.876_010_8,
        -0.204_025_9,
        -0.498_531_4,
        0.041_556,
        1.057_225_2,
    ]);
    let phase = TAU * difference * 1e-9;
    let wave = |position: f32, shift: f32| (position * phase + shift).cos();
    let fade = |variance: f32| (TAU * variance).sqrt() * (-phase * phase * variance).exp();
    let mut xyz = VALUE
        * VARIANCE.map(fade)
        * Vec3::new(wave(POSITION.x, shift.x), wave(POSITION.y, shift.y), wave(POSITION.z, shift.z));
    xyz.x += RED[0] * fade(RED[2]) * wave(RED[1], shift.x);
    RGB_OF_XYZ * (xyz / 1.0685e-7)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: Schlick = Schlick { f0: Vec3::splat(0.04), f90: 1.0 };

    /// A film without thickness, or of the index of air, leaves the base as it is at normal incidence. At grazing
    /// incidence, Schlick's term gives even an interface of air a reflection.
    #[test]
    fn no_film_is_the_base() {
        for (ior, thickness) in [(1.5, 0.0), (1.0, 500.0)] {
            let film = ThinFilm::new(FilmShape { factor: 1.0, ior, thickness }, BASE);
            for cos in [0.99, 1.0] {
                let (found, base) = (film.at(cos), BASE.at(cos));
                assert!((found - base).abs().max_element() < 0.03, "{found} for {base} at cosine {cos}");
            }
        }
    }

    /// At normal incidence, a quarter-wave film of the index √n of the base hides the reflection at 550 nm; a half-wave
    /// film leaves the reflection of the base (Born and Wolf, 1.6.4).
    #[test]
    fn quarter_wave_films_reflect_least() {
        let base = Schlick { f0: Vec3::splat((1.25f32 / 3.25).powi(2)), f90: 1.0 };
        let green = |thickness: f32| ThinFilm::new(FilmShape { factor: 1.0, ior: 1.5, thickness }, base).at(1.0).y;
        let (quarter, half) = (green(550.0 / 4.0 / 1.5), green(550.0 / 2.0 / 1.5));
        assert!(quarter < 0.02, "{quarter}");
        assert!((half - base.f0.y).abs() < 0.05, "{half} for {}", base.f0.y);
    }
}
