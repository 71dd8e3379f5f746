//! Syntax of a macroblock (6.2.5), and the predictors that run along a slice.

use crate::{
    bits::{BitCounter, BitSink},
    header::PictureType,
    motion::HalfSample,
    quant::Block,
    vlc::{self, P_CODED, P_INTRA, P_MOTION, P_MOTION_CODED},
};

/// How a macroblock is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Intra,
    Inter(HalfSample),
}

/// What is written of a macroblock.
#[derive(Clone)]
pub(crate) struct Macroblock {
    pub mode: Mode,
    /// Levels of the four luma blocks, Cb, Cr.
    pub blocks: [Block; 6],
}

impl Macroblock {
    /// pattern_code as a number, the first block highest (6.3.17.4).
    fn coded_block_pattern(&self) -> usize {
        self.blocks.iter().fold(0, |pattern, block| 2 * pattern + usize::from(block.end > 0))
    }

    /// Zero vector and no coefficients: not written at all unless it begins or ends a slice (7.6.6.2).
    pub fn is_skippable(&self) -> bool {
        self.mode == Mode::Inter(HalfSample::ZERO) && self.blocks.iter().all(|block| block.end == 0)
    }
}

/// What does not change within a slice.
#[derive(Clone, Copy)]
pub(crate) struct SliceParameters {
    pub picture_type: PictureType,
    pub f_code: [u32; 2],
    /// Value of the DC predictors after a reset (7.2.1).
    pub dc_reset: i32,
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
    /// PMV, the vector prediction (7.6.3).
    pub motion_prediction: HalfSample,
    /// dct_dc_pred for Y, Cb, Cr (7.2.1).
    dc_prediction: [i32; 3],
    /// Macroblocks since the last written one, this one included: macroblock_address_increment.
    increment: usize,
}

impl SliceState {
    /// At the start of a slice (7.2.1, 7.6.3.4), which begins with the first macroblock of its row.
    pub fn new(slice: &SliceParameters) -> Self {
        Self { motion_prediction: HalfSample::ZERO, dc_prediction: [slice.dc_reset; 3], increment: 1 }
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
        if macroblock.is_skippable() && column != 0 && column != slice.last_column {
            self.increment += 1;
            self.motion_prediction = HalfSample::ZERO; // 7.6.3.4
            self.dc_prediction = [slice.dc_reset; 3];
            return (false, bits);
        }
        vlc::put_macroblock_address_increment(sink, self.increment);
        self.increment = 1;
        match macroblock.mode {
            Mode::Intra => {
                sink.put_code(if slice.picture_type == PictureType::I { vlc::I_INTRA } else { P_INTRA }); // macroblock_type
                let before = sink.bits();
                for (i, block) in macroblock.blocks.iter().enumerate() {
                    let component = i.saturating_sub(3);
                    vlc::put_intra_block(sink, block, self.dc_prediction[component], i < 4);
                    self.dc_prediction[component] = block.levels[0].into();
                }
                bits.coefficients = sink.bits() - before;
                self.motion_prediction = HalfSample::ZERO; // 7.6.3.4
            }
            Mode::Inter(vector) => {
                let pattern = macroblock.coded_block_pattern();
                let before = sink.bits();
                if vector == HalfSample::ZERO && pattern != 0 {
                    sink.put_code(P_CODED); // macroblock_type
                    self.motion_prediction = HalfSample::ZERO; // 7.6.3.4
                } else {
                    sink.put_code(if pattern != 0 { P_MOTION_CODED } else { P_MOTION }); // macroblock_type
                    self.put_motion_vector(sink, slice, vector);
                }
                bits.motion = sink.bits() - before;
                let before = sink.bits();
                if pattern != 0 {
                    sink.put_code(vlc::CODED_BLOCK_PATTERN[pattern]); // coded_block_pattern()
                    for block in macroblock.blocks.iter().filter(|block| block.end > 0) {
                        vlc::put_inter_block(sink, block);
                    }
                }
                bits.coefficients = sink.bits() - before;
                self.dc_prediction = [slice.dc_reset; 3];
            }
        }
        (true, bits)
    }

    /// motion_vector(0, 0) (6.2.5.2.1); the vector is the next prediction (7.6.3.1).
    fn put_motion_vector(&mut self, sink: &mut impl BitSink, slice: &SliceParameters, vector: HalfSample) {
        vlc::put_motion_component(sink, vector.x - self.motion_prediction.x, slice.f_code[0]);
        vlc::put_motion_component(sink, vector.y - self.motion_prediction.y, slice.f_code[1]);
        self.motion_prediction = vector;
    }

    /// Bits that `macroblock` would take here.
    pub fn count(&self, slice: &SliceParameters, column: usize, macroblock: &Macroblock) -> u64 {
        let mut counter = BitCounter::default();
        self.clone().put_macroblock(&mut counter, slice, column, macroblock);
        counter.bits()
    }
}
