//! Environment light from the TOML file: a gradient from horizon to zenith, or an image.

use super::light::STRONGEST;
use super::settings_error::SettingsError;
use crate::environment::Gradient;
use serde::Deserialize;

/// Contents of the `[sky]` table: either colors or an image.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkySettings {
    /// Zenith color, [`Gradient::zenith`]. Invalid with an image.
    pub zenith: Option<[f32; 3]>,
    /// Horizon color, [`Gradient::horizon`]. Invalid with an image.
    pub horizon: Option<[f32; 3]>,
    /// Ground color, [`Gradient::ground`]. The default is black.
    pub ground: Option<[f32; 3]>,
    /// Path of an equirectangular `.hdr` or `.exr` file, relative to the TOML file's folder.
    pub image: Option<String>,
    /// Factor on all radiances. The default is 1.
    pub intensity: Option<f32>,
    /// Rotation of the image about +y \[°\], counter-clockwise seen from above.
    pub rotation: Option<f32>,
}

/// Source of a sky, from checked [`SkySettings`].
#[derive(Clone, Debug, PartialEq)]
pub(super) enum SkySource {
    Gradient(Gradient),
    Image { file: String, intensity: f32, rotation: f32 },
}

impl SkySettings {
    /// Returns the factor on all radiances.
    fn factor(&self) -> f32 {
        self.intensity.unwrap_or(1.0)
    }

    /// Returns the rotation of the image \[°\].
    fn turn(&self) -> f32 {
        self.rotation.unwrap_or(0.0)
    }

    /// Checks the range of each value, regardless of whether the values define a sky.
    pub(super) fn check_values(&self) -> Result<(), SettingsError> {
        let refuse = |problem: String| Err(SettingsError::value("sky", problem));
        let (intensity, rotation) = (self.factor(), self.turn());
        // Check the factors.
        if !(intensity.is_finite() && intensity >= 0.0) {
            return refuse(format!("intensity {intensity} must be finite and not negative"));
        }
        if !rotation.is_finite() {
            return refuse(format!("rotation {rotation} must be finite"));
        }
        // Check the colors, and their products with the intensity.
        let colors = [self.zenith, self.horizon, self.ground];
        let radiances = || colors.iter().flatten().flatten();
        if let Some(bad) = radiances().find(|r| !r.is_finite() || **r < 0.0) {
            return refuse(format!("radiance {bad} must be finite and not negative"));
        }
        if let Some(bad) = radiances().find(|r| **r * intensity > STRONGEST) {
            return refuse(format!("shines with {:e}; at most {STRONGEST:e} is allowed", bad * intensity));
        }
        Ok(())
    }

    /// Returns the sky of the table. The values must have been checked. The error names missing keys.
    pub(super) fn source(&self) -> Result<SkySource, SettingsError> {
        let refuse = |problem: &str| Err(SettingsError::value("sky", problem));
        let (intensity, rotation) = (self.factor(), self.turn());
        // An image excludes colors, since each defines the whole sky.
        if let Some(file) = &self.image {
            if [self.zenith, self.horizon, self.ground].iter().any(Option::is_some) {
                return refuse("image replaces zenith, horizon and ground; give one or the other");
            }
            return Ok(SkySource::Image { file: file.clone(), intensity, rotation });
        }
        // Without an image, two colors define a gradient.
        let (Some(zenith), Some(horizon)) = (self.zenith, self.horizon) else {
            return refuse("needs zenith and horizon, or an image");
        };
        let scaled = |color: [f32; 3]| color.map(|c| c * intensity);
        Ok(SkySource::Gradient(Gradient {
            zenith: scaled(zenith),
            horizon: scaled(horizon),
            ground: scaled(self.ground.unwrap_or_default()),
        }))
    }
}
