//! Radiance around a point in real spherical harmonics of degree 2, and the irradiance of any normal.
//!
//! ```text
//! L(ω) ≈ Σ cᵢ Yᵢ(ω)             cᵢ = ∫ L Yᵢ dω          i = 0 … 8
//! E(n) ≈ Σ A(i) cᵢ Yᵢ(n)        A = π, 2π/3, π/4 for the degrees 0, 1, 2
//! ```
//!
//! The irradiance of any environment deviates from this sum by about 1 % on average, and at most 9 %
//! \[RamamoorthiHanrahan01\].

use glam::Vec3;
use std::f32::consts::PI;

/// Number of coefficients.
const COUNT: usize = 9;
/// Factors of irradiance A, by coefficient.
const COSINE: [f32; COUNT] = {
    let (one, two) = (2.0 * PI / 3.0, PI / 4.0);
    [PI, one, one, one, two, two, two, two, two]
};

/// Radiance around a point \[W·m⁻²·sr⁻¹\], linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harmonics {
    /// Coefficients cᵢ, in the order of [`basis`].
    pub coefficients: [Vec3; COUNT],
}

/// Returns the real spherical harmonics of degrees 0, 1 and 2 for a unit direction.
///
/// The order within degrees 1 and 2 is y, z, x, and xy, yz, 3z² − 1, xz, x² − y².
#[must_use]
pub fn basis(direction: Vec3) -> [f32; COUNT] {
    let Vec3 { x, y, z } = direction;
    // √(1/4π), √(3/4π), √(15/4π), √(5/16π), √(15/16π)
    const Y0: f32 = 0.282_094_8;
    const Y1: f32 = 0.488_602_5;
    const Y2: f32 = 1.092_548_4;
    const Y20: f32 = 0.315_391_57;
    const Y22: f32 = 0.546_274_2;
    [Y0, Y1 * y, Y1 * z, Y1 * x, Y2 * x * y, Y2 * y * z, Y20 * (3.0 * z * z - 1.0), Y2 * x * z, Y22 * (x * x - y * y)]
}

impl Harmonics {
    /// Adds light of this `radiance` \[W·m⁻²·sr⁻¹\] from a `solid_angle` \[sr\] around a unit direction.
    pub fn add(&mut self, direction: Vec3, radiance: Vec3, solid_angle: f32) {
        for (coefficient, y) in self.coefficients.iter_mut().zip(basis(direction)) {
            *coefficient += radiance * (y * solid_angle);
        }
    }

    /// Adds the same `irradiance` \[W·m⁻²\] for all normals.
    pub fn add_irradiance(&mut self, irradiance: Vec3) {
        self.coefficients[0] += irradiance / (COSINE[0] * basis(Vec3::Z)[0]);
    }

    /// Returns the radiance from a unit direction \[W·m⁻²·sr⁻¹\]. It may be slightly negative.
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (&coefficient, y) in self.coefficients.iter().zip(basis(direction)) {
            sum += coefficient * y;
        }
        sum
    }

    /// Returns the irradiance of a surface with a unit `normal` \[W·m⁻²\]. It may be slightly negative.
    #[must_use]
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (k, y) in basis(normal).into_iter().enumerate() {
            sum += self.coefficients[k] * (COSINE[k] * y);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::TAU;

    /// Integrates `value` over the sphere by the midpoint rule.
    fn integral(value: impl Fn(Vec3) -> f32) -> f32 {
        const ROWS: usize = 200;
        let mut sum = 0.0;
        for row in 0..ROWS {
            let z = 1.0 - (2 * row + 1) as f32 / ROWS as f32;
            for column in 0..2 * ROWS {
                let (sine, cosine) = (TAU * (column as f32 + 0.5) / (2 * ROWS) as f32).sin_cos();
                let radius = (1.0 - z * z).sqrt();
                sum += f64::from(value(Vec3::new(radius * cosine, radius * sine, z)));
            }
        }
        (sum * f64::from(4.0 * PI) / (2 * ROWS * ROWS) as f64) as f32
    }

    #[test]
    fn functions_are_orthonormal() {
        for i in 0..COUNT {
            for j in 0..COUNT {
                let product = integral(|direction| basis(direction)[i] * basis(direction)[j]);
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-3, "{i} {j}: {product}");
            }
        }
    }

    /// Under a uniform hemisphere of radiance L, E = π L (1 + cos θ) / 2 for a normal at angle θ to its pole.
    #[test]
    fn a_hemisphere_lights_any_normal() {
        let mut light = Harmonics::default();
        const ROWS: usize = 100;
        for row in 0..ROWS {
            let z = (row as f32 + 0.5) / ROWS as f32;
            for column in 0..ROWS {
                let (sine, cosine) = (TAU * (column as f32 + 0.5) / ROWS as f32).sin_cos();
                let radius = (1.0 - z * z).sqrt();
                let direction = Vec3::new(radius * cosine, radius * sine, z);
                light.add(direction, Vec3::splat(2.0), TAU / (ROWS * ROWS) as f32);
            }
        }
        for degrees in [0.0f32, 30.0, 60.0, 90.0, 150.0] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let found = light.irradiance(Vec3::new(sine, 0.0, cosine)).x;
            let expected = PI * (1.0 + cosine);
            assert!((found - expected).abs() < 2e-3, "{degrees}°: {found} instead of {expected}");
        }
        let before = light.irradiance(Vec3::X);
        light.add_irradiance(Vec3::ONE);
        assert!((light.irradiance(Vec3::X) - before - 1.0).abs().max_element() < 1e-5);
    }
}
