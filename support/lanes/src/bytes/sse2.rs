//! Operations on sixteen samples with instructions of every x86-64 processor.
#![allow(unsafe_code, reason = "vector instructions that every processor of this kind has")]

use crate::samples::{Differences, Samples, Sum};
use std::arch::x86_64::*;

/// Runs the SSE2 instructions of this module.
macro_rules! sse2 {
    ($($body:tt)*) => {
        // SAFETY: the instructions require SSE2, which every x86-64 processor has. They access only the memory passed
        // to them.
        unsafe { $($body)* }
    };
}

/// A group of sixteen samples.
#[derive(Clone, Copy, Debug)]
pub struct Bytes(pub(crate) __m128i);

impl Bytes {
    /// Loads sixteen samples from memory.
    #[inline(always)]
    #[must_use]
    pub fn load(samples: &[u8; 16]) -> Self {
        sse2! {
            Self(_mm_loadu_si128(samples.as_ptr().cast()))
        }
    }

    /// Joins two groups of eight samples.
    #[inline(always)]
    #[must_use]
    pub fn new(low: [u8; 8], high: [u8; 8]) -> Self {
        sse2! {
            Self(_mm_set_epi64x(i64::from_le_bytes(high), i64::from_le_bytes(low)))
        }
    }

    /// Returns the first and the last eight samples.
    #[inline(always)]
    #[must_use]
    pub fn halves(self) -> [[u8; 8]; 2] {
        sse2! {
            [self.0, _mm_unpackhi_epi64(self.0, self.0)].map(|half| _mm_cvtsi128_si64(half).to_le_bytes())
        }
    }

    /// Returns the differences of the first eight and of the last eight samples.
    #[inline(always)]
    #[must_use]
    pub fn minus(self, other: Self) -> [Words; 2] {
        sse2! {
            // Widen the samples to 16 bits by interleaving them with zeros.
            let zero = _mm_setzero_si128();
            let low = _mm_sub_epi16(_mm_unpacklo_epi8(self.0, zero), _mm_unpacklo_epi8(other.0, zero));
            let high = _mm_sub_epi16(_mm_unpackhi_epi8(self.0, zero), _mm_unpackhi_epi8(other.0, zero));
            [Words(low), Words(high)]
        }
    }
}

impl Samples for Bytes {
    const COUNT: usize = 16;

    type Absolute = Absolute;
    type Squared = Squared;

    #[inline(always)]
    fn mean(self, other: Self) -> Self {
        sse2! {
            Self(_mm_avg_epu8(self.0, other.0))
        }
    }

    #[inline(always)]
    fn mean_of_four([a, b, c, d]: [Self; 4]) -> Self {
        sse2! {
            // The mean of two means is too large by 1 if both steps rounded up. Subtract that 1.
            let (upper, lower) = (a.mean(b), c.mean(d));
            let rounded = _mm_or_si128(_mm_xor_si128(a.0, b.0), _mm_xor_si128(c.0, d.0));
            let twice = _mm_and_si128(_mm_and_si128(rounded, _mm_xor_si128(upper.0, lower.0)), _mm_set1_epi8(1));
            Self(_mm_sub_epi8(upper.mean(lower).0, twice))
        }
    }

    #[inline(always)]
    fn absolute(self, other: Self) -> Absolute {
        sse2! { Absolute(Words(_mm_sad_epu8(self.0, other.0))) }
    }

    #[inline(always)]
    fn squared(self, other: Self) -> [Squared; 2] {
        let [first, last] = self.minus(other);
        [first.squares(), last.squares()]
    }
}

/// Eight signed 16-bit numbers.
#[derive(Clone, Copy, Debug)]
pub struct Words(__m128i);

impl Words {
    /// Returns Σ a·b over all lanes.
    #[inline(always)]
    #[must_use]
    pub fn dot(self, other: Self) -> i32 {
        sse2! {
            // Add products of neighbors, then fold the four sums into the first lane.
            let pairs = _mm_madd_epi16(self.0, other.0);
            let two = _mm_add_epi32(pairs, _mm_unpackhi_epi64(pairs, pairs));
            _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32::<1>(two)))
        }
    }

    /// Returns the same number in all eight lanes.
    #[inline(always)]
    #[must_use]
    pub fn splat(value: i16) -> Self {
        sse2! {
            Self(_mm_set1_epi16(value))
        }
    }

    /// Returns Σ a² as partial sums in unspecified lanes.
    #[inline(always)]
    #[must_use]
    pub fn squares(self) -> Squared {
        sse2! {
            Squared(_mm_madd_epi16(self.0, self.0))
        }
    }
}

/// Four 32-bit sums.
#[derive(Clone, Copy, Debug)]
pub struct Squared(__m128i);

impl Sum for Squared {
    #[inline(always)]
    fn zero() -> Self {
        sse2! {
            Self(_mm_setzero_si128())
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        sse2! {
            Self(_mm_add_epi32(self.0, other.0))
        }
    }

    #[inline(always)]
    fn total(self) -> u32 {
        sse2! {
            let two = _mm_add_epi32(self.0, _mm_unpackhi_epi64(self.0, self.0));
            _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32::<1>(two))) as u32
        }
    }
}

/// Sums of absolute differences in unsigned words.
#[derive(Clone, Copy, Debug)]
pub struct Absolute(Words);

impl Sum for Absolute {
    #[inline(always)]
    fn zero() -> Self {
        Self(Words::zero())
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self(self.0.plus(other.0))
    }

    #[inline(always)]
    fn total(self) -> u32 {
        self.0.dot(Words::splat(1)) as u32
    }
}

impl Differences for Words {
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0)
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        sse2! {
            Self(_mm_add_epi16(self.0, other.0))
        }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        sse2! {
            Self(_mm_sub_epi16(self.0, other.0))
        }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SSE2 has no instruction for the absolute value of words.
        sse2! {
            Self(_mm_max_epi16(self.0, _mm_sub_epi16(_mm_setzero_si128(), self.0)))
        }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        sse2! {
            Self(_mm_max_epi16(self.0, other.0))
        }
    }

    #[inline(always)]
    fn sums(self) -> [i32; 2] {
        [self.dot(Self::splat(1)), 0]
    }

    #[inline(always)]
    fn transposed(rows: [Self; 8]) -> [Self; 8] {
        // Interleave rows i and i + 4 three times. The loops avoid closures, which are not always inlined.
        let mut out = rows;
        for _ in 0..3 {
            let rows = out;
            for i in 0..4 {
                sse2! {
                    out[2 * i] = Self(_mm_unpacklo_epi16(rows[i].0, rows[i + 4].0));
                    out[2 * i + 1] = Self(_mm_unpackhi_epi16(rows[i].0, rows[i + 4].0));
                }
            }
        }
        out
    }
}
