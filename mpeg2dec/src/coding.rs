//! Parameters common to all slices of a picture.

use crate::{
    coefficients::{CODES, CoefficientCodes},
    frame::{FrameMemory, FrameShape, LineSet},
    header::{CodedHeader, PictureStructure},
    sequence::{Matrices, Sequence},
};
use mpeg2::{
    NON_LINEAR_SCALES, Standard,
    scan::{ALTERNATE, ZIGZAG},
};
use plane::PictureType;

/// Index of each coefficient in a block stored by column, in transmission order: zig-zag and alternate.
static SCANS: [[u8; 64]; 2] = [by_column(&ZIGZAG), by_column(&ALTERNATE)];

const fn by_column(scan: &[usize; 64]) -> [u8; 64] {
    let mut out = [0; 64];
    let mut place = 0;
    while place < 64 {
        out[place] = (scan[place] % 8 * 8 + scan[place] / 8) as u8;
        place += 1;
    }
    out
}

/// Weights of the four matrices in transmission order.
pub(crate) struct PlaceWeights(pub [[i32; 64]; 4]);

impl PlaceWeights {
    pub fn new(matrices: &Matrices, alternate_scan: bool) -> Self {
        let scan = if alternate_scan { &ALTERNATE } else { &ZIGZAG };
        Self(matrices.0.map(|matrix| scan.map(|raster| matrix[raster].into())))
    }
}

/// Parameters of a coded picture, which is a frame or a field.
pub(crate) struct PictureCoding {
    pub header: CodedHeader,
    pub standard: Standard,
    /// Whether slice headers contain slice_vertical_position_extension.
    pub is_tall: bool,
    pub shape: FrameShape,
    /// Rows of macroblocks of the frame or field.
    pub rows: usize,
    /// Number of 8×8 blocks of a macroblock.
    pub blocks: usize,
    pub weights: PlaceWeights,
    /// Whether the picture is the second field of its frame.
    pub is_second_field: bool,
}

impl PictureCoding {
    pub fn new(header: CodedHeader, sequence: &Sequence, matrices: &Matrices, is_second_field: bool) -> Self {
        let macroblocks = sequence.macroblocks();
        let is_field = header.structure != PictureStructure::Frame;
        Self {
            header,
            standard: sequence.standard,
            is_tall: sequence.height > 2800,
            shape: FrameShape { macroblocks, shifts: sequence.chroma.shifts() },
            rows: if is_field { macroblocks[1].div_ceil(2) } else { macroblocks[1] },
            blocks: sequence.chroma.blocks(),
            weights: PlaceWeights::new(matrices, header.alternate_scan),
            is_second_field,
        }
    }

    /// Returns the lines of the frame that the picture contains.
    #[inline]
    pub fn lines(&self) -> LineSet {
        match self.header.structure {
            PictureStructure::Frame => LineSet::ALL,
            PictureStructure::Field { parity } => LineSet::field(parity),
        }
    }

    /// Returns the parity of a field picture; 0 for a frame.
    #[inline]
    pub fn parity(&self) -> usize {
        match self.header.structure {
            PictureStructure::Frame => 0,
            PictureStructure::Field { parity } => parity,
        }
    }

    /// Returns whether the picture is a frame picture.
    #[inline]
    pub fn is_frame(&self) -> bool {
        self.header.structure == PictureStructure::Frame
    }

    /// Returns quantiser_scale of a code (7.4.2.2). MPEG-1 uses half of it, and half the divisor.
    pub fn scale(&self, code: u32) -> i32 {
        let code = code.max(1);
        (if self.header.q_scale_type { NON_LINEAR_SCALES[code as usize % 32 - 1] } else { 2 * code }) as i32
    }

    #[inline]
    pub fn scan(&self) -> &'static [u8; 64] {
        &SCANS[usize::from(self.header.alternate_scan)]
    }

    /// Returns the coefficient codes of intra or non-intra blocks (Table 7-3).
    #[inline]
    pub fn codes(&self, is_intra: bool) -> &'static CoefficientCodes {
        &CODES[usize::from(is_intra && self.header.intra_vlc_format)]
    }

    /// Returns whether the picture is of type B.
    #[inline]
    pub fn is_b(&self) -> bool {
        self.header.kind == PictureType::B
    }
}

/// Reference frames of a picture.
#[derive(Clone, Copy)]
pub(crate) struct References<'a> {
    pub past: Option<&'a FrameMemory>,
    pub future: Option<&'a FrameMemory>,
}

impl<'a> References<'a> {
    /// Returns the reference of a direction: 0 is forward, 1 is backward. If it is missing, returns the other one.
    #[inline]
    pub fn of(&self, direction: usize) -> Option<&'a FrameMemory> {
        if direction == 0 { self.past.or(self.future) } else { self.future.or(self.past) }
    }
}
