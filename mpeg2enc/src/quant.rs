//! Quantisation, and the inverse that every decoder shares (7.4).

use crate::{dct, scan::ZIGZAG, trellis};

/// Default weighting matrix for intra blocks in raster order (6.3.11); that of non-intra blocks is 16 throughout.
#[rustfmt::skip]
pub const DEFAULT_INTRA_MATRIX: [u8; 64] = [
     8, 16, 19, 22, 26, 27, 29, 34,
    16, 16, 22, 24, 27, 29, 34, 37,
    19, 22, 26, 27, 29, 34, 34, 38,
    22, 22, 26, 27, 29, 34, 37, 40,
    22, 26, 27, 29, 32, 35, 40, 48,
    26, 27, 29, 32, 35, 40, 48, 58,
    26, 27, 29, 34, 38, 46, 56, 69,
    27, 29, 35, 38, 46, 56, 69, 83,
];

/// The one weight of the default non-intra matrix (6.3.11).
const INTER_WEIGHT: i32 = 16;

/// Largest level that a coefficient may have (7.2.2.3): 12 bits, and −2048 is forbidden.
const LEVEL_MAX: i32 = 2047;

/// Quantised levels of one block.
#[derive(Clone, Copy)]
pub(crate) struct Block {
    /// Levels in transmission order.
    pub levels: [i16; 64],
    /// One more than the place of the last level that is not zero; at least 1 in an intra block.
    pub end: usize,
}

impl Block {
    pub const EMPTY: Self = Self { levels: [0; 64], end: 0 };
}

/// Which formulae of 7.4 hold for a block.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind {
    Intra,
    Inter,
}

/// The quantiser of one picture.
pub(crate) struct Quantiser {
    scale: i32,
    intra_dc_mult: i32,
    intra_dc_max: i32,
    /// Price of a bit, in squared errors of coefficients with [`dct::COEFFICIENT_BITS`] fractional bits.
    pub lambda: i64,
    intra: Weights,
    inter: Weights,
}

/// A weighting matrix in transmission order, times quantiser_scale, and its reciprocals.
struct Weights {
    scaled: [i32; 64],
    reciprocal_q32: [u64; 64],
}

impl Weights {
    fn new(scale: i32, weight: impl Fn(usize) -> i32) -> Self {
        let scaled = ZIGZAG.map(|raster| weight(raster) * scale);
        Self { scaled, reciprocal_q32: scaled.map(|step| (1 << 32) / step as u64 + 1) }
    }
}

impl Quantiser {
    /// `intra_dc_precision` in bits, 8 to 10.
    pub fn new(quantiser_scale: u32, intra_dc_precision: u32) -> Self {
        let scale = quantiser_scale as i32;
        Self {
            scale,
            intra_dc_mult: 1 << (11 - intra_dc_precision),
            intra_dc_max: (1 << intra_dc_precision) - 1,
            lambda: LAMBDA_NUMERATOR * i64::from(scale * scale),
            intra: Weights::new(scale, |raster| DEFAULT_INTRA_MATRIX[raster].into()),
            inter: Weights::new(scale, |_| INTER_WEIGHT),
        }
    }

    /// What a DC prediction is at the start of a slice (7.2.1): half of the range.
    pub fn dc_reset(&self) -> i32 {
        (self.intra_dc_max + 1) / 2
    }

    /// Levels of coefficients as [`dct::forward`] gives them, chosen for few bits and little error together.
    pub fn quantise(&self, coefficients: &[i32; 64], kind: Kind) -> Block {
        let (weights, start, rounding) = match kind {
            Kind::Intra => (&self.intra, 1, 1 << 31),
            // (2·QF+1)·quantiser_scale/2 lies in the middle of its interval already: no rounding, zero is twice as wide.
            Kind::Inter => (&self.inter, 0, 0),
        };
        let mut magnitudes = [0; 64];
        let mut levels = [0; 64];
        let mut end = 0;
        for i in start..64 {
            magnitudes[i] = coefficients[ZIGZAG[i]].abs();
            // step = weight·quantiser_scale/16, and coefficients have three fractional bits: hence the factor of 2.
            let level = (2 * magnitudes[i] as u64 * weights.reciprocal_q32[i] + rounding) >> 32;
            levels[i] = (level as i32).min(LEVEL_MAX);
            if levels[i] != 0 {
                end = i + 1;
            }
        }
        let mut block = Block::EMPTY;
        if end > 0 {
            block.end = trellis::choose(&magnitudes, &mut levels, end, kind, self.lambda, |i, level| {
                inverse_quantise(level, kind, weights.scaled[i])
            });
            for i in start..block.end {
                let level = levels[i] as i16;
                block.levels[i] = if coefficients[ZIGZAG[i]] < 0 { -level } else { level };
            }
        }
        if kind == Kind::Intra {
            let step = self.intra_dc_mult << dct::COEFFICIENT_BITS;
            block.levels[0] = ((coefficients[0] + step / 2) / step).clamp(0, self.intra_dc_max) as i16;
            block.end = block.end.max(1);
        }
        block
    }

