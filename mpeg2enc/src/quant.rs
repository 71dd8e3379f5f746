//! Quantisation, and the inverse quantisation that every decoder shares (7.4).

mod direct;
#[cfg(test)]
mod tests;

use crate::{
    Standard,
    block::{Block, BlockKind, places},
    dct, kernel,
    quantiser_scale::{QuantiserScaleCode, quantiser_scale_of},
    trellis::{self, BitPrice},
    vlc::{Codes, CoefficientTable, block_bits},
};
use mpeg2::scan::{ALTERNATE, ZIGZAG};

/// Parameters common to all quantisers of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct QuantiserParameters {
    pub standard: Standard,
    pub q_scale_type: bool,
    /// Precision of the intra DC in bits, 8 to 11.
    pub intra_dc_precision: u32,
    pub alternate_scan: bool,
    /// Table of the coefficients of intra blocks: intra_vlc_format.
    pub intra_table: CoefficientTable,
    /// Weighting matrices in raster order.
    pub intra_matrix: [u8; 64],
    pub non_intra_matrix: [u8; 64],
}

impl QuantiserParameters {
    /// Returns the code table and the escape coding of a block's coefficients.
    pub fn codes(&self, kind: BlockKind) -> Codes {
        let table = if kind == BlockKind::Intra { self.intra_table } else { CoefficientTable::Zero };
        Codes { table, standard: self.standard }
    }

    /// Returns the DC prediction at the start of a slice (7.2.1): half of the range.
    pub fn dc_reset(&self) -> i32 {
        1 << (self.intra_dc_precision - 1)
    }
}

/// Quantisers of all 31 values of quantiser_scale_code.
pub(crate) struct Quantisers {
    pub parameters: QuantiserParameters,
    by_code: Vec<Quantiser>,
}

impl Quantisers {
    pub fn new(parameters: QuantiserParameters) -> Self {
        let scale = |code| quantiser_scale_of(QuantiserScaleCode { q_scale_type: parameters.q_scale_type, code });
        Self { parameters, by_code: (1..=31).map(|code| Quantiser::new(scale(code), &parameters)).collect() }
    }

    /// Returns the quantiser of quantiser_scale_code `code`, 1 to 31.
    #[inline]
    pub fn of(&self, code: u8) -> &Quantiser {
        &self.by_code[usize::from(code) - 1]
    }
}

/// Quantiser of one quantiser_scale.
pub(crate) struct Quantiser {
    pub scale: i32,
    intra_dc_mult: i32,
    intra_dc_max: i32,
    /// Index of the coefficients in a block, [stored by column](dct), in transmission order.
    scan: [usize; 64],
    /// Position in transmission order of each coefficient of a block.
    places: [u8; 64],
    standard: Standard,
    /// Codes of intra blocks and of non-intra blocks.
    codes: [Codes; 2],
    intra: Weights,
    inter: Weights,
}

/// A weighting matrix times quantiser_scale: in transmission order, and in storage order with reciprocals.
struct Weights {
    scaled: [i32; 64],
    turned: [i32; 64],
    reciprocal: [u32; 64],
    /// Fractional bits of `reciprocal`, minus one.
    shift: u32,
}

impl Weights {
    fn new(scale: i32, matrix: &[u8; 64], scan: &[usize; 64]) -> Self {
        let steps = matrix.map(|weight| i32::from(weight) * scale);
        // The intra DC, which has the smallest weight, is quantised separately.
        let least = *steps[1..].iter().min().expect("63 weights") as u64;
        // The largest reciprocal has 17 bits, so its product with a 14-bit coefficient has at most 32 bits.
        let shift = (least << 16).ilog2();
        let reciprocal = |i: usize| ((2u64 << shift) / steps[turned(i)] as u64 + 1).min(1 << 17) as u32;
        Self {
            scaled: scan.map(|raster| steps[raster]),
            turned: std::array::from_fn(|i| steps[turned(i)]),
            reciprocal: std::array::from_fn(reciprocal),
            shift,
        }
    }
}

