//! The sky: light from all around, its small bright spots as discs, and the rest as a dome of points.

use super::distant::{DistantDisc, DistantLight, DistantSample};
use crate::environment::{Environment, SkyLamp, SkySample};
use crate::scene::Scene;
use crate::{Units, luminance};
use glam::{Vec2, Vec3, Vec3A};

/// Radius of the dome of far lights in radii of the scene: far enough that its parallax is below a pixel's width, and near
/// enough that a shadow ray cast from there ends as exactly as one that begins at the surface.
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

/// The disc of a small bright spot, with points to trace shadow rays to.
pub(super) fn sampled(lamp: &SkyLamp) -> DistantDisc {
    DistantDisc {
        irradiance: lamp.irradiance,
        towards: lamp.towards,
        angular_radius: lamp.angular_radius,
        directions: lamp.directions(DistantDisc::SAMPLES),
        border: lamp.border,
    }
}

/// A light of the sky's dome: a point so far away that it lights the whole scene from one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DomeLight {
    /// On the dome, meters.
    pub position: Vec3A,
    /// Intensity \[W·sr⁻¹\] such that its irradiance at the scene's center is that of its share of the sky.
    pub intensity: Vec3,
}

/// The sky beside its lamps as `count` points of a dome far outside of the scene; none without a sky.
///
/// Each stands for about the same luminance: where the sky is bright they are dense, so that a bright spot of an image
/// becomes many lights and not the luck of one.
#[must_use]
pub fn dome_lights(scene: &Scene, units: &Units, count: usize) -> Vec<DomeLight> {
    let Some(sky) = scene.sky.as_ref().and_then(Environment::beside_lamps) else { return Vec::new() };
    let distance = units.radius * DOME_RADII;
    (0..count)
        .map(|i| {
            // Steps of the golden ratio: under an even sky this is the golden spiral, the most even spread of directions.
            let across = (i as f64 * 0.618_033_988_749_894_9).fract() as f32;
            let SkySample { direction, pdf } = sky.sample(Vec2::new(across, (i as f32 + 0.5) / count as f32));
            let intensity = sky.radiance(direction) * (distance * distance / (pdf * count as f32));
            DomeLight { position: units.center + Vec3A::from(direction) * distance, intensity }
        })
        .filter(|light| luminance(light.intensity) > 0.0)
        .collect()
}
