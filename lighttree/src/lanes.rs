//! Generic code over one, four or eight lanes. Bounds and estimates are written once for one or several clusters.
//!
//! All types perform the same IEEE operations in the same order, without fusion, so each lane is bit-identical to the
//! scalar result. `f32` is the scalar type. [`Vec4`] is a vector register where the processor has one. [`F8`] is
//! eight lanes from the crate `lanes`, for [`Kernel`]s with contiguous operands.

use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::{BVec4A, Mat4, Vec3, Vec4};
use lanes::{Choice, Lanes};

/// Real numbers: one `f32`, four lanes of a [`Vec4`], or eight lanes of a type private to this crate.
pub trait Real:
    Copy
    + std::fmt::Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Comparison result, one flag per lane.
    type Mask: Copy;

    /// Returns the same number in every lane.
    fn splat(x: f32) -> Self;
    /// Returns `self < other ? self : other`, which is `other` if either is NaN.
    fn min(self, other: Self) -> Self;
    /// Returns `self > other ? self : other`, which is `other` if either is NaN.
    fn max(self, other: Self) -> Self;
    /// Returns the square root of each lane.
    fn sqrt(self) -> Self;
    /// Returns `self < other` for each lane.
    fn lt(self, other: Self) -> Self::Mask;
    /// Returns `yes` where the mask is set, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Applies a scalar function to each lane.
    fn map(self, f: impl Fn(f32) -> f32) -> Self;
    /// Applies a function of a vector to each lane, for materials written for a single direction.
    fn map3(v: Vector3<Self>, f: impl Fn(Vec3) -> Vec3) -> Vector3<Self>;
}

impl Real for f32 {
    type Mask = bool;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        x
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Self {
        f(self)
    }
    #[inline(always)]
    fn map3(v: Vector3<Self>, f: impl Fn(Vec3) -> Vec3) -> Vector3<Self> {
        Vector3::from(f(v.into()))
    }
}

impl Real for Vec4 {
    type Mask = BVec4A;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Vec4::splat(x)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // On other processors, the minimum instruction treats signed zeros and NaN differently.
        if cfg!(target_arch = "x86_64") { Vec4::min(self, other) } else { Vec4::select(self.cmplt(other), self, other) }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if cfg!(target_arch = "x86_64") { Vec4::max(self, other) } else { Vec4::select(self.cmpgt(other), self, other) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Vec4::sqrt(self)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> BVec4A {
        self.cmplt(other)
    }
    #[inline(always)]
    fn select(mask: BVec4A, yes: Self, no: Self) -> Self {
        Vec4::select(mask, yes, no)
    }
    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Vec4::from_array(self.to_array().map(f))
    }
    #[inline(always)]
    fn map3(v: Vector3<Self>, f: impl Fn(Vec3) -> Vec3) -> Vector3<Self> {
        let (x, y, z) = (v.x.to_array(), v.y.to_array(), v.z.to_array());
        Vector3::gather(std::array::from_fn(|k| f(Vec3::new(x[k], y[k], z[k]))))
    }
}

/// Eight numbers in memory.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Eight(pub [Vec4; 2]);

/// Number type that processes an [`Eight`] at once or in two groups of four.
pub(crate) trait EightLanes: Real {
    /// Number of groups of four lanes.
    const FOURS: usize;
    /// Loads lanes from the group of four at index `at`.
    fn load(eight: &Eight, at: usize) -> Self;
    /// Stores the lanes to the group of four at index `at`.
    fn store(self, eight: &mut Eight, at: usize);

    /// Loads three coordinates from the group of four at index `at`.
    #[inline(always)]
    fn load3(v: &Vector3<Eight>, at: usize) -> Vector3<Self> {
        Vector3 { x: Self::load(&v.x, at), y: Self::load(&v.y, at), z: Self::load(&v.z, at) }
    }
}

impl EightLanes for Vec4 {
    const FOURS: usize = 1;

    #[inline(always)]
    fn load(eight: &Eight, at: usize) -> Self {
        eight.0[at]
    }
    #[inline(always)]
    fn store(self, eight: &mut Eight, at: usize) {
        eight.0[at] = self;
    }
}

/// Eight numbers in a register of the lanes type L.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F8<L: Lanes>(L::F);

