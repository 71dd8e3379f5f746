//! Sixteen samples or eight differences at a time: with the instructions that every x86-64 processor has, and as plain
//! loops for others, which give the same. [`Differences`] is what transformed differences need of them.
//!
//! The compiler finds neither sums of differences of bytes nor transpositions in loops: with them, plain differences at half
//! positions take a third of the time, transformed ones half. No processor has to be asked first, so all of this is inlined
//! where it is used.

#[cfg(not(target_arch = "x86_64"))]
pub(crate) use plain::{Bytes, Sums, Words};
#[cfg(target_arch = "x86_64")]
pub(crate) use sse2::{Bytes, Sums, Words};

/// Rows of differences of 16 bits: of one block of 8×8, or of two beside each other.
pub(crate) trait Differences: Copy {
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn abs(self) -> Self;
    fn max(self, other: Self) -> Self;
    /// The sum of each block's row; 0 for a block that is not there.
    fn sums(self) -> [i32; 2];
    /// Rows become columns, in each block.
    fn transposed(rows: [Self; 8]) -> [Self; 8];
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "vector instructions that every processor of this kind has")]
mod sse2 {
    use super::Differences;
    use std::arch::x86_64::*;

    /// All instructions of this module go through here.
    macro_rules! sse2 {
        ($($body:tt)*) => {
            // SAFETY: the functions want SSE2, which belongs to x86-64, and touch no memory but what they are given.
            unsafe { $($body)* }
        };
    }

    /// Sixteen samples.
    #[derive(Clone, Copy)]
    pub(crate) struct Bytes(pub __m128i);

    impl Bytes {
        #[inline(always)]
        pub fn load(samples: &[u8; 16]) -> Self {
            sse2! {
                Self(_mm_loadu_si128(samples.as_ptr().cast()))
            }
        }

        /// Eight samples, and eight more.
        #[inline(always)]
        pub fn new(low: [u8; 8], high: [u8; 8]) -> Self {
            sse2! {
                Self(_mm_set_epi64x(i64::from_le_bytes(high), i64::from_le_bytes(low)))
            }
        }

        /// The first eight samples, and the last.
        #[inline(always)]
        pub fn halves(self) -> [[u8; 8]; 2] {
            sse2! {
                [self.0, _mm_unpackhi_epi64(self.0, self.0)].map(|half| _mm_cvtsi128_si64(half).to_le_bytes())
            }
        }

        /// (a + b + 1) / 2 of every pair.
        #[inline(always)]
        pub fn mean(self, other: Self) -> Self {
            sse2! {
                Self(_mm_avg_epu8(self.0, other.0))
            }
        }

        /// (a + b + c + d + 2) / 4: the mean of two means, less one where all three were rounded up.
        #[inline(always)]
        pub fn mean_of_four([a, b, c, d]: [Self; 4]) -> Self {
            sse2! {
                let (upper, lower) = (a.mean(b), c.mean(d));
                let rounded = _mm_or_si128(_mm_xor_si128(a.0, b.0), _mm_xor_si128(c.0, d.0));
                let twice = _mm_and_si128(_mm_and_si128(rounded, _mm_xor_si128(upper.0, lower.0)), _mm_set1_epi8(1));
                Self(_mm_sub_epi8(upper.mean(lower).0, twice))
            }
        }

        /// Sums of absolute differences, spread over the lanes somehow: sixteen of them together do not overflow.
        #[inline(always)]
        pub fn difference(self, other: Self) -> Words {
            sse2! { Words(_mm_sad_epu8(self.0, other.0)) }
        }

        /// Differences of the first eight samples, and of the last.
        #[inline(always)]
        pub fn minus(self, other: Self) -> [Words; 2] {
            sse2! {
                let zero = _mm_setzero_si128();
                let low = _mm_sub_epi16(_mm_unpacklo_epi8(self.0, zero), _mm_unpacklo_epi8(other.0, zero));
                let high = _mm_sub_epi16(_mm_unpackhi_epi8(self.0, zero), _mm_unpackhi_epi8(other.0, zero));
                [Words(low), Words(high)]
            }
        }
    }

