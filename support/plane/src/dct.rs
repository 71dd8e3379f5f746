//! Orthonormal 8×8 DCT-II, shared by a masking model and an MPEG-2 encoder.
//!
//! ```text
//! c(u,v) = ¼ C(u) C(v) Σ_y Σ_x f(x,y) cos((2x+1)uπ/16) cos((2y+1)vπ/16)       C(0) = 1/√2, otherwise C = 1
//! ```
//!
//! This is the transform of ISO/IEC 13818-2, Annex A. c(0,0) is 8 × the mean of the block. The transform is
//! orthonormal: a change of the samples and the resulting change of the coefficients have the same sum of squares.
//! Blocks are in raster order: the sample in column x and row y has index `8 * y + x`. The coefficient of horizontal
//! frequency u and vertical frequency v has index `8 * v + u`.
//!
//! [`dct`] and [`idct`] are the fast transforms. They apply butterflies down the columns, eight columns at a time, then
//! multiply the rows by one 8×8 matrix. Both loops are eight lanes wide, so that the compiler vectorizes them. They
//! need no transposition. [`dct_definition`] and [`idct_definition`] evaluate the defining sums in `f64`. Tests compare
//! the fast transforms with them.

use std::f64::consts::PI;

/// One number for each of eight columns.
type Lanes = [f32; 8];

/// `½ cos(kπ/16)` for k = 0 … 8. Every entry of the basis is one of these values or its negative.
const HALF_COSINE: [f32; 9] =
    [0.5, 0.490_392_64, 0.461_939_77, 0.415_734_8, 0.353_553_4, 0.277_785_12, 0.191_341_72, 0.097_545_16, 0.0];

/// `BASIS[u][x] = ½ C(u) cos((2x+1)uπ/16)`.
const BASIS: [Lanes; 8] = basis();
/// Transpose of `BASIS`.
const BASIS_TRANSPOSED: [Lanes; 8] = transposed(BASIS);

const fn basis() -> [Lanes; 8] {
    // Row u = 0 is constant: ½ C(0) = ½ cos(4π/16).
    let mut out = [[HALF_COSINE[4]; 8]; 8];
    let mut u = 1;
    while u < 8 {
        let mut x = 0;
        while x < 8 {
            // Fold the angle, in units of π/16, into the first quadrant.
            let angle = ((2 * x + 1) * u) % 32;
            let half_turn = if angle > 16 { 32 - angle } else { angle };
            out[u][x] = if half_turn > 8 { -HALF_COSINE[16 - half_turn] } else { HALF_COSINE[half_turn] };
            x += 1;
        }
        u += 1;
    }
    out
}

const fn transposed(matrix: [Lanes; 8]) -> [Lanes; 8] {
    let mut out = [[0.0; 8]; 8];
    // `for` loops are not allowed in constant functions.
    let mut i = 0;
    while i < 64 {
        out[i % 8][i / 8] = matrix[i / 8][i % 8];
        i += 1;
    }
    out
}

#[inline(always)]
fn lanes(f: impl Fn(usize) -> f32) -> Lanes {
    std::array::from_fn(f)
}

#[inline(always)]
fn sum(a: Lanes, b: Lanes) -> Lanes {
    lanes(|i| a[i] + b[i])
}

#[inline(always)]
fn difference(a: Lanes, b: Lanes) -> Lanes {
    lanes(|i| a[i] - b[i])
}

/// Returns `Σ_k weights[k] · rows[k]`, lane by lane.
#[inline(always)]
fn weighted<const N: usize>(weights: [f32; N], rows: [Lanes; N]) -> Lanes {
    lanes(|i| {
        let mut total = weights[0] * rows[0][i];
        for k in 1..N {
            total += weights[k] * rows[k][i];
        }
        total
    })
}

