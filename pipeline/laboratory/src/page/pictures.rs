//! Small pictures of a film for the film's page, as data URIs.

use super::html::data_uri;
use crate::png_file;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use plane::Plane;
use render2mpeg::error::{Context, Result};

/// Picture in 8-bit R′G′B′.
pub(super) type Rgb = Plane<[u8; 3]>;

/// Returns the integer factor by which a picture must shrink so that no side exceeds `most`.
pub(super) fn factor(width: usize, height: usize, most: usize) -> usize {
    width.max(height).div_ceil(most).max(1)
}

/// Reduces each square of `factor` × `factor` pixels to one pixel, computed from the samples by `of`. Squares at the
/// right and bottom edges may be smaller.
pub(super) fn shrunk<T: Copy, U: Copy>(plane: &Plane<T>, factor: usize, of: impl Fn(&[T]) -> U) -> Plane<U> {
    let size = (plane.width().div_ceil(factor), plane.height().div_ceil(factor));
    let mut square = Vec::new();
    Plane::from_fn(size.0, size.1, |x, y| {
        square.clear();
        let columns = factor * x..plane.width().min(factor * (x + 1));
        for row in factor * y..plane.height().min(factor * (y + 1)) {
            square.extend_from_slice(&plane.row(row)[columns.clone()]);
        }
        of(&square)
    })
}

/// Returns the mean of code values.
pub(super) fn mean_color(colors: &[[u8; 3]]) -> [u8; 3] {
    std::array::from_fn(|c| {
        let sum: usize = colors.iter().map(|color| usize::from(color[c])).sum();
        ((sum + colors.len() / 2) / colors.len().max(1)) as u8
    })
}

/// Returns a picture as a JPEG data URI, with quality 1 to 100.
///
/// # Errors
/// If JPEG does not support the picture's size.
pub(super) fn jpeg(picture: &Rgb, quality: u8) -> Result<String> {
    let mut bytes = Vec::new();
    let (width, height) = (picture.width() as u32, picture.height() as u32);
    let samples = picture.samples().as_flattened();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode(samples, width, height, ExtendedColorType::Rgb8)
        .context("a picture cannot be written as JPEG")?;
    Ok(data_uri("image/jpeg", &bytes))
}

/// Returns a picture as a lossless PNG data URI.
pub(super) fn png(picture: &Rgb) -> String {
    data_uri("image/png", &png_file::encode(picture))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_have_the_mean_of_their_pixels() {
        assert_eq!((factor(512, 300, 320), factor(320, 1, 320), factor(0, 0, 320)), (2, 1, 1));
        let picture = Plane::from_fn(5, 3, |x, y| [(10 * x) as u8, y as u8, 7]);
        let small = shrunk(&picture, 2, mean_color);
        assert_eq!((small.width(), small.height()), (3, 2));
        assert_eq!((small.get(0, 0), small.get(2, 1)), ([5, 1, 7], [40, 2, 7]));
        assert!(jpeg(&small, 80).unwrap().starts_with("data:image/jpeg;base64,/9j/"));
    }
}
