//! TOML file next to a scene: settings that glTF lacks.

use super::setting::Setting;
use super::settings_error::SettingsError;
use super::sky::SkySettings;
use super::studio_settings::StudioSettings;
use super::viewpoint::CameraChoice;
use serde::de::{self, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::path::{Path, PathBuf};

/// Contents of `SCENE.toml`. Every table is optional.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSettings {
    /// Tone mapping, as an unparsed table: another crate defines the tone curves.
    pub tone_mapping: Option<toml::Table>,
    /// Environment light of the scene.
    pub sky: Option<SkySettings>,
    /// Light and ground for scenes without lamps.
    #[serde(default)]
    pub studio: StudioSettings,
    /// Properties of directional lights that glTF lacks.
    #[serde(default)]
    pub sun: Sun,
    /// Selection of the filming camera.
    #[serde(default)]
    pub camera: CameraChoice,
    /// Selection of the animation to play.
    #[serde(default)]
    pub animation: AnimationChoice,
    /// Selection of the material variant.
    #[serde(default)]
    pub variant: VariantChoice,
    /// Strength and size of punctual lights.
    #[serde(default)]
    pub light: LightSettings,
    /// Width of points and lines.
    #[serde(default)]
    pub strokes: StrokeSettings,
    /// Length and frame rate of the video.
    #[serde(default)]
    pub video: Video,
    /// Nodes that viewers watch, and viewing conditions.
    #[serde(default)]
    pub importance: Gaze,
}

/// Properties of directional lights that glTF lacks.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sun {
    /// Angular diameter of the light's disc \[°\]. At 0, shadows are hard.
    pub angular_diameter: f32,
}

impl Default for Sun {
    /// Returns the properties of the sun as seen from Earth.
    fn default() -> Self {
        Self { angular_diameter: 0.53 }
    }
}

/// Selection of the animation to play.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnimationChoice {
    /// Name of an animation in the file, or "all". The default is the first animation.
    pub name: Option<String>,
}

/// Selection of the material variant (`KHR_materials_variants`).
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariantChoice {
    /// Name of a variant in the file. By default, meshes keep their materials.
    pub name: Option<String>,
}

/// Settings of the file's point, spot and directional lights (`KHR_lights_punctual`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightSettings {
    /// Factor on the lights' candela and lux [default: 1, and 1/683 for Blender's files].
    pub lamps: Option<f32>,
    /// Radius of point lights \[m\], which files lack. At 0, shadows are hard.
    #[serde(default)]
    pub lamp_radius: f32,
}

/// Settings of points and lines, which have no width in files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StrokeSettings {
    /// Width \[m\] before the scale of the node. The default is 1/200 of the mesh's diagonal.
    pub point_size: Option<f32>,
}

/// Length and frame rate of the video.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Video {
    /// Number of frames in the video.
    pub frames: Option<u32>,
    /// Frames per second: a number, or text with a fraction, such as "24000/1001".
    #[serde(default, deserialize_with = "frame_rate")]
    pub fps: Option<f64>,
}

/// Nodes that viewers watch, and viewing conditions.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gaze {
    /// Names of the nodes that viewers watch. Descendants are included; several nodes may share a name.
    pub nodes: Vec<String>,
    /// Distance from the viewer to the screen \[m\].
    pub viewing_distance: f32,
    /// Width of the picture on the screen \[m\].
    pub screen_width: f32,
}

impl Default for Gaze {
    /// Returns the viewing conditions of a monitor on a desk: the picture spans 45°.
    fn default() -> Self {
        Self { nodes: Vec::new(), viewing_distance: 0.6, screen_width: 0.5 }
    }
}

impl Gaze {
    /// Returns the number of pixels per degree in the middle of a picture with this width \[pixels\].
    #[must_use]
    pub fn pixels_per_degree(&self, width: usize) -> f32 {
        width as f32 / self.screen_width * self.viewing_distance * 1f32.to_radians().tan()
    }
}

impl SceneSettings {
    /// Returns the path of the settings file of `scene`: the same name with the extension `.toml`.
    #[must_use]
    pub fn path_for(scene: &Path) -> PathBuf {
        scene.with_extension("toml")
    }

    /// Parses the text of a settings file. The error names line and key.
    ///
    /// # Errors
    /// The text is not TOML, or contains unknown keys or values out of range.
    pub fn parse(text: &str) -> Result<Self, SettingsError> {
        Self::parse_with(text, &[])
    }

    /// Parses the text of a settings file and overrides its values with `set`.
    ///
    /// # Errors
    /// The text is not TOML, or the text or `set` contains unknown keys or values out of range.
    pub fn parse_with(text: &str, set: &[Setting]) -> Result<Self, SettingsError> {
        let wrong = |error: toml::de::Error| SettingsError::of_toml(&error.to_string());
        let settings: Self = if set.is_empty() {
            toml::from_str(text).map_err(wrong)?
        } else {
            // Parse the file alone first, so that its errors name lines.
            let mut tables: toml::Table = toml::from_str(text).map_err(wrong)?;
            set.iter().for_each(|setting| setting.put_into(&mut tables));
            tables.try_into().map_err(wrong)?
        };
        settings.check_values()?;
        if let Some(sky) = &settings.sky {
            sky.source()?;
        }
        Ok(settings)
    }

