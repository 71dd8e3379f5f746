//! Two rows of samples, and rows of differences of two blocks beside each other, by instructions of AVX2.
#![allow(unsafe_code, reason = "vector instructions may only run where the processor has them")]

use super::{
    lanes::{Bytes, Differences},
    predicted::Group,
};
use std::arch::x86_64::*;

/// All instructions of this module go through here.
macro_rules! avx2 {
    ($($body:tt)*) => {
        // SAFETY: a value of `Words` or `Rows` exists only where the processor has AVX2, and no instruction here touches
        // memory but what it is given.
        unsafe { $($body)* }
    };
}

/// Sixteen numbers of 16 bits, with sign: eight of each block.
#[derive(Clone, Copy)]
pub(super) struct Words(__m256i);

impl Words {
    /// All zero.
    ///
    /// # Safety
    /// The processor has AVX2.
    #[inline(always)]
    pub unsafe fn zero() -> Self {
        avx2! { Self(_mm256_setzero_si256()) }
    }

    /// `self` when sixteen samples and what is taken from them are put in.
    #[inline(always)]
    pub fn of(self, samples: Bytes, minus: Bytes) -> Self {
        avx2! { Self(_mm256_sub_epi16(_mm256_cvtepu8_epi16(samples.0), _mm256_cvtepu8_epi16(minus.0))) }
    }
}

/// Two rows of sixteen samples.
#[derive(Clone, Copy)]
pub(super) struct Rows(__m256i);

impl Rows {
    /// Sums of absolute differences, spread over the lanes somehow: eight of them together do not overflow.
    #[inline(always)]
    pub fn difference(self, other: Self) -> Words {
        avx2! { Words(_mm256_sad_epu8(self.0, other.0)) }
    }
}

impl Group for Rows {
    const SAMPLES: usize = 32;

    #[inline(always)]
    unsafe fn load<const N: usize>(first: *const u8, stride: usize) -> Self {
        const { assert!(N == 16) };
        // SAFETY: the caller's.
        unsafe { Self(_mm256_loadu2_m128i(first.add(stride).cast(), first.cast())) }
    }

    #[inline(always)]
    unsafe fn store<const N: usize>(self, first: *mut u8, stride: usize) {
        const { assert!(N == 16) };
        // SAFETY: the caller's.
        unsafe { _mm256_storeu2_m128i(first.add(stride).cast(), first.cast(), self.0) }
    }

    #[inline(always)]
    fn mean(self, other: Self) -> Self {
        avx2! { Self(_mm256_avg_epu8(self.0, other.0)) }
    }

    #[inline(always)]
    fn mean_of_four([a, b, c, d]: [Self; 4]) -> Self {
        // As in `lanes`.
        let (upper, lower) = (a.mean(b), c.mean(d));
        avx2! {
            let rounded = _mm256_or_si256(_mm256_xor_si256(a.0, b.0), _mm256_xor_si256(c.0, d.0));
            let both = _mm256_and_si256(rounded, _mm256_xor_si256(upper.0, lower.0));
            Self(_mm256_sub_epi8(upper.mean(lower).0, _mm256_and_si256(both, _mm256_set1_epi8(1))))
        }
    }
}

impl Differences for Words {
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        avx2! { Self(_mm256_add_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        avx2! { Self(_mm256_sub_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        avx2! { Self(_mm256_abs_epi16(self.0)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        avx2! { Self(_mm256_max_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    fn sums(self) -> [i32; 2] {
        avx2! {
            let pairs = _mm256_madd_epi16(self.0, _mm256_set1_epi16(1));
            let two = _mm256_add_epi32(pairs, _mm256_unpackhi_epi64(pairs, pairs));
            let one = _mm256_add_epi32(two, _mm256_shuffle_epi32::<1>(two));
            [_mm256_extract_epi32::<0>(one), _mm256_extract_epi32::<4>(one)]
        }
    }

    #[inline(always)]
    fn transposed(mut rows: [Self; 8]) -> [Self; 8] {
        // As in `lanes`: both halves of the lanes are woven together alike.
        for _ in 0..3 {
            let before = rows;
            for i in 0..4 {
                avx2! {
                    rows[2 * i] = Self(_mm256_unpacklo_epi16(before[i].0, before[i + 4].0));
                    rows[2 * i + 1] = Self(_mm256_unpackhi_epi16(before[i].0, before[i + 4].0));
                }
            }
        }
        rows
    }
}

/// [`divide`](super::divide) of eight values at a time.
///
/// # Safety
/// The processor has AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn divide(
    values: &[i32; 64],
    reciprocals: &[u32; 64],
    zero: u32,
    shift: u32,
    out: &mut [u32; 64],
) -> u64 {
    let (zero, shift, mut nonzero) = (_mm256_set1_epi32(zero as i32), _mm_cvtsi32_si128(shift as i32), 0);
    let (values, _) = values.as_chunks::<8>();
    let (reciprocals, _) = reciprocals.as_chunks::<8>();
    let (out, _) = out.as_chunks_mut::<8>();
    for (i, ((values, reciprocals), out)) in values.iter().zip(reciprocals).zip(out).enumerate() {
        // SAFETY: each of the three is eight numbers of 32 bits.
        unsafe {
            let magnitudes = _mm256_abs_epi32(_mm256_loadu_si256(values.as_ptr().cast()));
            let products = _mm256_mullo_epi32(magnitudes, _mm256_loadu_si256(reciprocals.as_ptr().cast()));
            let levels = _mm256_srl_epi32(_mm256_add_epi32(products, zero), shift);
            _mm256_storeu_si256(out.as_mut_ptr().cast(), levels);
            let empty = _mm256_cmpeq_epi32(levels, _mm256_setzero_si256());
            nonzero |= u64::from(!_mm256_movemask_ps(_mm256_castsi256_ps(empty)) as u8) << (8 * i);
        }
    }
    nonzero
}
