//! Implementation of lanes with the 256-bit instructions of x86-64.
//!
//! Speed compared with the scalar implementation, in million rays per second on one thread (Sponza, 66 thousand
//! triangles, AMD EPYC). `cargo bench -p render2mpeg-render-core --bench rays` runs both.
//!
//! | rays | AVX2 | scalar |
//! |---|---|---|
//! | primary, in packets | 20.3 | 12.7 |
//! | primary, single | 6.2 | 3.4 |
//! | shadow, single | 13.0 | 6.5 |
//! | diffuse, single | 3.7 | 2.5 |
#![allow(unsafe_code, reason = "vector instructions may only run where the processor has them")]

mod samples;

use crate::{Bytes, Kernel, LANES, Lanes};
use std::arch::x86_64::*;
use std::sync::atomic::{AtomicU8, Ordering};

/// Proof that this processor has AVX2 and the bit instructions of its generation.
///
/// Code outside this crate obtains a value only from [`Choice::best`](crate::Choice::best). It cannot name the type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// Returns the proof if the processor has AVX2, BMI1, LZCNT and POPCNT. Queries the processor on the first call.
    #[inline(always)]
    pub(crate) fn detect() -> Option<Self> {
        const UNKNOWN: u8 = 0;
        const ABSENT: u8 = 1;
        const PRESENT: u8 = 2;
        static KNOWN: AtomicU8 = AtomicU8::new(UNKNOWN);

        #[cold]
        fn query() -> bool {
            let has_all = is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("lzcnt")
                && is_x86_feature_detected!("popcnt");
            KNOWN.store(if has_all { PRESENT } else { ABSENT }, Ordering::Relaxed);
            has_all
        }

        // Threads may query at the same time, because all of them store the same result.
        let present = match KNOWN.load(Ordering::Relaxed) {
            UNKNOWN => query(),
            known => known == PRESENT,
        };
        present.then_some(Self(()))
    }

    /// Runs `kernel` inside a function that may use the vector instructions.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx2,bmi1,lzcnt,popcnt")]
        fn compiled_for_avx2<K: Kernel>(kernel: K, lanes: Avx2) -> K::Output {
            kernel.run(lanes)
        }
        // SAFETY: `self` exists only where `detect` has found all four features.
        unsafe { compiled_for_avx2(kernel, self) }
    }
}

/// Runs one instruction that requires only the processor's support.
macro_rules! instruction {
    ($call:expr) => {
        // SAFETY: a value of `Avx2`, or of a type parameter that implements `Lanes`, exists in running code only where
        // the processor has these instructions. They access memory only through the references passed to them.
        unsafe { $call }
    };
}

impl Lanes for Avx2 {
    const PROOF: Self = Self(());

    type F = __m256;
    type I = __m256i;
    type Mask = __m256;
    type Samples = samples::Rows;
    type Words = samples::Words;

    #[inline(always)]
    fn splat(self, x: f32) -> __m256 {
        instruction!(_mm256_set1_ps(x))
    }

    #[inline(always)]
    fn load(self, x: &[f32; LANES]) -> __m256 {
        instruction!(_mm256_loadu_ps(x.as_ptr()))
    }

    #[inline(always)]
    fn load_halves(self, low: &[f32; LANES / 2], high: &[f32; LANES / 2]) -> __m256 {
        // The intrinsic expects the high half first.
        instruction!(_mm256_loadu2_m128(high.as_ptr(), low.as_ptr()))
    }

    #[inline(always)]
    fn store(self, x: __m256) -> [f32; LANES] {
        let mut out = [0.0; LANES];
        instruction!(_mm256_storeu_ps(out.as_mut_ptr(), x));
        out
    }

