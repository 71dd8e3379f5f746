//! Predictions put where they will be shown, with the errors that they leave.
#![allow(
    unsafe_code,
    reason = "samples are read and written without a check for each, with the instructions there are"
)]

use super::{
    Place,
    lanes::{Bytes, Sums},
    predicted::{Group, Predicted},
};
#[cfg(target_arch = "x86_64")]
use super::{has_avx2, wide};

/// W rows of W predicted samples (7.6.4), put where `out` begins and `stride` apart, and the squared errors of their blocks
/// of 8×8, upper before lower, against the source at a whole position; W is 16, or 8 for a single block.
#[inline]
pub(crate) fn predict_onto<const W: usize>(source: Place, reference: Place, out: &mut [u8], stride: usize) -> [u32; 4] {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2<const W: usize>(source: Place, reference: Place, out: &mut [u8], stride: usize) -> [u32; 4] {
            // SAFETY: the processor has AVX2.
            unsafe { onto::<W, wide::Rows>(source, reference, out, stride, wide::Squares::zero()) }
        }
        if has_avx2() {
            // SAFETY: the processor has AVX2.
            return unsafe { avx2::<W>(source, reference, out, stride) };
        }
    }
    predict_onto_plain::<W>(source, reference, out, stride)
}

/// [`predict_onto`] for any processor.
pub(super) fn predict_onto_plain<const W: usize>(
    source: Place,
    reference: Place,
    out: &mut [u8],
    stride: usize,
) -> [u32; 4] {
    // SAFETY: every processor has what `Bytes` needs.
    unsafe { onto::<W, Bytes>(source, reference, out, stride, Sums::zero()) }
}

/// Samples of which squared differences can be taken.
pub(super) trait Squared: Group {
    /// Several sums beside each other.
    type Sums: Copy;

    /// Squared differences: of the first eight samples of each sixteen, and of the last.
    fn squares(self, other: Self) -> [Self::Sums; 2];

    /// Each sum and its counterpart together.
    fn plus(a: Self::Sums, b: Self::Sums) -> Self::Sums;

    /// All sums together, of each.
    fn totals(sums: [Self::Sums; 4]) -> [u32; 4];
}

impl Squared for Bytes {
    type Sums = Sums;

    #[inline(always)]
    fn squares(self, other: Self) -> [Sums; 2] {
        let [first, last] = self.minus(other);
        [first.squares(), last.squares()]
    }

    #[inline(always)]
    fn plus(a: Sums, b: Sums) -> Sums {
        a.plus(b)
    }

    #[inline(always)]
    fn totals([a, b, c, d]: [Sums; 4]) -> [u32; 4] {
        [a.total(), b.total(), c.total(), d.total()]
    }
}

#[cfg(target_arch = "x86_64")]
impl Squared for wide::Rows {
    type Sums = wide::Squares;

    #[inline(always)]
    fn squares(self, other: Self) -> [wide::Squares; 2] {
        self.squares(other)
    }

    #[inline(always)]
    fn plus(a: wide::Squares, b: wide::Squares) -> wide::Squares {
        a.plus(b)
    }

    #[inline(always)]
    fn totals(sums: [wide::Squares; 4]) -> [u32; 4] {
        wide::Squares::totals(sums)
    }
}

/// [`predict_onto`] in groups of any kind.
///
/// # Safety
/// The processor has the instructions for them.
#[inline(always)]
unsafe fn onto<const W: usize, G: Squared>(
    source: Place,
    reference: Place,
    out: &mut [u8],
    stride: usize,
    zero: G::Sums,
) -> [u32; 4] {
    // SAFETY: the caller's.
    unsafe {
        match reference.half {
            (false, false) => onto_at::<W, false, false, G>(source, reference, out, stride, zero),
            (true, false) => onto_at::<W, true, false, G>(source, reference, out, stride, zero),
            (false, true) => onto_at::<W, false, true, G>(source, reference, out, stride, zero),
            (true, true) => onto_at::<W, true, true, G>(source, reference, out, stride, zero),
        }
    }
}

/// For half positions to the right (`H`) and below (`V`).
#[inline(always)]
unsafe fn onto_at<const W: usize, const H: bool, const V: bool, G: Squared>(
    source: Place,
    reference: Place,
    out: &mut [u8],
    stride: usize,
    zero: G::Sums,
) -> [u32; 4] {
    debug_assert!(source.half == (false, false));
    let (source, predicted) = (Predicted::<W, W, false, false>::new(source), Predicted::<W, W, H, V>::new(reference));
    let out = &mut out[..(W - 1) * stride + W];
    let mut sums = [zero; 4];
    for strip in 0..W / 8 {
        let groups = 8 * W / G::SAMPLES;
        let (mut left, mut right) = (zero, zero);
        for i in strip * groups..(strip + 1) * groups {
            let first = i * G::SAMPLES / W * stride;
            debug_assert!(first + (G::SAMPLES / W - 1) * stride + W <= out.len());
            // SAFETY: there are so many groups, and the last sample of the last row is the last of `out`; the rest is the
            // caller's.
            let (source, predicted) = unsafe {
                let predicted: G = predicted.group(i);
                predicted.store::<W>(out.as_mut_ptr().add(first), stride);
                (source.group::<G>(i), predicted)
            };
            let [a, b] = source.squares(predicted);
            (left, right) = (G::plus(left, a), G::plus(right, b));
        }
        // Rows of eight take turns.
        (sums[2 * strip], sums[2 * strip + 1]) = if W == 16 { (left, right) } else { (G::plus(left, right), zero) };
    }
    G::totals(sums)
}
