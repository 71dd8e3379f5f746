//! PNG files of pictures for display.

use plane::Plane;
use render2mpeg::error::{Cause, Error, Result};
use std::io::BufReader;
use std::path::Path;

/// Maximum number of pixels in a file, checked before memory is allocated.
const MOST_PIXELS: u64 = 1 << 27;

/// Reads a PNG file as 8-bit R′G′B′. Gray and palettes are converted to colors, and alpha is dropped.
///
/// # Errors
/// If the file is not a PNG file or exceeds 2²⁷ pixels. The message names the path.
pub fn read(path: &Path) -> Result<Plane<[u8; 3]>> {
    let file = std::fs::File::open(path).map_err(Error::file(path, "cannot be read"))?;
    decode(BufReader::new(file)).map_err(|source| {
        let (path, problem) = (path.into(), " is not a complete PNG file".into());
        pipeline::Error::Content { path, problem, source: Some(source) }.into()
    })
}

fn decode(file: impl std::io::BufRead + std::io::Seek) -> Result<Plane<[u8; 3]>, Cause> {
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width, reader.info().height);
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(format!("{width}x{height} pixels exceed this program's limit").into());
    }
    let mut bytes = vec![0; reader.output_buffer_size().ok_or("its size overflows")?];
    // Read the first picture of an animation.
    reader.next_frame(&mut bytes)?;
    // Repeat gray in all three channels, and drop alpha.
    let channels = reader.output_color_type().0.samples();
    let pixel = |sample: &[u8]| if channels < 3 { [sample[0]; 3] } else { [sample[0], sample[1], sample[2]] };
    let count = width as usize * height as usize;
    let mut samples = Vec::with_capacity(count);
    for sample in bytes.chunks_exact(channels).take(count) {
        samples.push(pixel(sample));
    }
    Ok(Plane::from_vec(width as usize, height as usize, samples))
}

/// Encodes an R′G′B′ picture as a PNG file.
///
/// # Panics
/// If the picture has no pixels.
pub fn encode(picture: &Plane<[u8; 3]>) -> Vec<u8> {
    const WRITES: &str = "writing into memory cannot fail";
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width() as u32, picture.height() as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header().expect(WRITES);
    writer.write_image_data(picture.samples().as_flattened()).expect(WRITES);
    writer.finish().expect(WRITES);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let picture = Plane::from_fn(7, 5, |x, y| [x as u8, 40 * y as u8, 255]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::write(&path, encode(&picture)).unwrap();
        assert_eq!(read(&path).unwrap(), picture);
        std::fs::write(&path, b"no picture").unwrap();
        assert!(read(&path).unwrap_err().chain().contains("a.png"));
    }
}
