//! Receivers: surface properties that a lightcut requires.

mod ggx;

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use crate::bounds::{DirectionCone, Region};
use crate::lanes::{Real, Vector3};

pub use ggx::{Ggx, GgxBundle};

/// A shading point: position, reflection, and an upper bound of the reflection, all in world space.
///
/// The two reflection functions must be consistent. For every point of a region, `reflect` of the direction to the
/// point must not exceed `reflect_bound` of the region, in each channel. The error bound of a lightcut depends only on
/// this condition.
///
/// Both functions are generic over [`Real`] numbers, one or several at a time. A material with scalar code for one
/// direction can use [`Real::map3`]:
///
/// ```
/// # use glam::Vec3;
/// # use lighttree::{Real, Receiver, Region, Vector3};
/// struct Velvet(Vec3, Vec3);
/// impl Receiver for Velvet {
///     fn position(&self) -> Vec3 {
///         self.0
///     }
///     fn reflect<F: Real>(&self, direction: Vector3<F>) -> Vector3<F> {
///         F::map3(direction, |d| Vec3::splat((1.0 - self.1.dot(d)).clamp(0.0, 1.0)))
///     }
///     fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F> {
///         let most = F::splat(1.0) + region.max_cosine(Vector3::splat(-self.1));
///         Vector3 { x: most, y: most, z: most }
///     }
/// }
/// ```
pub trait Receiver {
    /// Position of the receiver \[m\].
    fn position(&self) -> Vec3;

    /// Returns the material term M of \[Walter05\], linear RGB \[sr⁻¹\], not negative: BRDF times the receiver's
    /// cosine. Light arrives from `direction` (unit length, pointing away from the receiver).
    fn reflect<F: Real>(&self, direction: Vector3<F>) -> Vector3<F>;

    /// Returns an upper bound M_max of [`Receiver::reflect`] over all directions to the region, per channel \[sr⁻¹\].
    /// Exactly zero means that nothing can be reflected, and the lightcut drops the whole cluster.
    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F>;
}

/// Receivers with common bounds, for [`LightTree::lightcuts`](crate::LightTree::lightcuts).
pub trait Bundled: Receiver + Sized {
    /// Type of the common bounds of several receivers.
    type Bundle: ReflectBound;

    /// Returns bounds that are valid for each of these receivers. At least one receiver is given.
    fn bundle(receivers: &[Self]) -> Self::Bundle;
}

/// Upper bound of the reflection at every receiver of a bundle.
pub trait ReflectBound {
    /// Returns an upper bound of [`Receiver::reflect`] for all receivers. The region contains the vector from any
    /// receiver's position to any point of the cluster's box.
    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F>;
}

/// Diffuse surface that reflects on its front side: M = reflectance/π · max(0, cos θ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    /// Position \[m\].
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Diffuse reflectance, linear RGB, 0 … 1.
    pub reflectance: Vec3,
}

impl Receiver for Lambert {
    #[inline]
    fn position(&self) -> Vec3 {
        self.position
    }

    #[inline(always)]
    fn reflect<F: Real>(&self, direction: Vector3<F>) -> Vector3<F> {
        let cosine = Vector3::splat(self.normal).dot(direction).max(F::splat(0.0));
        Vector3::splat(self.reflectance) * (cosine * F::splat(FRAC_1_PI))
    }

    #[inline(always)]
    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F> {
        let cosine = region.max_cosine_in_front(Vector3::splat(self.normal));
        Vector3::splat(self.reflectance) * (cosine * F::splat(FRAC_1_PI))
    }
}

/// Common bounds of [`Lambert`] receivers.
#[derive(Clone, Copy, Debug)]
pub struct LambertBundle {
    normals: DirectionCone,
    reflectance: Vec3,
}

impl Bundled for Lambert {
    type Bundle = LambertBundle;

    fn bundle(receivers: &[Self]) -> LambertBundle {
        LambertBundle {
            normals: DirectionCone::around(receivers.iter().map(|r| r.normal)),
            reflectance: receivers.iter().fold(Vec3::ZERO, |most, r| most.max(r.reflectance)),
        }
    }
}

impl ReflectBound for LambertBundle {
    #[inline(always)]
    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F> {
        Vector3::splat(self.reflectance) * (region.max_cosine_of_cone(&self.normals.splat()) * F::splat(FRAC_1_PI))
    }
}