macro_rules! operator {
    ($Operator:ident, $name:ident) => {
        impl<L: Lanes> $Operator for F8<L> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(L::PROOF.$name(self.0, other.0))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<L: Lanes> Neg for F8<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(L::PROOF.neg(self.0))
    }
}

impl<L: Lanes> Real for F8<L> {
    type Mask = L::Mask;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(L::PROOF.splat(x))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(L::PROOF.min(self.0, other.0))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(L::PROOF.max(self.0, other.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(L::PROOF.sqrt(self.0))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> L::Mask {
        L::PROOF.lt(self.0, other.0)
    }
    #[inline(always)]
    fn select(mask: L::Mask, yes: Self, no: Self) -> Self {
        Self(L::PROOF.select(mask, yes.0, no.0))
    }
    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self(L::PROOF.load(&L::PROOF.store(self.0).map(f)))
    }
    #[inline(always)]
    fn map3(v: Vector3<Self>, f: impl Fn(Vec3) -> Vec3) -> Vector3<Self> {
        let [x, y, z] = [v.x, v.y, v.z].map(|of| L::PROOF.store(of.0));
        let of: [Vec3; 8] = std::array::from_fn(|k| f(Vec3::new(x[k], y[k], z[k])));
        Vector3 {
            x: Self(L::PROOF.load(&of.map(|v| v.x))),
            y: Self(L::PROOF.load(&of.map(|v| v.y))),
            z: Self(L::PROOF.load(&of.map(|v| v.z))),
        }
    }
}

impl<L: Lanes> EightLanes for F8<L> {
    const FOURS: usize = 2;

    #[inline(always)]
    fn load(Eight([low, high]): &Eight, _: usize) -> Self {
        Self(L::PROOF.load_halves(low.as_ref(), high.as_ref()))
    }
    #[inline(always)]
    fn store(self, Eight([low, high]): &mut Eight, _: usize) {
        L::PROOF.store_halves(self.0, low.as_mut(), high.as_mut());
    }
}

/// A computation on contiguous groups of eight numbers.
///
/// `run`, and each function that `run` calls with these numbers, is `#[inline(always)]`, as for [`lanes::Kernel`].
pub(crate) trait Kernel {
    type Output;
    fn run<F: EightLanes>(self) -> Self::Output;
}

/// Adapter that runs a [`Kernel`] on eight numbers at once.
struct ByEight<K>(K);

impl<K: Kernel> lanes::Kernel for ByEight<K> {
    type Output = K::Output;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> K::Output {
        self.0.run::<F8<L>>()
    }
}

/// Number of lanes that an operation processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Width {
    Four,
    Eight(Choice),
}

impl Width {
    /// Returns the largest width supported by this processor.
    #[inline]
    pub fn best() -> Self {
        let best = Choice::best();
        if best.is_vector() { Self::Eight(best) } else { Self::Four }
    }

    #[inline(always)]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Four => kernel.run::<Vec4>(),
            Self::Eight(choice) => choice.run(ByEight(kernel)),
        }
    }
}

/// Three coordinates, or red, green and blue, of one or several vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector3<F> {
    /// First coordinate, or red component.
    pub x: F,
    /// Second coordinate, or green component.
    pub y: F,
    /// Third coordinate, or blue component.
    pub z: F,
}

impl<F: Real> Vector3<F> {
    /// Returns the same vector in every lane.
    #[inline(always)]
    pub fn splat(v: Vec3) -> Self {
        Self { x: F::splat(v.x), y: F::splat(v.y), z: F::splat(v.z) }
    }

    /// Returns the scalar product of two vectors.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Returns the componentwise product of two vectors.
    #[inline(always)]
    pub fn times(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self { x: self.x.max(other.x), y: self.y.max(other.y), z: self.z.max(other.z) }
    }

    #[inline(always)]
    pub(crate) fn select(mask: F::Mask, yes: Self, no: Self) -> Self {
        Self { x: F::select(mask, yes.x, no.x), y: F::select(mask, yes.y, no.y), z: F::select(mask, yes.z, no.z) }
    }
}

impl Vector3<Vec4> {
    /// Gathers four vectors into lanes.
    #[inline(always)]
    pub(crate) fn gather(v: [Vec3; 4]) -> Self {
        let of = |f: fn(&Vec3) -> f32| Vec4::new(f(&v[0]), f(&v[1]), f(&v[2]), f(&v[3]));
        Self { x: of(|v| v.x), y: of(|v| v.y), z: of(|v| v.z) }
    }

