//! One number or four: bounds and estimates are written once and run for one cluster, or for four side by side.
//!
//! Both kinds perform the same IEEE operations in the same order, none of them fused, so a lane of four has the bits
//! that the one number has. `f32` is the scalar twin; [`Vec4`] is a vector register where the processor has any.

use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::{BVec4A, Mat4, Vec3, Vec4};

/// Real numbers: one `f32`, or the four of a [`Vec4`].
pub trait Real:
    Copy
    + std::fmt::Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// An answer for each number.
    type Mask: Copy;

    /// The same number everywhere.
    fn splat(x: f32) -> Self;
    /// `self < other ? self : other`, which is `other` where either is no number.
    fn min(self, other: Self) -> Self;
    /// `self > other ? self : other`, which is `other` where either is no number.
    fn max(self, other: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// `self < other`
    fn lt(self, other: Self) -> Self::Mask;
    /// `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Any function of one number, for each.
    fn map(self, f: impl Fn(f32) -> f32) -> Self;
    /// A function of three numbers, for each: the way in for materials that are written for one direction.
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
        Vec4::min(self, other)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Vec4::max(self, other)
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

/// Three coordinates, or red, green and blue, of one thing or of four.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector3<F> {
    /// First coordinate, or red.
    pub x: F,
    /// Second coordinate, or green.
    pub y: F,
    /// Third coordinate, or blue.
    pub z: F,
}

impl<F: Real> Vector3<F> {
    /// The same vector everywhere.
    #[inline(always)]
    pub fn splat(v: Vec3) -> Self {
        Self { x: F::splat(v.x), y: F::splat(v.y), z: F::splat(v.z) }
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Product by coordinate.
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
    /// Four vectors side by side.
    #[inline(always)]
    pub(crate) fn gather(v: [Vec3; 4]) -> Self {
        let of = |f: fn(&Vec3) -> f32| Vec4::new(f(&v[0]), f(&v[1]), f(&v[2]), f(&v[3]));
        Self { x: of(|v| v.x), y: of(|v| v.y), z: of(|v| v.z) }
    }

    /// The four vectors, each with the sum of its coordinates behind it: of what is not negative, zero only for zero.
    #[inline(always)]
    pub(crate) fn rows(self) -> [Vec4; 4] {
        let m = Mat4::from_cols(self.x, self.y, self.z, self.x + self.y + self.z).transpose();
        [m.x_axis, m.y_axis, m.z_axis, m.w_axis]
    }
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
