//! Numbers in the formats of GPU textures: half floats, and three channels with a shared exponent.
//!
//! ```text
//! half             ± (1024 + m) 2^(e − 25)        m  10 bits, e  5 bits; e = 0: ± m 2⁻²⁴ (IEEE 754)
//! shared exponent  m_c 2^(e − 24)                 m_c  9 bits each, e  5 bits (EXT_texture_shared_exponent)
//! ```

use glam::Vec3;

/// Largest finite half float.
const MOST_HALF: f32 = 65_504.0;
/// Largest channel with a shared exponent, 511 · 2⁷.
const MOST_SHARED: f32 = 65_408.0;

/// Returns the half float nearest to `value`, as bits. Values outside ±65504 are clamped, and NaN becomes 0.
#[must_use]
pub fn half(value: f32) -> u16 {
    let value = if value.is_nan() { 0.0 } else { value.clamp(-MOST_HALF, MOST_HALF) };
    // Round to 11 significant bits, or to a multiple of 2⁻²⁴. A carry increments the exponent.
    let exponent = exponent(value.abs()).max(-14);
    let mantissa = (value.abs() / 2f32.powi(exponent - 10)).round_ties_even() as u16;
    let sign = if value.is_sign_negative() { 0x8000 } else { 0 };
    sign | (((exponent + 14) as u16) * 1024 + mantissa)
}

/// Returns the value of a finite half float.
#[must_use]
pub fn from_half(bits: u16) -> f32 {
    let (exponent, mantissa) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    let magnitude = match exponent {
        0 => mantissa * 2f32.powi(-24),
        _ => (1024.0 + mantissa) * 2f32.powi(exponent - 25),
    };
    if bits & 0x8000 == 0 { magnitude } else { -magnitude }
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
    fn all_halves_come_back() {
        for bits in 0..=u16::MAX {
            // Skip infinities and NaNs, which have the largest exponent.
            if bits >> 10 & 31 != 31 {
                assert_eq!(half(from_half(bits)), bits, "{bits:#x}");
            }
        }
        assert_eq!([half(1.0), half(-2.0), half(f32::INFINITY), half(f32::NAN)], [0x3c00, 0xc000, 0x7bff, 0]);
        // 1 + 2⁻¹¹ is in the middle between two halves: the even one is 1.
        assert_eq!([half(1.0 + 2f32.powi(-11)), half(1.0 + 3.0 * 2f32.powi(-11))], [0x3c00, 0x3c02]);
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