/// Applies eight DCTs of length 8 at once, down the columns.
#[inline(always)]
fn columns_forward(s: [Lanes; 8]) -> [Lanes; 8] {
    let [_, c1, c2, c3, c4, c5, c6, c7, _] = HALF_COSINE;
    // Even frequencies depend on sums of mirrored samples, odd frequencies on differences.
    let even: [Lanes; 4] = std::array::from_fn(|k| sum(s[k], s[7 - k]));
    let odd: [Lanes; 4] = std::array::from_fn(|k| difference(s[k], s[7 - k]));
    // Split the even frequencies again by the same symmetry.
    let outer = [sum(even[0], even[3]), sum(even[1], even[2])];
    let inner = [difference(even[0], even[3]), difference(even[1], even[2])];
    [
        weighted([c4, c4], outer),
        weighted([c1, c3, c5, c7], odd),
        weighted([c2, c6], inner),
        weighted([c3, -c7, -c1, -c5], odd),
        weighted([c4, -c4], outer),
        weighted([c5, -c1, c7, c3], odd),
        weighted([c6, -c2], inner),
        weighted([c7, -c5, c3, -c1], odd),
    ]
}

/// Computes the inverse of [`columns_forward`].
#[inline(always)]
fn columns_inverse(c: [Lanes; 8]) -> [Lanes; 8] {
    let [_, c1, c2, c3, c4, c5, c6, c7, _] = HALF_COSINE;
    // Rebuild the even half from frequencies 0, 4 and 2, 6.
    let outer = [weighted([c4, c4], [c[0], c[4]]), weighted([c4, -c4], [c[0], c[4]])];
    let inner = [weighted([c2, c6], [c[2], c[6]]), weighted([c6, -c2], [c[2], c[6]])];
    let even = [
        sum(outer[0], inner[0]),
        sum(outer[1], inner[1]),
        difference(outer[1], inner[1]),
        difference(outer[0], inner[0]),
    ];
    // Rebuild the odd half.
    let waves = [c[1], c[3], c[5], c[7]];
    let odd = [
        weighted([c1, c3, c5, c7], waves),
        weighted([c3, -c7, -c1, -c5], waves),
        weighted([c5, -c1, c7, c3], waves),
        weighted([c7, -c5, c3, -c1], waves),
    ];
    // Sample k is the sum of both halves. The mirrored sample is their difference.
    std::array::from_fn(|k| if k < 4 { sum(even[k], odd[k]) } else { difference(even[7 - k], odd[7 - k]) })
}

/// Multiplies each row by `matrix`: `out[y][j] = Σ_k rows[y][k] · matrix[k][j]`.
#[inline(always)]
fn rows_times(rows: [Lanes; 8], matrix: &[Lanes; 8]) -> [Lanes; 8] {
    std::array::from_fn(|y| weighted(rows[y], *matrix))
}

#[inline(always)]
fn split(block: &[f32; 64]) -> [Lanes; 8] {
    std::array::from_fn(|y| lanes(|x| block[8 * y + x]))
}

#[inline(always)]
fn join(rows: [Lanes; 8]) -> [f32; 64] {
    std::array::from_fn(|i| rows[i / 8][i % 8])
}

/// Returns the DCT coefficients of a block of samples. Coefficient (u, v) has index `8 * v + u`, and coefficient 0 is
/// 8 × the mean.
///
/// ```
/// let coefficients = plane::dct(&[3.0; 64]);
/// assert!((coefficients[0] - 24.0).abs() < 1e-5);
/// assert!(coefficients[1..].iter().all(|c| c.abs() < 1e-5));
/// ```
#[must_use]
pub fn dct(samples: &[f32; 64]) -> [f32; 64] {
    join(rows_times(columns_forward(split(samples)), &BASIS_TRANSPOSED))
}

/// Returns the samples of a block of coefficients: the inverse of [`dct`].
///
/// Samples are neither rounded nor clipped. An encoder that must match decoders has to round samples as the standard
/// specifies.
#[must_use]
pub fn idct(coefficients: &[f32; 64]) -> [f32; 64] {
    join(columns_inverse(rows_times(split(coefficients), &BASIS)))
}

