//! Syntax of a macroblock (6.2.5), and the predictors of a slice.

use crate::{
    PictureType,
    bits::{BitCounter, BitSink},
    block::Block,
    vector::HalfSample,
    vlc::{self, Codes},
};

/// Prediction mode of a macroblock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Intra,
    /// Prediction from the earlier reference picture.
    Forward(HalfSample),
    /// Prediction from the later reference picture, in B pictures.
    Backward(HalfSample),
    /// Prediction from the mean of both reference pictures, in B pictures.
    Both(HalfSample, HalfSample),
}

impl Mode {
    pub const STILL: Self = Self::Forward(HalfSample::ZERO);

    /// Returns the forward and backward vector.
    pub fn vectors(self) -> [Option<HalfSample>; 2] {
        match self {
            Self::Intra => [None, None],
            Self::Forward(vector) => [Some(vector), None],
            Self::Backward(vector) => [None, Some(vector)],
            Self::Both(forward, backward) => [Some(forward), Some(backward)],
        }
    }

    /// Returns the index of the directions in the tables of macroblock_type of B pictures.
    fn directions(self) -> usize {
        match self {
            Self::Intra => unreachable!("an intra macroblock has no direction"),
            Self::Forward(_) => 0,
            Self::Backward(_) => 1,
            Self::Both(..) => 2,
        }
    }
}

/// Syntax elements of a macroblock.
#[derive(Clone)]
pub(crate) struct Macroblock {
    pub mode: Mode,
    /// quantiser_scale_code that produced the levels.
    pub quantiser: u8,
    /// Levels of the four luma blocks, Cb and Cr.
    pub blocks: [Block; 6],
}

impl Macroblock {
    /// Returns the squared error of all blocks, with twice [`dct::COEFFICIENT_BITS`](crate::dct::COEFFICIENT_BITS) fractional
    /// bits.
    pub fn error(&self) -> i64 {
        self.blocks.iter().map(|block| block.error).sum()
    }

    /// Returns pattern_code as a number, with the first block as the highest bit (6.3.17.4).
    pub fn coded_block_pattern(&self) -> usize {
        self.blocks.iter().fold(0, |pattern, block| 2 * pattern + usize::from(block.is_coded()))
    }
}

/// Parameters that are constant in a slice.
#[derive(Clone, Copy)]
pub(crate) struct SliceParameters {
    pub picture_type: PictureType,
    /// f_code\[s\]\[t\]: forward and backward, horizontal and vertical reach of vectors.
    pub f_code: [[u32; 2]; 2],
    /// Value of the DC predictors after a reset (7.2.1).
    pub dc_reset: i32,
    /// Coefficient codes of intra blocks and of non-intra blocks.
    pub codes: [Codes; 2],
    /// quantiser_scale_code of the slice header.
    pub quantiser: u8,
    /// Column of the last macroblock of the slice, which must not be skipped.
    pub last_column: usize,
}

/// Bits of a macroblock by purpose.
#[derive(Clone, Copy, Default)]
pub(crate) struct MacroblockBits {
    pub motion: u64,
    pub coefficients: u64,
}

/// State of the predictors in a slice.
#[derive(Clone, Copy)]
pub(crate) struct SliceState {
    /// PMV, the vector predictions, forward and backward (7.6.3).
    pub motion_prediction: [HalfSample; 2],
    /// Current quantiser_scale_code.
    pub quantiser: u8,
    /// Mode of the previous macroblock.
    last_mode: Mode,
    /// dct_dc_pred of Y, Cb and Cr (7.2.1).
    dc_prediction: [i32; 3],
    /// macroblock_address_increment: number of macroblocks since the last written one, including this one.
    increment: usize,
}

impl SliceState {
    /// Returns the state at the start of a slice (7.2.1, 7.6.3.4), which begins with the first macroblock of its row.
    pub fn new(slice: &SliceParameters) -> Self {
        Self {
            motion_prediction: [HalfSample::ZERO; 2],
            quantiser: slice.quantiser,
            last_mode: Mode::Intra,
            dc_prediction: [slice.dc_reset; 3],
            increment: 1,
        }
    }

    /// Returns the mode in which a macroblock without coefficients may be skipped (7.6.6); `None` if it must be written.
    ///
    /// In a P picture, this mode is a zero vector. In a B picture, it is the previous macroblock's mode, unless that macroblock
    /// was intra.
    pub fn skipped_mode(&self, slice: &SliceParameters, column: usize) -> Option<Mode> {
        if column == 0 || column == slice.last_column {
            return None;
        }
        match slice.picture_type {
            PictureType::I => None,
            PictureType::P => Some(Mode::STILL),
            PictureType::B => Some(self.last_mode).filter(|&mode| mode != Mode::Intra),
        }
    }