    /// Eight numbers of 16 bits, with sign.
    #[derive(Clone, Copy)]
    pub(crate) struct Words(__m128i);

    impl Words {
        /// Σ a·b over all lanes.
        #[inline(always)]
        pub fn dot(self, other: Self) -> i32 {
            sse2! {
                let pairs = _mm_madd_epi16(self.0, other.0);
                let two = _mm_add_epi32(pairs, _mm_unpackhi_epi64(pairs, pairs));
                _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32::<1>(two)))
            }
        }

        #[inline(always)]
        pub fn splat(value: i16) -> Self {
            sse2! {
                Self(_mm_set1_epi16(value))
            }
        }

        /// Σ a², spread over the lanes somehow.
        #[inline(always)]
        pub fn squares(self) -> Sums {
            sse2! {
                Sums(_mm_madd_epi16(self.0, self.0))
            }
        }
    }

    /// Four sums of 32 bits.
    #[derive(Clone, Copy)]
    pub(crate) struct Sums(__m128i);

    impl Sums {
        #[inline(always)]
        pub fn zero() -> Self {
            sse2! {
                Self(_mm_setzero_si128())
            }
        }

        #[inline(always)]
        pub fn plus(self, other: Self) -> Self {
            sse2! {
                Self(_mm_add_epi32(self.0, other.0))
            }
        }

        /// All four together.
        #[inline(always)]
        pub fn total(self) -> u32 {
            sse2! {
                let two = _mm_add_epi32(self.0, _mm_unpackhi_epi64(self.0, self.0));
                _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32::<1>(two))) as u32
            }
        }
    }

    impl Differences for Words {
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
            // Rows that lie four apart are woven together three times over. Closures here are not always inlined.
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
}

#[cfg(any(test, not(target_arch = "x86_64")))]
mod plain {
    use super::Differences;

    /// Sixteen samples.
    #[derive(Clone, Copy)]
    pub(crate) struct Bytes([u8; 16]);

    impl Bytes {
        #[inline(always)]
        pub fn load(samples: &[u8; 16]) -> Self {
            Self(*samples)
        }

        /// Eight samples, and eight more.
        #[inline(always)]
        pub fn new(low: [u8; 8], high: [u8; 8]) -> Self {
            Self(std::array::from_fn(|i| if i < 8 { low[i] } else { high[i - 8] }))
        }

        /// The first eight samples, and the last.
        #[inline(always)]
        pub fn halves(self) -> [[u8; 8]; 2] {
            std::array::from_fn(|half| std::array::from_fn(|i| self.0[8 * half + i]))
        }

        /// (a + b + 1) / 2 of every pair.
        #[inline(always)]
        pub fn mean(self, other: Self) -> Self {
            Self(std::array::from_fn(|i| ((u16::from(self.0[i]) + u16::from(other.0[i]) + 1) >> 1) as u8))
        }

        /// (a + b + c + d + 2) / 4.
        #[inline(always)]
        pub fn mean_of_four(bytes: [Self; 4]) -> Self {
            Self(std::array::from_fn(|i| {
                ((bytes.iter().map(|bytes| u16::from(bytes.0[i])).sum::<u16>() + 2) >> 2) as u8
            }))
        }

        /// Sums of absolute differences, spread over the lanes somehow: sixteen of them together do not overflow.
        #[inline(always)]
        pub fn difference(self, other: Self) -> Words {
            let at = |i: usize| i16::from(self.0[i].abs_diff(other.0[i]));
            Words(std::array::from_fn(|i| at(i) + at(i + 8)))
        }

