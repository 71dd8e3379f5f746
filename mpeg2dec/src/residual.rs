//! Inverse transform of blocks, onto the samples of a macroblock.

use crate::{coefficients::Coefficients, predict::MacroblockBuffer};
use mpeg2::inverse_onto;

/// Position of an 8×8 block in a macroblock buffer.
#[derive(Clone, Copy)]
pub(crate) struct BlockSlot {
    start: usize,
    stride: usize,
}

impl BlockSlot {
    /// Returns the position of block `i` (Figures 6-10 to 6-12). `by_field` is dct_type.
    #[inline]
    pub fn new(buffer: &MacroblockBuffer, i: usize, by_field: bool) -> Self {
        let (component, column, row) = match i {
            0..4 => (0, i & 1, i >> 1),
            _ => (1 + (i & 1), i >> 3, (i >> 1) & 1),
        };
        let plane = buffer.plane(component);
        let (first, step) = match row {
            // A chroma block of 4:2:0 contains lines of both fields.
            _ if plane.height == 8 => (0, 1),
            row if by_field => (row, 2),
            row => (8 * row, 1),
        };
        Self { start: plane.start + first * plane.width + 8 * column, stride: plane.width * step }
    }

    /// Adds the transformed coefficients to the samples, or replaces the samples of an intra block.
    #[inline]
    pub fn add(self, coefficients: &Coefficients, is_intra: bool, buffer: &mut MacroblockBuffer) {
        let samples = &mut buffer.samples[self.start..][..7 * self.stride + 8];
        if let Some(mean) = flat_value(coefficients) {
            for row in samples.chunks_mut(self.stride) {
                for sample in &mut row[..8] {
                    let predicted = if is_intra { 0 } else { i32::from(*sample) };
                    *sample = (predicted + mean).clamp(0, 255) as u8;
                }
            }
            return;
        }
        let (mut predicted, mut out) = ([0; 64], [0; 64]);
        if !is_intra {
            for (to, from) in predicted.chunks_exact_mut(8).zip(samples.chunks(self.stride)) {
                to.copy_from_slice(&from[..8]);
            }
        }
        inverse_onto(&coefficients.values, &predicted, &mut out);
        for (from, to) in out.chunks_exact(8).zip(samples.chunks_mut(self.stride)) {
            to[..8].copy_from_slice(from);
        }
    }
}

/// Returns the value of all samples of the transform if they are certainly equal: only the DC is not zero, apart from mismatch
/// control.
///
/// The last coefficient changes samples by less than 0.241. It has no effect if the DC, in eighths, is at most 1/4 away from an
/// integer. Without it only one half is ambiguous.
#[inline]
fn flat_value(coefficients: &Coefficients) -> Option<i32> {
    let dc = coefficients.values[0];
    let is_certain = if coefficients.values[63] == 0 { dc & 7 != 4 } else { !(3..=5).contains(&(dc & 7)) };
    (!coefficients.has_ac && is_certain).then_some((dc + 4) >> 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_blocks_equal_the_transform() {
        for last in [0, 1] {
            for dc in -2048..2048 {
                let mut coefficients = Coefficients::ZERO;
                (coefficients.values[0], coefficients.values[63]) = (dc, last);
                let Some(value) = flat_value(&coefficients) else { continue };
                for predicted in [0, 100, 255] {
                    let mut out = [0; 64];
                    inverse_onto(&coefficients.values, &[predicted; 64], &mut out);
                    assert_eq!(out, [(i32::from(predicted) + value).clamp(0, 255) as u8; 64], "{dc} {last}");
                }
            }
        }
    }
}
