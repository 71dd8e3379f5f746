//! Phong's lobe.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use super::{Bundled, Receiver, ReflectBound};
use crate::bounds::{DirectionCone, Region};
use crate::lanes::{Real, Vector3};

/// A diffuse surface with a normalized Phong lobe around the mirror direction:
///
/// ```text
/// M = (diffuse/π + specular · (n + 2)/(2π) · max(0, cos α)ⁿ) · max(0, cos θ)
///   n  exponent             α  angle to the mirror direction           θ  angle to the normal
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phong {
    /// Position \[m\].
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Unit mirror direction of the view: where a mirror would show the viewer the light from.
    pub mirror: Vec3,
    /// Diffuse reflectance, linear RGB, 0 … 1.
    pub diffuse: Vec3,
    /// Specular reflectance, linear RGB, 0 … 1.
    pub specular: Vec3,
    /// Phong exponent n ≥ 0.
    pub exponent: f32,
}

/// M for the two cosines, where lobes of exponents between `widest` and `narrowest` cannot do more.
#[inline(always)]
fn material<F: Real>(
    diffuse: Vec3,
    specular: Vec3,
    [widest, narrowest]: [f32; 2],
    cos_mirror: F,
    cos_normal: F,
) -> Vector3<F> {
    let lobe = cos_mirror.max(F::splat(0.0)).map(|cosine| (narrowest + 2.0) / (2.0 * PI) * cosine.powf(widest));
    (Vector3::splat(diffuse * FRAC_1_PI) + Vector3::splat(specular) * lobe) * cos_normal
}

impl Receiver for Phong {
    #[inline]
    fn position(&self) -> Vec3 {
        self.position
    }

    #[inline(always)]
    fn reflect<F: Real>(&self, direction: Vector3<F>) -> Vector3<F> {
        let cos_mirror = Vector3::splat(self.mirror).dot(direction);
        let cos_normal = Vector3::splat(self.normal).dot(direction).max(F::splat(0.0));
        material(self.diffuse, self.specular, [self.exponent; 2], cos_mirror, cos_normal)
    }

    #[inline(always)]
    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F> {
        let cos_mirror = region.max_cosine_in_front(Vector3::splat(self.mirror));
        let cos_normal = region.max_cosine_in_front(Vector3::splat(self.normal));
        material(self.diffuse, self.specular, [self.exponent; 2], cos_mirror, cos_normal)
    }
}

/// [`Phong`] receivers together.
#[derive(Clone, Copy, Debug)]
pub struct PhongBundle {
    normals: DirectionCone,
    mirrors: DirectionCone,
    diffuse: Vec3,
    specular: Vec3,
    /// Smallest and largest.
    exponents: [f32; 2],
}

impl Bundled for Phong {
    type Bundle = PhongBundle;

    fn bundle(receivers: &[Self]) -> PhongBundle {
        let exponents = receivers.iter().map(|r| r.exponent);
        PhongBundle {
            normals: DirectionCone::around(receivers.iter().map(|r| r.normal)),
            mirrors: DirectionCone::around(receivers.iter().map(|r| r.mirror)),
            diffuse: receivers.iter().fold(Vec3::ZERO, |most, r| most.max(r.diffuse)),
            specular: receivers.iter().fold(Vec3::ZERO, |most, r| most.max(r.specular)),
            exponents: [exponents.clone().fold(f32::INFINITY, f32::min), exponents.fold(0.0, f32::max)],
        }
    }
}

impl ReflectBound for PhongBundle {
    #[inline(always)]
    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F> {
        let cos_mirror = region.max_cosine_of_cone(&self.mirrors.splat());
        let cos_normal = region.max_cosine_of_cone(&self.normals.splat());
        material(self.diffuse, self.specular, self.exponents, cos_mirror, cos_normal)
    }
}
