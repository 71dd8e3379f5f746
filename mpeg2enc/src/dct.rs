//! The forward and inverse 8×8 DCT in integers: the same bits on every processor (7.5, Annex A).
//!
//! ```text
//! F(u,v) = 1/4 C(u) C(v) Σx Σy f(x,y) cos((2x+1)uπ/16) cos((2y+1)vπ/16)      C(0) = 1/√2, else 1
//! ```
//! Both run over columns and rows with even and odd frequencies apart, 22 products for eight values,
//! with 28 fractional bits in the cosines and 14 between the passes: far finer than IEEE 1180 asks for.

/// round(cos(kπ/16) · 2^28) for k = 1 … 7.
const C1: i64 = 263_277_544;
const C2: i64 = 248_002_024;
const C3: i64 = 223_195_925;
const C4: i64 = 189_812_531;
const C5: i64 = 149_134_749;
const C6: i64 = 102_725_802;
const C7: i64 = 52_369_160;

/// Fractional bits of the cosines.
const COSINE_BITS: u32 = 28;
/// Fractional bits between the passes.
const MIDDLE_BITS: u32 = 14;
/// Fractional bits of the coefficients that [`forward`] gives.
pub(crate) const COEFFICIENT_BITS: u32 = 3;

#[inline(always)]
fn round_shift(value: i64, bits: u32) -> i64 {
    (value + (1 << (bits - 1))) >> bits
}

/// Twice the one-dimensional transform, with [`COSINE_BITS`] more fractional bits.
#[inline(always)]
fn forward_1d(f: [i64; 8]) -> [i64; 8] {
    let (s0, s1, s2, s3) = (f[0] + f[7], f[1] + f[6], f[2] + f[5], f[3] + f[4]);
    let (d0, d1, d2, d3) = (f[0] - f[7], f[1] - f[6], f[2] - f[5], f[3] - f[4]);
    let (e0, e1, e2, e3) = (s0 + s3, s1 + s2, s0 - s3, s1 - s2);
    [
        C4 * (e0 + e1),
        C1 * d0 + C3 * d1 + C5 * d2 + C7 * d3,
        C2 * e2 + C6 * e3,
        C3 * d0 - C7 * d1 - C1 * d2 - C5 * d3,
        C4 * (e0 - e1),
        C5 * d0 - C1 * d1 + C7 * d2 + C3 * d3,
        C6 * e2 - C2 * e3,
        C7 * d0 - C5 * d1 + C3 * d2 - C1 * d3,
    ]
}

/// Twice the one-dimensional inverse transform, with [`COSINE_BITS`] more fractional bits.
#[inline(always)]
fn inverse_1d(c: [i64; 8]) -> [i64; 8] {
    let (p, m) = (C4 * (c[0] + c[4]), C4 * (c[0] - c[4]));
    let (q, r) = (C2 * c[2] + C6 * c[6], C6 * c[2] - C2 * c[6]);
    let (e0, e1, e2, e3) = (p + q, m + r, m - r, p - q);
    let o0 = C1 * c[1] + C3 * c[3] + C5 * c[5] + C7 * c[7];
    let o1 = C3 * c[1] - C7 * c[3] - C1 * c[5] - C5 * c[7];
    let o2 = C5 * c[1] - C1 * c[3] + C7 * c[5] + C3 * c[7];
    let o3 = C7 * c[1] - C5 * c[3] + C3 * c[5] - C1 * c[7];
    [e0 + o0, e1 + o1, e2 + o2, e3 + o3, e3 - o3, e2 - o2, e1 - o1, e0 - o0]
}

