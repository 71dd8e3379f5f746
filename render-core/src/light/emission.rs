//! Emission of photons by a light, and the reverse: the path from a light to a given point.

use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A, Vec4};
use std::f32::consts::PI;

/// Number of Halton dimensions that an emission uses.
pub const EMISSION_DIMENSIONS: usize = 5;

/// A light that emits photons.
pub(super) trait PhotonEmitter: Sync {
    /// Whether the light is infinitely distant.
    fn is_distant(&self) -> bool {
        false
    }

    /// Radiant flux into the scene within `ball` \[W\], linear RGB.
    fn power(&self, ball: &Ball) -> Vec3;

    /// Emits the photon with this start. `share` is 1 / (N p), for N photons and the density p of the start.
    fn emit(&self, space: Space, start: Start, share: f32) -> EmittedPhoton;

    /// Light at a surface point from a point or direction drawn with `drawn`, as `place` and `way` of a start. `None`
    /// if no light arrives.
    fn towards(&self, space: Space, at: Facing, drawn: [Vec2; 2]) -> Option<SeenLight>;
}

/// The scene at the time of an emission.
#[derive(Clone, Copy)]
pub(super) struct Space<'a> {
    pub surfaces: &'a Surfaces<'a>,
    pub ball: Ball,
}

/// Bounding sphere of the scene: photons of distant lights start on discs of its size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub center: Vec3A,
    /// Radius \[m\].
    pub radius: f32,
}

impl Ball {
    /// Area of the sphere's cross-section \[m²\].
    pub fn disc_area(&self) -> f32 {
        PI * self.radius * self.radius
    }
}

/// A photon as it leaves a light.
#[derive(Clone, Copy, Debug)]
pub struct EmittedPhoton {
    /// Starting point, slightly off the surface \[m\].
    pub origin: Vec3A,
    /// Direction, a unit vector.
    pub direction: Vec3A,
    /// Flux \[W\], linear RGB.
    pub flux: Vec3,
    /// Whether its light is dynamic.
    pub from_moving: bool,
    /// Whether its light is infinitely distant.
    pub distant: bool,
}

/// The random numbers that start a photon.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    /// Index into the lights of the [`PhotonSource`](super::PhotonSource).
    pub light: usize,
    /// Remainder of the number that chose the light, 0…1.
    pub rest: f64,
    pub place: Vec2,
    pub way: Vec2,
    /// Probability density of all these numbers.
    pub density: f32,
}

/// A surface point that a light may illuminate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facing {
    /// Position \[m\].
    pub position: Vec3A,
    /// Normal, a unit vector.
    pub normal: Vec3A,
}

impl Facing {
    /// Cosine between the normal and the unit vector `towards`; `None` below the surface.
    pub(super) fn cosine(&self, towards: Vec3A) -> Option<f32> {
        Some(towards.dot(self.normal)).filter(|cosine| *cosine > 0.0)
    }
}

/// Direct light on a surface point, and the start of a photon that would reach it.
pub(crate) struct SeenLight {
    /// Unshadowed irradiance on the surface \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Direction towards the light, a unit vector.
    pub towards: Vec3A,
    /// Point slightly off the light; `None` for distant lights.
    pub end: Option<Vec3A>,
    /// `place` and `way` of the photon's start; set by distant lights.
    pub start: Vec4,
}