/// Converts a raster position to a storage index; the inverse is the same function.
fn turned(i: usize) -> usize {
    i % 8 * 8 + i / 8
}

/// Method of choosing levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rounding {
    /// Nearest level, with a wider zero interval.
    DeadZone,
    /// Minimum cost at this price of a bit, in squared errors with twice [`dct::COEFFICIENT_BITS`] fractional bits.
    Trellis { lambda: i64 },
}

/// A block after the transform.
#[derive(Clone, Copy)]
pub(crate) struct Transformed<'a> {
    /// Coefficients from [`dct::forward`].
    pub coefficients: &'a [i32; 64],
    /// Sum of the squared coefficients, without the DC of an intra block. It is the error if all become zero.
    pub energy: i64,
}

impl Quantiser {
    fn new(quantiser_scale: u32, parameters: &QuantiserParameters) -> Self {
        let scale = quantiser_scale as i32;
        let scan = if parameters.alternate_scan { &ALTERNATE } else { &ZIGZAG };
        // Invert the scan, because kernels find the levels in storage order.
        let mut places = [0; 64];
        for (place, &raster) in scan.iter().enumerate() {
            places[turned(raster)] = place as u8;
        }
        Self {
            scale,
            places,
            intra_dc_mult: 1 << (11 - parameters.intra_dc_precision),
            intra_dc_max: (1 << parameters.intra_dc_precision) - 1,
            scan: scan.map(turned),
            standard: parameters.standard,
            codes: [parameters.codes(BlockKind::Intra), parameters.codes(BlockKind::Inter)],
            intra: Weights::new(scale, &parameters.intra_matrix, scan),
            inter: Weights::new(scale, &parameters.non_intra_matrix, scan),
        }
    }

    /// Quantises the coefficients of a block and stores the levels in `block`.
    pub fn quantise(&self, transformed: Transformed, kind: BlockKind, rounding: Rounding, block: &mut Block) {
        let Transformed { coefficients, energy } = transformed;
        let [intra_codes, inter_codes] = self.codes;
        let (weights, codes, zero_256ths) = match (kind, rounding) {
            (BlockKind::Intra, Rounding::Trellis { .. }) => (&self.intra, intra_codes, 128),
            // Add 3/8, as in ffmpeg and other encoders: this is near the centroid of a Laplacian interval.
            (BlockKind::Intra, Rounding::DeadZone) => (&self.intra, intra_codes, 96),
            // Do not round, because (2·QF+1)·quantiser_scale/2 is already in the middle of its interval. The zero interval is
            // twice as wide.
            (BlockKind::Inter, _) => (&self.inter, inter_codes, 0),
        };
        let mut levels = [0; 64];
        let zero = (zero_256ths << weights.shift) >> 8;
        let nonzero = kernel::divide(coefficients, &weights.reciprocal, zero, weights.shift, &mut levels);
        // The DC of an intra block is excluded.
        let nonzero = if kind == BlockKind::Intra { nonzero & !1 } else { nonzero };
        // Start from the error of an empty block and subtract the gain of each level.
        block.clear();
        block.error = energy;
        let restore = |place: usize, level: i32| self.inverse_quantise(level, kind, weights.scaled[place]);
        let level_max = self.standard.level_max();
        let mut save = |place: usize, i: usize, level: i32| {
            let coefficient = coefficients[i];
            let before = i64::from(coefficient.abs());
            let after = before - (i64::from(restore(place, level)) << dct::COEFFICIENT_BITS);
            block.error += after * after - before * before;
            block.levels[place] = if coefficient < 0 { -level as i16 } else { level as i16 };
            block.places |= 1 << place;
        };
        match rounding {
            _ if nonzero == 0 => {}
            Rounding::DeadZone => {
                for i in places(nonzero) {
                    save(self.places[i].into(), i, (levels[i] as i32).min(level_max));
                }
            }
            Rounding::Trellis { lambda } => {
                let mut found = 0u64;
                for i in places(nonzero) {
                    found |= 1 << self.places[i];
                }
                let candidates = places(found).map(|place| {
                    let i = self.scan[place];
                    (place, coefficients[i].abs(), (levels[i] as i32).min(level_max))
                });
                let save = |place: usize, level: i32| save(place, self.scan[place], level);
                trellis::choose(candidates, kind, BitPrice { codes, lambda }, restore, save);
            }
        }
        // The intra DC has its own step, independent of quantiser_scale (7.4.1).
        if kind == BlockKind::Intra {
            let step = self.intra_dc_mult << dct::COEFFICIENT_BITS;
            let level = ((coefficients[0] + step / 2) / step).clamp(0, self.intra_dc_max);
            block.error += i64::from(coefficients[0] - level * step).pow(2);
            block.levels[0] = level as i16;
            block.places |= 1;
        }
        block.bits = block_bits(codes, block, kind == BlockKind::Intra);
    }

