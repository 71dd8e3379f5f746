//! Light from all around: a gradient from horizon to zenith, and the ground below.

use glam::Vec3;
use serde::Deserialize;

/// A dome of light, symmetric about +y. All radiances are linear RGB \[W·m⁻²·sr⁻¹\].
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sky {
    /// Straight up.
    pub zenith: [f32; 3],
    /// At eye level.
    pub horizon: [f32; 3],
    /// Below eye level.
    #[serde(default)]
    pub ground: [f32; 3],
}

impl Sky {
    /// The sky of scenes that bring no light at all: plain white.
    pub const PLAIN: Sky = Sky { zenith: [0.9, 0.95, 1.0], horizon: [0.7, 0.7, 0.7], ground: [0.25, 0.23, 0.21] };

    /// Radiance that arrives from the unit `direction` (towards the sky).
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let (horizon, y) = (Vec3::from(self.horizon), direction.y);
        if y >= 0.0 {
            // Clear skies brighten quickly towards the horizon: the root gives most of the dome to the zenith's colour.
            horizon.lerp(self.zenith.into(), y.sqrt())
        } else {
            // A narrow band joins sky and ground, so that the border does not alias.
            horizon.lerp(self.ground.into(), (-y * 20.0).min(1.0))
        }
    }
}