    /// Returns the four vectors, each followed by the sum of its coordinates. Without negative coordinates the sum is
    /// zero only for a zero vector.
    #[inline(always)]
    pub(crate) fn rows(self) -> [Vec4; 4] {
        let m = Mat4::from_cols(self.x, self.y, self.z, self.x + self.y + self.z).transpose();
        [m.x_axis, m.y_axis, m.z_axis, m.w_axis]
    }
}

impl Vector3<Eight> {
    pub(crate) const ZERO: Self = {
        let zero = Eight([Vec4::ZERO; 2]);
        Self { x: zero, y: zero, z: zero }
    };
}

impl From<Vec3> for Vector3<f32> {
    #[inline(always)]
    fn from(v: Vec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

impl From<Vector3<f32>> for Vec3 {
    #[inline(always)]
    fn from(v: Vector3<f32>) -> Self {
        Vec3::new(v.x, v.y, v.z)
    }
}

impl<F: Real> Add for Vector3<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<F: Real> Sub for Vector3<F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<F: Real> Neg for Vector3<F> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl<F: Real> Mul<F> for Vector3<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: F) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3Swizzles;

    use super::*;

    /// Kernel that applies every operation to eight pairs of numbers.
    struct Everything<'a>(&'a Eight, &'a Eight);

    impl Kernel for Everything<'_> {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<F: EightLanes>(self) -> Vec<u32> {
            let mut results = [Eight([Vec4::ZERO; 2]); 15];
            for at in (0..2).step_by(F::FOURS) {
                let (a, b) = (F::load(self.0, at), F::load(self.1, at));
                let turned = F::map3(Vector3 { x: a, y: b, z: a }, |v| v.yzx() + Vec3::X);
                let of = [
                    a + b,
                    a - b,
                    a * b,
                    a / b,
                    -a,
                    a.min(b),
                    a.max(b),
                    a.sqrt(),
                    F::select(a.lt(b), a, b),
                    F::select(b.lt(a), F::splat(0.1), b),
                    a.map(|x| x.abs().sqrt() + 1.0),
                    turned.x,
                    turned.y,
                    turned.z,
                    F::load3(&Vector3 { x: *self.0, y: *self.1, z: *self.0 }, at).y,
                ];
                for (result, of) in results.iter_mut().zip(of) {
                    of.store(result, at);
                }
            }
            results
                .iter()
                .flat_map(|Eight(fours)| fours.map(|four| four.to_array().map(f32::to_bits)))
                .flatten()
                .collect()
        }
    }

    /// The pairs contain finite numbers, zeros of both signs, infinities and NaN.
    #[test]
    fn eight_at_once_have_the_bits_of_four() {
        let numbers = [0.0, -0.0, 1.0, -2.5, 1e-40, -3e38, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 0.3, 7e20];
        let all = numbers.len() * numbers.len();
        for start in (0..all).step_by(if cfg!(miri) { 8 } else { 1 }) {
            let pairs: [(f32, f32); 8] = std::array::from_fn(|k| {
                let pair = (start + k) % all;
                (numbers[pair / numbers.len()], numbers[pair % numbers.len()])
            });
            let eight = |of: [f32; 8]| Eight([0, 4].map(|k| Vec4::from_slice(&of[k..])));
            let (a, b) = (eight(pairs.map(|pair| pair.0)), eight(pairs.map(|pair| pair.1)));
            let bits = |width: Width| -> Vec<u32> {
                // The payload of a resulting NaN is unspecified.
                let bits = width.run(Everything(&a, &b));
                bits.into_iter()
                    .map(|bits| if f32::from_bits(bits).is_nan() { f32::NAN.to_bits() } else { bits })
                    .collect()
            };
            let best = bits(Width::best());
            assert_eq!(best, bits(Width::Four), "{pairs:?}");
            assert_eq!(best, bits(Width::Eight(Choice::SCALAR)), "{pairs:?}");
            for (k, (a, b)) in pairs.into_iter().enumerate() {
                let expected = [a + b, a - b, a * b, a / b, -a, Real::min(a, b), Real::max(a, b), Real::sqrt(a)];
                for (which, expected) in expected.into_iter().enumerate() {
                    let found = f32::from_bits(best[8 * which + k]);
                    assert!(found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan());
                }
            }
        }
    }
}
