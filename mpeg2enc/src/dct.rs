//! Forward 8×8 DCT in integers, with the same bits on every processor (Annex A).
//!
//! ```text
//! F(u,v) = 1/4 C(u) C(v) Σx Σy f(x,y) cos((2x+1)uπ/16) cos((2y+1)vπ/16)      C(0) = 1/√2, else 1
//! ```
//! The transform processes columns, then the columns of the transposed block, with even and odd frequencies separated. Eight
//! values take 22 products, and eight columns run in parallel. Coefficients are stored by column: horizontal frequency u and
//! vertical frequency v are at `8 * u + v`. This order saves a second transposition.
//!
//! There are 13 fractional bits in the cosines and 5 between the passes, so 32-bit integers suffice.

use mpeg2::COSINE;
pub(crate) use mpeg2::inverse_onto;

/// round(cos(kπ/16) · 2^13).
const SHORT_COSINE: [i32; 8] = {
    let mut short = [0; 8];
    let mut k = 0;
    while k < 8 {
        short[k] = ((COSINE[k] + (1 << 14)) >> 15) as i32;
        k += 1;
    }
    short
};
const SHORT_COSINE_BITS: u32 = 13;
const SHORT_MIDDLE_BITS: u32 = 5;

/// Fractional bits of the coefficients returned by [`forward`].
pub(crate) const COEFFICIENT_BITS: u32 = 3;

/// Computes twice the one-dimensional transform along the first index, shifted right and rounded.
#[inline(always)]
fn forward_1d(f: &[[i32; 8]; 8], shift: u32) -> [[i32; 8]; 8] {
    let [_, c1, c2, c3, c4, c5, c6, c7] = SHORT_COSINE;
    let mut out = [[0; 8]; 8];
    let round = 1 << (shift - 1);
    for x in 0..8 {
        // Sums of mirrored samples determine even frequencies; differences determine odd ones.
        let (s0, s1, s2, s3) = (f[0][x] + f[7][x], f[1][x] + f[6][x], f[2][x] + f[5][x], f[3][x] + f[4][x]);
        let (d0, d1, d2, d3) = (f[0][x] - f[7][x], f[1][x] - f[6][x], f[2][x] - f[5][x], f[3][x] - f[4][x]);
        let (e0, e1, e2, e3) = (s0 + s3, s1 + s2, s0 - s3, s1 - s2);
        out[0][x] = (c4 * (e0 + e1) + round) >> shift;
        out[1][x] = (c1 * d0 + c3 * d1 + c5 * d2 + c7 * d3 + round) >> shift;
        out[2][x] = (c2 * e2 + c6 * e3 + round) >> shift;
        out[3][x] = (c3 * d0 - c7 * d1 - c1 * d2 - c5 * d3 + round) >> shift;
        out[4][x] = (c4 * (e0 - e1) + round) >> shift;
        out[5][x] = (c5 * d0 - c1 * d1 + c7 * d2 + c3 * d3 + round) >> shift;
        out[6][x] = (c6 * e2 - c2 * e3 + round) >> shift;
        out[7][x] = (c7 * d0 - c5 * d1 + c3 * d2 - c1 * d3 + round) >> shift;
    }
    out
}

#[inline(always)]
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

/// Transforms samples or differences to coefficients with [`COEFFICIENT_BITS`] fractional bits.
#[inline(always)]
fn forward(samples: &[i32; 64]) -> [i32; 64] {
    let middle = forward_1d(rows(samples), SHORT_COSINE_BITS + 1 - SHORT_MIDDLE_BITS);
    flat(&forward_1d(&transposed(&middle), SHORT_COSINE_BITS + 1 + SHORT_MIDDLE_BITS - COEFFICIENT_BITS))
}

vectorized! {
    /// Returns the coefficients of the difference between source and prediction, in the format of [`forward`].
    fn forward_difference, forward_difference_plain(source: &[u8; 64], predicted: &[u8; 64]) -> [i32; 64] {
        let mut difference = [0; 64];
        for i in 0..64 {
            difference[i] = i32::from(source[i]) - i32::from(predicted[i]);
        }
        forward(&difference)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plane::dct_definition;

    /// Transposes rows and columns.
    fn turned<T: Copy>(block: [T; 64]) -> [T; 64] {
        std::array::from_fn(|i| block[i % 8 * 8 + i / 8])
    }

    fn forward_definition(samples: &[i32; 64]) -> [f64; 64] {
        turned(dct_definition(&samples.map(f64::from)))
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
    fn forward_is_the_definition() {
        let mut random = Random(1);
        for _ in 0..2000 {
            let samples = std::array::from_fn(|_| random.next(255, 255));
            let (ours, truth) = (forward(&samples), forward_definition(&samples));
            for (a, b) in ours.into_iter().zip(truth) {
                let error = f64::from(a) / f64::from(1 << COEFFICIENT_BITS) - b;
                // The limit is the sum of three errors: half of the last place; eight sums rounded to 5 bits, each times at most
                // 1/2; cosines of 13 bits.
                let last_place = 1.0 / f64::from(1 << COEFFICIENT_BITS);
                let allowed = 0.5 * last_place + 8.0 * 0.5 / 64.0 + b.abs() * 2.0f64.powi(-12);
                assert!(error.abs() < allowed, "{a} is not {b}");
            }
        }
    }

    #[test]
    fn both_ways_give_the_same() {
        let mut random = Random(3);
        for _ in 0..if cfg!(miri) { 3 } else { 500 } {
            let [source, predicted]: [[u8; 64]; 2] =
                std::array::from_fn(|_| std::array::from_fn(|_| random.next(0, 255) as u8));
            let coefficients = forward_difference(&source, &predicted);
            assert_eq!(coefficients, forward_difference_plain(&source, &predicted));
        }
    }
}
