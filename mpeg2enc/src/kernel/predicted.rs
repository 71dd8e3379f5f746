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
    unsafe { for_predicted_groups::<N, Bytes>(place, each) }
}

/// The same in groups of any kind.
///
/// # Safety
/// The processor has the instructions for them.
#[inline(always)]
pub(super) unsafe fn for_predicted_groups<const N: usize, G: Group>(place: Place, each: impl FnMut(usize, G)) {
    // SAFETY: the caller's.
    unsafe {
        match place.half {
            (false, false) => for_predicted_at::<N, false, false, G>(place, each),
            (true, false) => for_predicted_at::<N, true, false, G>(place, each),
            (false, true) => for_predicted_at::<N, false, true, G>(place, each),
            (true, true) => for_predicted_at::<N, true, true, G>(place, each),
        }
    }
}

/// For half positions to the right (`H`) and below (`V`).
#[inline(always)]
unsafe fn for_predicted_at<const N: usize, const H: bool, const V: bool, G: Group>(
    place: Place,
    mut each: impl FnMut(usize, G),
) {
    const { assert!(N == 8 || N == 16) };
    let stride = place.stride;
    // N rows, or one more, of which the last needs no more than N samples, or one more.
    let samples = &place.samples[..(N - 1 + usize::from(V)) * stride + N + usize::from(H)];
    // The last row of a group is the last of all at most, or one more, and `x` is 0, or 1.
    let group = |row: usize, x: usize| {
        let first = row * stride + x;
        debug_assert!(first + (G::SAMPLES / N - 1) * stride + N <= samples.len());
        // SAFETY: the last of these samples is the last of `samples` at most; the rest is the caller's.
        unsafe { G::load::<N>(samples.as_ptr().add(first), stride) }
    };
    for i in 0..N * N / G::SAMPLES {
        let row = i * G::SAMPLES / N;
        let here = group(row, 0);
        each(
            i,
            match (H, V) {
                (false, false) => here,
                (true, false) => here.mean(group(row, 1)),
                (false, true) => here.mean(group(row + 1, 0)),
                (true, true) => G::mean_of_four([here, group(row, 1), group(row + 1, 0), group(row + 1, 1)]),
            },
        );
    }
}
