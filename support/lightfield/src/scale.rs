//! Light of high dynamic range as 16-bit codes.

use crate::error::FieldError;

/// Number of codes per octave.
const STEPS: f64 = 256.0;

/// Logarithmic scale with the unit L₀:
///
/// ```text
/// x = round(256 · log2(1 + L / L₀))        L = L₀ · (2^(x / 256) − 1)
/// ```
///
/// If a code errs by δ, the light errs by at most `(2^((δ + ½) / 256) − 1) · (L + L₀)`, including the rounding of the
/// code. At δ = 0 the error is 0.14 % for L ≫ L₀, and 0.0014 L₀ for L near 0. Every finite nonnegative `f32` has a
/// code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogScale {
    unit: f32,
}

impl LogScale {
    /// Creates a scale. L₀ has the unit of the light. Far below L₀ the steps are uniform.
    ///
    /// # Errors
    ///
    /// [`FieldError::Unit`] if L₀ is not a positive normal number.
    pub fn new(unit: f32) -> Result<Self, FieldError> {
        if unit.is_normal() && unit > 0.0 { Ok(Self { unit }) } else { Err(FieldError::Unit(unit)) }
    }

    /// Unit L₀ of the scale, in the unit of the light.
    #[must_use]
    pub fn unit(self) -> f32 {
        self.unit
    }

    /// Returns the code of a light value, or `None` if it is negative, infinite or NaN.
    #[must_use]
    pub fn code(self, light: f32) -> Option<u16> {
        if !(light >= 0.0 && light.is_finite()) {
            return None;
        }
        let x = (f64::from(light) / f64::from(self.unit)).ln_1p() * (STEPS / std::f64::consts::LN_2);
        // The largest ratio of two normal numbers is 2^254, with the code 65 024.
        Some(x.round() as u16)
    }

    /// Returns the light for a code, which may be fractional. The light is at most `f32::MAX`.
    #[must_use]
    pub fn light(self, code: f32) -> f32 {
        // Invert `code` in `f64`, and clamp light that overflows `f32`.
        let ratio = (f64::from(code) * (std::f64::consts::LN_2 / STEPS)).exp_m1();
        (ratio * f64::from(self.unit)).min(f64::from(f32::MAX)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_comes_back_within_half_a_step() {
        let half = 2f64.powf(0.5 / 256.0) - 1.0;
        for unit in [f32::MIN_POSITIVE, 1e-3, 1.0, 1e30] {
            let scale = LogScale::new(unit).unwrap();
            assert_eq!(scale.light(0.0), 0.0);
            let mut light = f32::MIN_POSITIVE / 8.0;
            while light.is_finite() {
                let found = f64::from(scale.light(f32::from(scale.code(light).unwrap())));
                let (light64, unit) = (f64::from(light), f64::from(unit));
                // Add one rounding to `f32`.
                let bound = half * (light64 + unit) + light64 * f64::from(f32::EPSILON);
                assert!((found - light64).abs() <= bound * (1.0 + 1e-9), "{light} of {unit}: {found}");
                light *= 1.37;
            }
        }
    }

    #[test]
    fn ends_of_numbers() {
        let scale = LogScale::new(f32::MIN_POSITIVE).unwrap();
        assert_eq!(scale.code(f32::MAX), Some(65_024));
        for refused in [-1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(scale.code(refused), None);
        }
        assert_eq!(scale.light(65_535.0), f32::MAX);
        for refused in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-40] {
            assert!(LogScale::new(refused).is_err(), "{refused}");
        }
    }
}
