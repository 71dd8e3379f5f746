//! AVX2 registers of picture samples: two rows of sixteen or four rows of eight, and difference rows of two adjacent
//! blocks.
#![allow(unsafe_code, reason = "vector instructions may only run where the processor has them")]

use crate::bytes::Bytes;
use crate::samples::{Differences, Memory, Samples, Sum};
use std::arch::x86_64::*;

/// Runs the AVX2 instructions of this module.
macro_rules! avx2 {
    ($($body:tt)*) => {
        // SAFETY: these types cannot be named outside this crate. Code reaches them only as associated types of
        // `Avx2`. A value of `Avx2` exists only where the processor has AVX2. The instructions access only the memory
        // passed to them.
        unsafe { $($body)* }
    };
}

/// Sixteen signed 16-bit numbers: one row of eight differences for each of two adjacent blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Words(__m256i);

impl Words {
    /// Returns the differences between two groups of sixteen samples.
    #[inline(always)]
    pub(super) fn between(samples: Bytes, minus: Bytes) -> Self {
        // Widen the samples to 16 bits before the subtraction.
        avx2! { Self(_mm256_sub_epi16(_mm256_cvtepu8_epi16(samples.0), _mm256_cvtepu8_epi16(minus.0))) }
    }
}

/// Sums of absolute differences: four 64-bit numbers, each below 2¹⁶.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Absolute(__m256i);

impl Sum for Absolute {
    #[inline(always)]
    fn zero() -> Self {
        avx2! { Self(_mm256_setzero_si256()) }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        // Sums stay below 2¹⁶, so 16-bit additions do not carry into the next field.
        avx2! { Self(_mm256_add_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    fn total(self) -> u32 {
        avx2! {
            let two = _mm_add_epi64(_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0));
            _mm_cvtsi128_si32(_mm_add_epi64(two, _mm_unpackhi_epi64(two, two))) as u32
        }
    }
}

/// Eight 32-bit sums.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Squared(__m256i);

impl Sum for Squared {
    #[inline(always)]
    fn zero() -> Self {
        avx2! { Self(_mm256_setzero_si256()) }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        avx2! { Self(_mm256_add_epi32(self.0, other.0)) }
    }

    #[inline(always)]
    fn total(self) -> u32 {
        Self::totals([self; 4])[0]
    }

    #[inline(always)]
    fn totals([a, b, c, d]: [Self; 4]) -> [u32; 4] {
        avx2! {
            // Add neighbors of all four registers, then the two halves of the result.
            let sums = _mm256_hadd_epi32(_mm256_hadd_epi32(a.0, b.0), _mm256_hadd_epi32(c.0, d.0));
            let sums = _mm_add_epi32(_mm256_castsi256_si128(sums), _mm256_extracti128_si256::<1>(sums));
            [
                _mm_extract_epi32::<0>(sums) as u32,
                _mm_extract_epi32::<1>(sums) as u32,
                _mm_extract_epi32::<2>(sums) as u32,
                _mm_extract_epi32::<3>(sums) as u32,
            ]
        }
    }
}

/// Two rows of sixteen samples, or four rows of eight samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows(__m256i);

impl Memory for Rows {
    #[inline(always)]
    unsafe fn load<const N: usize>(first: *const u8, stride: usize) -> Self {
        const { assert!(N == 8 || N == 16) };
        // SAFETY: the caller guarantees that the samples are accessible.
        unsafe {
            if N == 16 {
                return Self(_mm256_loadu2_m128i(first.add(stride).cast(), first.cast()));
            }
            let row = |y: usize| first.add(y * stride).cast::<i64>().read_unaligned();
            Self(_mm256_set_epi64x(row(3), row(2), row(1), row(0)))
        }
    }

    #[inline(always)]
    unsafe fn store<const N: usize>(self, first: *mut u8, stride: usize) {
        const { assert!(N == 8 || N == 16) };
        // SAFETY: the caller guarantees that the samples are accessible.
        unsafe {
            if N == 16 {
                return _mm256_storeu2_m128i(first.add(stride).cast(), first.cast(), self.0);
            }
            let (upper, lower) = (_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0));
            _mm_storel_epi64(first.cast(), upper);
            _mm_storel_epi64(first.add(stride).cast(), _mm_unpackhi_epi64(upper, upper));
            _mm_storel_epi64(first.add(2 * stride).cast(), lower);
            _mm_storel_epi64(first.add(3 * stride).cast(), _mm_unpackhi_epi64(lower, lower));
        }
    }
}

impl Samples for Rows {
    const COUNT: usize = 32;

    type Absolute = Absolute;
    type Squared = Squared;

    #[inline(always)]
    fn mean(self, other: Self) -> Self {
        avx2! { Self(_mm256_avg_epu8(self.0, other.0)) }
    }

    #[inline(always)]
    fn mean_of_four([a, b, c, d]: [Self; 4]) -> Self {
        // The mean of two means is too large by 1 if both steps rounded up. Subtract that 1.
        let (upper, lower) = (a.mean(b), c.mean(d));
        avx2! {
            let rounded = _mm256_or_si256(_mm256_xor_si256(a.0, b.0), _mm256_xor_si256(c.0, d.0));
            let both = _mm256_and_si256(rounded, _mm256_xor_si256(upper.0, lower.0));
            Self(_mm256_sub_epi8(upper.mean(lower).0, _mm256_and_si256(both, _mm256_set1_epi8(1))))
        }
    }

    #[inline(always)]
    fn absolute(self, other: Self) -> Absolute {
        avx2! { Absolute(_mm256_sad_epu8(self.0, other.0)) }
    }

    #[inline(always)]
    fn squared(self, other: Self) -> [Squared; 2] {
        avx2! {
            // Pair each sample with the other's sample. The weights 1 and −1 turn each pair into a difference.
            let signs = _mm256_set1_epi16(i16::from_le_bytes([1, 255]));
            [_mm256_unpacklo_epi8(self.0, other.0), _mm256_unpackhi_epi8(self.0, other.0)].map(|pairs| {
                let differences = _mm256_maddubs_epi16(pairs, signs);
                Squared(_mm256_madd_epi16(differences, differences))
            })
        }
    }
}

impl Differences for Words {
    #[inline(always)]
    fn zero() -> Self {
        avx2! { Self(_mm256_setzero_si256()) }
    }

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
            // Add neighbors, then fold each half of the register into its first lane.
            let pairs = _mm256_madd_epi16(self.0, _mm256_set1_epi16(1));
            let two = _mm256_add_epi32(pairs, _mm256_unpackhi_epi64(pairs, pairs));
            let one = _mm256_add_epi32(two, _mm256_shuffle_epi32::<1>(two));
            [_mm256_extract_epi32::<0>(one), _mm256_extract_epi32::<4>(one)]
        }
    }

    #[inline(always)]
    fn transposed(mut rows: [Self; 8]) -> [Self; 8] {
        // Interleave three times: each 128-bit half contains the rows of one block and is transposed separately.
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
