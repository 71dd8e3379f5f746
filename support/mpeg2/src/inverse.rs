//! Inverse 8×8 DCT in integers, with the same bits on every processor (7.5, Annex A).
//!
//! ```text
//! f(x,y) = 1/4 Σu Σv C(u) C(v) F(u,v) cos((2x+1)uπ/16) cos((2y+1)vπ/16)      C(0) = 1/√2, else 1
//! ```
//! The transform processes columns, then the columns of the transposed block, with even and odd frequencies separated.
//! Coefficients are stored by column: horizontal frequency u and vertical frequency v are at `8 * u + v`.
//!
//! There are 28 fractional bits in the cosines and 14 between the passes, which is far finer than IEEE 1180 requires. Nearly
//! all blocks use a faster floating-point inverse, which detects whether its result equals the exact one.

mod short; // floating-point inverse

use lanes::Choice;
use short::{Rounded, ShortInverse, rounded};

/// round(cos(kπ/16) · 2^28) for k = 1 … 7.
pub const COSINE: [i64; 8] =
    [1 << 28, 263_277_544, 248_002_024, 223_195_925, 189_812_531, 149_134_749, 102_725_802, 52_369_160];
/// Fractional bits of [`COSINE`].
pub const COSINE_BITS: u32 = 28;
/// Fractional bits between the passes of the inverse transform.
const MIDDLE_BITS: u32 = 14;

/// Computes twice the one-dimensional inverse transform along the first index, shifted right and rounded.
#[inline(never)]
fn inverse_1d(c: &[[i32; 8]; 8], shift: u32) -> [[i32; 8]; 8] {
    let [_, c1, c2, c3, c4, c5, c6, c7] = COSINE;
    let mut out = [[0; 8]; 8];
    let round = 1i64 << (shift - 1);
    for x in 0..8 {
        let at = |k: usize| i64::from(c[k][x]);
        // Even frequencies are symmetric about the center; odd frequencies are antisymmetric.
        let (p, m) = (c4 * at(0) + c4 * at(4), c4 * at(0) - c4 * at(4));
        let (q, r) = (c2 * at(2) + c6 * at(6), c6 * at(2) - c2 * at(6));
        let (e0, e1, e2, e3) = (p + q + round, m + r + round, m - r + round, p - q + round);
        let o0 = c1 * at(1) + c3 * at(3) + c5 * at(5) + c7 * at(7);
        let o1 = c3 * at(1) - c7 * at(3) - c1 * at(5) - c5 * at(7);
        let o2 = c5 * at(1) - c1 * at(3) + c7 * at(5) + c3 * at(7);
        let o3 = c7 * at(1) - c5 * at(3) + c3 * at(5) - c1 * at(7);
        out[0][x] = ((e0 + o0) >> shift) as i32;
        out[1][x] = ((e1 + o1) >> shift) as i32;
        out[2][x] = ((e2 + o2) >> shift) as i32;
        out[3][x] = ((e3 + o3) >> shift) as i32;
        out[4][x] = ((e3 - o3) >> shift) as i32;
        out[5][x] = ((e2 - o2) >> shift) as i32;
        out[6][x] = ((e1 - o1) >> shift) as i32;
        out[7][x] = ((e0 - o0) >> shift) as i32;
    }
    out
}

#[inline(never)]
fn transposed<T: Copy + Default>(block: &[[T; 8]; 8]) -> [[T; 8]; 8] {
    let mut out = [[T::default(); 8]; 8];
    for y in 0..8 {
        for x in 0..8 {
            out[x][y] = block[y][x];
        }
    }
    out
}

#[inline(always)]
fn rows(block: &[i32; 64]) -> &[[i32; 8]; 8] {
    block.as_chunks().0.try_into().expect("8 rows of 8")
}

#[inline(always)]
fn flat(block: &[[i32; 8]; 8]) -> [i32; 64] {
    block.as_flattened().try_into().expect("8 rows of 8")
}

