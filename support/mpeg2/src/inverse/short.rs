//! Floating-point inverse transform, which detects whether it equals the exact one.

use super::{COSINE, COSINE_BITS, rows, transposed};
use lanes::{Kernel, LANES, Lanes};

/// Half of [`COSINE`], with 24 significant bits.
pub(super) const FLOAT_COSINE: [f32; 8] = {
    let mut float = [0.0; 8];
    let mut k = 0;
    while k < 8 {
        float[k] = (COSINE[k] as f64 / (1u64 << (COSINE_BITS + 1)) as f64) as f32;
        k += 1;
    }
    float
};

/// Maximum error of the exact transform after two passes. It is ½·Σ cos(kπ/16), or 2.65, times half of the last place between
/// the passes, plus the error of 28-bit cosines.
const EXACT_ERROR: f32 = 1e-4;
/// Maximum error of two passes of [`inverse_1d`], relative to the sum of magnitudes. A coefficient has a factor of at most 1/4.
/// Each pass rounds it 6 times (cosine, product, four sums) by at most 2⁻²⁴, which makes 1.8·10⁻⁷.
const SHORT_ERROR: f32 = 2.2e-7;

/// Returns the maximum distance between a sample and an integer that ensures exact rounding, for this sum of coefficient
/// magnitudes.
pub(super) fn certain(magnitude: i32) -> f32 {
    0.5 - EXACT_ERROR - SHORT_ERROR * magnitude as f32
}

/// Adds the inverse transform to a prediction, and saturates. Returns whether the rounding is [`certain`]; if not, `out` is
/// undefined.
pub(super) struct ShortInverse<'a> {
    pub coefficients: &'a [i32; 64],
    pub predicted: &'a [u8; 64],
    pub out: &'a mut [u8; 64],
}

impl Kernel for ShortInverse<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let (coefficients, _) = self.coefficients.as_chunks::<LANES>();
        // Sum the magnitudes, because they bound the error of the floating-point passes.
        let (mut rows, mut magnitudes) = ([lanes.splat(0.0); LANES], lanes.splat_i(0));
        for (row, coefficients) in rows.iter_mut().zip(coefficients) {
            let coefficients = lanes.load_i(coefficients);
            magnitudes = lanes.add_i(magnitudes, lanes.abs_i(coefficients));
            *row = lanes.to_f(coefficients);
        }
        let rows = inverse_1d(lanes, lanes.transposed(inverse_1d(lanes, rows)));
        // Adding 3·2²² rounds, because the sum has no fractional bits.
        let rounding = lanes.splat(12_582_912.0);
        let mut farthest = lanes.splat(0.0);
        let mut sums = [lanes.splat_i(0); LANES];
        let (predicted, _) = self.predicted.as_chunks::<LANES>();
        for i in 0..LANES {
            let near = lanes.add(rows[i], rounding);
            let distance = lanes.abs(lanes.sub(rows[i], lanes.sub(near, rounding)));
            farthest = lanes.max(farthest, distance);
            let added = lanes.sub_i(lanes.to_bits(near), lanes.to_bits(rounding));
            sums[i] = lanes.add_i(lanes.load_u8(&predicted[i]), added);
        }
        let (out, _) = self.out.as_chunks_mut::<{ 4 * LANES }>();
        let [a, b, c, d, e, f, g, h] = sums;
        (out[0], out[1]) = (lanes.to_u8([a, b, c, d]), lanes.to_u8([e, f, g, h]));
        // Accept the result if no value is close to a rounding boundary.
        let bound = lanes.splat(certain(lanes.sum_i(magnitudes)));
        lanes.bits(lanes.lt(farthest, bound)) == 0xff
    }
}

