//! Picture samples: blocks in a plane, their half-sample predictions, and sums over differences.
//!
//! Bounds are checked once per block. Checking each row would take one and a half times as many instructions for
//! plain differences.

use std::fmt::Debug;

pub(crate) use memory::Memory;

/// Samples that are processed together: one or several rows of a block.
pub trait Samples: Memory + Copy + Debug {
    /// Number of samples per group.
    const COUNT: usize;

    /// Sums of absolute differences. Sums over 256 samples do not overflow.
    type Absolute: Sum;
    /// Sums of squared differences.
    type Squared: Sum;

    /// Returns (a + b + 1) / 2 for every pair of samples, rounded down.
    fn mean(self, other: Self) -> Self;
    /// Returns (a + b + c + d + 2) / 4 for every four samples, rounded down.
    fn mean_of_four(groups: [Self; 4]) -> Self;
    /// Returns sums of the absolute differences between the samples.
    fn absolute(self, other: Self) -> Self::Absolute;
    /// Returns the squared differences of the first and of the last eight samples in each group of sixteen. If the rows
    /// have eight samples, each half contains alternate rows.
    fn squared(self, other: Self) -> [Self::Squared; 2];
}

/// Several sums, one per lane.
pub trait Sum: Copy + Debug {
    /// Returns sums that are all zero.
    fn zero() -> Self;
    /// Adds each lane to the same lane of `other`.
    fn plus(self, other: Self) -> Self;
    /// Returns the sum of all lanes.
    fn total(self) -> u32;

    /// Returns the sum of all lanes of each argument.
    #[inline(always)]
    fn totals([a, b, c, d]: [Self; 4]) -> [u32; 4] {
        [a.total(), b.total(), c.total(), d.total()]
    }
}

/// Rows of 16-bit differences of one 8×8 block, or of two adjacent blocks.
pub trait Differences: Copy + Debug {
    /// Returns differences that are all zero.
    fn zero() -> Self;
    /// Returns the wrapping sum of each pair of differences.
    fn plus(self, other: Self) -> Self;
    /// Returns `self - other` for each pair, wrapping.
    fn minus(self, other: Self) -> Self;
    /// Returns the absolute value of each difference, except for −32768.
    fn abs(self) -> Self;
    /// Returns the maximum of each pair of signed numbers.
    fn max(self, other: Self) -> Self;
    /// Returns the sum of the row of each block. The second sum is 0 if only one block exists.
    fn sums(self) -> [i32; 2];
    /// Returns the transposed rows of each block.
    fn transposed(rows: [Self; 8]) -> [Self; 8];
}

/// Rows of two separate blocks, as a pair.
impl<D: Differences> Differences for [D; 2] {
    #[inline(always)]
    fn zero() -> Self {
        [D::zero(); 2]
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        [self[0].plus(other[0]), self[1].plus(other[1])]
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        [self[0].minus(other[0]), self[1].minus(other[1])]
    }

    #[inline(always)]
    fn abs(self) -> Self {
        [self[0].abs(), self[1].abs()]
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        [self[0].max(other[0]), self[1].max(other[1])]
    }

    #[inline(always)]
    fn sums(self) -> [i32; 2] {
        [self[0].sums()[0], self[1].sums()[0]]
    }

    #[inline(always)]
    fn transposed(rows: [Self; 8]) -> [Self; 8] {
        let [first, second] = [0, 1].map(|block| D::transposed(rows.map(|row| row[block])));
        std::array::from_fn(|i| [first[i], second[i]])
    }
}

/// Upper limit of strides. Below it, no offset in a window overflows.
const STRIDE_LIMIT: usize = usize::MAX >> 8;

/// A window of R rows of N samples with the given `stride` in a plane. With `H` or `V`, the window is half a sample
/// farther right or down. Each sample is then the mean of the two or four surrounding samples, rounded up (ISO/IEC
/// 13818-2, 7.6.4). N and R are 8 or 16.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a, const N: usize, const R: usize, const H: bool, const V: bool> {
    samples: &'a [u8],
    stride: usize,
}

