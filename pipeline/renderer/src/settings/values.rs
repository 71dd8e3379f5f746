//! Values of the renderer's settings: how each is written, and what its range is.

use pipeline::error::{Error, Result};
use render_core::scene::Scene;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;
use std::str::FromStr;

/// How indirect light is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Lighting {
    /// A cut through the light tree for each pixel, as fine as its threshold requires.
    Lightcuts,
    /// Every light at every pixel: slow, the reference that cuts are measured against.
    AllLights,
    /// Light of surfaces at rest by `render2mpeg bake`; that of others by cuts.
    #[cfg(feature = "bake")]
    Baked,
}

impl Lighting {
    /// Whether surfaces at rest have their light from a file.
    #[must_use]
    pub fn is_baked(self) -> bool {
        #[cfg(feature = "bake")]
        return self == Self::Baked;
        #[cfg(not(feature = "bake"))]
        false
    }
}

/// A further layer of a frame's OpenEXR file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Aov {
    /// direct.R, .G, .B: emitted light, and light reflected straight from its source.
    Direct,
    /// indirect.R, .G, .B: all other light.
    Indirect,
    /// albedo.R, .G, .B: diffuse reflectance.
    Albedo,
    /// normal.X, .Y, .Z: the unit normal that is shaded with, in the world.
    Normal,
    /// depth.Z: meters along the camera's axis.
    Depth,
    /// position.X, .Y, .Z: the point that is seen, in the world, meters; 0 where nothing is.
    Position,
    /// motion.X, .Y: pixels from here to the same point in the frame before, y down; motion.A: 1 where it was visible there.
    Motion,
    /// Vector.X, .Y: pixels from here to where the point was a frame ago; .Z, .W: from where it will be to here. y is up, as in
    /// Blender's vector pass.
    Vector,
    /// CryptoObject00 to 02: Cryptomatte of the objects, by the names of their nodes.
    CryptoObject,
    /// CryptoMaterial00 to 02: Cryptomatte of the materials.
    CryptoMaterial,
    /// cut.size: clusters of the pixel's cut, with the cache of the records' cuts at their pixels.
    CutSize,
    /// threshold.Y: luminance that the pixel may be wrong by; 0 where 2 % of its own hold.
    Threshold,
    /// cache.records: records of the irradiance cache in use at the pixel.
    Cache,
    /// importance.V: where people look, 0…1, and importance.N: samples of the pixel.
    Importance,
    /// shading.reused: 0 where all light was computed, 1 where direct light was carried from the frame before, 2 where
    /// indirect light was, 3 where both were.
    Shading,
}

/// Where the error that a pixel may have comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thresholds {
    /// From the masking model, one frame later.
    Perceptual,
    /// From what the encoder really did, or will do where it looks ahead, one frame later.
    Codec,
    /// A fixed share of each pixel's luminance; 0.02 is the original Lightcuts.
    Fixed(f32),
}

impl Thresholds {
    /// Share of its luminance that a pixel may be wrong by where it has no threshold: 2 % \[Walter05\], \[Herzog08, 5.3\], or the
    /// share that was fixed.
    #[must_use]
    pub fn share_elsewhere(self) -> f32 {
        match self {
            Self::Fixed(share) => share,
            _ => perceptual::RELATIVE_FLOOR,
        }
    }

    /// Whether masking wants to see what the encoder made of each picture.
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
                "\"{text}\" is neither \"codec\" nor \"perceptual\", nor \"fixed:SHARE\" with a share of 0 to 1, such as fixed:0.02"
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

/// When the cut of a pixel ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Stopping {
    /// When no cluster's error bound exceeds the threshold, as in the paper.
    Bound,
    /// When measured errors say that 95 % of the pixels are within it, or another share.
    Calibrated,
}

/// Which pixels of a frame are lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PixelShading {
    /// All of them.
    Full,
    /// Those whose light in the frame before says too little, by their thresholds.
    Adaptive,
}

/// Width and height of the picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Size {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Size {
    /// The shape of the camera that films, with as many pixels as a square of this side, to even numbers; a square without.
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

/// Largest side that the size fields of the sequence header and its extension hold (6.2.2.1, 6.2.2.3).
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

/// A value as files may write it.
#[derive(Deserialize)]
#[serde(untagged)]
enum WrittenValue {
    Switch(bool),
    Number(f64),
    Text(String),
}

/// Reads a value through its text, for serde's `deserialize_with`; `true` and `false` are "on" and "off".
///
/// # Errors
/// The text is no such value.
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

    /// Pictures have 512² pixels, or as near to that as even sides come, in the shape of the camera.
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
