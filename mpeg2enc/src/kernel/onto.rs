//! Predictions written to their final position, and the errors of these predictions.

use super::{
    ReferenceBlock,
    predicted::{BlockWork, predicted, whole},
};
use lanes::{Choice, Kernel, Lanes, Samples, Sum, Window, WindowMut};
use std::marker::PhantomData;

/// Predicts W rows of W samples (7.6.4) to the start of `out`, with rows `stride` apart. Returns the squared errors of its 8×8
/// blocks against the source at a whole position, in the order upper, lower. W is 16, or 8 for a single block.
#[inline]
pub(crate) fn predict_onto<const W: usize>(
    source: ReferenceBlock,
    reference: ReferenceBlock,
    out: &mut [u8],
    stride: usize,
) -> [u32; 4] {
    Choice::best().run(Onto::<W> { source: &source, reference: &reference, out, stride })
}

/// Scalar version of [`predict_onto`].
#[cfg(test)]
pub(super) fn predict_onto_plain<const W: usize>(
    source: ReferenceBlock,
    reference: ReferenceBlock,
    out: &mut [u8],
    stride: usize,
) -> [u32; 4] {
    Choice::SCALAR.run(Onto::<W> { source: &source, reference: &reference, out, stride })
}

/// Kernel of [`predict_onto`].
struct Onto<'a, const W: usize> {
    source: &'a ReferenceBlock<'a>,
    reference: &'a ReferenceBlock<'a>,
    out: &'a mut [u8],
    stride: usize,
}

impl<const W: usize> Kernel for Onto<'_, W> {
    type Output = [u32; 4];

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> [u32; 4] {
        let (source, out) = (whole(self.source), WindowMut::new(self.out, self.stride));
        predicted(self.reference, Copied::<W, L::Samples> { source, out, samples: PhantomData })
    }
}

/// Work that copies a prediction and sums its squared errors.
struct Copied<'a, const W: usize, S> {
    source: Window<'a, W, W, false, false>,
    out: WindowMut<'a, W, W>,
    samples: PhantomData<S>,
}

impl<const W: usize, S: Samples> BlockWork<W, W> for Copied<'_, W, S> {
    type Output = [u32; 4];

    #[inline(always)]
    fn on<const H: bool, const V: bool>(mut self, predicted: Window<'_, W, W, H, V>) -> [u32; 4] {
        let zero = S::Squared::zero();
        let mut sums = [zero; 4];
        for strip in 0..W / 8 {
            let groups = 8 * W / S::COUNT;
            let (mut left, mut right) = (zero, zero);
            for i in strip * groups..(strip + 1) * groups {
                let predicted: S = predicted.group(i);
                self.out.set_group(i, predicted);
                let [a, b] = self.source.group::<S>(i).squared(predicted);
                (left, right) = (left.plus(a), right.plus(b));
            }
            // In 8-sample rows, `left` and `right` contain alternate rows, so add them.
            (sums[2 * strip], sums[2 * strip + 1]) = if W == 16 { (left, right) } else { (left.plus(right), zero) };
        }
        Sum::totals(sums)
    }
}