/// Computes one-dimensional inverse transforms of columns in parallel.
#[inline(always)]
fn inverse_1d<L: Lanes>(lanes: L, c: [L::F; LANES]) -> [L::F; LANES] {
    let mut cosine = [lanes.splat(0.0); LANES];
    for (wide, &cosine) in cosine.iter_mut().zip(&FLOAT_COSINE) {
        *wide = lanes.splat(cosine);
    }
    // Compute products and two-term sums in a fixed order.
    macro_rules! times {
        ($k:literal, $x:expr) => {
            lanes.mul(cosine[$k], $x)
        };
    }
    // Even frequencies are symmetric about the center; odd frequencies are antisymmetric.
    let (p, m) = (times!(4, lanes.add(c[0], c[4])), times!(4, lanes.sub(c[0], c[4])));
    let q = lanes.add(times!(2, c[2]), times!(6, c[6]));
    let r = lanes.sub(times!(6, c[2]), times!(2, c[6]));
    let e = [lanes.add(p, q), lanes.add(m, r), lanes.sub(m, r), lanes.sub(p, q)];
    let o = [
        lanes.add(lanes.add(times!(1, c[1]), times!(3, c[3])), lanes.add(times!(5, c[5]), times!(7, c[7]))),
        lanes.sub(lanes.sub(times!(3, c[1]), times!(7, c[3])), lanes.add(times!(1, c[5]), times!(5, c[7]))),
        lanes.add(lanes.sub(times!(5, c[1]), times!(1, c[3])), lanes.add(times!(7, c[5]), times!(3, c[7]))),
        lanes.add(lanes.sub(times!(7, c[1]), times!(5, c[3])), lanes.sub(times!(3, c[5]), times!(1, c[7]))),
    ];
    // Mirrored samples are the sum and the difference of both halves.
    let mut out = c;
    for k in 0..LANES / 2 {
        out[k] = lanes.add(e[k], o[k]);
        out[LANES - 1 - k] = lanes.sub(e[k], o[k]);
    }
    out
}

/// Result of the floating-point transform before saturation.
pub(super) struct Rounded {
    pub samples: [i32; 64],
    /// Whether the rounding is [`certain`].
    pub is_certain: bool,
}

/// Computes the transform of [`ShortInverse`] with the same bits, in loops that take little code.
pub(super) fn rounded(coefficients: &[i32; 64]) -> Rounded {
    let float = rows(coefficients).map(|row| row.map(|c| c as f32));
    let bound = certain(coefficients.iter().map(|c| c.abs()).sum());
    let out = inverse_plain(&transposed(&inverse_plain(&float)));
    // Adding 3·2²² rounds, because the sum has no fractional bits.
    const ROUNDING: f32 = 12_582_912.0;
    let (mut samples, mut farthest) = ([0; 64], 0.0f32);
    for (sample, &value) in samples.iter_mut().zip(out.as_flattened()) {
        let near = value + ROUNDING;
        *sample = near.to_bits() as i32 - ROUNDING.to_bits() as i32;
        // `f32::max` calls a function on some processors.
        let distance = (value - (near - ROUNDING)).abs();
        farthest = if distance > farthest { distance } else { farthest };
    }
    Rounded { samples, is_certain: farthest < bound }
}

/// Computes the one-dimensional inverse transform along the first index.
#[inline(never)]
fn inverse_plain(c: &[[f32; 8]; 8]) -> [[f32; 8]; 8] {
    let [_, c1, c2, c3, c4, c5, c6, c7] = FLOAT_COSINE;
    let mut out = [[0.0; 8]; 8];
    for x in 0..8 {
        let (p, m) = (c4 * (c[0][x] + c[4][x]), c4 * (c[0][x] - c[4][x]));
        let (q, r) = (c2 * c[2][x] + c6 * c[6][x], c6 * c[2][x] - c2 * c[6][x]);
        let (e0, e1, e2, e3) = (p + q, m + r, m - r, p - q);
        let o0 = (c1 * c[1][x] + c3 * c[3][x]) + (c5 * c[5][x] + c7 * c[7][x]);
        let o1 = (c3 * c[1][x] - c7 * c[3][x]) - (c1 * c[5][x] + c5 * c[7][x]);
        let o2 = (c5 * c[1][x] - c1 * c[3][x]) + (c7 * c[5][x] + c3 * c[7][x]);
        let o3 = (c7 * c[1][x] - c5 * c[3][x]) + (c3 * c[5][x] - c1 * c[7][x]);
        out[0][x] = e0 + o0;
        out[1][x] = e1 + o1;
        out[2][x] = e2 + o2;
        out[3][x] = e3 + o3;
        out[4][x] = e3 - o3;
        out[5][x] = e2 - o2;
        out[6][x] = e1 - o1;
        out[7][x] = e0 - o0;
    }
    out
}