        /// Differences of the first eight samples, and of the last.
        #[inline(always)]
        pub fn minus(self, other: Self) -> [Words; 2] {
            let at = |i: usize| i16::from(self.0[i]) - i16::from(other.0[i]);
            std::array::from_fn(|half| Words(std::array::from_fn(|i| at(8 * half + i))))
        }
    }

    /// Eight numbers of 16 bits, with sign.
    #[derive(Clone, Copy)]
    pub(crate) struct Words([i16; 8]);

    impl Words {
        /// Σ a·b over all lanes.
        #[inline(always)]
        pub fn dot(self, other: Self) -> i32 {
            self.0.iter().zip(other.0).map(|(&a, b)| i32::from(a) * i32::from(b)).sum()
        }

        #[inline(always)]
        pub fn splat(value: i16) -> Self {
            Self([value; 8])
        }

        /// Σ a², spread over the lanes somehow.
        #[inline(always)]
        pub fn squares(self) -> Sums {
            Sums(self.dot(self) as u32)
        }
    }

    /// Sums of 32 bits.
    #[derive(Clone, Copy)]
    pub(crate) struct Sums(u32);

    impl Sums {
        #[inline(always)]
        pub fn zero() -> Self {
            Self(0)
        }

        #[inline(always)]
        pub fn plus(self, other: Self) -> Self {
            Self(self.0.wrapping_add(other.0))
        }

        /// All together.
        #[inline(always)]
        pub fn total(self) -> u32 {
            self.0
        }
    }

    impl Differences for Words {
        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            Self(std::array::from_fn(|i| self.0[i].wrapping_add(other.0[i])))
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            Self(std::array::from_fn(|i| self.0[i].wrapping_sub(other.0[i])))
        }

        #[inline(always)]
        fn abs(self) -> Self {
            Self(self.0.map(i16::wrapping_abs))
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            Self(std::array::from_fn(|i| self.0[i].max(other.0[i])))
        }

        #[inline(always)]
        fn sums(self) -> [i32; 2] {
            [self.dot(Self::splat(1)), 0]
        }

        #[inline(always)]
        fn transposed(rows: [Self; 8]) -> [Self; 8] {
            std::array::from_fn(|x| Self(std::array::from_fn(|y| rows[y].0[x])))
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::{Differences, plain, sse2};

    /// Every function of a module on the same sixteen bytes; words are told apart by products with others.
    macro_rules! results {
        ($lanes:ident, $bytes:expr) => {{
            let [a, b, c, d] = $bytes.map(|[low, high]: [[u8; 8]; 2]| $lanes::Bytes::new(low, high));
            let ([w0, w1], [w2, w3]) = (a.minus(b), c.minus(d));
            let words = [w0, w1, w2, w3, w0.plus(w1), w1.minus(w2), w2.abs(), w3.max(w0)];
            let columns = $lanes::Words::transposed(words);
            let dots: Vec<i32> = words.iter().chain(&columns).flat_map(|w| columns.map(|c| w.dot(c))).collect();
            let sum = a.difference(b).dot($lanes::Words::splat(1));
            let squares = $lanes::Sums::zero().plus(w0.squares()).plus(w1.squares()).total();
            let loaded = $lanes::Bytes::load($bytes[0].as_flattened().try_into().unwrap()).mean(d);
            let means = [a.mean(b), $lanes::Bytes::mean_of_four([a, b, c, d]), loaded].map($lanes::Bytes::halves);
            (means, sum, squares, dots)
        }};
    }

    #[test]
    fn both_ways_give_the_same() {
        let mut state = 1u32;
        for _ in 0..if cfg!(miri) { 4 } else { 1000 } {
            let bytes: [[[u8; 8]; 2]; 4] = std::array::from_fn(|_| {
                std::array::from_fn(|_| {
                    std::array::from_fn(|_| {
                        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        (state >> 24) as u8
                    })
                })
            });
            assert_eq!(results!(sse2, bytes), results!(plain, bytes));
        }
    }
}
