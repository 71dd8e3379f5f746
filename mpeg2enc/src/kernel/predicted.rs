//! The samples that half-sample prediction reads, checked once for a whole block.
//!
//! With a check for each row, plain differences take one and a half times as many instructions.
#![allow(unsafe_code, reason = "samples are read without a check for each")]

use super::{Place, lanes::Bytes};

/// Samples that go through the instructions together: a row of a block, or several.
pub(super) trait Group: Copy {
    /// How many.
    const SAMPLES: usize;

    /// Rows of N samples that begin `stride` apart, as many as make a group.
    ///
    /// # Safety
    /// They are there, and the processor has the instructions for them.
    unsafe fn load<const N: usize>(first: *const u8, stride: usize) -> Self;

    /// Puts them where they would be loaded from.
    ///
    /// # Safety
    /// There is room for them, and the processor has the instructions.
    unsafe fn store<const N: usize>(self, first: *mut u8, stride: usize);

    /// (a + b + 1) / 2 of every pair.
    fn mean(self, other: Self) -> Self;

    /// (a + b + c + d + 2) / 4.
    fn mean_of_four(groups: [Self; 4]) -> Self;
}

impl Group for Bytes {
    const SAMPLES: usize = 16;

    #[inline(always)]
    unsafe fn load<const N: usize>(first: *const u8, stride: usize) -> Self {
        // SAFETY: the caller's.
        unsafe {
            if N == 16 { Self::load(&*first.cast()) } else { Self::new(*first.cast(), *first.add(stride).cast()) }
        }
    }

    #[inline(always)]
    unsafe fn store<const N: usize>(self, first: *mut u8, stride: usize) {
        let [low, high] = self.halves();
        // SAFETY: the caller's.
        unsafe {
            *first.cast() = low;
            *first.add(if N == 16 { 8 } else { stride }).cast() = high;
        }
    }

    #[inline(always)]
    fn mean(self, other: Self) -> Self {
        self.mean(other)
    }

    #[inline(always)]
    fn mean_of_four(groups: [Self; 4]) -> Self {
        Self::mean_of_four(groups)
    }
}

/// Gives `each` the predicted samples of N rows of N (7.6.4), in groups from the upper left on; N is 8 or 16.
#[inline(always)]
pub(super) fn for_predicted<const N: usize>(place: Place, each: impl FnMut(usize, Bytes)) {
    // SAFETY: every processor has what `Bytes` needs.
    unsafe { for_predicted_groups::<N, N, Bytes>(place, each) }
}

/// Gives `each` the samples of N rows of N of a source, at a whole position, and their prediction.
#[inline(always)]
pub(super) fn for_both<const N: usize>(source: Place, reference: Place, each: impl FnMut(usize, Bytes, Bytes)) {
    // SAFETY: every processor has what `Bytes` needs.
    unsafe { for_both_groups::<N, N, Bytes>(source, reference, each) }
}

/// R rows of a source and their prediction in groups of any kind.
///
/// # Safety
/// The processor has the instructions for them.
#[inline(always)]
pub(super) unsafe fn for_both_groups<const N: usize, const R: usize, G: Group>(
    source: Place,
    reference: Place,
    mut each: impl FnMut(usize, G, G),
) {
    debug_assert!(source.half == (false, false));
    let samples = &source.samples[..(R - 1) * source.stride + N];
    let both = |i: usize, predicted: G| {
        let first = i * G::SAMPLES / N * source.stride;
        debug_assert!(first + (G::SAMPLES / N - 1) * source.stride + N <= samples.len());
        // SAFETY: the last sample of the last row is the last of `samples`; the rest is the caller's.
        each(i, unsafe { G::load::<N>(samples.as_ptr().add(first), source.stride) }, predicted);
    };
    // SAFETY: the caller's.
    unsafe { for_predicted_groups::<N, R, G>(reference, both) }
}

/// The samples of a macroblock at a whole position, in groups of two rows.
///
/// # Safety
/// The processor has the instructions for them.
#[inline(always)]
pub(super) unsafe fn rows<G: Group>(source: Place) -> [G; 8] {
    const { assert!(G::SAMPLES == 32) };
    debug_assert!(source.half == (false, false));
    let samples = &source.samples[..15 * source.stride + 16];
    // SAFETY: the last sample of the last row is the last of `samples`; the rest is the caller's.
    std::array::from_fn(|i| unsafe { G::load::<16>(samples.as_ptr().add(2 * i * source.stride), source.stride) })
}

/// R rows of N predicted samples in groups of any kind.
///
/// # Safety
/// The processor has the instructions for them.
#[inline(always)]
pub(super) unsafe fn for_predicted_groups<const N: usize, const R: usize, G: Group>(
    place: Place,
    each: impl FnMut(usize, G),
) {
    // SAFETY: the caller's.
    unsafe {
        match place.half {
            (false, false) => for_predicted_at::<N, R, false, false, G>(place, each),
            (true, false) => for_predicted_at::<N, R, true, false, G>(place, each),
            (false, true) => for_predicted_at::<N, R, false, true, G>(place, each),
            (true, true) => for_predicted_at::<N, R, true, true, G>(place, each),
        }
    }
}

/// For half positions to the right (`H`) and below (`V`).
#[inline(always)]
unsafe fn for_predicted_at<const N: usize, const R: usize, const H: bool, const V: bool, G: Group>(
    place: Place,
    mut each: impl FnMut(usize, G),
) {
    let predicted = Predicted::<N, R, H, V>::new(place);
    for i in 0..R * N / G::SAMPLES {
        // SAFETY: `i` is less than the number of groups; the rest is the caller's.
        each(i, unsafe { predicted.group(i) });
    }
}

/// R rows of N predicted samples, at half positions to the right (`H`) and below (`V`).
pub(super) struct Predicted<'a, const N: usize, const R: usize, const H: bool, const V: bool> {
    samples: &'a [u8],
    stride: usize,
}

impl<'a, const N: usize, const R: usize, const H: bool, const V: bool> Predicted<'a, N, R, H, V> {
    #[inline(always)]
    pub fn new(place: Place<'a>) -> Self {
        // R rows, or one more, of which the last needs no more than N samples, or one more.
        let samples = &place.samples[..(R - 1 + usize::from(V)) * place.stride + N + usize::from(H)];
        Self { samples, stride: place.stride }
    }

    /// Group number `i`, from the upper left on.
    ///
    /// # Safety
    /// There is such a group, and the processor has the instructions for it.
    #[inline(always)]
    pub unsafe fn group<G: Group>(&self, i: usize) -> G {
        const { assert!((N == 8 || N == 16) && (R * N).is_multiple_of(G::SAMPLES)) };
        debug_assert!(i < R * N / G::SAMPLES);
        // The last row of a group is the last of all at most, or one more, and `x` is 0, or 1.
        let group = |row: usize, x: usize| {
            let first = row * self.stride + x;
            debug_assert!(first + (G::SAMPLES / N - 1) * self.stride + N <= self.samples.len());
            // SAFETY: the last of these samples is the last of `samples` at most; the rest is the caller's.
            unsafe { G::load::<N>(self.samples.as_ptr().add(first), self.stride) }
        };
        let row = i * G::SAMPLES / N;
        let here = group(row, 0);
        match (H, V) {
            (false, false) => here,
            (true, false) => here.mean(group(row, 1)),
            (false, true) => here.mean(group(row + 1, 0)),
            (true, true) => G::mean_of_four([here, group(row, 1), group(row + 1, 0), group(row + 1, 1)]),
        }
    }
}
