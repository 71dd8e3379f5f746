//! Innermost loops.
//!
//! All loops are kernels of the crate [`lanes`], compiled from one source for AVX2 and for any processor, with identical results.
//! Difference and prediction kernels use sample types of the crate, and level kernels use its integers. The other kernels are
//! plain loops of fixed size that the compiler vectorizes if possible. Tests compare both versions of every kernel.

mod absolute;
mod levels;
mod onto;
mod predicted;
mod transformed;

pub(crate) use absolute::{absolute_difference, absolute_differences};
use lanes::{Bytes, Samples};
pub(crate) use levels::{divide, restore};
pub(crate) use onto::predict_onto;
use predicted::for_predicted;
pub(crate) use transformed::transformed_difference;

/// Defines a function that runs its body with AVX2 if available, and a scalar version `$plain`.
macro_rules! vectorized {
    ($(#[$meta:meta])* fn $name:ident, $plain:ident $(<const $n:ident: usize>)? ($($arg:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        #[inline(always)]
        pub(crate) fn $plain $(<const $n: usize>)? ($($arg: $type),*) $(-> $out)? $body

        $(#[$meta])*
        #[inline]
        pub(crate) fn $name $(<const $n: usize>)? ($($arg: $type),*) $(-> $out)? {
            /// Arguments of the call.
            struct Call<A $(, const $n: usize)?>(A);

            #[allow(unused_parens, reason = "a function without a result returns ()")]
            impl $(<const $n: usize>)? lanes::Kernel for Call<($($type,)*) $(, $n)?> {
                type Output = ($($out)?);

                #[inline(always)]
                fn run<L: lanes::Lanes>(self, _: L) -> Self::Output {
                    let ($($arg,)*) = self.0;
                    $plain $(::<$n>)? ($($arg),*)
                }
            }

            lanes::Choice::best().run(Call::<_ $(, $n)?>(($($arg,)*)))
        }
    };
}

use vectorized;

/// Source of a prediction: the samples of a plane from the upper left whole sample on, and the half-sample steps.
#[derive(Clone, Copy)]
pub(crate) struct ReferenceBlock<'a> {
    pub samples: &'a [u8],
    pub stride: usize,
    pub half: (bool, bool),
}

impl<'a> ReferenceBlock<'a> {
    /// Returns the reference block at a whole position, in rows of `stride` samples.
    #[inline(always)]
    pub fn whole(samples: &'a [u8], stride: usize) -> Self {
        Self { samples, stride, half: (false, false) }
    }
}

vectorized! {
    /// Predicts N rows of N samples (7.6.4); N is 8 or 16.
    fn predict, predict_plain<const N: usize>(place: &ReferenceBlock<'_>, out: &mut [[u8; N]; N]) {
        let (out, _) = out.as_flattened_mut().as_chunks_mut::<8>();
        for_predicted::<N>(place, |i, bytes| [out[2 * i], out[2 * i + 1]] = bytes.halves());
    }
}

vectorized! {
    /// Predicts the four luma blocks of a macroblock (7.6.4), upper before lower.
    fn predict_blocks, predict_blocks_plain(place: &ReferenceBlock<'_>, out: &mut [[u8; 64]; 4]) {
        for_predicted::<16>(place, |y, bytes| {
            for (x, eight) in bytes.halves().into_iter().enumerate() {
                out[2 * (y / 8) + x][8 * (y % 8)..][..8].copy_from_slice(&eight);
            }
        });
    }
}

/// Copies a block from rows `stride` apart.
#[inline]
pub(crate) fn gathered(samples: &[u8], stride: usize) -> [u8; 64] {
    let (samples, mut block) = (&samples[..7 * stride + 8], [0; 64]);
    for (y, row) in block.as_chunks_mut::<8>().0.iter_mut().enumerate() {
        row.copy_from_slice(&samples[y * stride..][..8]);
    }
    block
}

/// Copies a block to the start of `out`, with rows `stride` apart.
#[inline]
pub(crate) fn scatter(block: &[u8; 64], out: &mut [u8], stride: usize) {
    let out = &mut out[..7 * stride + 8];
    for (y, row) in block.as_chunks::<8>().0.iter().enumerate() {
        out[y * stride..][..8].copy_from_slice(row);
    }
}

/// Averages two predictions of a multiple of 16 samples, rounding up (7.6.7.1).
#[inline]
pub(crate) fn mean(a: &[u8], b: &[u8], out: &mut [u8]) {
    let ((a, _), (b, _), (out, _)) = (a.as_chunks(), b.as_chunks(), out.as_chunks_mut::<16>());
    for ((a, b), out) in a.iter().zip(b).zip(out) {
        out.as_chunks_mut::<8>().0.copy_from_slice(&Bytes::load(a).mean(Bytes::load(b)).halves());
    }
}

vectorized! {
    /// Averages blocks of 2×2 samples from two rows, rounded.
    fn means_of_four, means_of_four_plain(upper: &[u8], lower: &[u8], out: &mut [u8]) {
        let (upper, lower) = (upper.as_chunks::<2>().0, lower.as_chunks::<2>().0);
        for ((upper, lower), out) in upper.iter().zip(lower).zip(out) {
            *out = ((u16::from(upper[0]) + u16::from(upper[1]) + u16::from(lower[0]) + u16::from(lower[1]) + 2) >> 2) as u8;
        }
    }
}

vectorized! {
    /// Returns the sum of squared differences between two blocks.
    fn squared_difference, squared_difference_plain(a: &[u8; 64], b: &[u8; 64]) -> u32 {
        let mut sum = 0;
        for k in 0..64 {
            let difference = i32::from(a[k]) - i32::from(b[k]);
            sum += (difference * difference) as u32;
        }
        sum
    }
}

vectorized! {
    /// Returns the sums of squared differences for each of six blocks.
    fn squared_differences, squared_differences_plain(a: &[[u8; 64]; 6], b: &[[u8; 64]; 6]) -> [u32; 6] {
        let mut sums = [0; 6];
        for block in 0..6 {
            sums[block] = squared_difference_plain(&a[block], &b[block]);
        }
        sums
    }
}

vectorized! {
    /// Returns the sum of the squared deviations of blocks from their means.
    fn deviation, deviation_plain(blocks: &[[u8; 64]; 6]) -> u32 {
        let mut deviation = 0;
        for samples in blocks {
            let (mut sum, mut squares) = (0, 0);
            for &sample in samples {
                sum += u32::from(sample);
                squares += (i32::from(sample) * i32::from(sample)) as u32;
            }
            let mean = (sum + 32) / 64;
            // Σ(x − m)² = Σx² − 2m·Σx + 64m².
            deviation += squares + 64 * mean * mean - 2 * mean * sum;
        }
        deviation
    }
}

#[cfg(test)]
mod tests {
    use super::{
        absolute::absolute_difference_plain,
        levels::{divide_plain, restore_plain},
        onto::predict_onto_plain,
        transformed::transformed_difference_plain,
        *,
    };

    fn block<const N: usize>(random: &mut fastrand::Rng) -> [[u8; N]; N] {
        std::array::from_fn(|_| std::array::from_fn(|_| random.u8(..)))
    }

    /// Definition of 7.6.4: the mean of the two or four samples around a half position, rounded up.
    fn predicted<const N: usize>(place: ReferenceBlock) -> [[u8; N]; N] {
        let (right, below) = (usize::from(place.half.0), usize::from(place.half.1));
        let at = |x: usize, y: usize| u32::from(place.samples[y * place.stride + x]);
        std::array::from_fn(|y| {
            std::array::from_fn(|x| {
                ((at(x, y) + at(x + right, y) + at(x, y + below) + at(x + right, y + below) + 2) / 4) as u8
            })
        })
    }

    /// The sign of entry (u, v) of the transform is the parity of the common bits of u and x, and of v and y.
    fn transformed(source: &[[u8; 8]; 8], predicted: &[[u8; 8]; 8]) -> u32 {
        let mut sum = 0i32;
        for (u, v) in (0..8).flat_map(|u| (0..8).map(move |v| (u, v))) {
            let sign = |u: usize, x: usize| if (u & x).count_ones().is_multiple_of(2) { 1 } else { -1 };
            let difference = |i: usize| i32::from(source[i / 8][i % 8]) - i32::from(predicted[i / 8][i % 8]);
            sum += (0..64).map(|i| sign(v, i / 8) * sign(u, i % 8) * difference(i)).sum::<i32>().abs();
        }
        ((sum + 4) / 8) as u32
    }

    const POSITIONS: [(bool, bool); 4] = [(false, false), (true, false), (false, true), (true, true)];

    fn follow_their_definitions<const N: usize>() {
        let mut random = fastrand::Rng::with_seed(N as u64);
        // Test once with Miri, which is ten thousand times slower.
        for _ in 0..if cfg!(miri) { 1 } else { 50 } {
            let samples: Vec<u8> = (0..40 * 40).map(|_| random.u8(..)).collect();
            let source = block::<N>(&mut random);
            for half in POSITIONS {
                let place = ReferenceBlock { samples: &samples[43..], stride: 40, half };
                let truth = predicted::<N>(place);
                let mut ours = [[0; N]; N];
                predict(&place, &mut ours);
                assert_eq!(ours, truth);
                let pairs = source.as_flattened().iter().zip(truth.as_flattened());
                let absolute: u32 = pairs.map(|(&a, &b)| u32::from(a.abs_diff(b))).sum();
                let here = ReferenceBlock::whole(source.as_flattened(), N);
                assert_eq!(absolute_difference::<N>(here, place), absolute);
                assert_eq!(absolute_difference_plain::<N>(here, place), absolute);
                let others = [
                    place,
                    here,
                    ReferenceBlock { half: (false, false), ..place },
                    ReferenceBlock { half: (true, true), ..place },
                ];
                assert_eq!(
                    absolute_differences::<N>(here, others),
                    others.map(|other| absolute_difference_plain::<N>(here, other))
                );
                let mut onto = [[0; 24]; N];
                let errors = predict_onto::<N>(here, place, onto.as_flattened_mut(), 24);
                assert_eq!(errors, predict_onto_plain::<N>(here, place, onto.as_flattened_mut(), 24));
                for (block, &error) in errors.iter().enumerate().take(N * N / 64) {
                    let square = |y: usize, x: usize| u32::from(source[y][x].abs_diff(truth[y][x])).pow(2);
                    let (top, left) = (block / 2 * 8, block % 2 * 8);
                    let sum = (0..64).map(|i| square(top + i / 8, left + i % 8)).sum::<u32>();
                    assert_eq!(error, sum);
                }
                assert!(onto.iter().zip(&truth).all(|(onto, truth)| onto[..N] == *truth && onto[N..] == [0; 24][N..]));
                let eight = |of: &[[u8; N]; N], left: usize, top: usize| -> [[u8; 8]; 8] {
                    std::array::from_fn(|y| std::array::from_fn(|x| of[top + y][left + x]))
                };
                let corners = (0..N / 8).flat_map(|y| (0..N / 8).map(move |x| (8 * x, 8 * y)));
                let sum: u32 = corners.map(|(x, y)| transformed(&eight(&source, x, y), &eight(&truth, x, y))).sum();
                assert_eq!(transformed_difference::<N>(here, place), sum);
                assert_eq!(transformed_difference_plain::<N>(here, place), sum);
            }
        }
    }

    #[test]
    fn predictions_and_differences_follow_their_definitions() {
        follow_their_definitions::<8>();
        follow_their_definitions::<16>();
        let place = ReferenceBlock { samples: &[0; 64], stride: 8, half: (false, false) };
        let white = ReferenceBlock::whole(&[255; 64], 8);
        assert_eq!(transformed_difference::<8>(white, place), 255 * 8, "the largest values must fit");
    }

    #[test]
    fn both_ways_give_the_same() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..if cfg!(miri) { 4 } else { 200 } {
            let (a, b): ([u8; 64], [u8; 64]) = (std::array::from_fn(|_| random.u8(..)), [random.u8(..); 64]);
            let (six, others) = ([a; 6], [b, a, b, a, b, b]);
            assert_eq!(squared_differences(&six, &others), squared_differences_plain(&six, &others));
            assert_eq!(deviation(&six), deviation_plain(&six));
            let values = std::array::from_fn(|i| i32::from(a[i]) * 128 - 16384);
            let reciprocals = std::array::from_fn(|i| u32::from(a[i]) * 513);
            let (mut x, mut y) = ([0; 64], [0; 64]);
            let nonzero = divide(&values, &reciprocals, 1 << 20, 26, &mut x);
            assert!((0..64).all(|i| (nonzero >> i & 1 == 1) == (x[i] != 0)));
            let level = |i: usize| (values[i].unsigned_abs() * reciprocals[i] + (1 << 20)) >> 26;
            assert_eq!(x, std::array::from_fn(level));
            assert_eq!((nonzero, x), (divide_plain(&values, &reciprocals, 1 << 20, 26, &mut y), y));
            // The levels must match their coefficients, otherwise the squares overflow.
            let weights: [i32; 64] = std::array::from_fn(|i| 16 * i32::from(b[i]) + 16);
            let coefficients = values.map(|value| value / 8);
            let level = |i: usize| (2 * coefficients[i].abs() / weights[i]) as u32;
            let (mut levels, mut restored) = ([std::array::from_fn(level); 2], [[0; 64]; 2]);
            let sums = restore(&coefficients, &weights, &mut levels[0], &mut restored[0]);
            assert_eq!(sums, restore_plain(&coefficients, &weights, &mut levels[1], &mut restored[1]));
            assert_eq!((levels[0], restored[0]), (levels[1], restored[1]));
            let mut mean_of_both = [0; 64];
            mean(&a, &b, &mut mean_of_both);
            assert_eq!(mean_of_both, std::array::from_fn(|i| (u16::from(a[i]) + u16::from(b[i])).div_ceil(2) as u8));
        }
    }
}
