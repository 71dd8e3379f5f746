//! Luminance and contrast masking in the DCT domain: the largest invisible changes of a block.
//!
//! The model is Watson's \[Watson93\] with the intra matrix of MPEG-2 as base thresholds, as in \[Herzog08, §5.1 and
//! §5.2\]:
//!
//! ```text
//! (1)  t_ij = q_ij (c_00 / c̄_00)^(0.649 γ)
//! (2)  m_ij = t_ij max(1, |c_ij| / t_ij)^0.7                   m_00 = t_00
//! (3)  ĉ_ij = ½ sign(c_ij) s q_min                             if |c_ij| < ½ q_ij s   (vanishes in the stream)
//!      ĉ_ij = c_ij + ½ sign(c_ij) s m_ij                       otherwise
//!
//!   c_ij   orthonormal DCT of a block of luma, black = 0, white = 219: the scale in which the quantiser's steps act
//!   c̄_00   mean of c_00 over all blocks of the picture          q_ij   intra quantiser matrix
//!   γ      display gamma, 2.0 by default                        s      quantiser_scale / 16
//!   q_min  smallest q_ij other than q_00; 16 by default
//! ```
//!
//! # Choices where the sources are ambiguous
//! - sign(0) is positive. Coefficients that vanish are replaced by a wave with their sign. In a completely flat block
//!   all signs are positive, and the 63 waves add up in the upper left sample. This sample gets nearly seven times the
//!   tolerance of the block. The block's root mean square is ½ s q_min code values for any signs, because the transform
//!   is orthonormal.
//! - The first case of (3) replaces a coefficient instead of adding to it. The same cases apply to the DC. In a block
//!   darker than ½ q_00 s (mean luma ¹⁄₁₆ q_00 s, black in practice) the DC is replaced by ½ s q_min.
//! - `c_00 / c̄_00` is clamped to 1/16…16 ([`MaskingModel::max_luminance_ratio`]). A single white block in a black
//!   picture then stays finite, and a black block keeps a positive threshold. In a black picture (c̄_00 = 0) the
//!   ratio is 1 everywhere.

use crate::bounded;
use plane::matrices::DEFAULT_INTRA_MATRIX;
use plane::{Plane, dct, idct};
use threads::prelude::*;

/// Exponent of luminance masking for linear luminance \[Watson93\]. Eq. (1) multiplies it by the display gamma.
pub const LUMINANCE_MASKING_EXPONENT: f32 = 0.649;
/// Exponent of contrast masking \[Watson93\]. It is equal for all AC frequencies.
pub const CONTRAST_MASKING_EXPONENT: f32 = 0.7;
/// Divisor in s = quantiser_scale / 16. MPEG-2's step of coefficient ij is q_ij · quantiser_scale / 16.
const QUANTISER_SCALE_UNIT: f32 = 16.0;
/// Largest c̄_00 that counts as a black picture: less than 2·10⁻⁴ code values on average.
const BLACK_MEAN_DC: f32 = 1e-3;

/// Parameters of the masking model.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MaskingModel {
    /// q_ij in raster order, 1…255. 0 is replaced by 1. Default: [`DEFAULT_INTRA_MATRIX`].
    #[cfg_attr(feature = "serde", serde(with = "matrix"))]
    pub intra_matrix: [u8; 64],
    /// Display gamma γ in eq. (1). Default 2.0 \[Herzog08, §5.1\].
    pub display_gamma: f32,
    /// Limit r of c_00 / c̄_00, which is clamped to 1/r…r. At least 1, default 16. Only nearly black pictures reach the
    /// default: the ratio of white to the mean is 16 if the mean luma is 14.
    pub max_luminance_ratio: f32,
}

impl Default for MaskingModel {
    fn default() -> Self {
        Self { intra_matrix: DEFAULT_INTRA_MATRIX, display_gamma: 2.0, max_luminance_ratio: 16.0 }
    }
}

/// Returns `s = quantiser_scale / 16`, with the scale clamped to 1…112 (ISO/IEC 13818-2, Table 7-6).
fn step_multiplier(quantiser_scale: f32) -> f32 {
    bounded(quantiser_scale, 1.0, 112.0) / QUANTISER_SCALE_UNIT
}

impl MaskingModel {
    /// Evaluates eq. (1): the thresholds, before contrast masking, of a block with DC coefficient `dc`. `mean_dc` is
    /// the mean DC coefficient of the picture.
    #[must_use]
    pub fn luminance_thresholds(&self, dc: f32, mean_dc: f32) -> [f32; 64] {
        let factor = self.luminance_factor(dc, mean_dc);
        self.intra_matrix.map(|q| f32::from(q.max(1)) * factor)
    }

    /// Evaluates eq. (2): thresholds `t`, raised by the magnitudes of the block's own coefficients `c`.
    #[must_use]
    pub fn contrast_thresholds(t: &[f32; 64], c: &[f32; 64]) -> [f32; 64] {
        std::array::from_fn(|i| match i {
            0 => t[0],
            _ => t[i] * (c[i].abs() / t[i]).max(1.0).powf(CONTRAST_MASKING_EXPONENT),
        })
    }

