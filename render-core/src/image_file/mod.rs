//! Reading and writing of linear image files.

#[cfg(feature = "exr")]
mod attributes;
mod cryptomatte;
mod error;
mod gray;
#[cfg(feature = "exr")]
mod open_exr;

pub use cryptomatte::{Cryptomatte, RankedId, RankedThing, cryptomatte_id, murmur_hash3};
pub use error::ImageFileError;
pub use gray::decode_gray;
#[cfg(feature = "exr")]
pub use open_exr::{Layers, read_exr, read_layers, write_exr, write_frame, write_layers};
pub use plane::{FrameCamera, FrameChannel, FrameHeader, FramePlace, HeaderText, SampleDepth};

use glam::Vec3;
use plane::Plane;
use std::path::Path;

/// Maximum number of pixels of an image. A header may claim any size, and memory is allocated for it.
#[cfg(any(feature = "exr", feature = "textures"))]
const MOST_PIXELS: usize = 1 << 27;

/// Reads an image of radiances in Radiance `.hdr` or OpenEXR format, depending on the extension.
///
/// # Errors
/// The extension is unknown, this build does not support the format, or the file cannot be read. The message names the
/// path.
pub fn read_radiance(path: &Path) -> Result<Plane<Vec3>, ImageFileError> {
    match readable_ending(path)?.as_str() {
        #[cfg(feature = "exr")]
        "exr" => read_exr(path),
        #[cfg(feature = "textures")]
        "hdr" => read_hdr(path),
        _ => Err(ImageFileError::UnknownEnding { path: path.into() }),
    }
}

/// Returns the extension of a path in lower case.
///
/// # Errors
/// The extension is a known format that this build does not read; the message names the missing feature.
fn readable_ending(path: &Path) -> Result<String, ImageFileError> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    let needed = match ending.as_str() {
        "exr" if !cfg!(feature = "exr") => Some("exr"),
        "hdr" | "png" if !cfg!(feature = "textures") => Some("textures"),
        _ => None,
    };
    match needed {
        Some(feature) => Err(ImageFileError::LeftOut { path: path.into(), ending, feature }),
        None => Ok(ending),
    }
}

/// Reads a Radiance file.
#[cfg(feature = "textures")]
fn read_hdr(path: &Path) -> Result<Plane<Vec3>, ImageFileError> {
    let file = std::fs::File::open(path).map_err(ImageFileError::system(path))?;
    let decoder = image::codecs::hdr::HdrDecoder::new(std::io::BufReader::new(file));
    let decoder = decoder.map_err(ImageFileError::format(path))?;
    let (width, height) = (decoder.metadata().width as usize, decoder.metadata().height as usize);
    check_size(path, width, height)?;
    let picture = image::DynamicImage::from_decoder(decoder).map_err(ImageFileError::format(path))?;
    let texels = picture.into_rgb32f().pixels().map(|pixel| Vec3::from(pixel.0)).collect();
    Ok(Plane::from_vec(width, height, texels))
}

/// Refuses headers that claim too many pixels, before memory is allocated.
#[cfg(any(feature = "exr", feature = "textures"))]
fn check_size(path: &Path, width: usize, height: usize) -> Result<(), ImageFileError> {
    if width.saturating_mul(height) > MOST_PIXELS {
        return Err(ImageFileError::TooLarge { path: path.into(), width, height });
    }
    Ok(())
}

#[cfg(all(test, feature = "exr", feature = "textures"))]
mod tests {
    use super::*;

    #[test]
    fn radiance_pictures_are_read_by_their_ending() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let pixels: Vec<image::Rgb<f32>> = (0..6).map(|i| image::Rgb([i as f32, 0.5, 200.0 * i as f32])).collect();
        let file = std::fs::File::create(path("a.hdr")).unwrap();
        image::codecs::hdr::HdrEncoder::new(file).encode(&pixels, 3, 2).unwrap();
        let read = read_radiance(&path("a.hdr")).unwrap();
        // All three channels share one exponent, so a step is at most 1/128 of the largest channel.
        assert!((read.get(2, 1) - Vec3::new(5.0, 0.5, 1000.0)).abs().max_element() < 8.0 && read.width() == 3);
        assert!((read.get(2, 1).z / 1000.0 - 1.0).abs() < 0.01 && read.get(0, 0) == Vec3::new(0.0, 0.5, 0.0));
        write_exr(&path("b.exr"), &read).unwrap();
        assert_eq!(read_radiance(&path("b.exr")).unwrap(), read);
        std::fs::write(path("c.hdr"), b"#?RADIANCE").unwrap();
        for name in ["c.hdr", "d.hdr", "e.png"] {
            assert!(read_radiance(&path(name)).unwrap_err().to_string().contains(name));
        }
    }
}
