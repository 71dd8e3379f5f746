//! Sky as a light: small bright spots are discs, and the remaining light is a dome of points.

use super::distant::{DistantDisc, DistantLight, DistantSample};
use crate::environment::{Environment, SkyLamp, SkySample};
use crate::scene::Scene;
use crate::{Units, luminance};
use glam::{Vec2, Vec3, Vec3A};

/// Radius of the dome of distant lights, relative to the radius of the scene. The parallax of the dome is below a
/// pixel's width. Shadow rays from the dome still end as precisely as shadow rays from the surface.
const DOME_RADII: f32 = 100.0;

impl DistantLight for Environment {
    fn fluence(&self) -> Vec3 {
        Self::fluence(self)
    }

    fn draw(&self, u: Vec2) -> DistantSample {
        let SkySample { direction, pdf } = self.sample(u);
        DistantSample { towards: direction.into(), radiance: self.radiance(direction), pdf: Some(pdf) }
    }
}

/// Returns the disc of a small bright spot, with sample points for shadow rays.
pub(super) fn sampled(lamp: &SkyLamp) -> DistantDisc {
    DistantDisc {
        irradiance: lamp.irradiance,
        towards: lamp.towards,
        angular_radius: lamp.angular_radius,
        directions: lamp.directions(DistantDisc::SAMPLES),
        border: lamp.border,
    }
}

/// Light on the sky's dome: a point so distant that it lights the whole scene from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DomeLight {
    /// Position on the dome \[m\].
    pub position: Vec3A,
    /// Intensity of the light \[W·sr⁻¹\]. At the scene's center, the light causes the same irradiance as the region
    /// of the sky that it represents.
    pub intensity: Vec3,
}

/// Returns the sky without its lamps as `count` points on a dome far outside the scene. The list is empty without a
/// sky.
///
/// All points represent about the same luminance. They are dense in bright regions of the sky. A bright spot of an
/// image therefore becomes many lights, instead of one light hit by chance.
#[must_use]
pub fn dome_lights(scene: &Scene, units: &Units, count: usize) -> Vec<DomeLight> {
    let Some(sky) = scene.sky.as_ref().and_then(Environment::beside_lamps) else { return Vec::new() };
    let distance = units.radius * DOME_RADII;
    let mut lights = Vec::new();
    for i in 0..count {
        // Step by the golden ratio. For a uniform sky, the result is the golden spiral, the most even distribution of
        // directions.
        let across = (i as f64 * 0.618_033_988_749_894_9).fract() as f32;
        let SkySample { direction, pdf } = sky.sample(Vec2::new(across, (i as f32 + 0.5) / count as f32));

        // I = L d² / (p N): the light replaces its fraction of the sky, at distance d.
        let intensity = sky.radiance(direction) * (distance * distance / (pdf * count as f32));
        if luminance(intensity) > 0.0 {
            lights.push(DomeLight { position: units.center + Vec3A::from(direction) * distance, intensity });
        }
    }
    lights
}
