//! Gray images of data from 0 to 1, such as maps of importance.

#[cfg(feature = "textures")]
use super::check_size;
use super::{ImageFileError, readable_ending};
use plane::Plane;
use std::path::Path;

/// Layer of a film's own importance maps in OpenEXR files.
#[cfg(feature = "exr")]
const OWN_CHANNEL: &str = "importance.V";

/// Decodes a gray image with values from 0 to 1. `bytes` is the content of the file at `path`, a `.png` or `.exr`.
///
/// Codes of PNG files are linear: 255, or 65535 with 16 bits, is 1. An OpenEXR file has one channel, a channel
/// `importance.V` or `Y`, or equal channels R, G and B. Alpha is ignored.
///
/// # Errors
/// The file is damaged, has colors, or has a value outside of 0 to 1; this build does not read the format. The message
/// names the path.
pub fn decode_gray(path: &Path, bytes: &[u8]) -> Result<Plane<f32>, ImageFileError> {
    let gray = decode(path, bytes)?;
    // Refuse other ranges: their scale is unknown.
    for (index, value) in gray.samples().iter().enumerate() {
        if !(0.0..=1.0).contains(value) {
            let (x, y) = (index % gray.width(), index / gray.width());
            let problem =
                format!("pixel ({x}, {y}) is {value}; divide the map by its maximum to get values from 0 to 1");
            return Err(ImageFileError::Content { path: path.into(), problem });
        }
    }
    Ok(gray)
}

/// Decodes a gray image with any values.
fn decode(path: &Path, bytes: &[u8]) -> Result<Plane<f32>, ImageFileError> {
    match (readable_ending(path)?.as_str(), bytes) {
        #[cfg(feature = "textures")]
        ("png", bytes) => decode_png(path, bytes),
        #[cfg(feature = "exr")]
        ("exr", bytes) => decode_exr(path, bytes),
        _ => Err(ImageFileError::Content { path: path.into(), problem: "maps are .png or .exr files".into() }),
    }
}

/// Returns the error of an image with colors.
#[cfg(any(feature = "exr", feature = "textures"))]
fn has_colors(path: &Path) -> ImageFileError {
    let problem = "the map has colors; save it as gray, without a color scale".into();
    ImageFileError::Content { path: path.into(), problem }
}

#[cfg(feature = "textures")]
fn decode_png(path: &Path, bytes: &[u8]) -> Result<Plane<f32>, ImageFileError> {
    use image::ImageDecoder;

    // Check the size before decoding, because the decoder allocates memory for the whole image.
    let decoder = image::codecs::png::PngDecoder::new(std::io::Cursor::new(bytes));
    let decoder = decoder.map_err(ImageFileError::format(path))?;
    let (width, height) = decoder.dimensions();
    check_size(path, width as usize, height as usize)?;
    let picture = image::DynamicImage::from_decoder(decoder).map_err(ImageFileError::format(path))?;

    // Widen all kinds of pixels to 16-bit colors: 255 becomes 65535.
    let mut values = Vec::with_capacity(width as usize * height as usize);
    for pixel in picture.into_rgb16().pixels() {
        let [r, g, b] = pixel.0;
        if r != g || g != b {
            return Err(has_colors(path));
        }
        values.push(f32::from(r) / 65535.0);
    }
    Ok(Plane::from_vec(width as usize, height as usize, values))
}

#[cfg(feature = "exr")]
fn decode_exr(path: &Path, bytes: &[u8]) -> Result<Plane<f32>, ImageFileError> {
    let layers = super::open_exr::decode_layers(path, bytes)?;
    let channel = |name: &str| layers.channel(name);
    let samples = match &layers.channels[..] {
        [(_, only)] => only.as_slice(),
        channels => match (channel(OWN_CHANNEL).or(channel("Y")), layers.colors("")) {
            (Some(gray), _) => gray,
            (None, Some(colors)) if colors.samples().iter().all(|[r, g, b]| r == g && g == b) => {
                channel("R").expect("the image has colors")
            }
            (None, Some(_)) => return Err(has_colors(path)),
            (None, None) => {
                let names: Vec<&str> = channels.iter().map(|(name, _)| name.as_str()).collect();
                let problem = format!("the map must have one channel, or one named Y; it has {}", names.join(", "));
                return Err(ImageFileError::Content { path: path.into(), problem });
            }
        },
    };
    Ok(Plane::from_vec(layers.width, layers.height, samples.to_vec()))
}

#[cfg(all(test, feature = "exr", feature = "textures"))]
mod tests {
    use super::super::write_layers;
    use super::*;
    use image::{DynamicImage, ImageFormat};

    /// Encodes a picture as PNG.
    fn png(picture: DynamicImage) -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    fn gray(name: &str, bytes: &[u8]) -> Result<Vec<f32>, String> {
        decode_gray(Path::new(name), bytes).map(|map| map.samples().to_vec()).map_err(|error| error.to_string())
    }

    #[test]
    fn all_kinds_of_gray_pictures_are_read() {
        let eight = image::GrayImage::from_vec(3, 1, vec![0, 51, 255]).unwrap();
        let expected = Ok(vec![0.0, 0.2, 1.0]);
        for picture in [
            DynamicImage::ImageLuma8(eight.clone()),
            DynamicImage::ImageRgb8(DynamicImage::ImageLuma8(eight.clone()).into_rgb8()),
            DynamicImage::ImageRgba8(DynamicImage::ImageLuma8(eight.clone()).into_rgba8()),
            DynamicImage::ImageLuma16(DynamicImage::ImageLuma8(eight).into_luma16()),
        ] {
            assert_eq!(gray("a.PNG", &png(picture)), expected);
        }
    }

    #[test]
    fn channels_of_linear_files_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let read = |names: &[(&str, f32)]| {
            let channel = |&(name, value): &(&str, f32)| (name.to_owned(), vec![value, 0.5]);
            write_layers(&path, 2, 1, names.iter().map(channel).collect()).unwrap();
            gray("a.exr", &std::fs::read(&path).unwrap())
        };
        assert_eq!(read(&[("gaze", 0.25)]), Ok(vec![0.25, 0.5]));
        assert_eq!(read(&[("R", 9.0), ("G", 1.0), ("B", 1.0), ("importance.V", 0.75)]), Ok(vec![0.75, 0.5]));
        assert_eq!(read(&[("R", 0.125), ("G", 0.125), ("B", 0.125)]), Ok(vec![0.125, 0.5]));
        for (names, word) in [
            (&[("R", 0.5), ("G", 0.25), ("B", 0.5)][..], "colors"),
            (&[("a", 0.5), ("b", 0.25)], "named Y"),
            (&[("Y", 37.0)], "maximum"),
            (&[("Y", -0.5)], "maximum"),
            (&[("Y", f32::NAN)], "NaN"),
        ] {
            let message = read(names).unwrap_err();
            assert!(message.starts_with("a.exr: ") && message.contains(word), "{message}");
        }
    }

    #[test]
    fn other_files_are_refused() {
        let colored = DynamicImage::ImageRgb8(image::RgbImage::from_vec(1, 1, vec![9, 9, 8]).unwrap());
        assert!(gray("a.png", &png(colored)).unwrap_err().contains("colors"));
        for name in ["a.png", "a.exr", "a.tif"] {
            assert!(gray(name, b"no picture").unwrap_err().starts_with(name));
        }
    }
}
