//! Emission of photons by a light, and sampling of light that arrives at a given point.

use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A, Vec4};
use std::f32::consts::PI;

/// Number of Halton dimensions that an emission uses.
pub const EMISSION_DIMENSIONS: usize = 5;

/// Light that emits photons.
pub(super) trait PhotonEmitter: Sync {
    /// Returns whether the light is infinitely distant.
    fn is_distant(&self) -> bool {
        false
    }

    /// Returns the radiant flux into the scene within `ball` \[W\], linear RGB.
    fn power(&self, ball: &Ball) -> Vec3;

    /// Emits the photon with the random numbers `start`. `share` is 1 / (N p), for N photons and the density p of
    /// `start`.
    fn emit(&self, space: Space, start: Start, share: f32) -> EmittedPhoton;

    /// Returns the light at a surface point from a point or direction drawn with `drawn`: the numbers `place` and `way`
    /// of a start. Returns `None` if no light arrives.
    fn towards(&self, space: Space, at: Facing, drawn: [Vec2; 2]) -> Option<SeenLight>;
}

/// Scene at the time of an emission.
#[derive(Clone, Copy)]
pub(super) struct Space<'a> {
    pub surfaces: &'a Surfaces<'a>,
    pub ball: Ball,
}

/// Bounding sphere of the scene. Photons of distant lights start on discs with the sphere's radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub center: Vec3A,
    /// Radius of the sphere \[m\].
    pub radius: f32,
}

impl Ball {
    /// Returns the area of the sphere's cross-section \[m²\].
    pub fn disc_area(&self) -> f32 {
        PI * self.radius * self.radius
    }
}

/// Photon as it leaves a light.
#[derive(Clone, Copy, Debug)]
pub struct EmittedPhoton {
    /// Starting point of the photon, slightly off the surface \[m\].
    pub origin: Vec3A,
    /// Direction of the photon, a unit vector.
    pub direction: Vec3A,
    /// Flux of the photon \[W\], linear RGB.
    pub flux: Vec3,
    /// Whether the photon's light is dynamic.
    pub from_moving: bool,
    /// Whether the photon's light is infinitely distant.
    pub distant: bool,
}

/// Random numbers that start a photon.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    /// Index into the lights of the [`PhotonSource`](super::PhotonSource).
    pub light: usize,
    /// Remainder of the random number that selected the light, 0…1.
    pub rest: f64,
    pub place: Vec2,
    pub way: Vec2,
    /// Probability density of all random numbers of the start.
    pub density: f32,
}

/// Surface point that a light may illuminate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facing {
    /// Position of the point \[m\].
    pub position: Vec3A,
    /// Normal at the point, a unit vector.
    pub normal: Vec3A,
}

impl Facing {
    /// Returns the cosine between the normal and the unit vector `towards`, or `None` below the surface.
    pub(super) fn cosine(&self, towards: Vec3A) -> Option<f32> {
        Some(towards.dot(self.normal)).filter(|cosine| *cosine > 0.0)
    }
}

/// Direct light on a surface point, and the start of a photon that would reach the point.
pub(crate) struct SeenLight {
    /// Unshadowed irradiance on the surface \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Direction towards the light, a unit vector.
    pub towards: Vec3A,
    /// Point slightly off the light; `None` for distant lights.
    pub end: Option<Vec3A>,
    /// Numbers `place` and `way` of the photon's start. Only distant lights set them.
    pub start: Vec4,
}
