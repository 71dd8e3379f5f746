//! Sums of absolute transformed differences, which approximate coding cost.

use super::{
    ReferenceBlock,
    predicted::{BlockWork, predicted, whole},
};
use lanes::{Bytes, Choice, Differences, Kernel, Lanes, Samples, Window, Words};

/// Returns the sum of absolute transformed differences between N×N samples and their prediction; N is 8 or 16.
///
/// Each block of 8×8 differences is Hadamard transformed, and the sum of magnitudes is divided by eight. The single coefficient
/// of a flat difference d then counts 8·d. This roughly equals 64 plain differences spread over many coefficients.
#[inline]
pub(crate) fn transformed_difference<const N: usize>(source: ReferenceBlock, reference: ReferenceBlock) -> u32 {
    Choice::best().run(Transformed::<N> { source: &source, reference: &reference })
}

/// Scalar version of [`transformed_difference`].
#[cfg(test)]
pub(super) fn transformed_difference_plain<const N: usize>(source: ReferenceBlock, reference: ReferenceBlock) -> u32 {
    Choice::SCALAR.run(Transformed::<N> { source: &source, reference: &reference })
}

/// Kernel of [`transformed_difference`], with two blocks at a time if N is 16.
struct Transformed<'a, const N: usize> {
    source: &'a ReferenceBlock<'a>,
    reference: &'a ReferenceBlock<'a>,
}

impl<const N: usize> Kernel for Transformed<'_, N> {
    type Output = u32;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> u32 {
        if N == 8 {
            predicted::<8, 8, _>(self.reference, SingleBlock(whole(self.source)))
        } else {
            predicted::<16, 16, _>(self.reference, Macroblock(whole(self.source), lanes))
        }
    }
}

/// Work of a block: sums the transformed differences between one block and its prediction.
struct SingleBlock<'a>(Window<'a, 8, 8, false, false>);

impl BlockWork<8, 8> for SingleBlock<'_> {
    type Output = u32;

    #[inline(always)]
    fn on<const H: bool, const V: bool>(self, predicted: Window<'_, 8, 8, H, V>) -> u32 {
        let mut rows = [Words::zero(); 8];
        for i in 0..64 / Bytes::COUNT {
            [rows[2 * i], rows[2 * i + 1]] = self.0.group::<Bytes>(i).minus(predicted.group(i));
        }
        hadamard_sum(rows)
    }
}

/// Work of a macroblock: sums the transformed differences between four blocks and their prediction.
struct Macroblock<'a, L>(Window<'a, 16, 16, false, false>, L);

impl<L: Lanes> BlockWork<16, 16> for Macroblock<'_, L> {
    type Output = u32;

    #[inline(always)]
    fn on<const H: bool, const V: bool>(self, predicted: Window<'_, 16, 16, H, V>) -> u32 {
        let mut strips = [[L::Words::zero(); 8]; 2];
        for i in 0..256 / Bytes::COUNT {
            strips[i / 8][i % 8] = self.1.differences(self.0.group(i), predicted.group(i));
        }
        hadamard_sum(strips[0]) + hadamard_sum(strips[1])
    }
}

/// Returns an eighth of the sum of magnitudes of transformed differences, rounded for each block.
#[inline(always)]
fn hadamard_sum<W: Differences>(mut rows: [W; 8]) -> u32 {
    butterflies::<W, 4>(&mut rows);
    butterflies::<W, 2>(&mut rows);
    butterflies::<W, 1>(&mut rows);
    let mut columns = W::transposed(rows);
    butterflies::<W, 4>(&mut columns);
    butterflies::<W, 2>(&mut columns);
    // The last step is |x + y| + |x − y| = 2·max(|x|, |y|); four times this would exceed 16 bits.
    let [a, b, c, d, e, f, g, h] = columns;
    let upper = a.abs().max(b.abs()).plus(c.abs().max(d.abs())).sums();
    let lower = e.abs().max(f.abs()).plus(g.abs().max(h.abs())).sums();
    let eighth = |block: usize| (2 * (upper[block] + lower[block]) as u32 + 4) >> 3;
    eighth(0) + eighth(1)
}

/// Computes sums and differences of rows at this distance: one of the three stages of an eight-point Hadamard transform.
#[inline(always)]
fn butterflies<W: Differences, const DISTANCE: usize>(rows: &mut [W; 8]) {
    for k in 0..4 {
        // Row i is the first row of pair k; the second row follows at DISTANCE.
        let i = k / DISTANCE * 2 * DISTANCE + k % DISTANCE;
        (rows[i], rows[i + DISTANCE]) = (rows[i].plus(rows[i + DISTANCE]), rows[i].minus(rows[i + DISTANCE]));
    }
}
