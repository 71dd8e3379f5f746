//! Blocks of numbers of 32 bits, eight at a time, by instructions of AVX2.
#![allow(unsafe_code, reason = "vector instructions may only run where the processor has them")]

use std::arch::x86_64::*;

/// [`divide`](super::divide) of eight values at a time.
///
/// # Safety
/// The processor has AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn divide(
    values: &[i32; 64],
    reciprocals: &[u32; 64],
    zero: u32,
    shift: u32,
    out: &mut [u32; 64],
) -> u64 {
    let (zero, shift, mut nonzero) = (_mm256_set1_epi32(zero as i32), _mm_cvtsi32_si128(shift as i32), 0);
    let (values, _) = values.as_chunks::<8>();
    let (reciprocals, _) = reciprocals.as_chunks::<8>();
    let (out, _) = out.as_chunks_mut::<8>();
    for (i, ((values, reciprocals), out)) in values.iter().zip(reciprocals).zip(out).enumerate() {
        // SAFETY: each of the three is eight numbers of 32 bits.
        unsafe {
            let magnitudes = _mm256_abs_epi32(_mm256_loadu_si256(values.as_ptr().cast()));
            let products = _mm256_mullo_epi32(magnitudes, _mm256_loadu_si256(reciprocals.as_ptr().cast()));
            let levels = _mm256_srl_epi32(_mm256_add_epi32(products, zero), shift);
            _mm256_storeu_si256(out.as_mut_ptr().cast(), levels);
            let empty = _mm256_cmpeq_epi32(levels, _mm256_setzero_si256());
            nonzero |= u64::from(!_mm256_movemask_ps(_mm256_castsi256_ps(empty)) as u8) << (8 * i);
        }
    }
    nonzero
}

/// One-dimensional inverse transforms of columns beside each other, as `inverse_short_1d` of [`dct`](crate::dct) makes them.
#[target_feature(enable = "avx2")]
#[inline]
fn inverse_1d(c: [__m256; 8], cosine: &[f32; 8]) -> [__m256; 8] {
    let times = |k: usize, x: __m256| _mm256_mul_ps(_mm256_set1_ps(cosine[k]), x);
    let (p, m) = (times(4, _mm256_add_ps(c[0], c[4])), times(4, _mm256_sub_ps(c[0], c[4])));
    let q = _mm256_add_ps(times(2, c[2]), times(6, c[6]));
    let r = _mm256_sub_ps(times(6, c[2]), times(2, c[6]));
    let e = [_mm256_add_ps(p, q), _mm256_add_ps(m, r), _mm256_sub_ps(m, r), _mm256_sub_ps(p, q)];
    let o = [
        _mm256_add_ps(_mm256_add_ps(times(1, c[1]), times(3, c[3])), _mm256_add_ps(times(5, c[5]), times(7, c[7]))),
        _mm256_sub_ps(_mm256_sub_ps(times(3, c[1]), times(7, c[3])), _mm256_add_ps(times(1, c[5]), times(5, c[7]))),
        _mm256_add_ps(_mm256_sub_ps(times(5, c[1]), times(1, c[3])), _mm256_add_ps(times(7, c[5]), times(3, c[7]))),
        _mm256_add_ps(_mm256_sub_ps(times(7, c[1]), times(5, c[3])), _mm256_sub_ps(times(3, c[5]), times(1, c[7]))),
    ];
    [
        _mm256_add_ps(e[0], o[0]),
        _mm256_add_ps(e[1], o[1]),
        _mm256_add_ps(e[2], o[2]),
        _mm256_add_ps(e[3], o[3]),
        _mm256_sub_ps(e[3], o[3]),
        _mm256_sub_ps(e[2], o[2]),
        _mm256_sub_ps(e[1], o[1]),
        _mm256_sub_ps(e[0], o[0]),
    ]
}

