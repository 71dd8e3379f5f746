//! Perceptual quantisers: finer in smooth areas, coarser in busy ones.
//!
//! ```text
//! factor = (energy / mean)^STRENGTH      energy  variance of the four luma blocks of a macroblock
//!                                        mean    geometric mean of the energies in the picture
//! ```
//! Integer arithmetic produces the same result on every processor. Logarithms and powers of two are linear between integers, with
//! errors of at most 6 %. One function inverts the other.

use plane::Plane;

/// Exponent in 256ths. The standard does not define this value; it was tuned by SSIM on the clips of README.md.
const STRENGTH_256THS: i64 = 48;
/// Offset that is added to the energy; below it, noise and rounding dominate.
const FLOOR: u64 = 256;
/// Minimum and maximum factor, in 256ths.
const FACTORS: (u32, u32) = (128, 512);
/// Minimum and maximum factor that a caller may request, in 256ths.
const GIVEN: (u32, u32) = (16, 4096);

/// Returns the factors of quantiser_scale, in 256ths, of all macroblocks of a picture in raster order.
pub(crate) fn by_activity(luma: &Plane<u8>) -> Vec<u32> {
    let (columns, rows) = (luma.width() / 16, luma.height() / 16);
    let mut logarithms: Vec<i64> = Vec::with_capacity(columns * rows);
    for i in 0..columns * rows {
        let (left, top) = (2 * (i % columns), 2 * (i / columns));
        let mut energy = 0u64;
        for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            energy += variance(luma.block(left + x, top + y));
        }
        logarithms.push(logarithm(energy + FLOOR));
    }
    // The mean of the logarithms is the logarithm of the geometric mean.
    let mean = logarithms.iter().sum::<i64>() / logarithms.len().max(1) as i64;
    logarithms.iter().map(|l| power((l - mean) * STRENGTH_256THS / 256).clamp(FACTORS.0, FACTORS.1)).collect()
}

/// Converts a caller's factors to 256ths for `counts` macroblocks across and down. NaN becomes 1, and macroblocks outside the
/// requested picture repeat its border.
pub(crate) fn given(weights: &Plane<f32>, counts: (usize, usize)) -> Vec<u32> {
    let factor = |weight: f32| {
        if weight.is_nan() { 256 } else { (256.0 * weight).round().clamp(GIVEN.0 as f32, GIVEN.1 as f32) as u32 }
    };
    let at = |x: usize, y: usize| weights.get(x.min(weights.width() - 1), y.min(weights.height() - 1));
    Plane::from_fn(counts.0, counts.1, |x, y| factor(at(x, y))).samples().to_vec()
}

/// Returns whether a factor in 256ths is within the limits of the encoder.
pub(crate) fn is_plausible(factor: &u32) -> bool {
    (GIVEN.0..=GIVEN.1).contains(factor)
}

/// Returns the variance of 64 samples, times 64.
fn variance(samples: [u8; 64]) -> u64 {
    let sum: u64 = samples.iter().map(|&sample| u64::from(sample)).sum();
    let squares: u64 = samples.iter().map(|&sample| u64::from(sample) * u64::from(sample)).sum();
    squares - sum * sum / 64
}

/// Returns the logarithm to base 2, in 256ths.
fn logarithm(value: u64) -> i64 {
    let whole = value.ilog2();
    256 * i64::from(whole) + ((value << 8 >> whole) & 255) as i64
}

/// Returns two to a power of −8 to 8; `exponent` and result are in 256ths.
fn power(exponent: i64) -> u32 {
    let exponent = exponent.clamp(-2048, 2047);
    ((256 + (exponent & 255)) << 8 >> (8 - (exponent >> 8))) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_and_logarithms_are_near_the_true_ones() {
        for value in [1, 2, 3, 100, 1000, 12345, 1 << 40] {
            assert!((logarithm(value) as f64 / 256.0 - (value as f64).log2()).abs() < 0.09);
        }
        for exponent in -1000..1000 {
            let truth = 256.0 * (exponent as f64 / 256.0).exp2();
            assert!((f64::from(power(exponent)) - truth).abs() < 1.0 + 0.065 * truth, "{exponent}");
        }
        assert_eq!((power(0), power(256), power(-256)), (256, 512, 128));
    }

    #[test]
    fn smooth_macroblocks_are_finer_than_busy_ones() {
        let luma = Plane::from_fn(48, 16, |x, y| match x / 16 {
            0 => 100,
            1 => (100 + x % 16) as u8,
            _ => (x * 97 + y * 61) as u8,
        });
        let factors = by_activity(&luma);
        assert!(
            factors[0] < factors[1] && factors[1] < factors[2] && factors[0] < 256 && factors[2] > 256,
            "{factors:?}"
        );
        assert_eq!(by_activity(&Plane::filled(32, 32, 7)), [256; 4]);
    }

    #[test]
    fn what_callers_give_is_kept_within_reason() {
        let weights = Plane::from_vec(5, 1, vec![1.0, 0.5, f32::NAN, -3.0, f32::INFINITY]);
        assert_eq!(given(&weights, (5, 1)), [256, 128, 256, 16, 4096]);
    }
}
