//! Sums of absolute differences, for vector searches.

use super::{
    ReferenceBlock,
    predicted::{BlockWork, predicted, whole},
};
use lanes::{Bytes, Choice, Kernel, Lanes, Samples, Sum, Window};
use std::marker::PhantomData;

/// Returns the sum of absolute differences between N×N samples at a whole position and their prediction; N is 8 or 16.
#[inline]
pub(crate) fn absolute_difference<const N: usize>(source: ReferenceBlock, reference: ReferenceBlock) -> u32 {
    Choice::best().run(One::<N> { source: &source, reference: &reference })
}

/// Scalar version of [`absolute_difference`].
#[cfg(test)]
pub(super) fn absolute_difference_plain<const N: usize>(source: ReferenceBlock, reference: ReferenceBlock) -> u32 {
    Choice::SCALAR.run(One::<N> { source: &source, reference: &reference })
}

/// Returns the sums of absolute differences between N×N samples at a whole position and each of four predictions; N is 8 or 16.
///
/// The source samples are read once and the instruction set is chosen once. This takes half the time of four calls of
/// [`absolute_difference`].
#[inline]
pub(crate) fn absolute_differences<const N: usize>(
    source: ReferenceBlock,
    references: [ReferenceBlock; 4],
) -> [u32; 4] {
    Choice::best().run(Four::<N> { source: &source, references: &references })
}

/// Kernel of [`absolute_difference`]. A block of 8×8 is too small to benefit from longer registers.
struct One<'a, const N: usize> {
    source: &'a ReferenceBlock<'a>,
    reference: &'a ReferenceBlock<'a>,
}

impl<const N: usize> Kernel for One<'_, N> {
    type Output = u32;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> u32 {
        let source = whole::<N, N>(self.source);
        if N == 8 {
            predicted::<N, N, _>(self.reference, ToWindow::<N, Bytes>(source, PhantomData))
        } else {
            predicted::<N, N, _>(self.reference, ToWindow::<N, L::Samples>(source, PhantomData))
        }
    }
}

/// Kernel of [`absolute_differences`].
struct Four<'a, const N: usize> {
    source: &'a ReferenceBlock<'a>,
    references: &'a [ReferenceBlock<'a>; 4],
}

impl<const N: usize> Kernel for Four<'_, N> {
    type Output = [u32; 4];

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> [u32; 4] {
        if N == 8 { four::<N, Bytes>(self) } else { four::<N, L::Samples>(self) }
    }
}

/// Returns the sums of absolute differences of [`Four`]. A source of eight groups stays in registers.
#[inline(always)]
fn four<const N: usize, S: Samples>(Four { source, references }: Four<'_, N>) -> [u32; 4] {
    let source = whole::<N, N>(source);
    let mut groups = [source.group::<S>(0); 16];
    for (i, group) in groups.iter_mut().enumerate().take(N * N / S::COUNT) {
        *group = source.group(i);
    }
    let mut sums = [0; 4];
    for (sum, reference) in sums.iter_mut().zip(references) {
        *sum = predicted::<N, N, _>(reference, ToGroups(&groups));
    }
    sums
}

/// Work that sums absolute differences between the prediction and samples in memory.
struct ToWindow<'a, const N: usize, S>(Window<'a, N, N, false, false>, PhantomData<S>);

impl<const N: usize, S: Samples> BlockWork<N, N> for ToWindow<'_, N, S> {
    type Output = u32;

    #[inline(always)]
    fn on<const H: bool, const V: bool>(self, predicted: Window<'_, N, N, H, V>) -> u32 {
        let mut sum = S::Absolute::zero();
        for i in 0..N * N / S::COUNT {
            sum = sum.plus(self.0.group::<S>(i).absolute(predicted.group(i)));
        }
        sum.total()
    }
}

/// Work that sums absolute differences between the prediction and groups of samples.
struct ToGroups<'a, S>(&'a [S; 16]);

impl<const N: usize, S: Samples> BlockWork<N, N> for ToGroups<'_, S> {
    type Output = u32;

    #[inline(always)]
    fn on<const H: bool, const V: bool>(self, predicted: Window<'_, N, N, H, V>) -> u32 {
        let mut sum = S::Absolute::zero();
        for i in 0..N * N / S::COUNT {
            sum = sum.plus(self.0[i].absolute(predicted.group(i)));
        }
        sum.total()
    }
}
