//! Syntax of a macroblock (6.2.5), and the predictors that run along a slice.

use crate::{
    PictureType,
    bits::{BitCounter, BitSink},
    block::Block,
    vector::HalfSample,
    vlc::{self, Codes},
};

/// How a macroblock is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Intra,
    /// From the reference picture before it.
    Forward(HalfSample),
    /// From the reference picture after it, in B pictures.
    Backward(HalfSample),
    /// From the mean of both, in B pictures.
    Both(HalfSample, HalfSample),
}

impl Mode {
    pub const STILL: Self = Self::Forward(HalfSample::ZERO);

    /// The forward and the backward vector.
    pub fn vectors(self) -> [Option<HalfSample>; 2] {
        match self {
            Self::Intra => [None, None],
            Self::Forward(vector) => [Some(vector), None],
            Self::Backward(vector) => [None, Some(vector)],
            Self::Both(forward, backward) => [Some(forward), Some(backward)],
        }
    }

    /// Place of the directions in the tables of macroblock_type of B pictures.
    fn directions(self) -> usize {
        match self {
            Self::Intra => unreachable!("an intra macroblock has no direction"),
            Self::Forward(_) => 0,
            Self::Backward(_) => 1,
            Self::Both(..) => 2,
        }
    }
}

/// The syntax elements of a macroblock.
#[derive(Clone)]
pub(crate) struct Macroblock {
    pub mode: Mode,
    /// quantiser_scale_code that the levels were made with.
    pub quantiser: u8,
    /// Levels of the four luma blocks, Cb, Cr.
    pub blocks: [Block; 6],
}

impl Macroblock {
    /// Squared error of all blocks, with twice [`dct::COEFFICIENT_BITS`](crate::dct::COEFFICIENT_BITS) fractional bits.
    pub fn error(&self) -> i64 {
        self.blocks.iter().map(|block| block.error).sum()
    }

    /// pattern_code as a number, the first block highest (6.3.17.4).
    pub fn coded_block_pattern(&self) -> usize {
        self.blocks.iter().fold(0, |pattern, block| 2 * pattern + usize::from(block.is_coded()))
    }
}

/// Parameters that do not change within a slice.
#[derive(Clone, Copy)]
pub(crate) struct SliceParameters {
    pub picture_type: PictureType,
    /// f_code\[s\]\[t\]: forward and backward, horizontal and vertical.
    pub f_code: [[u32; 2]; 2],
    /// Value of the DC predictors after a reset (7.2.1).
    pub dc_reset: i32,
    /// Codes of the coefficients of intra blocks, and of others.
    pub codes: [Codes; 2],
    /// quantiser_scale_code of the slice header.
    pub quantiser: u8,
    /// Column of the last macroblock of the slice, which may not be skipped.
    pub last_column: usize,
}

/// Bits of a macroblock by what they say.
#[derive(Clone, Copy, Default)]
pub(crate) struct MacroblockBits {
    pub motion: u64,
    pub coefficients: u64,
}

/// Predictors within a slice.
#[derive(Clone, Copy)]
pub(crate) struct SliceState {
    /// PMV, the vector predictions, forward and backward (7.6.3).
    pub motion_prediction: [HalfSample; 2],
    /// quantiser_scale_code in force.
    pub quantiser: u8,
    /// Mode of the macroblock before.
    last_mode: Mode,
    /// dct_dc_pred for Y, Cb, Cr (7.2.1).
    dc_prediction: [i32; 3],
    /// Macroblocks since the last written one, this one included: macroblock_address_increment.
    increment: usize,
}

impl SliceState {
    /// At the start of a slice (7.2.1, 7.6.3.4), which begins with the first macroblock of its row.
    pub fn new(slice: &SliceParameters) -> Self {
        Self {
            motion_prediction: [HalfSample::ZERO; 2],
            quantiser: slice.quantiser,
            last_mode: Mode::Intra,
            dc_prediction: [slice.dc_reset; 3],
            increment: 1,
        }
    }

    /// The mode in which a macroblock without coefficients would not be written at all (7.6.6), if there is one here.
    ///
    /// In a P picture that is a zero vector, in a B picture what the macroblock before had unless that was intra.
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

    /// Writes a macroblock, or counts it as skipped: false then.
    pub fn put_macroblock(
        &mut self,
        sink: &mut impl BitSink,
        slice: &SliceParameters,
        column: usize,
        macroblock: &Macroblock,
    ) -> (bool, MacroblockBits) {
        let mut bits = MacroblockBits::default();
        let pattern = macroblock.coded_block_pattern();
        if pattern == 0 && self.skipped_mode(slice, column) == Some(macroblock.mode) {
            self.increment += 1;
            if slice.picture_type == PictureType::P {
                self.motion_prediction = [HalfSample::ZERO; 2]; // 7.6.3.4
            }
            self.last_mode = macroblock.mode;
            self.dc_prediction = [slice.dc_reset; 3];
            return (false, bits);
        }
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
            if slice.picture_type == PictureType::P && macroblock.mode == Mode::STILL && pattern != 0 {
                self.motion_prediction = [HalfSample::ZERO; 2]; // 7.6.3.4: macroblock_type says that there is no vector
            } else {
                self.put_motion_vectors(sink, slice, macroblock.mode);
            }
            bits.motion = sink.bits() - before;
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

    /// motion_vectors(0), motion_vectors(1) (6.2.5.2); each vector is the next prediction (7.6.3.1).
    fn put_motion_vectors(&mut self, sink: &mut impl BitSink, slice: &SliceParameters, mode: Mode) {
        for (s, vector) in mode.vectors().into_iter().enumerate() {
            if let Some(vector) = vector {
                vlc::put_motion_component(sink, vector.x - self.motion_prediction[s].x, slice.f_code[s][0]);
                vlc::put_motion_component(sink, vector.y - self.motion_prediction[s].y, slice.f_code[s][1]);
                self.motion_prediction[s] = vector;
            }
        }
    }

    /// Bits that `macroblock` would take here.
    pub fn count(&self, slice: &SliceParameters, column: usize, macroblock: &Macroblock) -> u64 {
        let mut counter = BitCounter::default();
        self.clone().put_macroblock(&mut counter, slice, column, macroblock);
        counter.bits()
    }
}

/// macroblock_type (Tables B.2, B.3, B.4).
fn macroblock_type(picture_type: PictureType, mode: Mode, coded: bool, new_quantiser: bool) -> crate::bits::Vlc {
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
