//! Conversion of 8-bit R′G′B′ to Y′C_BC_R 4:2:0 in integers, rounded to the nearest code.
//!
//! ```text
//! Y′  = 16 + 219 Y′₁                 Y′₁ = 0.2126 R′ + 0.7152 G′ + 0.0722 B′
//! C_B = 128 + 112 (B′ − Y′₁) / 0.9278
//! C_R = 128 + 112 (R′ − Y′₁) / 0.7874
//! ```

use crate::{Picture, SizeError};

/// Weights of red, green and blue in BT.709 luma, in units of 1/10000.
const WEIGHTS: [i32; 3] = [2126, 7152, 722];
/// Sum of the weights.
const UNIT: i32 = 10_000;

impl Picture {
    /// Converts 8-bit R′G′B′ (for example sRGB codes) of `width` × `height` pixels to BT.709, limited range.
    ///
    /// `rgb` contains red, green and blue of each pixel, 0 … 255, in raster order without padding. This is the layout
    /// of an 8-bit PNG without alpha. Codes are not linearized: 255 becomes the code value of white.
    ///
    /// Chroma is filtered with \[1 2 1\]/4 along the rows and \[1 1\]/2 across them. The filter is centered at the
    /// positions in the documentation of [`Picture`]. Beyond the border, the last row and column repeat.
    ///
    /// ```
    /// use plane::Picture;
    ///
    /// let picture = Picture::from_rgb8(2, 1, &[255, 255, 255, 0, 0, 0])?;
    /// assert_eq!(picture.luma().samples(), [235, 16]);
    /// assert_eq!((picture.cb().samples(), picture.cr().samples()), (&[128][..], &[128][..]));
    /// # Ok::<(), plane::SizeError>(())
    /// ```
    ///
    /// # Errors
    /// If `rgb` does not have 3 · `width` · `height` bytes.
    pub fn from_rgb8(width: usize, height: usize, rgb: &[u8]) -> Result<Self, SizeError> {
        let expected_width = width.saturating_mul(3);
        if expected_width.checked_mul(height) != Some(rgb.len()) {
            let size = SizeError { plane: "rgb", width: rgb.len(), height: 1, expected_width, expected_height: height };
            return Err(size);
        }
        let mut picture = Self::black(width, height);
        let [luma, cb, cr] = picture.samples_mut();
        for (luma, pixel) in luma.iter_mut().zip(rgb.as_chunks().0) {
            *luma = code(16, 219 * luma_of(pixel), 255 * UNIT);
        }
        if width == 0 {
            return Ok(picture);
        }

        // A chroma row is between two luma rows. If the height is odd, the last row replaces the missing one.
        let chroma_width = width.div_ceil(2);
        let chroma_rows = cb.chunks_exact_mut(chroma_width).zip(cr.chunks_exact_mut(chroma_width));
        for (rows, (cb, cr)) in rgb.chunks(2 * expected_width).zip(chroma_rows) {
            let upper = &rows[..expected_width];
            let lower = &rows[rows.len() - expected_width..];
            let differences = |x: usize| {
                let [upper, lower] = [upper, lower].map(|row| differences_of(&row.as_chunks().0[x]));
                [upper[0] + lower[0], upper[1] + lower[1]]
            };
            let mut left = differences(0);
            for (i, (cb, cr)) in cb.iter_mut().zip(cr).enumerate() {
                let middle = differences(2 * i);
                let right = differences((2 * i + 1).min(width - 1));
                let [blue, red] = [0, 1].map(|k| left[k] + 2 * middle[k] + right[k]);
                // The weights have the sum 8, and 112 / 8 is 14.
                *cb = code(128, 14 * blue, 255 * (UNIT - WEIGHTS[2]));
                *cr = code(128, 14 * red, 255 * (UNIT - WEIGHTS[0]));
                left = right;
            }
        }
        Ok(picture)
    }
}

/// Returns the luma of a pixel, 0 … 255 · `UNIT`.
fn luma_of(pixel: &[u8; 3]) -> i32 {
    pixel.iter().zip(WEIGHTS).map(|(&component, weight)| weight * i32::from(component)).sum()
}

