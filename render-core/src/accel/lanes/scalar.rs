//! Lanes one by one: the definition that the vector instructions are tested against, and what runs where there are none.

use super::{LANES, Lanes};
use std::array::from_fn;

#[derive(Clone, Copy)]
pub(super) struct Scalar;

#[inline(always)]
fn ask(answer: impl Fn(usize) -> bool) -> u32 {
    (0..LANES).fold(0, |bits, lane| bits | u32::from(answer(lane)) << lane)
}

impl Lanes for Scalar {
    type F = [f32; LANES];
    type Mask = u32;

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
    fn min(self, a: Self::F, b: Self::F) -> Self::F {
        from_fn(|i| if a[i] < b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn max(self, a: Self::F, b: Self::F) -> Self::F {
        from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn lt(self, a: Self::F, b: Self::F) -> Self::Mask {
        ask(|i| a[i] < b[i])
    }

    #[inline(always)]
    fn le(self, a: Self::F, b: Self::F) -> Self::Mask {
        ask(|i| a[i] <= b[i])
    }

    #[inline(always)]
    fn eq(self, a: Self::F, b: Self::F) -> Self::Mask {
        ask(|i| a[i] == b[i])
    }

    #[inline(always)]
    fn lt_bits(self, a: Self::F, b: Self::F) -> Self::Mask {
        ask(|i| (a[i].to_bits() as i32) < b[i].to_bits() as i32)
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
}
