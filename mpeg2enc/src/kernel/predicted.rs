//! The samples that half-sample prediction reads, checked once for a whole block.
//!
//! With a check for each row, plain differences take one and a half times as many instructions.
#![allow(unsafe_code, reason = "samples are read without a check for each")]

use super::{Place, lanes::Bytes};

/// Gives `each` the predicted samples of N rows of N (7.6.4), sixteen at a time: N is 8 or 16, and each group is one row of
/// 16 or two of 8.
#[inline(always)]
pub(super) fn for_predicted<const N: usize>(place: Place, each: impl FnMut(usize, Bytes)) {
    match place.half {
        (false, false) => for_predicted_at::<N, false, false>(place, each),
        (true, false) => for_predicted_at::<N, true, false>(place, each),
        (false, true) => for_predicted_at::<N, false, true>(place, each),
        (true, true) => for_predicted_at::<N, true, true>(place, each),
    }
}

/// For half positions to the right (`H`) and below (`V`).
#[inline(always)]
fn for_predicted_at<const N: usize, const H: bool, const V: bool>(place: Place, mut each: impl FnMut(usize, Bytes)) {
    assert!(N == 8 || N == 16);
    let stride = place.stride;
    // N rows, or one more, of which the last needs no more than N samples, or one more.
    let samples = &place.samples[..(N - 1 + usize::from(V)) * stride + N + usize::from(H)];
    // Sixteen samples of a row, or eight of each of two: `row` + 16/N is at most N, or one more, and `x` 0, or 1.
    let group = |row: usize, x: usize| {
        let first = row * stride + x;
        debug_assert!(first + (16 / N - 1) * stride + N <= samples.len());
        // SAFETY: the last of these samples is the last of `samples` at most.
        unsafe {
            if N == 16 {
                Bytes::load(&*samples.as_ptr().add(first).cast())
            } else {
                Bytes::new(*samples.as_ptr().add(first).cast(), *samples.as_ptr().add(first + stride).cast())
            }
        }
    };
    for i in 0..N * N / 16 {
        let row = i * 16 / N;
        let here = group(row, 0);
        each(
            i,
            match (H, V) {
                (false, false) => here,
                (true, false) => here.mean(group(row, 1)),
                (false, true) => here.mean(group(row + 1, 0)),
                (true, true) => Bytes::mean_of_four([here, group(row, 1), group(row + 1, 0), group(row + 1, 1)]),
            },
        );
    }
}
