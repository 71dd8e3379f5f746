//! Values of the renderer's settings: text forms and ranges.

use pipeline::error::{Error, Result};
use render_core::scene::Scene;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;
use std::str::FromStr;

/// Method for indirect light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Lighting {
    /// A lightcut per pixel, as fine as the pixel's threshold requires.
    Lightcuts,
    /// Every light at every pixel: the slow reference for lightcuts.
    AllLights,
    /// Baked light on static surfaces; other surfaces gather light from them.
    #[cfg(feature = "bake")]
    Baked,
}

impl Lighting {
    /// Returns whether static surfaces read light from a bake file.
    #[must_use]
    pub fn is_baked(self) -> bool {
        #[cfg(feature = "bake")]
        return self == Self::Baked;
        #[cfg(not(feature = "bake"))]
        false
    }
}

/// Additional layer of a frame's OpenEXR file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Aov {
    /// direct.R, .G, .B: emitted light and light reflected directly from its source.
    Direct,
    /// indirect.R, .G, .B: all other light.
    Indirect,
    /// albedo.R, .G, .B: diffuse reflectance.
    Albedo,
    /// normal.X, .Y, .Z: unit shading normal in world space.
    Normal,
    /// depth.Z: depth along the camera axis in meters.
    Depth,
    /// position.X, .Y, .Z: visible point in world space in meters; 0 for no surface.
    Position,
    /// motion.X, .Y: pixels to the point in the previous frame, y down; motion.A: 1 if it was visible.
    Motion,
    /// Vector.X, .Y: pixels to the previous position; .Z, .W: pixels from the next position; y up, as in Blender.
    Vector,
    /// CryptoObject00 to 02: Cryptomatte of objects, by node name.
    CryptoObject,
    /// CryptoMaterial00 to 02: Cryptomatte of materials.
    CryptoMaterial,
    /// cut.size: clusters in the pixel's lightcut, or in the lightcut of a cache record at its pixel.
    CutSize,
    /// threshold.Y: permitted luminance error; 0 where the limit of 2 % applies.
    Threshold,
    /// cache.records: number of irradiance cache records used by the pixel.
    Cache,
    /// importance.V: importance, 0…1; importance.N: number of samples.
    Importance,
    /// shading.reused: 0 for computed light, 1 for reprojected direct light, 2 for indirect, 3 for both.
    Shading,
}

/// Source of the permitted error per pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thresholds {
    /// The masking model's permitted error, with a delay of one frame.
    Perceptual,
    /// The encoder's actual error, or its predicted error with look-ahead, with a delay of one frame.
    Codec,
    /// A fixed fraction of each pixel's luminance. The original Lightcuts algorithm uses 0.02.
    Fixed(f32),
}

impl Thresholds {
    /// Returns the permitted fraction of luminance for pixels without a threshold: the fixed fraction, or 2 %
    /// \[Walter05\], \[Herzog08, 5.3\].
    #[must_use]
    pub fn share_elsewhere(self) -> f32 {
        match self {
            Self::Fixed(share) => share,
            _ => perceptual::RELATIVE_FLOOR,
        }
    }

    /// Returns whether thresholds depend on the coded pictures.
    pub fn follow_coding(self) -> bool {
        self == Self::Codec
    }
}

impl FromStr for Thresholds {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let share = |share: &str| share.parse::<f32>().ok().filter(|share| (0.0..=1.0).contains(share));
        let known = match text.split_once(':') {
            None if text == "perceptual" => Some(Self::Perceptual),
            None if text == "codec" => Some(Self::Codec),
            Some(("fixed", text)) => share(text).map(Self::Fixed),
            _ => None,
        };
        known.ok_or_else(|| {
            Error::Options(format!(
                "\"{text}\" is not \"codec\", \"perceptual\" or \"fixed:SHARE\" with a share from 0 to 1, such as fixed:0.02"
            ))
        })
    }
}

impl fmt::Display for Thresholds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Perceptual => write!(f, "perceptual"),
            Self::Codec => write!(f, "codec"),
            Self::Fixed(share) => write!(f, "fixed:{share}"),
        }
    }
}

impl Serialize for Thresholds {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Thresholds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

/// Stopping criterion of a pixel's lightcut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Stopping {
    /// Upper error bounds of all clusters are within the threshold.
    Bound,
    /// Measured errors of 95 % of the pixels, or another fraction, are within the threshold.
    Calibrated,
}

