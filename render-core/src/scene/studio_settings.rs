//! Settings of the studio around a scene.

use super::settings_error::SettingsError;
use serde::Deserialize;

/// Studio around a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StudioKind {
    /// Large soft lamps on a light gray ground.
    Soft,
    /// Bright, even light on a white ground, as for products in a shop.
    Product,
    /// Clear sky with a sun.
    Outdoor,
    /// Plain white sky without a ground.
    Off,
}

/// Contents of the `[studio]` table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudioSettings {
    /// Kind of the studio. By default, scenes without lamps and sky have a soft studio.
    pub kind: Option<StudioKind>,
    /// Radiance of ground and background, linear RGB \[W·m⁻²·sr⁻¹\]. The kind sets the default.
    pub background: Option<[f32; 3]>,
}

impl StudioSettings {
    /// Checks the range of each value.
    pub(super) fn check_values(&self) -> Result<(), SettingsError> {
        let is_outside = |background: [f32; 3]| background.iter().any(|c| !(0.0..=100.0).contains(c));
        if self.background.is_some_and(is_outside) {
            return Err(SettingsError::value("studio", "background must be three numbers in 0..=100"));
        }
        Ok(())
    }
}