/// Transforms coefficients to samples or differences, saturated to −256 … 255 (7.5). Calls are rare.
#[cold]
#[inline(never)]
fn inverse(coefficients: &[i32; 64]) -> [i32; 64] {
    // Transform columns first, because intermediate rounding makes the result depend on the order of the passes.
    let middle = inverse_1d(&transposed(rows(coefficients)), COSINE_BITS + 1 - MIDDLE_BITS);
    let out = inverse_1d(&transposed(&middle), COSINE_BITS + 1 + MIDDLE_BITS);
    flat(&transposed(&out)).map(|sample| sample.clamp(-256, 255))
}

/// Adds the inverse transform to a prediction and saturates the sum (7.6.8).
///
/// A 24-bit transform suffices if all values are far enough from rounding boundaries; its result is then exact.
/// Otherwise, for about one block in thirty, the exact transform is used.
#[inline]
pub fn inverse_onto(coefficients: &[i32; 64], predicted: &[u8; 64], out: &mut [u8; 64]) {
    inverse_onto_with(Choice::best(), coefficients, predicted, out);
}

/// Computes [`inverse_onto`] with the chosen instruction set.
#[inline(always)]
fn inverse_onto_with(choice: Choice, coefficients: &[i32; 64], predicted: &[u8; 64], out: &mut [u8; 64]) {
    if !choice.is_vector() {
        inverse_onto_plain(coefficients, predicted, out);
    } else if !choice.run(ShortInverse { coefficients, predicted, out }) {
        add(predicted, &inverse(coefficients), out);
    }
}

/// Computes [`inverse_onto`] without vector instructions.
fn inverse_onto_plain(coefficients: &[i32; 64], predicted: &[u8; 64], out: &mut [u8; 64]) {
    let Rounded { samples, is_certain } = rounded(coefficients);
    add(predicted, &if is_certain { samples } else { inverse(coefficients) }, out);
}