impl<'a, const N: usize, const R: usize, const H: bool, const V: bool> Window<'a, N, R, H, V> {
    /// Creates a window. `samples` start at the upper left full sample of the window.
    ///
    /// # Panics
    /// If `samples` end before the window, or `stride` is too large.
    #[inline(always)]
    #[must_use]
    pub fn new(samples: &'a [u8], stride: usize) -> Self {
        const { assert!((N == 8 || N == 16) && (R == 8 || R == 16)) };
        assert!(stride < STRIDE_LIMIT, "rows that lie {stride} apart");
        // Keep R rows, or R + 1 with `V`. The last row needs only N samples, or N + 1 with `H`.
        let samples = &samples[..(R - 1 + usize::from(V)) * stride + N + usize::from(H)];
        Self { samples, stride }
    }

    /// Returns group `i` of the [`R * N / S::COUNT`](Samples::COUNT) groups, which are counted from the upper left.
    ///
    /// # Panics
    /// If the group does not exist.
    #[inline(always)]
    #[must_use]
    pub fn group<S: Samples>(&self, i: usize) -> S {
        const { assert!(S::COUNT >= N && (R * N).is_multiple_of(S::COUNT)) };
        assert!(i < R * N / S::COUNT, "a group of a window");
        // Average over the half-sample neighbors. `H` and `V` are constants, so no branch remains.
        let row = i * S::COUNT / N;
        let here = self.load(row, 0);
        match (H, V) {
            (false, false) => here,
            (true, false) => here.mean(self.load(row, 1)),
            (false, true) => here.mean(self.load(row + 1, 0)),
            (true, true) => S::mean_of_four([here, self.load(row, 1), self.load(row + 1, 0), self.load(row + 1, 1)]),
        }
    }

    /// Loads full samples from a row. The last row of the group is at most R − 1, or R with `V`. `x` is 0, or at most 1
    /// with `H`.
    #[inline(always)]
    #[allow(unsafe_code, reason = "samples are read without a check for each")]
    fn load<S: Samples>(&self, row: usize, x: usize) -> S {
        let first = row * self.stride + x;
        debug_assert!(first + (S::COUNT / N - 1) * self.stride + N <= self.samples.len());
        // SAFETY: the last sample read is inside `samples`, which `new` has sliced for this window.
        unsafe { S::load::<N>(self.samples.as_ptr().add(first), self.stride) }
    }
}

/// A writable window of R rows of N samples with the given `stride`. N and R are 8 or 16.
#[derive(Debug)]
pub struct WindowMut<'a, const N: usize, const R: usize> {
    samples: &'a mut [u8],
    stride: usize,
}

impl<'a, const N: usize, const R: usize> WindowMut<'a, N, R> {
    /// Creates a window. `samples` start at the upper left sample of the window.
    ///
    /// # Panics
    /// If `samples` end before the window, or `stride` is too large.
    #[inline(always)]
    #[must_use]
    pub fn new(samples: &'a mut [u8], stride: usize) -> Self {
        const { assert!((N == 8 || N == 16) && (R == 8 || R == 16)) };
        assert!(stride < STRIDE_LIMIT, "rows that lie {stride} apart");
        Self { samples: &mut samples[..(R - 1) * stride + N], stride }
    }

    /// Writes group `i` of the [`R * N / S::COUNT`](Samples::COUNT) groups, which are counted from the upper left.
    ///
    /// # Panics
    /// If the group does not exist.
    #[inline(always)]
    #[allow(unsafe_code, reason = "samples are written without a check for each")]
    pub fn set_group<S: Samples>(&mut self, i: usize, group: S) {
        const { assert!(S::COUNT >= N && (R * N).is_multiple_of(S::COUNT)) };
        assert!(i < R * N / S::COUNT, "a group of a window");
        let first = i * S::COUNT / N * self.stride;
        debug_assert!(first + (S::COUNT / N - 1) * self.stride + N <= self.samples.len());
        // SAFETY: the last sample written is inside `samples`, which `new` has sliced for this window.
        unsafe { group.store::<N>(self.samples.as_mut_ptr().add(first), self.stride) };
    }
}

