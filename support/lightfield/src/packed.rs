//! Numbers in the formats of GPU textures: half floats, and three channels with a shared exponent.
//!
//! ```text
//! shared exponent  m_c 2^(e − 24)                 m_c  9 bits each, e  5 bits (EXT_texture_shared_exponent)
//! ```

use glam::Vec3;
use half::f16;

/// Largest channel with a shared exponent, 511 · 2⁷.
const MOST_SHARED: f32 = 65_408.0;

/// Returns the bits of the half float nearest to `value`. Values outside ±65504 are clamped, and NaN becomes 0.
pub(crate) fn half(value: f32) -> u16 {
    let most = f16::MAX.to_f32();
    f16::from_f32(if value.is_nan() { 0.0 } else { value.clamp(-most, most) }).to_bits()
}

/// Returns the nearest color with a shared exponent: red in the lowest 9 bits, the exponent in the highest 5. Channels
/// are clamped to 0…65408, and NaN becomes 0. A channel errs by at most 1/512 of the largest channel, or 2⁻²⁵.
#[must_use]
pub fn shared_exponent(color: Vec3) -> u32 {
    // The condition is false for NaN.
    let channels = color.to_array().map(|channel| if channel > 0.0 { channel.min(MOST_SHARED) } else { 0.0 });
    let largest = channels.into_iter().fold(0.0, f32::max);
    let mut shared = (exponent(largest) + 16).max(0);
    // Use the next exponent if the largest channel rounds up to 512.
    if (largest / 2f32.powi(shared - 24)).round() > 511.0 {
        shared += 1;
    }
    let [r, g, b] = channels.map(|channel| (channel / 2f32.powi(shared - 24)).round() as u32);
    r | g << 9 | b << 18 | (shared as u32) << 27
}

/// Returns the color of [`shared_exponent`].
#[must_use]
pub fn from_shared_exponent(bits: u32) -> Vec3 {
    let step = 2f32.powi((bits >> 27) as i32 - 24);
    Vec3::from([bits, bits >> 9, bits >> 18].map(|channel| (channel & 511) as f32 * step))
}

/// Returns ⌊log₂ x⌋ of a positive normal number, and at most −127 for smaller numbers.
fn exponent(positive: f32) -> i32 {
    (positive.to_bits() >> 23) as i32 - 127
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_finite() {
        assert_eq!([1.0, -2.0, f32::INFINITY, f32::NAN].map(half), [0x3c00, 0xc000, 0x7bff, 0]);
    }

    #[test]
    fn shared_exponents_err_by_half_a_step() {
        let mut light = 1e-9f32;
        while light < 6e4 {
            for color in [Vec3::splat(light), Vec3::new(light, 0.3 * light, 0.0), Vec3::new(0.01 * light, 0.0, light)] {
                let error = (from_shared_exponent(shared_exponent(color)) - color).abs().max_element();
                let bound = (color.max_element() / 512.0).max(2f32.powi(-25)) * 1.0001;
                assert!(error <= bound, "{color}: {error} > {bound}");
            }
            light *= 1.0137;
        }
        assert_eq!(from_shared_exponent(shared_exponent(Vec3::new(-1.0, f32::NAN, 1e9))), Vec3::Z * MOST_SHARED);
    }
}
