//! The receiver: the one thing a cut asks of materials.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use crate::bounds::Region;

/// A shading point: position, reflection, and an upper bound of the reflection. All in world space.
///
/// The two reflection functions must agree: for every point of a region, `reflect` of the direction to it stays
/// below `reflect_bound` of the region, in each channel. A cut's error bound rests on nothing else.
pub trait Receiver {
    /// Where light is gathered \[m\].
    fn position(&self) -> Vec3;

    /// Material term M of \[Walter05\], linear RGB \[sr⁻¹\]: BRDF times the receiver's cosine, for light arriving from
    /// `direction` (unit length, pointing away from the receiver). Not negative.
    fn reflect(&self, direction: Vec3) -> Vec3;

    /// Upper bound M_max of [`Receiver::reflect`] over all directions to the region, each channel for itself \[sr⁻¹\].
    /// Exactly zero says that nothing can be reflected: the cut then drops the whole cluster.
    fn reflect_bound(&self, region: &Region) -> Vec3;
}

/// A diffuse surface seen from its front: M = reflectance/π · max(0, cos θ).
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

    #[inline]
    fn reflect(&self, direction: Vec3) -> Vec3 {
        self.reflectance * (FRAC_1_PI * self.normal.dot(direction).max(0.0))
    }

    #[inline]
    fn reflect_bound(&self, region: &Region) -> Vec3 {
        self.reflectance * (FRAC_1_PI * region.max_cosine_in_front(self.normal))
    }
}

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

impl Phong {
    #[inline]
    fn material(&self, cos_mirror: f32, cos_normal: f32) -> Vec3 {
        let lobe = (self.exponent + 2.0) / (2.0 * PI) * cos_mirror.max(0.0).powf(self.exponent);
        (self.diffuse * FRAC_1_PI + self.specular * lobe) * cos_normal
    }
}

impl Receiver for Phong {
    #[inline]
    fn position(&self) -> Vec3 {
        self.position
    }

    #[inline]
    fn reflect(&self, direction: Vec3) -> Vec3 {
        self.material(self.mirror.dot(direction), self.normal.dot(direction).max(0.0))
    }

    #[inline]
    fn reflect_bound(&self, region: &Region) -> Vec3 {
        let cos_normal = region.max_cosine_in_front(self.normal);
        if cos_normal == 0.0 {
            return Vec3::ZERO;
        }
        self.material(region.max_cosine_in_front(self.mirror), cos_normal)
    }
}