    #[inline(always)]
    fn store_halves(self, x: __m256, low: &mut [f32; LANES / 2], high: &mut [f32; LANES / 2]) {
        // The intrinsic expects the high half first.
        instruction!(_mm256_storeu2_m128(high.as_mut_ptr(), low.as_mut_ptr(), x));
    }

    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_add_ps(a, b))
    }

    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_sub_ps(a, b))
    }

    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_mul_ps(a, b))
    }

    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_div_ps(a, b))
    }

    #[inline(always)]
    fn neg(self, a: __m256) -> __m256 {
        // Flip the sign bit. A subtraction from 0 would give +0 for +0.
        instruction!(_mm256_xor_ps(a, _mm256_set1_ps(-0.0)))
    }

    #[inline(always)]
    fn abs(self, a: __m256) -> __m256 {
        instruction!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), a))
    }

    #[inline(always)]
    fn sqrt(self, a: __m256) -> __m256 {
        instruction!(_mm256_sqrt_ps(a))
    }

    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_min_ps(a, b))
    }

    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_max_ps(a, b))
    }

    #[inline(always)]
    fn lt(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b))
    }

    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))
    }

    #[inline(always)]
    fn eq(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_cmp_ps::<_CMP_EQ_OQ>(a, b))
    }

    #[inline(always)]
    fn lt_bits(self, a: __m256, b: __m256) -> __m256 {
        // Reverse the operands, because AVX2 compares integers only with `>`.
        instruction!(_mm256_castsi256_ps(_mm256_cmpgt_epi32(_mm256_castps_si256(b), _mm256_castps_si256(a))))
    }

    #[inline(always)]
    fn and(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_and_ps(a, b))
    }

    #[inline(always)]
    fn or(self, a: __m256, b: __m256) -> __m256 {
        instruction!(_mm256_or_ps(a, b))
    }

    #[inline(always)]
    fn select(self, mask: __m256, yes: __m256, no: __m256) -> __m256 {
        instruction!(_mm256_blendv_ps(no, yes, mask))
    }

    #[inline(always)]
    fn bits(self, mask: __m256) -> u32 {
        instruction!(_mm256_movemask_ps(mask)) as u32
    }

    #[inline(always)]
    fn transposed(self, [a, b, c, d, e, f, g, h]: [__m256; LANES]) -> [__m256; LANES] {
        instruction!({
            // Interleave pairs of rows, then groups of four rows, then halves of registers.
            let pairs = [
                [
                    _mm256_unpacklo_ps(a, b),
                    _mm256_unpacklo_ps(c, d),
                    _mm256_unpacklo_ps(e, f),
                    _mm256_unpacklo_ps(g, h),
                ],
                [
                    _mm256_unpackhi_ps(a, b),
                    _mm256_unpackhi_ps(c, d),
                    _mm256_unpackhi_ps(e, f),
                    _mm256_unpackhi_ps(g, h),
                ],
            ];
            // The low and high halves of each shuffled register belong to columns i and i + 4.
            let mut out = [a; LANES];
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
        })
    }

    #[inline(always)]
    fn splat_i(self, x: i32) -> __m256i {
        instruction!(_mm256_set1_epi32(x))
    }

    #[inline(always)]
    fn load_i(self, x: &[i32; LANES]) -> __m256i {
        instruction!(_mm256_loadu_si256(x.as_ptr().cast()))
    }

    #[inline(always)]
    fn load_u32(self, x: &[u32; LANES]) -> __m256i {
        instruction!(_mm256_loadu_si256(x.as_ptr().cast()))
    }

    #[inline(always)]
    fn load_u8(self, x: &[u8; LANES]) -> __m256i {
        instruction!(_mm256_cvtepu8_epi32(_mm_loadl_epi64(x.as_ptr().cast())))
    }

    #[inline(always)]
    fn store_i(self, x: __m256i) -> [i32; LANES] {
        let mut out = [0; LANES];
        instruction!(_mm256_storeu_si256(out.as_mut_ptr().cast(), x));
        out
    }

    #[inline(always)]
    fn store_u32(self, x: __m256i) -> [u32; LANES] {
        let mut out = [0; LANES];
        instruction!(_mm256_storeu_si256(out.as_mut_ptr().cast(), x));
        out
    }

    #[inline(always)]
    fn add_i(self, a: __m256i, b: __m256i) -> __m256i {
        instruction!(_mm256_add_epi32(a, b))
    }

    #[inline(always)]
    fn sub_i(self, a: __m256i, b: __m256i) -> __m256i {
        instruction!(_mm256_sub_epi32(a, b))
    }

    #[inline(always)]
    fn mul_i(self, a: __m256i, b: __m256i) -> __m256i {
        instruction!(_mm256_mullo_epi32(a, b))
    }

    #[inline(always)]
    fn abs_i(self, a: __m256i) -> __m256i {
        instruction!(_mm256_abs_epi32(a))
    }

    #[inline(always)]
    fn shift_right_i(self, a: __m256i, by: u32) -> __m256i {
        // The number of bits is in a vector register, because it is not a constant.
        instruction!(_mm256_srl_epi32(a, _mm_cvtsi32_si128(by as i32)))
    }

    #[inline(always)]
    fn eq_i(self, a: __m256i, b: __m256i) -> __m256 {
        instruction!(_mm256_castsi256_ps(_mm256_cmpeq_epi32(a, b)))
    }

    #[inline(always)]
    fn sum_i(self, a: __m256i) -> i32 {
        instruction!({
            // Add neighbors twice, which leaves one sum of four lanes in each half.
            let zero = _mm256_setzero_si256();
            let fours = _mm256_hadd_epi32(_mm256_hadd_epi32(a, zero), zero);
            _mm256_extract_epi32::<0>(fours).wrapping_add(_mm256_extract_epi32::<4>(fours))
        })
    }

    #[inline(always)]
    fn to_f(self, a: __m256i) -> __m256 {
        instruction!(_mm256_cvtepi32_ps(a))
    }

    #[inline(always)]
    fn to_bits(self, a: __m256) -> __m256i {
        instruction!(_mm256_castps_si256(a))
    }

    #[inline(always)]
    fn to_u8(self, [a, b, c, d]: [__m256i; 4]) -> [u8; 4 * LANES] {
        let mut out = [0; 4 * LANES];
        instruction!({
            // Each half of a register is packed separately. Restore the order of the rows.
            let order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
            let packed = _mm256_packus_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d));
            _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(packed, order));
        });
        out
    }

    #[inline(always)]
    fn differences(self, samples: Bytes, minus: Bytes) -> samples::Words {
        samples::Words::between(samples, minus)
    }
}