    /// Returns whether the squared error of a non-intra block is less than this number of quarters of quantiser_scale².
    ///
    /// No coefficient exceeds the square root of the sum, and coefficients below quantiser_scale become zero. With
    /// [`CERTAIN`](Self::CERTAIN) quarters no level remains; the fourth quarter covers rounding.
    pub fn leaves_nothing(&self, squared_error: u32, quarters: i64) -> bool {
        4 * i64::from(squared_error) < quarters * i64::from(self.scale).pow(2)
    }

    /// Quarters for [`leaves_nothing`](Self::leaves_nothing) at which all levels are certain to be zero.
    pub const CERTAIN: i64 = 3;

    /// Returns the coefficients that a decoder restores (7.4): arithmetic, saturation, mismatch control.
    pub fn dequantise(&self, block: &Block, kind: BlockKind) -> [i32; 64] {
        let mut out = [0; 64];
        let mut sum = 0;
        let weights = if kind == BlockKind::Intra { &self.intra } else { &self.inter };
        for i in places(block.places) {
            let level = i32::from(block.levels[i]);
            let value = match (kind, i) {
                (BlockKind::Intra, 0) => self.intra_dc_mult * level, // 7.4.1
                _ => self.inverse_quantise(level, kind, weights.scaled[i]),
            };
            let value = value.clamp(-2048, 2047); // 7.4.3
            sum += value;
            out[self.scan[i]] = value;
        }
        if self.standard == Standard::Mpeg2 {
            odd_sum(&mut out, sum);
        }
        out
    }

    /// Restores one coefficient except the intra DC. In MPEG-1 even values are made odd, toward zero (11172-2, 2.4.4.1 and
    /// 2.4.4.2).
    #[inline]
    fn inverse_quantise(&self, level: i32, kind: BlockKind, scaled_weight: i32) -> i32 {
        let value = inverse_quantise(level, kind, scaled_weight);
        if self.standard == Standard::Mpeg1 && value & 1 == 0 { value - value.signum() } else { value }
    }
}

/// Applies mismatch control (7.4.4): inverts the last bit of F\[7\]\[7\] if the sum of all coefficients is even.
fn odd_sum(coefficients: &mut [i32; 64], sum: i32) {
    if sum & 1 == 0 {
        coefficients[63] += if coefficients[63] & 1 == 0 { 1 } else { -1 };
    }
}

/// Restores one coefficient (7.4.2.3) except the intra DC.
///
/// ```text
/// F'' = (2·QF + k) · W · quantiser_scale / 32      "/" truncates toward zero
///   QF  quantised level      W·quantiser_scale  scaled_weight
///   k   0 for intra blocks, Sign(QF) for non-intra
/// ```
#[inline]
fn inverse_quantise(level: i32, kind: BlockKind, scaled_weight: i32) -> i32 {
    let k = if kind == BlockKind::Intra { 0 } else { level.signum() };
    (2 * level + k) * scaled_weight / 32
}
