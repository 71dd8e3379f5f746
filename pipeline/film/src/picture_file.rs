//! File formats of single pictures.

use crate::error::{Error, Result};
use perceptual::ToneMap;
#[cfg(feature = "still")]
use pipeline::output::Output;
use plane::Plane;
use std::path::Path;

/// Kind of picture in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// OpenEXR with linear light.
    Linear,
    /// PNG, WebP or JPEG with display codes.
    Shown(ShownFormat),
}

/// File formats of display codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownFormat {
    /// PNG, a lossless format.
    Png,
    /// WebP, without losses.
    Webp,
    /// JPEG, with hardly visible losses.
    Jpeg,
}

impl PictureFormat {
    /// Returns the format of a file, chosen by file ending.
    ///
    /// # Errors
    /// If the ending is unknown.
    pub fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        match ending.as_str() {
            "exr" => Ok(Self::Linear),
            "png" => Ok(Self::Shown(ShownFormat::Png)),
            "webp" => Ok(Self::Shown(ShownFormat::Webp)),
            "jpg" | "jpeg" => Ok(Self::Shown(ShownFormat::Jpeg)),
            _ => {
                let text = "unknown picture format; name it .png, .webp or .jpg for display, or .exr for linear light";
                Err(Error::Options(format!("{}: {text}", path.display())))
            }
        }
    }

    /// Returns whether files of this format can have a transparent background.
    #[must_use]
    pub fn has_opacity(self) -> bool {
        self != Self::Shown(ShownFormat::Jpeg)
    }

    /// Returns the error for a transparent picture in a format without opacity.
    #[must_use]
    pub fn without_opacity(path: &Path) -> Error {
        let text = "JPEG has no transparent background; name it .png, .webp or .exr";
        Error::Options(format!("{}: {text}", path.display()))
    }
}

/// Quality of JPEG files, 1…100: high enough to make the blocks invisible.
#[cfg(feature = "still")]
const JPEG_QUALITY: u8 = 92;

/// Returns the display codes of linear RGB `radiance`.
#[must_use]
pub fn shown(radiance: &Plane<[f32; 3]>, tone_map: &ToneMap) -> Plane<[u8; 3]> {
    radiance.map(|rgb| rgb.map(|linear| (tone_map.encode(linear) * 255.0).round().clamp(0.0, 255.0) as u8))
}

/// Writes display codes as `.png`, `.webp` or `.jpg`, atomically.
///
/// # Errors
/// If the file cannot be written, or its ending is another one.
#[cfg(feature = "still")]
pub fn write_shown(path: &Path, picture: &Plane<[u8; 3]>) -> Result<()> {
    write_samples(path, picture, image::ExtendedColorType::Rgb8)
}

/// Writes display codes with opacity as `.png` or `.webp`, atomically.
///
/// # Errors
/// If the file cannot be written, or its format has no opacity.
#[cfg(feature = "still")]
pub fn write_transparent(path: &Path, picture: &Plane<[u8; 4]>) -> Result<()> {
    if !PictureFormat::of(path)?.has_opacity() {
        return Err(PictureFormat::without_opacity(path));
    }
    write_samples(path, picture, image::ExtendedColorType::Rgba8)
}

/// Writes pixels of `N` bytes in the format of the file's ending.
#[cfg(feature = "still")]
fn write_samples<const N: usize>(path: &Path, picture: &Plane<[u8; N]>, color: image::ExtendedColorType) -> Result<()> {
    use image::{ImageEncoder, codecs};
    let (width, height, samples) = (picture.width() as u32, picture.height() as u32, picture.samples().as_flattened());
    // Encode into memory first, so that a failure leaves no file.
    let mut bytes = Vec::new();
    let written = match PictureFormat::of(path)? {
        PictureFormat::Linear => {
            let text = "display codes are written as .png, .webp or .jpg";
            return Err(Error::Options(format!("{}: {text}", path.display())));
        }
        PictureFormat::Shown(ShownFormat::Png) => {
            codecs::png::PngEncoder::new(&mut bytes).write_image(samples, width, height, color)
        }
        PictureFormat::Shown(ShownFormat::Webp) => {
            codecs::webp::WebPEncoder::new_lossless(&mut bytes).write_image(samples, width, height, color)
        }
        PictureFormat::Shown(ShownFormat::Jpeg) => {
            let encoder = codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
            encoder.write_image(samples, width, height, color)
        }
    };
    written.map_err(|error| Error::content(path, format!(": cannot be coded: {error}")))?;
    write_bytes(path, &bytes)
}

#[cfg(feature = "still")]
fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = Output::create(path)?;
    file.write(bytes)?;
    Ok(file.finish()?)
}

/// Returns an error, because this build lacks the feature `still`.
///
/// # Errors
/// Always returns an error.
#[cfg(not(feature = "still"))]
pub fn write_transparent(path: &Path, _: &Plane<[u8; 4]>) -> Result<()> {
    Err(Error::content(path, ": this build writes no pictures; build it with the feature still"))
}

/// Returns an error, because this build lacks the feature `still`.
///
/// # Errors
/// Always returns an error.
#[cfg(not(feature = "still"))]
pub fn write_shown(path: &Path, _: &Plane<[u8; 3]>) -> Result<()> {
    Err(Error::content(path, ": this build writes no pictures; build it with the feature still"))
}