    /// Writes a macroblock, or skips it and returns false.
    pub fn put_macroblock(
        &mut self,
        sink: &mut impl BitSink,
        slice: &SliceParameters,
        column: usize,
        macroblock: &Macroblock,
    ) -> (bool, MacroblockBits) {
        let mut bits = MacroblockBits::default();
        let pattern = macroblock.coded_block_pattern();
        // Skipped macroblocks reset predictors and only increase the address increment.
        if pattern == 0 && self.skipped_mode(slice, column) == Some(macroblock.mode) {
            self.increment += 1;
            if slice.picture_type == PictureType::P {
                self.motion_prediction = [HalfSample::ZERO; 2]; // 7.6.3.4
            }
            self.last_mode = macroblock.mode;
            self.dc_prediction = [slice.dc_reset; 3];
            return (false, bits);
        }
        // Begin with the address and the type. The quantiser is only written together with coefficients.
        vlc::put_macroblock_address_increment(sink, self.increment);
        self.increment = 1;
        let is_intra = macroblock.mode == Mode::Intra;
        let new_quantiser = macroblock.quantiser != self.quantiser && (is_intra || pattern != 0);
        let before = sink.bits();
        sink.put_code(macroblock_type(slice.picture_type, macroblock.mode, pattern != 0, new_quantiser));
        if new_quantiser {
            sink.put(macroblock.quantiser.into(), 5); // quantiser_scale_code
            self.quantiser = macroblock.quantiser;
        }
        // An intra macroblock contains all six blocks and resets the vector predictions.
        if is_intra {
            let before = sink.bits();
            for (i, block) in macroblock.blocks.iter().enumerate() {
                let prediction = &mut self.dc_prediction[i.saturating_sub(3)];
                vlc::put_intra_block(sink, slice.codes[0], block, *prediction, i < 4);
                *prediction = block.levels[0].into();
            }
            bits.coefficients = sink.bits() - before;
            self.motion_prediction = [HalfSample::ZERO; 2]; // 7.6.3.4
        } else {
            // A zero vector with coefficients has its own macroblock_type in P pictures.
            if slice.picture_type == PictureType::P && macroblock.mode == Mode::STILL && pattern != 0 {
                self.motion_prediction = [HalfSample::ZERO; 2]; // 7.6.3.4: macroblock_type without a vector
            } else {
                self.put_motion_vectors(sink, slice, macroblock.mode);
            }
            bits.motion = sink.bits() - before;
            // Write only the blocks with levels.
            let before = sink.bits();
            if pattern != 0 {
                sink.put_code(vlc::CODED_BLOCK_PATTERN[pattern]); // coded_block_pattern()
                for block in macroblock.blocks.iter().filter(|block| block.is_coded()) {
                    vlc::put_inter_block(sink, slice.codes[1], block);
                }
            }
            bits.coefficients = sink.bits() - before;
            self.dc_prediction = [slice.dc_reset; 3];
        }
        self.last_mode = macroblock.mode;
        (true, bits)
    }

    /// Writes motion_vectors(0) and motion_vectors(1) (6.2.5.2); each vector becomes the next prediction (7.6.3.1).
    fn put_motion_vectors(&mut self, sink: &mut impl BitSink, slice: &SliceParameters, mode: Mode) {
        for (s, vector) in mode.vectors().into_iter().enumerate() {
            if let Some(vector) = vector {
                vlc::put_motion_component(sink, vector.x - self.motion_prediction[s].x, slice.f_code[s][0]);
                vlc::put_motion_component(sink, vector.y - self.motion_prediction[s].y, slice.f_code[s][1]);
                self.motion_prediction[s] = vector;
            }
        }
    }

    /// Returns the number of bits that `macroblock` would take at this position.
    pub fn count(&self, slice: &SliceParameters, column: usize, macroblock: &Macroblock) -> u64 {
        let mut counter = BitCounter::default();
        self.clone().put_macroblock(&mut counter, slice, column, macroblock);
        counter.bits()
    }
}

/// Returns macroblock_type (Tables B.2, B.3, B.4).
fn macroblock_type(picture_type: PictureType, mode: Mode, coded: bool, new_quantiser: bool) -> mpeg2::Vlc {
    let choose = |plain, with_quantiser| if new_quantiser { with_quantiser } else { plain };
    match (picture_type, mode) {
        (PictureType::I, _) => choose(vlc::I_INTRA, vlc::I_INTRA_QUANT),
        (PictureType::P, Mode::Intra) => choose(vlc::P_INTRA, vlc::P_INTRA_QUANT),
        (PictureType::P, _) if !coded => vlc::P_MOTION,
        (PictureType::P, Mode::STILL) => choose(vlc::P_CODED, vlc::P_CODED_QUANT),
        (PictureType::P, _) => choose(vlc::P_MOTION_CODED, vlc::P_MOTION_CODED_QUANT),
        (PictureType::B, Mode::Intra) => choose(vlc::B_INTRA, vlc::B_INTRA_QUANT),
        (PictureType::B, _) if !coded => vlc::B_MOTION[mode.directions()],
        (PictureType::B, _) => {
            choose(vlc::B_MOTION_CODED[mode.directions()], vlc::B_MOTION_CODED_QUANT[mode.directions()])
        }
    }
}
