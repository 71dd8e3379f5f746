//! Linear pictures in OpenEXR files.

use exr::prelude::{WritableImage, read_first_rgba_layer_from_file};
use glam::Vec3;
use plane::Plane;
use std::path::Path;

/// Most pixels that [`read_exr`] accepts: a header may claim anything, and memory is taken for what it claims.
const MOST_PIXELS: usize = 1 << 27;

/// Writes linear Rec.709 RGB radiance as 32-bit floats, under a temporary name until it is whole.
///
/// # Errors
/// What the file system said, with the path.
pub fn write_exr(path: &Path, radiance: &Plane<Vec3>) -> Result<(), String> {
    let partial = path.with_extension("exr.part");
    let rgb = |at: exr::math::Vec2<usize>| {
        let [r, g, b] = radiance.get(at.x(), at.y()).to_array();
        (r, g, b)
    };
    let channels = exr::image::SpecificChannels::rgb(rgb);
    let image = exr::image::Image::from_channels((radiance.width(), radiance.height()), channels);
    let named = |error: String| format!("{}: {error}", path.display());
    image.write().to_file(&partial).map_err(|error| named(error.to_string()))?;
    std::fs::rename(&partial, path).map_err(|error| named(error.to_string()))
}

/// Reads the colour of an OpenEXR file.
///
/// # Errors
/// Not an EXR file, no colour in it, or larger than 2²⁷ pixels; the message names the path.
pub fn read_exr(path: &Path) -> Result<Plane<Vec3>, String> {
    let named = |error: String| format!("{}: {error}", path.display());
    let meta = exr::meta::MetaData::read_from_file(path, false).map_err(|error| named(error.to_string()))?;
    for header in &meta.headers {
        let size = header.layer_size;
        if size.0.saturating_mul(size.1) > MOST_PIXELS {
            return Err(named(format!("{}x{} pixels are more than this program takes", size.0, size.1)));
        }
    }
    let image = read_first_rgba_layer_from_file(
        path,
        |size, _| Plane::filled(size.0, size.1, Vec3::ZERO),
        |plane: &mut Plane<Vec3>, at, (r, g, b, _): (f32, f32, f32, f32)| plane.set(at.x(), at.y(), Vec3::new(r, g, b)),
    )
    .map_err(|error| named(error.to_string()))?;
    Ok(image.layer_data.channel_data.pixels)
}

/// Reads a picture of radiances, Radiance `.hdr` or OpenEXR by the file's ending.
///
/// # Errors
/// Another ending, or what [`read_exr`] says.
pub fn read_radiance(path: &Path) -> Result<Plane<Vec3>, String> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    let named = |error: String| format!("{}: {error}", path.display());
    match ending.as_str() {
        "exr" => read_exr(path),
        "hdr" => {
            let file = std::fs::File::open(path).map_err(|error| named(error.to_string()))?;
            let decoder = image::codecs::hdr::HdrDecoder::new(std::io::BufReader::new(file))
                .map_err(|error| named(error.to_string()))?;
            let (width, height) = (decoder.metadata().width as usize, decoder.metadata().height as usize);
            if width.saturating_mul(height) > MOST_PIXELS {
                return Err(named(format!("{width}x{height} pixels are more than this program takes")));
            }
            let picture = image::DynamicImage::from_decoder(decoder).map_err(|error| named(error.to_string()))?;
            let texels = picture.into_rgb32f().pixels().map(|pixel| Vec3::from(pixel.0)).collect();
            Ok(Plane::from_vec(width, height, texels))
        }
        _ => Err(named("radiances are read from .hdr and .exr files".into())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let picture = Plane::from_fn(7, 5, |x, y| Vec3::new(x as f32, y as f32 * 1e6, 1e-6));
        write_exr(&path, &picture).unwrap();
        assert_eq!(read_exr(&path).unwrap(), picture);
        assert!(read_exr(&folder.path().join("none.exr")).unwrap_err().contains("none.exr"));
    }
}
