//! Directional lights (suns): parallel light from a disc in the sky.

use super::distant::{DistantDisc, DistantLight, DistantSample};
use crate::sampling::{centered_sobol, concentric_disc, frame};
use crate::scene::{PunctualLight, SceneSettings};
use glam::{Vec2, Vec3, Vec3A};

/// Directional light at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunLight {
    /// Direction towards the center of the disc, a unit vector.
    pub towards: Vec3A,
    /// Irradiance of a surface that faces the light \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Half the angular diameter of the disc \[rad\].
    pub angular_radius: f32,
    /// Whether the light ever moves.
    pub moves: bool,
}

impl SunLight {
    /// Builds the light. `axis` is the direction of the light's rays.
    pub(super) fn new(light: &PunctualLight, axis: Vec3A, moves: bool, settings: &SceneSettings) -> Self {
        let angular_radius = settings.sun.angular_diameter.to_radians() / 2.0;
        Self { towards: -axis, irradiance: light.color, angular_radius, moves }
    }

    /// Maps `u` in the unit square to a direction towards a point of the disc, a unit vector.
    #[must_use]
    pub fn direction(&self, u: Vec2) -> Vec3A {
        let (x, y) = frame(self.towards.into());
        let p = concentric_disc(u) * self.angular_radius.sin();
        (self.towards + Vec3A::from(x * p.x + y * p.y)).normalize()
    }

    /// Returns the light's disc, with sample points for shadow rays.
    pub(super) fn sampled(&self) -> DistantDisc {
        DistantDisc {
            irradiance: self.irradiance,
            towards: self.towards,
            angular_radius: self.angular_radius,
            directions: centered_sobol(DistantDisc::SAMPLES).map(|u| self.direction(u)).collect(),
            border: DistantDisc::BORDER.map(|u| self.direction(u)),
        }
    }
}

impl DistantLight for SunLight {
    fn fluence(&self) -> Vec3 {
        self.irradiance
    }

    fn moves(&self) -> bool {
        self.moves
    }

    fn draw(&self, u: Vec2) -> DistantSample {
        DistantSample { towards: self.direction(u), radiance: self.irradiance, pdf: None }
    }
}
