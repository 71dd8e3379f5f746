//! The sky: environment light, with small bright spots as discs and the remainder as a dome of points.

use super::distant::{DistantDisc, DistantLight, DistantSample};
use crate::environment::{Environment, SkyLamp, SkySample};
use crate::scene::Scene;
use crate::{Units, luminance};
use glam::{Vec2, Vec3, Vec3A};

/// Radius of the dome of distant lights, in radii of the scene. Its parallax is below a pixel's width, and shadow rays
/// from the dome still end as precisely as rays from the surface.
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

/// The disc of a small bright spot, with sample points for shadow rays.
pub(super) fn sampled(lamp: &SkyLamp) -> DistantDisc {
    DistantDisc {
        irradiance: lamp.irradiance,
        towards: lamp.towards,
        angular_radius: lamp.angular_radius,
        directions: lamp.directions(DistantDisc::SAMPLES),
        border: lamp.border,
    }
}

/// A light on the sky's dome: a point so distant that it lights the whole scene from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DomeLight {
    /// Position on the dome \[m\].
    pub position: Vec3A,
    /// Intensity \[W·sr⁻¹\]. At the scene's center, its irradiance equals the irradiance from its region of the sky.
    pub intensity: Vec3,
}

/// The sky without its lamps, as `count` points on a dome far outside the scene; empty without a sky.
///
/// All points represent about the same luminance. They are dense where the sky is bright, so a bright spot of an image
/// becomes many lights, not one chance light.
#[must_use]
pub fn dome_lights(scene: &Scene, units: &Units, count: usize) -> Vec<DomeLight> {
    let Some(sky) = scene.sky.as_ref().and_then(Environment::beside_lamps) else { return Vec::new() };
    let distance = units.radius * DOME_RADII;
    (0..count)
        .map(|i| {
            // Steps by the golden ratio: for a uniform sky, this is the golden spiral, the most even distribution of
            // directions.
            let across = (i as f64 * 0.618_033_988_749_894_9).fract() as f32;
            let SkySample { direction, pdf } = sky.sample(Vec2::new(across, (i as f32 + 0.5) / count as f32));
            let intensity = sky.radiance(direction) * (distance * distance / (pdf * count as f32));
            DomeLight { position: units.center + Vec3A::from(direction) * distance, intensity }
        })
        .filter(|light| luminance(light.intensity) > 0.0)
        .collect()
}
