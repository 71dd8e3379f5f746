//! Conversion of linear RGB to pictures for MPEG-2: 8-bit Y′C_BC_R 4:2:0, limited range, Rec. ITU-R BT.709 or BT.601.
//!
//! ```text
//! Y′  = 16 + 219 Y′₁                      Y′₁ = w_R R′ + w_G G′ + w_B B′
//! C_B = 128 + 112 (B′ − Y′₁) / (1 − w_B)  w   0.2126, 0.7152, 0.0722 in BT.709
//! C_R = 128 + 112 (R′ − Y′₁) / (1 − w_R)      0.299, 0.587, 0.114 in BT.601
//! ```
//!
//! Chroma samples have the sites of MPEG-2 (ISO/IEC 13818-2, 6.1.1.8): on every second luma column, midway between two
//! luma rows. Chroma is filtered with [1 2 1]/4 along the rows and [1 1]/2 across them.

use crate::{ToneMap, WHITE_LUMA, table::EncodeTable};
use plane::{LUMINANCE_WEIGHTS, Picture, Plane, luminance};
use std::sync::Arc;
use threads::prelude::*;

/// Luma code value of black.
const BLACK: f32 = 16.0;
/// Weights of red, green and blue in BT.601 luma.
const BT601_WEIGHTS: [f32; 3] = [0.299, 0.587, 0.114];

/// Weights of red, green and blue in luma. They also determine the chroma scales.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorMatrix {
    /// Rec. ITU-R BT.709, for high definition.
    #[default]
    Bt709,
    /// Rec. ITU-R BT.601, for MPEG-1 and for files without a specified matrix.
    Bt601,
}

impl ColorMatrix {
    /// Returns the luma of R′G′B′, 0…1.
    fn luma(self, [r, g, b]: [f32; 3]) -> f32 {
        match self {
            Self::Bt709 => luminance([r, g, b]),
            Self::Bt601 => BT601_WEIGHTS[0] * r + BT601_WEIGHTS[1] * g + BT601_WEIGHTS[2] * b,
        }
    }

    fn weights(self) -> [f32; 3] {
        match self {
            Self::Bt709 => LUMINANCE_WEIGHTS,
            Self::Bt601 => BT601_WEIGHTS,
        }
    }

    /// Returns the number of chroma code values per unit of B′ − Y′, and per unit of R′ − Y′.
    fn chroma_scales(self) -> [f32; 2] {
        match self {
            Self::Bt709 => [224.0 / 1.8556, 224.0 / 1.5748],
            Self::Bt601 => [224.0 / 1.772, 224.0 / 1.402],
        }
    }
}

/// Returns the luminance of every pixel. Negative components are replaced by 0, as in the tone map. The luminance of a
/// pixel that is not finite is 0.
pub fn luminance_plane(radiance: &Plane<[f32; 3]>) -> Plane<f32> {
    radiance.map(|rgb| {
        let luminance = luminance(rgb.map(|c| c.max(0.0)));
        if luminance.is_finite() && rgb.iter().all(|c| c.is_finite()) { luminance } else { 0.0 }
    })
}

/// A tone-mapped picture.
#[derive(Clone, Debug, PartialEq)]
pub struct YCbCr {
    /// Picture for the encoder: luma 16…235, chroma 16…240.
    pub picture: Arc<Picture>,
    /// Luma before rounding, in code values above black: 0 is black, 219 is white. The codec's quantiser steps apply
    /// without scaling. The masking model reads this luma.
    pub luma: Plane<f32>,
    /// Number of pixels with a NaN or infinite component, which were replaced by black.
    pub non_finite: usize,
}

/// Tone-mapped R′G′B′ of a row, and the resulting luma.
#[derive(Default, Clone)]
struct Row {
    rgb: Vec<[f32; 3]>,
    luma: Vec<f32>,
}

impl Row {
    /// Fills the row from linear radiance. Returns the number of pixels that are not finite.
    fn fill(&mut self, radiance: &[[f32; 3]], table: &EncodeTable, matrix: ColorMatrix) -> usize {
        let mut non_finite = 0;
        self.rgb.clear();
        // Replace pixels that are not finite by black, and count them.
        self.rgb.extend(radiance.iter().map(|pixel| {
            if pixel.iter().all(|c| c.is_finite()) {
                pixel.map(|c| table.get(c))
            } else {
                non_finite += 1;
                [0.0; 3]
            }
        }));
        self.luma.clear();
        self.luma.extend(self.rgb.iter().map(|&rgb| matrix.luma(rgb).clamp(0.0, 1.0)));
        non_finite
    }
}

/// Two luma rows and the chroma row between them.
struct Strip<'a> {
    radiance: &'a [[f32; 3]],
    y: &'a mut [u8],
    luma: &'a mut [f32],
    cb: &'a mut [u8],
    cr: &'a mut [u8],
}