mod memory {
    /// Loads and stores of samples. The trait is private, because implementations in other crates could break
    /// assumptions of the windows.
    #[allow(unsafe_code, reason = "samples are read and written without a check for each")]
    pub trait Memory: Sized {
        /// Loads the rows of one group, with N samples each and the given `stride`. N is 8 or 16.
        ///
        /// # Safety
        /// The samples must be readable.
        unsafe fn load<const N: usize>(first: *const u8, stride: usize) -> Self;

        /// Stores the rows of one group, with the layout of [`load`](Self::load).
        ///
        /// # Safety
        /// The samples must be writable.
        unsafe fn store<const N: usize>(self, first: *mut u8, stride: usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Choice, Kernel, Lanes, bytes::Bytes};
    use fastrand::Rng;

    const STRIDE: usize = 21;

    /// Returns the expected samples: the mean of the two or four surrounding samples, rounded up.
    fn expected<const N: usize, const R: usize>(samples: &[u8], right: usize, below: usize) -> Vec<u8> {
        let at = |x: usize, y: usize| u32::from(samples[y * STRIDE + x]);
        let mean =
            |x: usize, y: usize| (at(x, y) + at(x + right, y) + at(x, y + below) + at(x + right, y + below) + 2) / 4;
        (0..R * N).map(|i| mean(i % N, i / N) as u8).collect()
    }

    struct Copied<'a, const N: usize, const R: usize, const H: bool, const V: bool>(&'a [u8]);

    impl<const N: usize, const R: usize, const H: bool, const V: bool> Kernel for Copied<'_, N, R, H, V> {
        type Output = Vec<u8>;