/// Returns B′ − Y′ and R′ − Y′ of a pixel, in units of 1 / `UNIT` codes.
fn differences_of(pixel: &[u8; 3]) -> [i32; 2] {
    let luma = luma_of(pixel);
    [pixel[2], pixel[0]].map(|component| UNIT * i32::from(component) - luma)
}

/// Returns `offset + numerator / denominator`, rounded to the nearest code; ties go up.
fn code(offset: i32, numerator: i32, denominator: i32) -> u8 {
    (offset + (2 * numerator + denominator).div_euclid(2 * denominator)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;

    /// Returns the codes of a picture of one color, which all samples of a plane share.
    fn codes(width: usize, height: usize, color: [u8; 3]) -> [u8; 3] {
        let picture = Picture::from_rgb8(width, height, &color.repeat(width * height)).unwrap();
        assert_eq!((picture.width(), picture.height()), (width, height));
        picture.planes().map(|plane| {
            let first = plane.get(0, 0);
            assert!(plane.samples().iter().all(|&sample| sample == first), "{color:?}");
            first
        })
    }

    /// Code values of 100 % color bars with the matrix of Rec. ITU-R BT.709.
    #[test]
    fn colors_have_the_codes_of_the_standard() {
        for size in [(1, 1), (2, 2), (5, 3), (8, 7)] {
            let codes = |color| codes(size.0, size.1, color);
            assert_eq!(codes([255, 255, 255]), [235, 128, 128]);
            assert_eq!(codes([0, 0, 0]), [16, 128, 128]);
            assert_eq!(codes([255, 0, 0]), [63, 102, 240]);
            assert_eq!(codes([0, 255, 0]), [173, 42, 26]);
            assert_eq!(codes([0, 0, 255]), [32, 240, 118]);
            assert_eq!(codes([255, 255, 0]), [219, 16, 138]);
            assert_eq!(codes([0, 255, 255]), [188, 154, 16]);
            assert_eq!(codes([255, 0, 255]), [78, 214, 230]);
        }
    }

    /// The filter by its definition, in `f64` and at each site alone.
    #[test]
    fn chroma_is_filtered_around_its_sites() {
        for (width, height) in [(1, 5), (7, 5), (6, 4), (2, 1)] {
            let rgb: Vec<u8> = (0..3 * width * height).map(|i| (i * i * 37 + 11 * i) as u8).collect();
            let picture = Picture::from_rgb8(width, height, &rgb).unwrap();
            let pixels = Plane::from_vec(width, height, rgb.as_chunks::<3>().0.to_vec());
            let expected = |component: usize, weight: f64, x: usize, y: usize| {
                let mut sum = 0.0;
                for (column, factor) in [(-1, 0.125), (0, 0.25), (1, 0.125)] {
                    for row in 0..2 {
                        let rgb = pixels.get_clamped(2 * x as isize + column, 2 * y as isize + row).map(f64::from);
                        let luma = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
                        sum += factor * (rgb[component] - luma) / 255.0;
                    }
                }
                (128.0 + 112.0 * sum / (1.0 - weight)).round() as u8
            };
            let sizes = (width.div_ceil(2), height.div_ceil(2));
            assert_eq!(picture.cb(), &Plane::from_fn(sizes.0, sizes.1, |x, y| expected(2, 0.0722, x, y)));
            assert_eq!(picture.cr(), &Plane::from_fn(sizes.0, sizes.1, |x, y| expected(0, 0.2126, x, y)));
        }
    }

    #[test]
    fn sizes_must_match() {
        let error = Picture::from_rgb8(5, 3, &[0; 44]).unwrap_err();
        assert_eq!(error.to_string(), "rgb has 44x1 samples and needs 15x3");
        assert!(Picture::from_rgb8(usize::MAX, 2, &[]).is_err());
        assert_eq!(Picture::from_rgb8(0, 0, &[]), Ok(Picture::default()));
    }
}
