//! Sky without an image, defined by three colors and the transitions between them.

use glam::Vec3;

/// Dome of light, symmetric about +y. All radiances are linear RGB \[W·m⁻²·sr⁻¹\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient {
    /// Radiance from straight up.
    pub zenith: [f32; 3],
    /// Radiance from eye level.
    pub horizon: [f32; 3],
    /// Radiance from below eye level.
    pub ground: [f32; 3],
}

impl Gradient {
    /// Default sky for scenes without any light: plain white.
    pub const PLAIN: Gradient =
        Gradient { zenith: [0.9, 0.95, 1.0], horizon: [0.7, 0.7, 0.7], ground: [0.25, 0.23, 0.21] };

    /// Returns a sky with the same radiance from all directions.
    #[must_use]
    pub const fn constant(radiance: [f32; 3]) -> Self {
        Self { zenith: radiance, horizon: radiance, ground: radiance }
    }

    /// Returns the radiance from the unit `direction`, which points towards the sky \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let (horizon, y) = (Vec3::from(self.horizon), direction.y);
        if y >= 0.0 {
            // Clear skies brighten only near the horizon. With the square root, most of the dome is close to the
            // zenith's color.
            horizon.lerp(self.zenith.into(), y.sqrt())
        } else {
            // A narrow transition joins sky and ground, so that their border does not alias.
            horizon.lerp(self.ground.into(), (-y * 20.0).min(1.0))
        }
    }
}
