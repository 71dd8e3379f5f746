//! Light from all around as the TOML file describes it: a gradient from horizon to zenith, or an image.

use super::gltf_file::STRONGEST;
use glam::Vec3;
use serde::Deserialize;

/// A dome of light, symmetric about +y. All radiances are linear RGB \[W·m⁻²·sr⁻¹\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient {
    /// Straight up.
    pub zenith: [f32; 3],
    /// At eye level.
    pub horizon: [f32; 3],
    /// Below eye level.
    pub ground: [f32; 3],
}

impl Gradient {
    /// The sky of scenes that bring no light at all: plain white.
    pub const PLAIN: Gradient =
        Gradient { zenith: [0.9, 0.95, 1.0], horizon: [0.7, 0.7, 0.7], ground: [0.25, 0.23, 0.21] };

    /// The same radiance from everywhere.
    pub const fn constant(radiance: [f32; 3]) -> Self {
        Self { zenith: radiance, horizon: radiance, ground: radiance }
    }

    /// Radiance that arrives from the unit `direction` (towards the sky).
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let (horizon, y) = (Vec3::from(self.horizon), direction.y);
        if y >= 0.0 {
            // Clear skies brighten quickly towards the horizon: the root gives most of the dome to the zenith's color.
            horizon.lerp(self.zenith.into(), y.sqrt())
        } else {
            // A narrow band joins sky and ground, so that the border does not alias.
            horizon.lerp(self.ground.into(), (-y * 20.0).min(1.0))
        }
    }
}

/// The `[sky]` table: either colors, or an image.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkySettings {
    /// See [`Gradient::zenith`]; not with an image.
    pub zenith: Option<[f32; 3]>,
    /// See [`Gradient::horizon`]; not with an image.
    pub horizon: Option<[f32; 3]>,
    /// See [`Gradient::ground`]; black when left out.
    pub ground: Option<[f32; 3]>,
    /// An equirectangular `.hdr` or `.exr` file, its path relative to the TOML file's folder.
    pub image: Option<String>,
    /// Factor on all radiances, 1 when left out.
    pub intensity: Option<f32>,
    /// Degrees by which an image is turned about +y, counter-clockwise seen from above.
    pub rotation: Option<f32>,
}

/// A checked [`SkySettings`].
#[derive(Clone, Debug, PartialEq)]
pub(super) enum SkySource {
    Gradient(Gradient),
    Image { file: String, intensity: f32, rotation: f32 },
}

impl SkySettings {
    /// What the table means; the message says what is wrong with it.
    pub(super) fn source(&self) -> Result<SkySource, String> {
        let intensity = self.intensity.unwrap_or(1.0);
        let rotation = self.rotation.unwrap_or(0.0);
        if !(intensity.is_finite() && intensity >= 0.0) {
            return Err(format!("[sky] intensity {intensity} must be finite and not negative"));
        }
        if !rotation.is_finite() {
            return Err(format!("[sky] rotation {rotation} must be finite"));
        }
        let colors = [self.zenith, self.horizon, self.ground];
        if let Some(file) = &self.image {
            if colors.iter().any(Option::is_some) {
                return Err("[sky] image replaces zenith, horizon and ground; give one or the other".into());
            }
            return Ok(SkySource::Image { file: file.clone(), intensity, rotation });
        }
        let (Some(zenith), Some(horizon)) = (self.zenith, self.horizon) else {
            return Err("[sky] needs zenith and horizon, or an image".into());
        };
        if let Some(bad) = colors.iter().flatten().flatten().find(|r| !r.is_finite() || **r < 0.0) {
            return Err(format!("[sky] radiance {bad} must be finite and not negative"));
        }
        if let Some(bad) = colors.iter().flatten().flatten().find(|r| **r * intensity > STRONGEST) {
            return Err(format!("[sky] shines with {:e}; {STRONGEST:e} is the most", bad * intensity));
        }
        let scaled = |color: [f32; 3]| color.map(|c| c * intensity);
        Ok(SkySource::Gradient(Gradient {
            zenith: scaled(zenith),
            horizon: scaled(horizon),
            ground: scaled(self.ground.unwrap_or_default()),
        }))
    }
}
