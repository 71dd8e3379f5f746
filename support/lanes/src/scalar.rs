//! Scalar implementation of lanes: the reference for tests, and the fallback for processors without AVX2.

use crate::{Bytes, LANES, Lanes, Words};
use std::array::from_fn;

/// Empty proof, because every processor supports scalar code.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scalar;

#[inline(always)]
fn lane_bits(holds: impl Fn(usize) -> bool) -> u32 {
    (0..LANES).fold(0, |bits, lane| bits | u32::from(holds(lane)) << lane)
}

impl Lanes for Scalar {
    const PROOF: Self = Self;

    type F = [f32; LANES];
    type I = [i32; LANES];
    type Mask = u32;
    type Samples = Bytes;
    type Words = [Words; 2];

    #[inline(always)]
    fn splat(self, x: f32) -> Self::F {
        [x; LANES]
    }

    #[inline(always)]
    fn load(self, x: &[f32; LANES]) -> Self::F {
        *x
    }

    #[inline(always)]
    fn load_halves(self, low: &[f32; LANES / 2], high: &[f32; LANES / 2]) -> Self::F {
        from_fn(|i| if i < LANES / 2 { low[i] } else { high[i - LANES / 2] })
    }

    #[inline(always)]
    fn store(self, x: Self::F) -> [f32; LANES] {
        x
    }

    #[inline(always)]
    fn store_halves(self, x: Self::F, low: &mut [f32; LANES / 2], high: &mut [f32; LANES / 2]) {
        (*low, *high) = (from_fn(|i| x[i]), from_fn(|i| x[i + LANES / 2]));
    }

    #[inline(always)]
    fn add(self, a: Self::F, b: Self::F) -> Self::F {
        from_fn(|i| a[i] + b[i])
    }

    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        from_fn(|i| a[i] - b[i])
    }

    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        from_fn(|i| a[i] * b[i])
    }

    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        from_fn(|i| a[i] / b[i])
    }

    #[inline(always)]
    fn neg(self, a: Self::F) -> Self::F {
        from_fn(|i| -a[i])
    }

    #[inline(always)]
    fn abs(self, a: Self::F) -> Self::F {
        from_fn(|i| a[i].abs())
    }

    #[inline(always)]
    fn sqrt(self, a: Self::F) -> Self::F {
        from_fn(|i| a[i].sqrt())
    }

    #[inline(always)]
    fn min(self, a: Self::F, b: Self::F) -> Self::F {
        // `f32::min` would ignore NaN and choose either zero.
        from_fn(|i| if a[i] < b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn max(self, a: Self::F, b: Self::F) -> Self::F {
        // `f32::max` would ignore NaN and choose either zero.
        from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn lt(self, a: Self::F, b: Self::F) -> Self::Mask {
        lane_bits(|i| a[i] < b[i])
    }

    #[inline(always)]
    fn le(self, a: Self::F, b: Self::F) -> Self::Mask {
        lane_bits(|i| a[i] <= b[i])
    }

    #[inline(always)]
    fn eq(self, a: Self::F, b: Self::F) -> Self::Mask {
        lane_bits(|i| a[i] == b[i])
    }

    #[inline(always)]
    fn lt_bits(self, a: Self::F, b: Self::F) -> Self::Mask {
        lane_bits(|i| (a[i].to_bits() as i32) < b[i].to_bits() as i32)
    }

    #[inline(always)]
    fn and(self, a: Self::Mask, b: Self::Mask) -> Self::Mask {
        a & b
    }

    #[inline(always)]
    fn or(self, a: Self::Mask, b: Self::Mask) -> Self::Mask {
        a | b
    }

    #[inline(always)]
    fn select(self, mask: Self::Mask, yes: Self::F, no: Self::F) -> Self::F {
        from_fn(|i| if mask >> i & 1 == 1 { yes[i] } else { no[i] })
    }

    #[inline(always)]
    fn bits(self, mask: Self::Mask) -> u32 {
        mask
    }

    #[inline(always)]
    fn transposed(self, rows: [Self::F; LANES]) -> [Self::F; LANES] {
        from_fn(|column| from_fn(|row| rows[row][column]))
    }

    #[inline(always)]
    fn splat_i(self, x: i32) -> Self::I {
        [x; LANES]
    }

    #[inline(always)]
    fn load_i(self, x: &[i32; LANES]) -> Self::I {
        *x
    }

    #[inline(always)]
    fn load_u32(self, x: &[u32; LANES]) -> Self::I {
        from_fn(|i| x[i] as i32)
    }

    #[inline(always)]
    fn load_u8(self, x: &[u8; LANES]) -> Self::I {
        from_fn(|i| i32::from(x[i]))
    }

    #[inline(always)]
    fn store_i(self, x: Self::I) -> [i32; LANES] {
        x
    }

    #[inline(always)]
    fn store_u32(self, x: Self::I) -> [u32; LANES] {
        from_fn(|i| x[i] as u32)
    }

    #[inline(always)]
    fn add_i(self, a: Self::I, b: Self::I) -> Self::I {
        from_fn(|i| a[i].wrapping_add(b[i]))
    }

    #[inline(always)]
    fn sub_i(self, a: Self::I, b: Self::I) -> Self::I {
        from_fn(|i| a[i].wrapping_sub(b[i]))
    }

    #[inline(always)]
    fn mul_i(self, a: Self::I, b: Self::I) -> Self::I {
        from_fn(|i| a[i].wrapping_mul(b[i]))
    }

    #[inline(always)]
    fn abs_i(self, a: Self::I) -> Self::I {
        from_fn(|i| a[i].wrapping_abs())
    }

    #[inline(always)]
    fn shift_right_i(self, a: Self::I, by: u32) -> Self::I {
        from_fn(|i| (a[i] as u32 >> by) as i32)
    }

    #[inline(always)]
    fn eq_i(self, a: Self::I, b: Self::I) -> Self::Mask {
        lane_bits(|i| a[i] == b[i])
    }

    #[inline(always)]
    fn sum_i(self, a: Self::I) -> i32 {
        a.into_iter().fold(0, i32::wrapping_add)
    }

    #[inline(always)]
    fn to_f(self, a: Self::I) -> Self::F {
        from_fn(|i| a[i] as f32)
    }

    #[inline(always)]
    fn to_bits(self, a: Self::F) -> Self::I {
        from_fn(|i| a[i].to_bits() as i32)
    }

    #[inline(always)]
    fn to_u8(self, rows: [Self::I; 4]) -> [u8; 4 * LANES] {
        from_fn(|i| rows[i / LANES][i % LANES].clamp(0, 255) as u8)
    }

    #[inline(always)]
    fn differences(self, samples: Bytes, minus: Bytes) -> [Words; 2] {
        samples.minus(minus)
    }
}
