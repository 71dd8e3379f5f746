//! Sequence headers and their extensions (6.2.2).

use crate::bits::BitReader;
use mpeg2::{FRAME_RATES, PEL_ASPECT_RATIOS, Standard, scan::ZIGZAG};
use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};

/// Number of chroma samples per luma sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChromaFormat {
    /// 4:2:0: half the columns and half the rows.
    Yuv420 = 1,
    /// 4:2:2: half the columns.
    Yuv422 = 2,
    /// 4:4:4: all columns and rows.
    Yuv444 = 3,
}

impl ChromaFormat {
    /// Returns the binary logarithms of the subsampling factors of columns and rows.
    #[must_use]
    pub fn shifts(self) -> [u32; 2] {
        match self {
            Self::Yuv420 => [1, 1],
            Self::Yuv422 => [1, 0],
            Self::Yuv444 => [0, 0],
        }
    }

    /// Returns the number of 8×8 blocks of a macroblock.
    pub(crate) fn blocks(self) -> usize {
        match self {
            Self::Yuv420 => 6,
            Self::Yuv422 => 8,
            Self::Yuv444 => 12,
        }
    }
}

/// Color description of a sequence (6.3.6), in the codes of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColorCodes {
    /// colour_primaries (Table 6-7).
    pub primaries: u8,
    /// transfer_characteristics (Table 6-8).
    pub transfer: u8,
    /// matrix_coefficients (Table 6-9).
    pub matrix: u8,
}

/// Properties of a video sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Sequence {
    /// MPEG-1, or MPEG-2 if the header has an extension.
    pub standard: Standard,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Number of chroma samples per luma sample.
    pub chroma: ChromaFormat,
    /// Whether all pictures are progressive frames.
    pub progressive: bool,
    /// Whether the sequence contains no B pictures, so that pictures need no reordering.
    pub low_delay: bool,
    /// Frames per second as numerator and denominator.
    pub frame_rate: (u32, u32),
    /// aspect_ratio_information (Table 6-3), or pel_aspect_ratio of MPEG-1.
    pub aspect_code: u8,
    /// profile_and_level_indication; 0 in MPEG-1.
    pub profile_and_level: u8,
    /// Bit rate in units of 400 bit/s.
    pub bit_rate: u32,
    /// Color description, if the stream contains one.
    pub color: Option<ColorCodes>,
}

impl Sequence {
    /// Reads a sequence header without its matrices. `None` if the size is zero.
    pub(crate) fn read(bits: &mut BitReader) -> Option<Self> {
        let (width, height) = (bits.read(12) as usize, bits.read(12) as usize);
        let (aspect_code, rate_code) = (bits.read(4) as u8, bits.read(4) as usize);
        let bit_rate = bits.read(18);
        bits.read(1 + 10 + 1); // marker_bit, vbv_buffer_size_value, constrained_parameters_flag
        (width > 0 && height > 0).then_some(Self {
            standard: Standard::Mpeg1,
            width,
            height,
            chroma: ChromaFormat::Yuv420,
            progressive: true,
            low_delay: false,
            frame_rate: FRAME_RATES[rate_code.clamp(1, FRAME_RATES.len()) - 1],
            aspect_code,
            profile_and_level: 0,
            bit_rate,
            color: None,
        })
    }

    /// Reads a sequence extension, after its identifier (6.2.2.3).
    pub(crate) fn extend(&mut self, bits: &mut BitReader) {
        self.standard = Standard::Mpeg2;
        self.profile_and_level = bits.read(8) as u8;
        self.progressive = bits.flag();
        self.chroma = match bits.read(2) {
            2 => ChromaFormat::Yuv422,
            3 => ChromaFormat::Yuv444,
            _ => ChromaFormat::Yuv420,
        };
        self.width |= (bits.read(2) as usize) << 12;
        self.height |= (bits.read(2) as usize) << 12;
        self.bit_rate |= bits.read(12) << 18;
        bits.read(1 + 8); // marker_bit, vbv_buffer_size_extension
        self.low_delay = bits.flag();
        let (numerator, denominator) = (bits.read(2) + 1, bits.read(5) + 1);
        self.frame_rate = (self.frame_rate.0 * numerator, self.frame_rate.1 * denominator);
    }

    /// Reads a sequence display extension, after its identifier (6.2.2.4).
    pub(crate) fn describe_color(&mut self, bits: &mut BitReader) {
        bits.read(3); // video_format
        if bits.flag() {
            let [primaries, transfer, matrix] = std::array::from_fn(|_| bits.read(8) as u8);
            self.color = Some(ColorCodes { primaries, transfer, matrix });
        }
    }

    /// Returns the width of a sample divided by its height.
    #[must_use]
    pub fn sample_aspect(&self) -> f64 {
        let picture = match (self.standard, self.aspect_code) {
            (Standard::Mpeg1, code) => {
                return 1.0 / PEL_ASPECT_RATIOS[usize::from(code).clamp(1, PEL_ASPECT_RATIOS.len()) - 1];
            }
            (_, 2) => 4.0 / 3.0,
            (_, 3) => 16.0 / 9.0,
            (_, 4) => 2.21,
            _ => return 1.0,
        };
        picture * self.height as f64 / self.width as f64
    }

    /// Returns the number of columns and rows of macroblocks of a frame (6.3.3).
    pub(crate) fn macroblocks(&self) -> [usize; 2] {
        let pairs = usize::from(!self.progressive && self.standard == Standard::Mpeg2);
        [self.width.div_ceil(16), self.height.div_ceil(16 << pairs) << pairs]
    }
}

/// Weighting matrices in raster order: intra and non-intra of luma, then of chroma.
#[derive(Clone, Copy)]
pub(crate) struct Matrices(pub [[u8; 64]; 4]);

impl Matrices {
    pub const DEFAULT: Self =
        Self([DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX, DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX]);

    /// Reads the first `count` matrices if present (6.2.2.1, 6.2.3.2). Luma matrices replace those of chroma too (6.3.11).
    pub fn load(&mut self, bits: &mut BitReader, count: usize) {
        for i in 0..count {
            if !bits.flag() {
                continue;
            }
            let mut matrix = [0; 64];
            for raster in ZIGZAG {
                matrix[raster] = (bits.read(8) as u8).max(1);
            }
            self.0[i] = matrix;
            if i < 2 {
                self.0[i + 2] = matrix;
            }
        }
    }
}