    /// Evaluates eq. (3): the coefficients `c` of a block, with the largest distortion that quantisation and the
    /// masking thresholds `m` hide.
    #[must_use]
    pub fn worst_case(&self, c: &[f32; 64], m: &[f32; 64], quantiser_scale: f32) -> [f32; 64] {
        let (s, q_min) = (step_multiplier(quantiser_scale), self.smallest_ac());
        std::array::from_fn(|i| {
            let sign = if c[i] < 0.0 { -1.0 } else { 1.0 };
            let q = f32::from(self.intra_matrix[i].max(1));
            if c[i].abs() < 0.5 * q * s { 0.5 * sign * s * q_min } else { c[i] + 0.5 * sign * s * m[i] }
        })
    }

    /// Evaluates eqs. (1) to (3) for all blocks of a picture. Returns the distorted luma ŷ′, which is visually equal to
    /// `luma`.
    ///
    /// `luma` is in code values above black, before rounding. Values that are not finite are replaced by black. Other
    /// values are clamped to −16…239, the range of eight bits. The result is neither rounded nor clipped.
    /// `quantiser_scale` is clamped to 1…112.
    #[must_use]
    pub fn worst_case_luma(&self, luma: &Plane<f32>, quantiser_scale: f32) -> Plane<f32> {
        let (width, height) = (luma.width(), luma.height());
        let mut out = Plane::filled(width, height, 0.0);
        if width == 0 || height == 0 {
            return out;
        }
        let columns = luma.block_counts().0;
        let fast = FastMasking::new(self, mean_dc(luma), quantiser_scale);
        out.samples_mut().par_chunks_mut(8 * width).enumerate().for_each(|(row, strip)| {
            for column in 0..columns {
                // Distort the block, then copy its samples inside the picture.
                let block = idct(&fast.worst_case(&dct(&finite_block(luma, column, row))));
                let left = 8 * column;
                let inside = (width - left).min(8);
                for (line, samples) in strip.chunks_exact_mut(width).zip(block.chunks_exact(8)) {
                    line[left..left + inside].copy_from_slice(&samples[..inside]);
                }
            }
        });
        out
    }

    /// Returns `(c_00 / c̄_00)^(0.649 γ)`, with the ratio clamped to the model's limit.
    fn luminance_factor(&self, dc: f32, mean_dc: f32) -> f32 {
        if mean_dc.is_nan() || mean_dc < BLACK_MEAN_DC {
            return 1.0;
        }
        let bound = bounded(self.max_luminance_ratio, 1.0, 1e6);
        let gamma = if self.display_gamma.is_nan() { 2.0 } else { self.display_gamma.clamp(0.0, 4.0) };
        bounded(dc / mean_dc, 1.0 / bound, bound).powf(LUMINANCE_MASKING_EXPONENT * gamma)
    }

    /// Returns q_min, the smallest AC entry of the matrix.
    fn smallest_ac(&self) -> f32 {
        f32::from(self.intra_matrix[1..].iter().copied().fold(u8::MAX, u8::min).max(1))
    }
}

/// Returns c̄_00, the mean of the DC coefficients of all blocks of a luma plane. It is 0 for a plane without samples.
#[must_use]
pub fn mean_dc(luma: &Plane<f32>) -> f32 {
    let (columns, rows) = luma.block_counts();
    if columns * rows == 0 {
        return 0.0;
    }
    let dc = |column, row| {
        // Add into eight independent sums, because sequential additions would wait for each other.
        let mut sums = [0.0f32; 8];
        for line in finite_block(luma, column, row).chunks_exact(8) {
            for (sum, value) in sums.iter_mut().zip(line) {
                *sum += value;
            }
        }
        sums.iter().sum::<f32>() / 8.0
    };
    let of_row = |row| (0..columns).map(|column| f64::from(dc(column, row))).sum::<f64>();
    // Add the sums of rows in order, so that the result does not depend on the number of threads.
    let sums: Vec<f64> = (0..rows).into_par_iter().map(of_row).collect();
    (sums.iter().sum::<f64>() / (columns * rows) as f64) as f32
}

/// Returns a block of luma, clamped to the range of eight bits.
fn finite_block(luma: &Plane<f32>, column: usize, row: usize) -> [f32; 64] {
    luma.block(column, row).map(|v| if v.is_finite() { v.clamp(-16.0, 239.0) } else { 0.0 })
}

/// Evaluates eqs. (1) to (3) in one pass over a block, without branches or calls, so that the compiler vectorizes it.
///
/// Eq. (2) is rearranged: t max(1, |c| / t)^0.7 = max(t, t^0.3 |c|^0.7), and t^0.3 = q^0.3 · factor^0.3 with a
/// precomputed q^0.3.
struct FastMasking<'a> {
    model: &'a MaskingModel,
    mean_dc: f32,
    q: [f32; 64],
    q_power: [f32; 64],
    s: f32,
    vanishing: f32,
}

