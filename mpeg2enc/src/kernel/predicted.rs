//! Predictions with half positions as compile-time constants.

use super::ReferenceBlock;
use lanes::{Bytes, Samples, Window};

/// Work on R rows of N predicted samples.
pub(super) trait BlockWork<const N: usize, const R: usize> {
    /// Result of the work.
    type Output;

    /// Processes the prediction, with half positions to the right (`H`) and below (`V`).
    fn on<const H: bool, const V: bool>(self, predicted: Window<'_, N, R, H, V>) -> Self::Output;
}

/// Applies `work` to the prediction at `place`.
#[inline(always)]
pub(super) fn predicted<const N: usize, const R: usize, W: BlockWork<N, R>>(
    place: &ReferenceBlock,
    work: W,
) -> W::Output {
    let ReferenceBlock { samples, stride, half } = *place;
    match half {
        (false, false) => work.on(Window::<N, R, false, false>::new(samples, stride)),
        (true, false) => work.on(Window::<N, R, true, false>::new(samples, stride)),
        (false, true) => work.on(Window::<N, R, false, true>::new(samples, stride)),
        (true, true) => work.on(Window::<N, R, true, true>::new(samples, stride)),
    }
}

/// Returns R rows of N samples at a whole position.
#[inline(always)]
pub(super) fn whole<'a, const N: usize, const R: usize>(source: &ReferenceBlock<'a>) -> Window<'a, N, R, false, false> {
    debug_assert!(source.half == (false, false));
    Window::new(source.samples, source.stride)
}

/// Calls `each` with groups of the predicted samples of N rows of N (7.6.4), starting at the upper left; N is 8 or 16.
#[inline(always)]
pub(super) fn for_predicted<const N: usize>(place: &ReferenceBlock, each: impl FnMut(usize, Bytes)) {
    struct Each<F>(F);

    impl<const N: usize, F: FnMut(usize, Bytes)> BlockWork<N, N> for Each<F> {
        type Output = ();

        #[inline(always)]
        fn on<const H: bool, const V: bool>(mut self, predicted: Window<'_, N, N, H, V>) {
            for i in 0..N * N / Bytes::COUNT {
                (self.0)(i, predicted.group(i));
            }
        }
    }

    predicted::<N, N, _>(place, Each(each));
}
