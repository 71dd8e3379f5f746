//! Sums of absolute differences: what a search for vectors compares.

use super::{
    Place,
    lanes::{Differences, Words},
    predicted::for_both,
};
#[cfg(target_arch = "x86_64")]
use super::{has_avx2, predicted, wide};

/// Sum of absolute differences between N×N samples, at a whole position, and their prediction; N is 8 or 16.
#[inline]
#[allow(unsafe_code, reason = "a function with AVX2 is called after a check that the processor has it")]
pub(crate) fn absolute_difference<const N: usize>(source: Place, reference: Place) -> u32 {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2<const N: usize>(source: Place, reference: Place) -> u32 {
            if N == 8 {
                return absolute_difference_plain::<N>(source, reference);
            }
            // SAFETY: the processor has AVX2.
            unsafe { absolute_difference_wide(source, reference, wide::Words::zero()) }
        }
        if has_avx2() {
            // SAFETY: the processor has AVX2.
            return unsafe { avx2::<N>(source, reference) };
        }
    }
    absolute_difference_plain::<N>(source, reference)
}

/// [`absolute_difference`] of two rows of a macroblock at a time.
///
/// # Safety
/// The processor has AVX2.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
#[allow(unsafe_code, reason = "for processors with AVX2")]
unsafe fn absolute_difference_wide(source: Place, reference: Place, zero: wide::Words) -> u32 {
    let mut sums = zero;
    let add = |_, source: wide::Rows, predicted: wide::Rows| sums = sums.plus(source.difference(predicted));
    // SAFETY: the caller's.
    unsafe { predicted::for_both_groups::<16, 16, _>(source, reference, add) };
    sums.total()
}

/// [`absolute_difference`] for any processor.
#[inline(always)]
pub(super) fn absolute_difference_plain<const N: usize>(source: Place, reference: Place) -> u32 {
    let mut sums = Words::splat(0);
    for_both::<N>(source, reference, |_, source, predicted| sums = sums.plus(source.difference(predicted)));
    sums.dot(Words::splat(1)) as u32
}

/// Sums of absolute differences between N×N samples, at a whole position, and each of four predictions; N is 8 or 16.
///
/// The samples are read once, and the processor is asked once what it has: half of the time of four calls of
/// [`absolute_difference`].
#[inline]
#[allow(unsafe_code, reason = "a function with AVX2 is called after a check that the processor has it")]
pub(crate) fn absolute_differences<const N: usize>(source: Place, references: [Place; 4]) -> [u32; 4] {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2<const N: usize>(source: Place, references: [Place; 4]) -> [u32; 4] {
            if N == 8 {
                return references.map(|reference| absolute_difference_plain::<N>(source, reference));
            }
            // SAFETY: the processor has AVX2.
            unsafe { absolute_differences_wide(source, references, wide::Words::zero()) }
        }
        if has_avx2() {
            // SAFETY: the processor has AVX2.
            return unsafe { avx2::<N>(source, references) };
        }
    }
    references.map(|reference| absolute_difference_plain::<N>(source, reference))
}

/// [`absolute_differences`] of a macroblock, which stays in eight registers.
///
/// # Safety
/// The processor has AVX2.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
#[allow(unsafe_code, reason = "for processors with AVX2")]
unsafe fn absolute_differences_wide(source: Place, references: [Place; 4], zero: wide::Words) -> [u32; 4] {
    // SAFETY: the caller's.
    let rows: [wide::Rows; 8] = unsafe { predicted::rows(source) };
    let mut out = [0; 4];
    for (reference, out) in references.iter().zip(&mut out) {
        let mut sums = zero;
        let add = |i: usize, predicted: wide::Rows| sums = sums.plus(rows[i].difference(predicted));
        // SAFETY: the caller's.
        unsafe { predicted::for_predicted_groups::<16, 16, _>(*reference, add) };
        *out = sums.total();
    }
    out
}