/// Returns an entry of the basis: `½ C(u) cos((2x+1)uπ/16)`.
fn basis_definition(u: usize, x: usize) -> f64 {
    let c = if u == 0 { 0.5f64.sqrt() } else { 1.0 };
    0.5 * c * (((2 * x + 1) * u) as f64 * PI / 16.0).cos()
}

/// Computes [`dct`] as its defining double sum, in `f64`. It is the slow reference for testing the fast transform.
#[must_use]
pub fn dct_definition(samples: &[f64; 64]) -> [f64; 64] {
    std::array::from_fn(|i| {
        let (u, v) = (i % 8, i / 8);
        (0..64).map(|k| samples[k] * basis_definition(u, k % 8) * basis_definition(v, k / 8)).sum()
    })
}

/// Computes [`idct`] as its defining double sum, in `f64`.
#[must_use]
pub fn idct_definition(coefficients: &[f64; 64]) -> [f64; 64] {
    std::array::from_fn(|k| {
        let (x, y) = (k % 8, k / 8);
        (0..64).map(|i| coefficients[i] * basis_definition(i % 8, x) * basis_definition(i / 8, y)).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn block() -> impl Strategy<Value = [f32; 64]> {
        prop::array::uniform32(prop::array::uniform2(-256.0f32..256.0)).prop_map(|pairs| {
            let mut out = [0.0; 64];
            for (i, pair) in pairs.iter().enumerate() {
                out[2 * i..][..2].copy_from_slice(pair);
            }
            out
        })
    }

    #[test]
    fn the_basis_is_the_one_of_the_definition() {
        for (u, row) in BASIS.iter().enumerate() {
            for (x, &value) in row.iter().enumerate() {
                assert!((f64::from(value) - basis_definition(u, x)).abs() < 3e-8, "u = {u}, x = {x}");
                assert_eq!(value, BASIS_TRANSPOSED[x][u]);
            }
        }
    }

    #[test]
    fn dc_is_eight_times_the_mean() {
        let ramp: [f32; 64] = std::array::from_fn(|i| i as f32);
        assert!((dct(&ramp)[0] - 8.0 * 31.5).abs() < 1e-3);
    }

    #[test]
    fn horizontal_frequency_runs_along_the_row_of_coefficients() {
        let wave: [f32; 64] =
            std::array::from_fn(|i| (((2 * (i % 8) + 1) * 3) as f32 * std::f32::consts::PI / 16.0).cos());
        let coefficients = dct(&wave);
        assert!((coefficients[3] - 32f32.sqrt()).abs() < 1e-4, "{}", coefficients[3]);
        assert!(coefficients.iter().enumerate().all(|(i, c)| i == 3 || c.abs() < 1e-4));
    }

    proptest! {
        #[test]
        fn fast_forms_agree_with_the_definition(samples in block()) {
            // The largest coefficient is 256 · 8. The tolerance, 1e-3 code values, is 2^-21 of it: a few `f32`
            // roundings.
            let exact = dct_definition(&samples.map(f64::from));
            for (fast, exact) in dct(&samples).iter().zip(exact) {
                prop_assert!((f64::from(*fast) - exact).abs() < 1e-3, "{fast} {exact}");
            }
            let exact = idct_definition(&samples.map(f64::from));
            for (fast, exact) in idct(&samples).iter().zip(exact) {
                prop_assert!((f64::from(*fast) - exact).abs() < 1e-3, "{fast} {exact}");
            }
        }

        #[test]
        fn the_inverse_undoes_the_transform(samples in block()) {
            for (there_and_back, sample) in idct(&dct(&samples)).iter().zip(samples) {
                prop_assert!((there_and_back - sample).abs() < 1e-3);
            }
        }

        #[test]
        fn energy_is_kept(samples in block()) {
            let energy = |block: &[f32; 64]| block.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>();
            let (before, after) = (energy(&samples), energy(&dct(&samples)));
            prop_assert!((after / before - 1.0).abs() < 1e-5, "{before} {after}");
        }
    }
}
