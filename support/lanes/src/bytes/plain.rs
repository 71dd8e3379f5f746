//! Scalar operations on sixteen samples: for other processors, and as the reference for tests of SSE2.

use crate::samples::{Differences, Samples, Sum};

/// A group of sixteen samples.
#[derive(Clone, Copy, Debug)]
pub struct Bytes([u8; 16]);

impl Bytes {
    /// Loads sixteen samples from memory.
    #[inline(always)]
    #[must_use]
    pub fn load(samples: &[u8; 16]) -> Self {
        Self(*samples)
    }

    /// Joins two groups of eight samples.
    #[inline(always)]
    #[must_use]
    pub fn new(low: [u8; 8], high: [u8; 8]) -> Self {
        Self(std::array::from_fn(|i| if i < 8 { low[i] } else { high[i - 8] }))
    }

    /// Returns the first and the last eight samples.
    #[inline(always)]
    #[must_use]
    pub fn halves(self) -> [[u8; 8]; 2] {
        std::array::from_fn(|half| std::array::from_fn(|i| self.0[8 * half + i]))
    }

    /// Returns the differences of the first eight and of the last eight samples.
    #[inline(always)]
    #[must_use]
    pub fn minus(self, other: Self) -> [Words; 2] {
        let at = |i: usize| i16::from(self.0[i]) - i16::from(other.0[i]);
        std::array::from_fn(|half| Words(std::array::from_fn(|i| at(8 * half + i))))
    }
}

impl Samples for Bytes {
    const COUNT: usize = 16;

    type Absolute = Absolute;
    type Squared = Squared;

    #[inline(always)]
    fn mean(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| ((u16::from(self.0[i]) + u16::from(other.0[i]) + 1) >> 1) as u8))
    }

    #[inline(always)]
    fn mean_of_four(bytes: [Self; 4]) -> Self {
        Self(std::array::from_fn(|i| ((bytes.iter().map(|bytes| u16::from(bytes.0[i])).sum::<u16>() + 2) >> 2) as u8))
    }

    #[inline(always)]
    fn absolute(self, other: Self) -> Absolute {
        let at = |i: usize| i16::from(self.0[i].abs_diff(other.0[i]));
        Absolute(Words(std::array::from_fn(|i| at(i) + at(i + 8))))
    }

    #[inline(always)]
    fn squared(self, other: Self) -> [Squared; 2] {
        let [first, last] = self.minus(other);
        [first.squares(), last.squares()]
    }
}

/// Eight signed 16-bit numbers.
#[derive(Clone, Copy, Debug)]
pub struct Words([i16; 8]);

impl Words {
    /// Returns Σ a·b over all lanes.
    #[inline(always)]
    #[must_use]
    pub fn dot(self, other: Self) -> i32 {
        self.0.iter().zip(other.0).map(|(&a, b)| i32::from(a) * i32::from(b)).sum()
    }

    /// Returns the same number in all eight lanes.
    #[inline(always)]
    #[must_use]
    pub fn splat(value: i16) -> Self {
        Self([value; 8])
    }

    /// Returns Σ a² as partial sums in unspecified lanes.
    #[inline(always)]
    #[must_use]
    pub fn squares(self) -> Squared {
        Squared(self.dot(self) as u32)
    }
}

/// One 32-bit sum.
#[derive(Clone, Copy, Debug)]
pub struct Squared(u32);

impl Sum for Squared {
    #[inline(always)]
    fn zero() -> Self {
        Self(0)
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }

    #[inline(always)]
    fn total(self) -> u32 {
        self.0
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