/// Rows become columns.
#[target_feature(enable = "avx2")]
#[inline]
fn transposed(rows: [__m256; 8]) -> [__m256; 8] {
    let [a, b, c, d, e, f, g, h] = rows;
    // Pairs of rows, then fours, then halves.
    let pairs = [
        [_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d), _mm256_unpacklo_ps(e, f), _mm256_unpacklo_ps(g, h)],
        [_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d), _mm256_unpackhi_ps(e, f), _mm256_unpackhi_ps(g, h)],
    ];
    let mut out = rows;
    for i in 0..2 {
        let [ab, cd, ef, gh] = pairs[i];
        let (low, high) = (_mm256_shuffle_ps::<0x44>(ab, cd), _mm256_shuffle_ps::<0x44>(ef, gh));
        out[2 * i] = _mm256_permute2f128_ps::<0x20>(low, high);
        out[2 * i + 4] = _mm256_permute2f128_ps::<0x31>(low, high);
        let (low, high) = (_mm256_shuffle_ps::<0xee>(ab, cd), _mm256_shuffle_ps::<0xee>(ef, gh));
        out[2 * i + 1] = _mm256_permute2f128_ps::<0x20>(low, high);
        out[2 * i + 5] = _mm256_permute2f128_ps::<0x31>(low, high);
    }
    out
}

/// A prediction and what coefficients add to it, saturated, if rounding to the nearest is certain: no sum is farther from a
/// whole number than `bound` of the sum of magnitudes. Otherwise `out` is anything.
///
/// # Safety
/// The processor has AVX2.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn inverse_onto(
    coefficients: &[i32; 64],
    cosine: &[f32; 8],
    bound: impl Fn(i32) -> f32,
    predicted: &[u8; 64],
    out: &mut [u8; 64],
) -> bool {
    let zero = _mm256_setzero_si256();
    let (mut rows, mut magnitudes) = ([_mm256_setzero_ps(); 8], zero);
    // Loops with numbers are unrolled.
    for (i, row) in rows.iter_mut().enumerate() {
        // SAFETY: eight numbers of 32 bits.
        let coefficients = unsafe { _mm256_loadu_si256(coefficients.as_ptr().add(8 * i).cast()) };
        magnitudes = _mm256_add_epi32(magnitudes, _mm256_abs_epi32(coefficients));
        *row = _mm256_cvtepi32_ps(coefficients);
    }
    let sums = _mm256_hadd_epi32(magnitudes, zero);
    let sums = _mm256_hadd_epi32(sums, zero);
    let magnitude = _mm256_extract_epi32::<0>(sums) + _mm256_extract_epi32::<4>(sums);
    let rows = inverse_1d(transposed(inverse_1d(rows, cosine)), cosine);
    // The sum with 3·2²² has no bits left for a fraction.
    let rounding = _mm256_set1_ps(12_582_912.0);
    let sign = _mm256_set1_ps(-0.0);
    let mut farthest = _mm256_setzero_ps();
    let mut sums = [zero; 8];
    for i in 0..8 {
        let near = _mm256_add_ps(rows[i], rounding);
        let distance = _mm256_andnot_ps(sign, _mm256_sub_ps(rows[i], _mm256_sub_ps(near, rounding)));
        farthest = _mm256_max_ps(farthest, distance);
        let added = _mm256_sub_epi32(_mm256_castps_si256(near), _mm256_castps_si256(rounding));
        // SAFETY: eight bytes.
        let predicted = unsafe { _mm_loadl_epi64(predicted.as_ptr().add(8 * i).cast()) };
        sums[i] = _mm256_add_epi32(_mm256_cvtepu8_epi32(predicted), added);
    }
    // Packing takes each half by itself: four samples of every row, then the four others.
    let order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
    for i in 0..2 {
        let (upper, lower) =
            (_mm256_packs_epi32(sums[4 * i], sums[4 * i + 1]), _mm256_packs_epi32(sums[4 * i + 2], sums[4 * i + 3]));
        let bytes = _mm256_permutevar8x32_epi32(_mm256_packus_epi16(upper, lower), order);
        // SAFETY: 32 bytes.
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().add(32 * i).cast(), bytes) };
    }
    let bound = _mm256_set1_ps(bound(magnitude));
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(farthest, bound)) == 0xff
}
