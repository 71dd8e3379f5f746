//! Quantises a predicted block by rounding and restores its coefficients, in one step.
//!
//! All coefficients are processed together, including zero levels. [`quantise`](Quantiser::quantise) and
//! [`dequantise`](Quantiser::dequantise) process single levels; tests compare the two.

use super::{Block, BlockKind, Quantiser, Rounding, Transformed, odd_sum, places};
use crate::{Standard, kernel, vlc::block_bits};

impl Quantiser {
    /// Combines [`quantise`](Self::quantise) of a non-intra block with [`dequantise`](Self::dequantise), which writes
    /// `restored`. `restored` is undefined if no level is coded.
    pub fn quantise_predicted(
        &self,
        transformed: Transformed,
        rounding: Rounding,
        block: &mut Block,
        restored: &mut [i32; 64],
    ) {
        let Transformed { coefficients, energy } = transformed;
        // Only rounding in MPEG-2 has a kernel for whole blocks.
        if rounding != Rounding::DeadZone || self.standard != Standard::Mpeg2 {
            self.quantise(transformed, BlockKind::Inter, rounding, block);
            if block.is_coded() {
                *restored = self.dequantise(block, BlockKind::Inter);
            }
            return;
        }
        block.clear();
        block.error = energy;
        let mut levels = [0; 64];
        let nonzero = kernel::divide(coefficients, &self.inter.reciprocal, 0, self.inter.shift, &mut levels);
        if nonzero == 0 {
            return;
        }
        // Mismatch control affects the restored coefficients, not the levels.
        let (change, sum) = kernel::restore(coefficients, &self.inter.turned, &mut levels, restored);
        odd_sum(restored, sum);
        block.error += i64::from(change);
        // Store the signed levels in transmission order.
        for i in places(nonzero) {
            let (place, level) = (self.places[i], levels[i] as i16);
            block.levels[usize::from(place)] = if coefficients[i] < 0 { -level } else { level };
            block.places |= 1 << place;
        }
        block.bits = block_bits(self.codes[1], block, false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{dct, quant::QuantiserParameters, vlc::CoefficientTable};
    use plane::matrices::DEFAULT_INTRA_MATRIX;

    /// Returns the coefficients of random differences; they decrease with frequency unless `flat`.
    fn coefficients(state: &mut u32, flat: bool) -> [i32; 64] {
        let mut random = || {
            *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (*state >> 16) as i32
        };
        let amplitude = 1 + random() % 255;
        let source: [u8; 64] = std::array::from_fn(|i| {
            let slope = (i % 8 * 9 + i / 8 * 23) as i32;
            let noise = random() % amplitude;
            if flat { noise as u8 } else { (slope + noise / 8).clamp(0, 255) as u8 }
        });
        dct::forward_difference(&source, &[if flat { 0 } else { 128 }; 64])
    }

    #[test]
    fn at_once_gives_what_level_by_level_does() {
        let mut state = 5;
        for standard in [Standard::Mpeg1, Standard::Mpeg2] {
            for (scale, matrix) in
                [(1, [1; 64]), (2, [16; 64]), (16, std::array::from_fn(|i| 16 + i as u8)), (112, [255; 64])]
            {
                for alternate_scan in [false, true] {
                    let quantiser = Quantiser::new(
                        scale,
                        &QuantiserParameters {
                            standard,
                            q_scale_type: true,
                            intra_dc_precision: 8,
                            alternate_scan,
                            intra_table: CoefficientTable::Zero,
                            intra_matrix: DEFAULT_INTRA_MATRIX,
                            non_intra_matrix: matrix,
                        },
                    );
                    // Compare both implementations with dense and sparse coefficients.
                    for case in 0..200 {
                        let coefficients = coefficients(&mut state, case % 2 == 0);
                        let energy = coefficients.iter().map(|&c| i64::from(c).pow(2)).sum();
                        let (mut ours, mut twin, mut restored) = (Block::EMPTY, Block::EMPTY, [0; 64]);
                        let transformed = Transformed { coefficients: &coefficients, energy };
                        quantiser.quantise_predicted(transformed, Rounding::DeadZone, &mut ours, &mut restored);
                        quantiser.quantise(transformed, BlockKind::Inter, Rounding::DeadZone, &mut twin);
                        assert_eq!((ours.places, ours.bits, ours.error), (twin.places, twin.bits, twin.error));
                        assert!(places(ours.places).all(|place| ours.levels[place] == twin.levels[place]));
                        assert!(!ours.is_coded() || restored == quantiser.dequantise(&twin, BlockKind::Inter));
                    }
                }
            }
        }
    }
}