impl Strip<'_> {
    fn convert(self, width: usize, table: &EncodeTable, matrix: ColorMatrix, rows: &mut [Row; 2]) -> usize {
        let mut non_finite = 0;
        let luma_rows = self.radiance.len() / width;
        // Convert the luma of both rows.
        for (i, row) in rows.iter_mut().enumerate().take(luma_rows) {
            non_finite += row.fill(&self.radiance[i * width..][..width], table, matrix);
            let range = i * width..(i + 1) * width;
            for ((y, luma), &value) in self.y[range.clone()].iter_mut().zip(&mut self.luma[range]).zip(&row.luma) {
                *luma = WHITE_LUMA * value;
                *y = (BLACK + *luma).round() as u8;
            }
        }
        // If the height is odd, the last row also replaces the missing row.
        let [upper, lower] = [&rows[0], &rows[luma_rows - 1]];
        // Sum B′ − Y′ and R′ − Y′ over both rows in column x.
        let differences = |x: usize| {
            let of = |row: &Row| (row.rgb[x][2] - row.luma[x], row.rgb[x][0] - row.luma[x]);
            let ((b0, r0), (b1, r1)) = (of(upper), of(lower));
            (b0 + b1, r0 + r1)
        };
        // Average two rows, with weights ¼, ½, ¼ across the columns around each MPEG-2 site.
        let code = |scale: f32, sum: f32| (128.0 + scale * 0.125 * sum).round().clamp(16.0, 240.0) as u8;
        let [cb_scale, cr_scale] = matrix.chroma_scales();
        let mut left = differences(0);
        for (i, (cb, cr)) in self.cb.iter_mut().zip(self.cr).enumerate() {
            let middle = differences(2 * i);
            let right = differences((2 * i + 1).min(width - 1));
            *cb = code(cb_scale, left.0 + 2.0 * middle.0 + right.0);
            *cr = code(cr_scale, left.1 + 2.0 * middle.1 + right.1);
            left = right;
        }
        non_finite
    }
}

impl YCbCr {
    /// Tone maps linear RGB radiance and converts it with BT.709, rounded to the nearest code. Accepts any picture
    /// size.
    pub fn from_radiance(radiance: &Plane<[f32; 3]>, tone_map: &ToneMap) -> Self {
        Self::with_matrix(radiance, tone_map, ColorMatrix::Bt709)
    }

    /// Tone maps linear RGB radiance and converts it with `matrix`, rounded to the nearest code. Accepts any picture
    /// size.
    pub fn with_matrix(radiance: &Plane<[f32; 3]>, tone_map: &ToneMap, matrix: ColorMatrix) -> Self {
        let (width, height) = (radiance.width(), radiance.height());
        let chroma_width = width.div_ceil(2);
        let mut picture = Picture::black(width, height);
        let mut luma = Plane::filled(width, height, 0.0);
        if width == 0 || height == 0 {
            return Self { picture: Arc::new(picture), luma, non_finite: 0 };
        }
        let table = EncodeTable::new(tone_map);
        let [y, cb, cr] = picture.samples_mut();
        // Each strip has two luma rows and one chroma row, so strips are independent.
        let luma_strips = y.par_chunks_mut(2 * width).zip(luma.samples_mut().par_chunks_mut(2 * width));
        let chroma_strips = cb.par_chunks_mut(chroma_width).zip(cr.par_chunks_mut(chroma_width));
        // Convert the strips in parallel, with two rows of scratch memory per thread.
        let non_finite = radiance
            .samples()
            .par_chunks(2 * width)
            .zip(luma_strips)
            .zip(chroma_strips)
            .map_init(<[Row; 2]>::default, |rows, ((radiance, (y, luma)), (cb, cr))| {
                Strip { radiance, y, luma, cb, cr }.convert(width, &table, matrix, rows)
            })
            .sum();
        Self { picture: Arc::new(picture), luma, non_finite }
    }
}

/// Converts a BT.709 picture to 8-bit R′G′B′, for previews.
///
/// Chroma is interpolated linearly from its MPEG-2 sites.
#[must_use]
pub fn to_rgb8(picture: &Picture) -> Plane<[u8; 3]> {
    to_rgb8_by(picture, ColorMatrix::Bt709)
}

/// Converts a picture with the color matrix `matrix` to 8-bit R′G′B′, for previews.
///
/// Chroma is interpolated linearly from its MPEG-2 sites.
#[must_use]
pub fn to_rgb8_by(picture: &Picture, matrix: ColorMatrix) -> Plane<[u8; 3]> {
    let [cb_scale, cr_scale] = matrix.chroma_scales();
    let chroma = |plane: &Plane<u8>, x: usize, y: usize| {
        let (column, row) = ((x / 2) as isize, (y / 2) as isize);
        let next_column = column + (x % 2) as isize;
        // Luma row 2j is a quarter of a chroma row above chroma row j. Luma row 2j + 1 is a quarter below it.
        let next_row = if y.is_multiple_of(2) { row - 1 } else { row + 1 };
        let along =
            |row| 0.5 * (f32::from(plane.get_clamped(column, row)) + f32::from(plane.get_clamped(next_column, row)));
        0.75 * along(row) + 0.25 * along(next_row) - 128.0
    };
    Plane::from_fn(picture.width(), picture.height(), |x, y| {
        // Solve the equations of Y′, C_B and C_R for R′, G′ and B′.
        let luma = (f32::from(picture.luma().get(x, y)) - BLACK) / WHITE_LUMA;
        let b = luma + chroma(picture.cb(), x, y) / cb_scale;
        let r = luma + chroma(picture.cr(), x, y) / cr_scale;
        let [wr, wg, wb] = matrix.weights();
        let g = (luma - wr * r - wb * b) / wg;
        [r, g, b].map(|c| (255.0 * c).round().clamp(0.0, 255.0) as u8)
    })
}