        #[inline(always)]
        fn run<L: Lanes>(self, _: L) -> Vec<u8> {
            copied::<N, R, H, V, L::Samples>(self.0)
        }
    }

    #[inline(always)]
    fn copied<const N: usize, const R: usize, const H: bool, const V: bool, S: Samples>(samples: &[u8]) -> Vec<u8> {
        let mut out = [7; 16 * STRIDE];
        let from = Window::<N, R, H, V>::new(samples, STRIDE);
        let mut to = WindowMut::<N, R>::new(&mut out, STRIDE);
        for i in 0..R * N / S::COUNT {
            to.set_group(i, from.group::<S>(i));
        }
        let (inside, outside): (Vec<_>, Vec<_>) = (0..out.len()).partition(|i| i % STRIDE < N && i / STRIDE < R);
        assert!(outside.into_iter().all(|i| out[i] == 7), "nothing else is written");
        inside.into_iter().map(|i| out[i]).collect()
    }

    fn one_size<const N: usize, const R: usize>(random: &mut Rng) {
        let samples: Vec<u8> = (0..17 * STRIDE).map(|_| random.u8(..)).collect();
        let size = |h: usize, v: usize| (R - 1 + v) * STRIDE + N + h;
        macro_rules! check {
            ($h:literal, $v:literal) => {
                let (right, below) = (usize::from($h), usize::from($v));
                // Pass exactly the required number of samples.
                let samples = &samples[..size(right, below)];
                let expected =
                    expected::<N, R>(&samples.iter().copied().chain([0; 40]).collect::<Vec<_>>(), right, below);
                assert_eq!(copied::<N, R, $h, $v, Bytes>(samples), expected);
                for choice in [Choice::SCALAR, Choice::best()] {
                    assert_eq!(choice.run(Copied::<N, R, $h, $v>(samples)), expected);
                }
                let short = std::panic::catch_unwind(|| Window::<N, R, $h, $v>::new(&samples[1..], STRIDE));
                assert!(short.is_err());
            };
        }
        check!(false, false);
        check!(true, false);
        check!(false, true);
        check!(true, true);
    }

    #[test]
    fn windows_hold_what_the_definition_says_and_nothing_beyond() {
        let mut random = Rng::with_seed(3);
        for _ in 0..if cfg!(miri) { 1 } else { 20 } {
            one_size::<8, 8>(&mut random);
            one_size::<16, 8>(&mut random);
            one_size::<8, 16>(&mut random);
            one_size::<16, 16>(&mut random);
        }
    }

    #[test]
    fn strides_that_overflow_are_refused() {
        let refused =
            |stride| std::panic::catch_unwind(|| Window::<8, 8, false, false>::new(&[0; 64], stride)).is_err();
        assert!(refused(usize::MAX / 7 + 1) && refused(usize::MAX) && refused(1 << 60) && !refused(8));
    }

    /// Kernel that sums differences between two sets of eight rows of sixteen samples, and transposes the difference
    /// rows.
    struct Compared<'a>(&'a [[u8; 16]; 8], &'a [[u8; 16]; 8]);

    impl Kernel for Compared<'_> {
        type Output = (u32, [u32; 4], Vec<[i32; 2]>);

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) -> Self::Output {
            let (a, b) = (self.0.as_flattened(), self.1.as_flattened());
            let (a, b) = (Window::<16, 8, false, false>::new(a, 16), Window::<16, 8, false, false>::new(b, 16));
            let mut absolute = <L::Samples as Samples>::Absolute::zero();
            let mut squared = [<L::Samples as Samples>::Squared::zero(); 2];
            for i in 0..128 / L::Samples::COUNT {
                let (a, b) = (a.group::<L::Samples>(i), b.group::<L::Samples>(i));
                absolute = absolute.plus(a.absolute(b));
                let [left, right] = a.squared(b);
                squared = [squared[0].plus(left), squared[1].plus(right)];
            }
            let mut rows = [L::Words::zero(); 8];
            for (row, (a, b)) in rows.iter_mut().zip(self.0.iter().zip(self.1)) {
                *row = lanes.differences(Bytes::load(a), Bytes::load(b));
            }
            let columns = L::Words::transposed(rows);
            let of = |k: usize| {
                let (row, column) = (rows[k], columns[k]);
                [
                    row.sums(),
                    column.sums(),
                    row.abs().sums(),
                    row.max(column).sums(),
                    row.plus(column).minus(row).sums(),
                ]
            };
            let totals = Sum::totals([squared[0], squared[1], squared[1], squared[0].plus(squared[1])]);
            (absolute.total(), totals, (0..8).flat_map(of).collect())
        }
    }

    #[test]
    fn sums_follow_their_definitions() {
        let mut random = Rng::with_seed(5);
        for _ in 0..if cfg!(miri) { 2 } else { 200 } {
            let (a, b): ([[u8; 16]; 8], [[u8; 16]; 8]) =
                (std::array::from_fn(|_| std::array::from_fn(|_| random.u8(..))), [[random.u8(..); 16]; 8]);
            let difference = |x: usize, y: usize| i32::from(a[y][x]) - i32::from(b[y][x]);
            let all = || (0..8).flat_map(|y| (0..16).map(move |x| (x, y)));
            let absolute = all().map(|(x, y)| difference(x, y).unsigned_abs()).sum::<u32>();
            let square = |left: usize| {
                all().filter(|(x, _)| x / 8 == left).map(|(x, y)| difference(x, y).pow(2) as u32).sum::<u32>()
            };
            let squared = [square(0), square(1), square(1), square(0) + square(1)];
            let sums = |of: &dyn Fn(usize, usize) -> i32| {
                [0, 1].map(|block| (0..8).map(|x| of(8 * block + x, 8 * block)).sum::<i32>())
            };
            let rows = (0..8).flat_map(|k| {
                let row = |x: usize, _: usize| difference(x, k);
                let column = |x: usize, left: usize| difference(left + k, x - left);
                [
                    sums(&row),
                    sums(&column),
                    sums(&|x, left| row(x, left).abs()),
                    sums(&|x, left| row(x, left).max(column(x, left))),
                    sums(&column),
                ]
            });
            let expected = (absolute, squared, rows.collect::<Vec<_>>());
            for choice in [Choice::SCALAR, Choice::best()] {
                assert_eq!(choice.run(Compared(&a, &b)), expected);
            }
        }
    }
}