    /// Checks the range of each single value.
    pub(super) fn check_values(&self) -> Result<(), SettingsError> {
        if let Some(sky) = &self.sky {
            sky.check_values()?;
        }
        if !(0.0..=90.0).contains(&self.sun.angular_diameter) {
            let problem = format!("angular_diameter {} must lie in 0..=90 degrees", self.sun.angular_diameter);
            return Err(SettingsError::value("sun", problem));
        }
        self.camera.check_values()?;
        self.studio.check_values()?;
        // Check lights and strokes.
        let LightSettings { lamps, lamp_radius } = self.light;
        if lamps.is_some_and(|factor| !(0.0..=1e9).contains(&factor)) {
            return Err(SettingsError::value("light", "lamps must lie in 0..=1000000000"));
        }
        if !(0.0..=1e3).contains(&lamp_radius) {
            return Err(SettingsError::value("light", "lamp_radius must lie in 0..=1000 meters"));
        }
        if self.strokes.point_size.is_some_and(|size| !(1e-9..=1e6).contains(&size)) {
            return Err(SettingsError::value("strokes", "point_size must lie in 0.000000001..=1000000 meters"));
        }
        // Check the video.
        if self.video.frames == Some(0) {
            return Err(SettingsError::value("video", "frames must be at least 1"));
        }
        if self.video.fps.is_some_and(|fps| !fps.is_finite() || fps <= 0.0) {
            return Err(SettingsError::value("video", "fps must be positive"));
        }
        // Check the viewing conditions.
        let Gaze { viewing_distance, screen_width, .. } = self.importance;
        for (name, value) in [("viewing_distance", viewing_distance), ("screen_width", screen_width)] {
            if !(1e-3..=1e3).contains(&value) {
                return Err(SettingsError::value(
                    "importance",
                    format!("{name} {value} must lie in 0.001..=1000 meters"),
                ));
            }
        }
        Ok(())
    }
}

/// Deserializes a frame rate.
fn frame_rate<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    // Accept numbers and text, because TOML has no fractions.
    struct FrameRate;

    impl Visitor<'_> for FrameRate {
        type Value = f64;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a number, or a fraction such as \"24000/1001\"")
        }

        fn visit_f64<E: de::Error>(self, fps: f64) -> Result<f64, E> {
            Ok(fps)
        }

        fn visit_i64<E: de::Error>(self, fps: i64) -> Result<f64, E> {
            Ok(fps as f64)
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<f64, E> {
            parse_frame_rate(text).ok_or_else(|| E::invalid_type(Unexpected::Str(text), &self))
        }
    }

    deserializer.deserialize_any(FrameRate).map(Some)
}

/// Parses frames per second: a number such as `29.97`, or a fraction such as `30000/1001`.
#[must_use]
pub fn parse_frame_rate(text: &str) -> Option<f64> {
    let Some((numerator, denominator)) = text.split_once('/') else { return text.trim().parse().ok() };
    let [numerator, denominator] = [numerator, denominator].map(|text| text.trim().parse::<f64>().ok());
    Some(numerator? / denominator?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_is_there_and_names_what_is_wrong() {
        let settings = SceneSettings::parse("[sky]\nzenith=[1,2,3]\nhorizon=[1,1,1]\n[video]\nframes=5").unwrap();
        assert_eq!(settings.sky.unwrap().zenith, Some([1.0, 2.0, 3.0]));
        assert_eq!(settings.video.frames, Some(5));
        assert_eq!(SceneSettings::parse("").unwrap(), SceneSettings::default());
        for (text, word) in [
            ("[sky]\nzenit=[1,1,1]", "zenit"),
            ("[video]\nframes=0", "frames"),
            ("[sun]\nangular_diameter=-1", "angular_diameter"),
            ("[sky]\nzenith=[1,1,1]", "horizon"),
            ("[sky]\nimage=\"a.hdr\"\nhorizon=[1,1,1]", "image"),
            ("[sky]\nimage=\"a.hdr\"\nintensity=-1", "intensity"),
            ("[sky]\nimage=\"a.hdr\"\nrotation=inf", "rotation"),
            ("[sky]\nzenith=[nan,0,0]\nhorizon=[0,0,0]", "sky"),
            ("[video", "video"),
            ("[importance]\nnodes=[\"a\"]\nscreen_width=0", "screen_width"),
            ("[importance]\nnode=[\"a\"]", "node"),
        ] {
            let message = SceneSettings::parse(text).unwrap_err().to_string();
            assert!(message.contains(word) && !message.contains('\n'), "{message}");
        }
    }
}