    /// Is a non-intra block of this squared error certain to quantise to zeros?
    ///
    /// No coefficient is larger than the root of the sum, and those below quantiser_scale become zero;
    /// the quarter covers rounding.
    pub fn leaves_nothing(&self, squared_error: u32) -> bool {
        4 * i64::from(squared_error) < 3 * i64::from(self.scale).pow(2)
    }

    /// Coefficients in raster order as the decoder gets them (7.4): arithmetic, saturation, mismatch control.
    pub fn dequantise(&self, block: &Block, kind: Kind) -> [i32; 64] {
        let mut out = [0; 64];
        let mut sum = 0;
        let weights = if kind == Kind::Intra { &self.intra } else { &self.inter };
        for i in 0..block.end {
            let level = i32::from(block.levels[i]);
            let value = match (kind, i) {
                (Kind::Intra, 0) => self.intra_dc_mult * level, // 7.4.1
                _ => inverse_quantise(level, kind, weights.scaled[i]),
            };
            let value = value.clamp(-2048, 2047); // 7.4.3
            sum += value;
            out[ZIGZAG[i]] = value;
        }
        // 7.4.4: an even sum changes the last bit of F[7][7].
        if sum & 1 == 0 {
            out[63] += if out[63] & 1 == 0 { 1 } else { -1 };
        }
        out
    }
}

/// Price of a bit against squared error, 0.16·quantiser_scale² with six fractional bits
/// (two times [`dct::COEFFICIENT_BITS`]): the factor of mode decisions in the y262 encoder, near the best for us too.
const LAMBDA_NUMERATOR: i64 = 10;

/// Inverse quantisation of one coefficient (7.4.2.3), all but the intra DC.
///
/// ```text
/// F'' = (2·QF + k) · W · quantiser_scale / 32      "/" truncates toward zero
///   QF  quantised level      W·quantiser_scale  scaled_weight
///   k   0 for intra blocks, Sign(QF) for non-intra
/// ```
#[inline]
fn inverse_quantise(level: i32, kind: Kind, scaled_weight: i32) -> i32 {
    let k = if kind == Kind::Intra { 0 } else { level.signum() };
    (2 * level + k) * scaled_weight / 32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mismatch_control_makes_the_sum_odd() {
        let quantiser = Quantiser::new(8, 8);
        for seed in 0..500i32 {
            let coefficients = std::array::from_fn(|i| (seed * 7919 + i as i32 * 104_729) % 9000 - 4500);
            for kind in [Kind::Intra, Kind::Inter] {
                let block = quantiser.quantise(&coefficients, kind);
                assert_eq!(quantiser.dequantise(&block, kind).iter().sum::<i32>() & 1, 1);
            }
        }
    }

    #[test]
    fn levels_come_back_near_the_coefficients() {
        for scale in [1, 2, 8, 31, 112] {
            let quantiser = Quantiser::new(scale, 8);
            for seed in 0..100i32 {
                let coefficients: [i32; 64] = std::array::from_fn(|i| {
                    (seed * 7919 + i as i32 * 104_729).rem_euclid(1600) - 800 + if i == 0 { 3000 } else { 0 }
                });
                for (kind, widest) in [(Kind::Intra, 83), (Kind::Inter, 16)] {
                    let restored = quantiser.dequantise(&quantiser.quantise(&coefficients, kind), kind);
                    let step = f64::from(widest * scale) / 16.0;
                    for (i, (&a, &b)) in coefficients.iter().zip(&restored).enumerate() {
                        let error = (f64::from(a) / 8.0 - f64::from(b)).abs();
                        assert!(error <= 8.0f64.max(2.0 * step), "{kind:?} {i}: {error} at step {step}");
                    }
                }
            }
        }
    }

    #[test]
    fn values_saturate() {
        let quantiser = Quantiser::new(112, 8);
        let mut block = Block::EMPTY;
        (block.levels[5], block.levels[6], block.end) = (2047, -2047, 7);
        let restored = quantiser.dequantise(&block, Kind::Inter);
        assert_eq!((restored[ZIGZAG[5]], restored[ZIGZAG[6]]), (2047, -2048));
    }
}
