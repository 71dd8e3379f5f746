//! The light of a source as photons, and the same ways backwards: how it gets to a place.

use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A, Vec4};
use std::f32::consts::PI;

/// Dimensions of the Halton sequence that an emission uses.
pub const EMISSION_DIMENSIONS: usize = 5;

/// A light that photons start from.
pub(super) trait PhotonEmitter: Sync {
    /// Whether the light is infinitely far away.
    fn is_distant(&self) -> bool {
        false
    }

    /// Radiant flux into the scene within `ball` \[W\], linear RGB.
    fn power(&self, ball: &Ball) -> Vec3;

    /// The photon with this start. `share` is 1 / (N p), for N photons and the density p of the start.
    fn emit(&self, space: Space, start: Start, share: f32) -> EmittedPhoton;

    /// How it lights a place, by a point or direction drawn with the place and way of a start; `None` if it does not.
    fn towards(&self, space: Space, at: Facing, drawn: [Vec2; 2]) -> Option<SeenLight>;
}

/// The scene at the time of an emission.
#[derive(Clone, Copy)]
pub(super) struct Space<'a> {
    pub surfaces: &'a Surfaces<'a>,
    pub ball: Ball,
}

/// A ball around the scene: light from far away starts on discs of its size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub center: Vec3A,
    /// \[m\]
    pub radius: f32,
}

impl Ball {
    /// Its cross-section \[m²\].
    pub fn disc_area(&self) -> f32 {
        PI * self.radius * self.radius
    }
}

/// A photon on its way out.
#[derive(Clone, Copy, Debug)]
pub struct EmittedPhoton {
    /// Where it starts, a little off the surface.
    pub origin: Vec3A,
    /// Unit vector.
    pub direction: Vec3A,
    /// Linear RGB flux \[W\].
    pub flux: Vec3,
    /// Whether its light moves through the scene.
    pub from_moving: bool,
    /// Whether its light is infinitely far away.
    pub distant: bool,
}

/// How a photon starts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    /// Index into the lights of the [`PhotonSource`](super::PhotonSource).
    pub light: usize,
    /// Left of the number that chose the light, 0…1.
    pub rest: f64,
    pub place: Vec2,
    pub way: Vec2,
    /// Probability density of all that.
    pub density: f32,
}

/// A place on a surface that a light may shine on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facing {
    /// \[m\]
    pub position: Vec3A,
    /// Unit vector.
    pub normal: Vec3A,
}

impl Facing {
    /// Cosine between the normal and the unit vector `towards`; `None` from below the surface.
    pub(super) fn cosine(&self, towards: Vec3A) -> Option<f32> {
        Some(towards.dot(self.normal)).filter(|cosine| *cosine > 0.0)
    }
}

/// How a surface is lit straight by a light, and how a photon would start to get there.
pub(crate) struct SeenLight {
    /// On the surface, without shadows \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Unit vector towards the light.
    pub towards: Vec3A,
    /// A little off the light; `None` if that is infinitely far away.
    pub end: Option<Vec3A>,
    /// Place and way of the photon; for lights that are infinitely far away.
    pub start: Vec4,
}