/// Coefficients (raster order, `8 * v + u`) of samples or differences, with [`COEFFICIENT_BITS`] fractional bits.
pub(crate) fn forward(samples: &[i32; 64]) -> [i32; 64] {
    let mut middle = [0; 64];
    for x in 0..8 {
        let column = forward_1d(std::array::from_fn(|y| samples[8 * y + x].into()));
        for v in 0..8 {
            middle[8 * v + x] = round_shift(column[v], COSINE_BITS + 1 - MIDDLE_BITS);
        }
    }
    let mut out = [0; 64];
    for v in 0..8 {
        let row = forward_1d(std::array::from_fn(|x| middle[8 * v + x]));
        for u in 0..8 {
            out[8 * v + u] = round_shift(row[u], COSINE_BITS + 1 + MIDDLE_BITS - COEFFICIENT_BITS) as i32;
        }
    }
    out
}

/// Samples or differences of coefficients in raster order, saturated to −256 … 255 (7.5).
pub(crate) fn inverse(coefficients: &[i32; 64]) -> [i32; 64] {
    let mut middle = [0; 64];
    for u in 0..8 {
        let column: [i64; 8] = std::array::from_fn(|v| coefficients[8 * v + u].into());
        if column == [0; 8] {
            continue; // as most columns are after quantisation
        }
        let column = inverse_1d(column);
        for y in 0..8 {
            middle[8 * y + u] = round_shift(column[y], COSINE_BITS + 1 - MIDDLE_BITS);
        }
    }
    let mut out = [0; 64];
    for y in 0..8 {
        let row = inverse_1d(std::array::from_fn(|u| middle[8 * y + u]));
        for x in 0..8 {
            out[8 * y + x] = round_shift(row[x], COSINE_BITS + 1 + MIDDLE_BITS).clamp(-256, 255) as i32;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn basis(frequency: usize, position: usize) -> f64 {
        let scale = if frequency == 0 { 0.125f64.sqrt() } else { 0.5 };
        scale * ((2 * position + 1) as f64 * frequency as f64 * PI / 16.0).cos()
    }

    /// Rows, then columns with `f(output index, input index)`: the definition in f64.
    fn separable(values: [f64; 64], f: impl Fn(usize, usize) -> f64) -> [f64; 64] {
        let rows: [f64; 64] = std::array::from_fn(|i| (0..8).map(|k| values[i / 8 * 8 + k] * f(i % 8, k)).sum());
        std::array::from_fn(|i| (0..8).map(|k| rows[8 * k + i % 8] * f(i / 8, k)).sum())
    }

    fn forward_definition(samples: &[i32; 64]) -> [f64; 64] {
        separable(samples.map(f64::from), basis)
    }

    fn inverse_definition(coefficients: &[i32; 64]) -> [f64; 64] {
        separable(coefficients.map(f64::from), |x, u| basis(u, x))
    }

    /// The random numbers of IEEE 1180-1990: uniform integers in −low … high.
    struct Random(u32);
    impl Random {
        fn next(&mut self, low: i32, high: i32) -> i32 {
            self.0 = self.0.wrapping_mul(1_103_515_245).wrapping_add(12345);
            let x = f64::from(self.0 & 0x7fff_fffe) / f64::from(0x7fff_ffff) * f64::from(low + high + 1);
            x as i32 - low
        }
    }

    #[test]
    fn forward_is_the_definition() {
        let mut random = Random(1);
        for _ in 0..2000 {
            let samples = std::array::from_fn(|_| random.next(255, 255));
            let (ours, truth) = (forward(&samples), forward_definition(&samples));
            for (a, b) in ours.into_iter().zip(truth) {
                let error = f64::from(a) / f64::from(1 << COEFFICIENT_BITS) - b;
                assert!(error.abs() < 0.5 / f64::from(1 << COEFFICIENT_BITS) + 0.01, "{a} is not {b}");
            }
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
                let overall = |values: &[f64; 64]| values.iter().sum::<f64>() / 64.0;
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
    fn extreme_coefficients_saturate() {
        assert!(inverse(&[2047; 64]).iter().all(|x| (-256..=255).contains(x)));
        assert!(inverse(&[-2048; 64]).iter().all(|x| (-256..=255).contains(x)));
    }
}