impl<'a> FastMasking<'a> {
    fn new(model: &'a MaskingModel, mean_dc: f32, quantiser_scale: f32) -> Self {
        let q = model.intra_matrix.map(|q| f32::from(q.max(1)));
        let s = step_multiplier(quantiser_scale);
        let q_power = q.map(|q| q.powf(1.0 - CONTRAST_MASKING_EXPONENT));
        Self { model, mean_dc, q, q_power, s, vanishing: 0.5 * s * model.smallest_ac() }
    }

    fn worst_case(&self, c: &[f32; 64]) -> [f32; 64] {
        let factor = self.model.luminance_factor(c[0], self.mean_dc);
        let factor_power = factor.powf(1.0 - CONTRAST_MASKING_EXPONENT);
        let half = 0.5 * self.s;
        let powers = contrast_powers(c);
        let mut out = [0.0; 64];
        for i in 0..64 {
            let size = c[i].abs();
            let m = (self.q[i] * factor).max(self.q_power[i] * factor_power * powers[i]);
            let distorted = if size < half * self.q[i] { self.vanishing } else { size + half * m };
            out[i] = if c[i] < 0.0 { -distorted } else { distorted };
        }
        // The DC has no contrast masking, so m_00 = t_00.
        if c[0].abs() >= half * self.q[0] {
            let m = self.q[0] * factor;
            out[0] = c[0] + if c[0] < 0.0 { -half * m } else { half * m };
        }
        out
    }
}

/// Returns `|c|^0.7` of all coefficients.
///
/// This function is not inlined, because the compiler would move each power into the branch that needs it and compute
/// the powers one by one.
#[inline(never)]
fn contrast_powers(c: &[f32; 64]) -> [f32; 64] {
    c.map(|c| contrast_power(c.abs()))
}

/// Returns `x^0.7` for x in 0…1e6, with a relative error below 1e-5, using basic arithmetic only. The result for 0 is
/// less than 1e-20.
#[inline(always)]
fn contrast_power(x: f32) -> f32 {
    const SQRT_HALF: u32 = std::f32::consts::FRAC_1_SQRT_2.to_bits();
    const TWO_OVER_LN_2: f32 = 2.0 / std::f32::consts::LN_2;
    /// 1.5 · 2²³. Adding this constant rounds a number to an integer in the low bits.
    const ROUNDER: f32 = 12_582_912.0;
    // log2(x) = exponent + log2(mantissa). The mantissa is in √½ … √2. Use the series of the inverse hyperbolic
    // tangent.
    let bits = x.max(1e-30).to_bits();
    let exponent = (bits.wrapping_sub(SQRT_HALF) as i32) >> 23;
    let mantissa = f32::from_bits(bits.wrapping_sub((exponent << 23) as u32));
    let z = (mantissa - 1.0) / (mantissa + 1.0);
    let zz = z * z;
    let log2 = exponent as f32 + TWO_OVER_LN_2 * z * (1.0 + zz * (1.0 / 3.0 + zz * (0.2 + zz * (1.0 / 7.0))));
    // 2^y = 2^whole · 2^rest. The rest is in −½ … ½. Use the exponential series up to the fifth power.
    let y = CONTRAST_MASKING_EXPONENT * log2;
    let shifted = y + ROUNDER;
    let rest = (y - (shifted - ROUNDER)) * std::f32::consts::LN_2;
    let series = 1.0 + rest * (1.0 + rest * (0.5 + rest * (1.0 / 6.0 + rest * (1.0 / 24.0 + rest * (1.0 / 120.0)))));
    f32::from_bits(series.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// Serialization of 64 numbers. Serde supports arrays of at most 32.
#[cfg(feature = "serde")]
mod matrix {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub fn serialize<S: Serializer>(matrix: &[u8; 64], serializer: S) -> Result<S::Ok, S::Error> {
        matrix.as_slice().serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[u8; 64], D::Error> {
        let entries = Vec::<u8>::deserialize(deserializer)?;
        entries.try_into().map_err(|entries: Vec<u8>| D::Error::invalid_length(entries.len(), &"64 matrix entries"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_power_is_the_power() {
        for i in 0..=100_000 {
            let x = 1e-6 * 10f64.powf(i as f64 * 1.2e-4);
            let fast = f64::from(contrast_power(x as f32));
            assert!((fast / f64::from(x as f32).powf(0.7) - 1.0).abs() < 1e-5, "{x}: {fast}");
        }
        assert!(contrast_power(0.0) < 1e-20);
    }

    #[test]
    fn fast_block_is_the_chain_of_equations() {
        let model = MaskingModel::default();
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        for quantiser_scale in [1.0, 2.0, 16.0, 62.0, 112.0] {
            let fast = FastMasking::new(&model, 800.0, quantiser_scale);
            for _ in 0..200 {
                let spread = 300.0 * random();
                let mut c: [f32; 64] = std::array::from_fn(|_| spread * (random() - 0.5));
                c[0] = 1752.0 * random();
                let m = MaskingModel::contrast_thresholds(&model.luminance_thresholds(c[0], 800.0), &c);
                for (fast, plain) in fast.worst_case(&c).iter().zip(model.worst_case(&c, &m, quantiser_scale)) {
                    assert!((fast - plain).abs() <= 2e-5 * plain.abs(), "{fast} {plain}");
                }
            }
        }
    }
}