/// Pixels that are shaded in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PixelShading {
    /// All pixels.
    Full,
    /// Pixels for which reprojected light is not accurate enough.
    Adaptive,
}

/// Width and height of a frame \[pixels\].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Size {
    /// Number of pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Size {
    /// Returns a size of about `side`² pixels with even sides, in the filming camera's aspect ratio, or 1:1 if the
    /// camera has none.
    #[must_use]
    pub fn of_camera(scene: &Scene, side: usize) -> Self {
        let aspect = scene.filming_camera().and_then(|camera| camera.aspect).unwrap_or(1.0).clamp(0.125, 8.0);
        let even = |length: f32| 2 * (length / 2.0).round() as usize;
        Self { width: even(side as f32 * aspect.sqrt()), height: even(side as f32 / aspect.sqrt()) }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// Maximum side that fits the size fields of the sequence header and its extension (6.2.2.1, 6.2.2.3).
const LARGEST_SIDE: usize = 16383;

impl FromStr for Size {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let size = format!("a size such as 512x512, with sides of 1 to {LARGEST_SIDE} pixels");
        let wrong = || Error::Options(format!("\"{text}\" is not {size}"));
        let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
        let side = |text: &str| text.parse::<usize>().ok().filter(|side| (1..=LARGEST_SIDE).contains(side));
        Ok(Self { width: side(width).ok_or_else(wrong)?, height: side(height).ok_or_else(wrong)? })
    }
}

/// A value as written in a configuration file.
#[derive(Deserialize)]
#[serde(untagged)]
enum WrittenValue {
    Switch(bool),
    Number(f64),
    Text(String),
}

/// Parses a value from text, for serde's `deserialize_with`. `true` and `false` are read as "on" and "off".
///
/// # Errors
/// If the text is not a valid value.
pub fn parsed<'de, D: Deserializer<'de>, T: FromStr<Err: fmt::Display>>(deserializer: D) -> Result<T, D::Error> {
    let text = match WrittenValue::deserialize(deserializer)? {
        WrittenValue::Switch(on) => if on { "on" } else { "off" }.to_owned(),
        WrittenValue::Number(number) => number.to_string(),
        WrittenValue::Text(text) => text,
    };
    text.parse().map_err(de::Error::custom)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that default sizes have about 512² pixels, even sides and the camera's aspect ratio.
    #[test]
    fn the_default_size_has_the_camera_s_shape() {
        use render_core::scene::{Camera, Node, Transform};
        let size = |aspect: Option<f32>, side| {
            let nodes = vec![Node { name: String::new(), parent: None, rest: Transform::IDENTITY }];
            let cameras = vec![Camera { aspect, ..Camera::default() }];
            Size::of_camera(&Scene { nodes, cameras, ..Scene::default() }, side).to_string()
        };
        assert_eq!(size(None, 512), "512x512");
        assert_eq!(size(Some(1.0), 512), "512x512");
        assert_eq!(size(Some(16.0 / 9.0), 512), "682x384");
        assert_eq!(size(Some(9.0 / 16.0), 512), "384x682");
        assert_eq!(size(Some(4.0 / 3.0), 512), "592x444");
        assert_eq!(size(Some(16.0 / 9.0), 256), "342x192");
        assert_eq!(size(Some(1e6), 512), "1448x182");
        assert_eq!(Size::of_camera(&Scene::default(), 512).to_string(), "512x512");
    }

    #[test]
    fn sizes_and_thresholds_are_read_or_explained() {
        assert_eq!("640x360".parse::<Size>().unwrap(), Size { width: 640, height: 360 });
        for bad in ["0x0", "512", "x", "99999x1", "-1x5"] {
            assert!(bad.parse::<Size>().unwrap_err().to_string().contains("512x512"), "{bad}");
        }
        assert_eq!("fixed:0.02".parse::<Thresholds>().unwrap(), Thresholds::Fixed(0.02));
        assert_eq!("perceptual".parse::<Thresholds>().unwrap(), Thresholds::Perceptual);
        for bad in ["fixed", "fixed:-1", "fixed:nan", "watson"] {
            assert!(bad.parse::<Thresholds>().unwrap_err().to_string().contains("fixed:0.02"), "{bad}");
        }
    }
}
