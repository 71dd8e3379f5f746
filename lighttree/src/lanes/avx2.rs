//! Eight numbers by the 256-bit instructions of x86-64: the one place of this crate with `unsafe` in it.
#![allow(unsafe_code, reason = "vector instructions may only run where the processor has them")]

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::Vec3;

use super::{Eight, Kernel, PartOfEight, Real, Vector3};

/// Proof that this processor has AVX2: there is no other way to one than [`Avx2::detect`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Avx2(());

impl Avx2 {
    #[inline]
    pub fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx2").then_some(Self(()))
    }

    /// Runs `kernel` as part of a function that may use the vector instructions.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx2")]
        fn compiled_for_avx2<K: Kernel>(kernel: K) -> K::Output {
            kernel.run::<F8>()
        }
        // SAFETY: `self` exists only where `detect` found AVX2.
        unsafe { compiled_for_avx2(kernel) }
    }
}

/// Eight numbers. Outside of this file it has no name: kernels, and the receivers that they ask, meet it as the parameter
/// that [`Avx2::run`] sets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F8(__m256);

/// One instruction, which needs no more than the processor's support.
macro_rules! instruction {
    ($call:expr) => {
        // SAFETY: only `Avx2::run` brings `F8` into use, where the processor has AVX2. No instruction touches memory
        // other than through the references it is given.
        unsafe { $call }
    };
}

macro_rules! operator {
    ($Operator:ident, $name:ident, $instruction:ident) => {
        impl $Operator for F8 {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(instruction!($instruction(self.0, other.0)))
            }
        }
    };
}

operator!(Add, add, _mm256_add_ps);
operator!(Sub, sub, _mm256_sub_ps);
operator!(Mul, mul, _mm256_mul_ps);
operator!(Div, div, _mm256_div_ps);

impl Neg for F8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(instruction!(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0))))
    }
}

impl F8 {
    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        let mut out = [0.0; 8];
        instruction!(_mm256_storeu_ps(out.as_mut_ptr(), self.0));
        out
    }

    #[inline(always)]
    fn from_array(x: [f32; 8]) -> Self {
        Self(instruction!(_mm256_loadu_ps(x.as_ptr())))
    }
}

impl Real for F8 {
    /// All bits of a lane set, or none.
    type Mask = __m256;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(instruction!(_mm256_set1_ps(x)))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(instruction!(_mm256_min_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(instruction!(_mm256_max_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(instruction!(_mm256_sqrt_ps(self.0)))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> __m256 {
        instruction!(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0))
    }
    #[inline(always)]
    fn select(mask: __m256, yes: Self, no: Self) -> Self {
        Self(instruction!(_mm256_blendv_ps(no.0, yes.0, mask)))
    }
    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self::from_array(self.to_array().map(f))
    }
    #[inline(always)]
    fn map3(v: Vector3<Self>, f: impl Fn(Vec3) -> Vec3) -> Vector3<Self> {
        let (x, y, z) = (v.x.to_array(), v.y.to_array(), v.z.to_array());
        let of: [Vec3; 8] = std::array::from_fn(|k| f(Vec3::new(x[k], y[k], z[k])));
        Vector3 {
            x: Self::from_array(of.map(|v| v.x)),
            y: Self::from_array(of.map(|v| v.y)),
            z: Self::from_array(of.map(|v| v.z)),
        }
    }
}

impl PartOfEight for F8 {
    const FOURS: usize = 2;

    #[inline(always)]
    fn load(eight: &Eight, _: usize) -> Self {
        Self(instruction!(_mm256_load_ps(std::ptr::from_ref(eight).cast())))
    }
    #[inline(always)]
    fn store(self, eight: &mut Eight, _: usize) {
        instruction!(_mm256_store_ps(std::ptr::from_mut(eight).cast(), self.0));
    }
}
