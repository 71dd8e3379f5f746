//! Orientation: the strength of waves and edges in four directions.
//!
//! ```text
//! O(θ) = 2 / Σ w · √(E² + D²)         E = Σ w (cos φ − m) F         D = Σ w sin φ F         m = Σ w cos φ / Σ w
//!
//!   w = exp(−(x² + y²) / 2σ²)         φ = 2π (x cos θ + y sin θ) / λ         sums over x, y = −7 … 7
//! ```
//!
//! F is the level of the intensity pyramid, as a function of the offset (x, y) from the current sample. A wave with
//! amplitude a and wavelength λ along θ has O = a. Subtracting m removes the mean of the even filter, so that uniform
//! brightness has no orientation.
//!
//! w, cos and sin are products of functions of x and y, or sums of two such products. All filters together take 14
//! passes over rows or columns.

use super::pyramid::{reflect_borders, reflected};
use plane::Plane;
use std::f32::consts::{SQRT_2, TAU};

/// Wavelength λ \[samples\], from the SaliencyToolbox \[Walther06\].
const WAVELENGTH: f32 = 7.0;
/// Standard deviation σ of the window \[samples\], from the SaliencyToolbox \[Walther06\].
const SIGMA: f32 = 7.0 / 3.0;
/// Filter radius \[samples\]. It is 3 σ.
const REACH: usize = 7;
/// Filter length \[samples\].
const TAPS: usize = 2 * REACH + 1;

/// Filter weights along a row or column.
type Taps = [f32; TAPS];

/// Returns `exp(−x² / 2σ²) f(2π x / wavelength)` for each tap.
fn taps(f: fn(f32) -> f32, wavelength: f32) -> Taps {
    std::array::from_fn(|i| {
        let x = i as f32 - REACH as f32;
        (-x * x / (2.0 * SIGMA * SIGMA)).exp() * f(TAU * x / wavelength)
    })
}

/// Filters each row of the plane.
fn along_rows(plane: &Plane<f32>, taps: &Taps) -> Plane<f32> {
    let width = plane.width();
    let mut out = Plane::filled(width, plane.height(), 0.0);
    let mut padded = vec![0.0; width + 2 * REACH];
    for (out, row) in out.samples_mut().chunks_exact_mut(width).zip(plane.rows()) {
        // Pad the row by reflection, so that the taps need no border cases.
        padded[REACH..REACH + width].copy_from_slice(row);
        reflect_borders(&mut padded, REACH, width);
        for (i, &weight) in taps.iter().enumerate() {
            add(out, weight, &padded[i..i + width]);
        }
    }
    out
}

/// Filters each column of the plane.
fn along_columns(plane: &Plane<f32>, taps: &Taps) -> Plane<f32> {
    let (width, height) = (plane.width(), plane.height());
    let mut out = Plane::filled(width, height, 0.0);
    for y in 0..height {
        for (i, &weight) in taps.iter().enumerate() {
            let source = reflected((y + i) as isize - REACH as isize, height);
            add(out.row_mut(y), weight, plane.row(source));
        }
    }
    out
}

/// Adds `weight · row` to `sum`.
fn add(sum: &mut [f32], weight: f32, row: &[f32]) {
    for (sum, &value) in sum.iter_mut().zip(row) {
        *sum += weight * value;
    }
}

/// Returns O(θ) of an intensity level, for θ = 0°, 45°, 90° and 135°.
pub fn orientations(level: &Plane<f32>) -> [Plane<f32>; 4] {
    // Along a diagonal, a wave has 1/√2 of its frequency in x and in y.
    let bell = taps(|_| 1.0, WAVELENGTH);
    let [cos, sin] = [f32::cos, f32::sin].map(|f| taps(f, WAVELENGTH));
    let [diagonal_cos, diagonal_sin] = [f32::cos, f32::sin].map(|f| taps(f, SQRT_2 * WAVELENGTH));

    // Filter along the rows, then down the columns. In names of two functions, the first is the function of x.
    let rows = [&bell, &diagonal_cos, &diagonal_sin].map(|taps| along_rows(level, taps));
    let [bell_row, cos_row, sin_row] = &rows;
    let mean = along_columns(bell_row, &bell);
    let horizontal = [&cos, &sin].map(|taps| along_columns(&along_rows(level, taps), &bell));
    let vertical = [&cos, &sin].map(|taps| along_columns(bell_row, taps));
    let [cos_cos, cos_sin] = [&diagonal_cos, &diagonal_sin].map(|taps| along_columns(cos_row, taps));
    let [sin_cos, sin_sin] = [&diagonal_cos, &diagonal_sin].map(|taps| along_columns(sin_row, taps));

    // Compute m. The mean of sin φ is 0.
    let sum = |taps: &Taps| taps.iter().sum::<f32>();
    let m = sum(&cos) / sum(&bell);
    let diagonal_m = (sum(&diagonal_cos) / sum(&bell)).powi(2);
    let scale = 2.0 / sum(&bell).powi(2);
    let magnitude = |even: f32, odd: f32| scale * (even * even + odd * odd).sqrt();

    // Addition theorems: cos(a ± b) = cos a cos b ∓ sin a sin b; sin(a ± b) = sin a cos b ± cos a sin b.
    let mut out = std::array::from_fn(|_| Plane::filled(level.width(), level.height(), 0.0));
    let [o0, o45, o90, o135] = out.each_mut().map(Plane::samples_mut);
    for (i, &mean) in mean.samples().iter().enumerate() {
        let at = |plane: &Plane<f32>| plane.samples()[i];
        o0[i] = magnitude(at(&horizontal[0]) - m * mean, at(&horizontal[1]));
        o90[i] = magnitude(at(&vertical[0]) - m * mean, at(&vertical[1]));
        let (cos_cos, cos_sin) = (at(&cos_cos) - diagonal_m * mean, at(&cos_sin));
        let (sin_cos, sin_sin) = (at(&sin_cos), at(&sin_sin));
        o45[i] = magnitude(cos_cos - sin_sin, sin_cos + cos_sin);
        o135[i] = magnitude(cos_cos + sin_sin, sin_cos - cos_sin);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saliency_orientation_of_a_wave_is_its_amplitude() {
        for (k, degrees) in [0.0f32, 45.0, 90.0, 135.0].into_iter().enumerate() {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let phase = |x: usize, y: usize| TAU * (x as f32 * cos + y as f32 * sin) / WAVELENGTH;
            let found = orientations(&Plane::from_fn(48, 48, |x, y| 0.5 + 0.3 * (phase(x, y) + 1.0).sin()));
            let middle = found.each_ref().map(|o| o.get(24, 24));
            assert!((middle[k] - 0.3).abs() < 0.01, "{middle:?}");
            let others = (0..4).filter(|&other| other != k).map(|other| middle[other]);
            assert!(others.fold(0.0, f32::max) < 0.15, "{middle:?}");
        }
    }

    #[test]
    fn saliency_orientation_of_brightness_is_none() {
        for o in orientations(&Plane::filled(5, 3, 0.8)) {
            assert!(o.samples().iter().all(|&o| o < 1e-6), "{o:?}");
        }
    }
}