fn add(predicted: &[u8; 64], added: &[i32; 64], out: &mut [u8; 64]) {
    for i in 0..64 {
        // Outside −256 … 255 any difference saturates the sum.
        out[i] = (i32::from(predicted[i]) + added[i]).clamp(0, 255) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn basis(frequency: usize, position: usize) -> f64 {
        let scale = if frequency == 0 { 0.125f64.sqrt() } else { 0.5 };
        scale * ((2 * position + 1) as f64 * frequency as f64 * PI / 16.0).cos()
    }

    /// Transforms rows, then columns with `f(output index, input index)`: the definition in f64.
    fn separable(values: [f64; 64], f: impl Fn(usize, usize) -> f64) -> [f64; 64] {
        let rows: [f64; 64] = std::array::from_fn(|i| (0..8).map(|k| values[i / 8 * 8 + k] * f(i % 8, k)).sum());
        std::array::from_fn(|i| (0..8).map(|k| rows[8 * k + i % 8] * f(i / 8, k)).sum())
    }

    /// Transposes rows and columns.
    fn turned<T: Copy>(block: [T; 64]) -> [T; 64] {
        std::array::from_fn(|i| block[i % 8 * 8 + i / 8])
    }

    fn forward_definition(samples: &[i32; 64]) -> [f64; 64] {
        turned(separable(samples.map(f64::from), basis))
    }

    fn inverse_definition(coefficients: &[i32; 64]) -> [f64; 64] {
        separable(turned(coefficients.map(f64::from)), |x, u| basis(u, x))
    }

    /// Returns the random numbers of IEEE 1180-1990: uniform integers in −low … high.
    struct Random(u32);
    impl Random {
        fn next(&mut self, low: i32, high: i32) -> i32 {
            self.0 = self.0.wrapping_mul(1_103_515_245).wrapping_add(12345);
            let x = f64::from(self.0 & 0x7fff_fffe) / f64::from(0x7fff_ffff) * f64::from(low + high + 1);
            x as i32 - low
        }
    }

    #[test]
    fn inverse_meets_ieee_1180() {
        let blocks = 10_000;
        for (low, high) in [(256, 255), (5, 5), (300, 300)] {
            for sign in [1, -1] {
                let mut random = Random(1);
                let (mut mean, mut square, mut peak) = ([0.0; 64], [0.0; 64], 0.0f64);
                for _ in 0..blocks {
                    let samples: [i32; 64] = std::array::from_fn(|_| sign * random.next(low, high));
                    let coefficients = forward_definition(&samples).map(|c| (c.round() as i32).clamp(-2048, 2047));
                    let truth = inverse_definition(&coefficients).map(|x| x.round().clamp(-256.0, 255.0));
                    for (i, (ours, truth)) in inverse(&coefficients).into_iter().zip(truth).enumerate() {
                        let error = f64::from(ours) - truth;
                        mean[i] += error / f64::from(blocks);
                        square[i] += error * error / f64::from(blocks);
                        peak = peak.max(error.abs());
                    }
                }
                // Compare with the limits of IEEE 1180.
                let overall = |values: &[f64; 64]| values.iter().sum::<f64>() / 64.0;
                println!(
                    "{}..{}: peak {peak}, mean square {:.5} (worst position {:.5}), mean {:.6} (worst position {:.6})",
                    -low * sign,
                    high * sign,
                    overall(&square),
                    square.iter().fold(0.0f64, |a, &b| a.max(b)),
                    overall(&mean),
                    mean.iter().fold(0.0f64, |a, &b| a.max(b.abs()))
                );
                assert!(peak <= 1.0, "peak error {peak}");
                assert!(square.iter().all(|&e| e <= 0.06) && overall(&square) <= 0.02, "mean square errors {square:?}");
                assert!(
                    mean.iter().all(|&e| e.abs() <= 0.015) && overall(&mean).abs() <= 0.0015,
                    "mean errors {mean:?}"
                );
            }
        }
        assert_eq!(inverse(&[0; 64]), [0; 64]);
    }

    #[test]
    fn both_ways_give_the_same() {
        let mut random = Random(3);
        for _ in 0..if cfg!(miri) { 3 } else { 500 } {
            let predicted: [u8; 64] = std::array::from_fn(|_| random.next(0, 255) as u8);
            let coefficients: [i32; 64] = std::array::from_fn(|_| random.next(300, 300));
            let (mut x, mut y) = ([0; 64], [0; 64]);
            inverse_onto(&coefficients, &predicted, &mut x);
            inverse_onto_plain(&coefficients, &predicted, &mut y);
            assert_eq!(x, y);
            let mut z = [0; 64];
            assert!(
                !Choice::SCALAR.run(ShortInverse { coefficients: &coefficients, predicted: &predicted, out: &mut z })
                    || x == z
            );
            inverse_onto_with(Choice::SCALAR, &coefficients, &predicted, &mut z);
            assert_eq!(x, z);
        }
    }

    #[test]
    fn what_is_certain_is_exact() {
        let mut random = Random(7);
        let mut certain = 0;
        for size in [3, 20, 100, 500, 2000] {
            for count in [1, 2, 4, 12, 64] {
                for _ in 0..400 {
                    // Cover sparse and dense blocks of small and large coefficients.
                    let mut coefficients = [0; 64];
                    for _ in 0..count {
                        coefficients[random.next(0, 63) as usize] = random.next(size, size);
                    }
                    coefficients[63] ^= 1; // mismatch control
                    let Rounded { samples, is_certain } = rounded(&coefficients);
                    if is_certain {
                        certain += 1;
                        assert_eq!(samples.map(|sample| sample.clamp(-256, 255)), inverse(&coefficients));
                    }
                    let (mut out, predicted) = ([0; 64], std::array::from_fn(|i| 4 * i as u8));
                    inverse_onto(&coefficients, &predicted, &mut out);
                    let exact = inverse(&coefficients);
                    let sum = |i: usize| (i32::from(predicted[i]) + exact[i]).clamp(0, 255) as u8;
                    assert_eq!(out, std::array::from_fn(sum));
                }
            }
        }
        assert!(certain > 25 * 400 / 2, "{certain} of 10 000 are certain");
        // A mean of 4½ is on a rounding boundary, so no result is certain.
        let mut middle = [0; 64];
        middle[0] = 36;
        assert!(!rounded(&middle).is_certain);
        let mut off = middle;
        off[0] = 37;
        assert!(rounded(&off).is_certain);
    }

    #[test]
    fn extreme_coefficients_saturate() {
        assert!(inverse(&[2047; 64]).iter().all(|x| (-256..=255).contains(x)));
        assert!(inverse(&[-2048; 64]).iter().all(|x| (-256..=255).contains(x)));
    }
}
