//! Slices of a picture: each macroblock row is one, so rows are coded beside each other.

use crate::{
    Frame,
    bits::{BitSink, BitWriter},
    decide::Decision,
    header::{PictureHeader, put_slice_header},
    macroblock::{Mode, SliceParameters, SliceState},
    motion::HalfSample,
    predict::samples,
    quant::Quantiser,
};
use rayon::prelude::*;

/// What a picture's bits were spent on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PictureStatistics {
    /// Macroblocks coded without a prediction.
    pub intra: u32,
    /// Macroblocks coded with a prediction.
    pub inter: u32,
    /// Macroblocks that repeat the reference picture and take no bits.
    pub skipped: u32,
    /// Bits of macroblock types and vectors of the predicted macroblocks.
    pub motion_bits: u64,
    /// Bits of coefficients and of coded block patterns.
    pub coefficient_bits: u64,
}

impl std::ops::AddAssign for PictureStatistics {
    fn add_assign(&mut self, other: Self) {
        self.intra += other.intra;
        self.inter += other.inter;
        self.skipped += other.skipped;
        self.motion_bits += other.motion_bits;
        self.coefficient_bits += other.coefficient_bits;
    }
}

/// What a picture is coded from.
pub(crate) struct Picture<'a> {
    pub header: PictureHeader,
    /// The picture in whole macroblocks.
    pub source: &'a Frame,
    /// The reconstructed picture before it; a P picture needs one.
    pub reference: Option<&'a Frame>,
    /// Vector of every macroblock, or empty.
    pub vectors: &'a [HalfSample],
    pub quantiser: &'a Quantiser,
    /// vertical_size as the sequence header has it, before padding.
    pub height: usize,
}

/// A coded picture.
pub(crate) struct CodedPicture {
    /// The slices one after the other.
    pub slices: Vec<u8>,
    /// What a decoder shows, in whole macroblocks.
    pub reconstruction: Frame,
    pub statistics: PictureStatistics,
}

/// Rows of the three planes that belong to one row of macroblocks.
struct RowMut<'a> {
    luma: &'a mut [u8],
    cb: &'a mut [u8],
    cr: &'a mut [u8],
}

impl Picture<'_> {
    /// picture_data() (6.2.3): all slices.
    pub fn code(&self) -> CodedPicture {
        let width = self.source.width();
        let mut reconstruction = Frame::black(width, self.source.height());
        let rows = {
            let luma = reconstruction.luma.samples_mut().par_chunks_mut(16 * width);
            let cb = reconstruction.cb.samples_mut().par_chunks_mut(4 * width);
            let cr = reconstruction.cr.samples_mut().par_chunks_mut(4 * width);
            luma.zip(cb.zip(cr))
                .enumerate()
                .map(|(row, (luma, (cb, cr)))| self.code_slice(row, RowMut { luma, cb, cr }))
                .collect::<Vec<_>>()
        };
        let mut coded = CodedPicture { slices: Vec::new(), reconstruction, statistics: PictureStatistics::default() };
        for (bytes, statistics) in rows {
            coded.slices.extend(bytes);
            coded.statistics += statistics;
        }
        coded
    }

    /// slice() (6.2.4) of one row of macroblocks.
    fn code_slice(&self, row: usize, out: RowMut) -> (Vec<u8>, PictureStatistics) {
        let columns = self.source.width() / 16;
        let slice = SliceParameters {
            picture_type: self.header.picture_type,
            f_code: self.header.f_code,
            dc_reset: self.quantiser.dc_reset(),
            last_column: columns - 1,
        };
        let mut writer = BitWriter::default();
        let mut statistics = PictureStatistics::default();
        put_slice_header(&mut writer, row, self.height, self.header.quantiser);
        let mut state = SliceState::new(&slice);
        for column in 0..columns {
            let source = samples(self.source, column, row);
            let vector = self.vectors.get(row * columns + column).copied().unwrap_or_default();
            let decision =
                Decision { slice: &slice, state: &state, quantiser: self.quantiser, column, row, source: &source };
            let trial = decision.decide(self.reference, vector);
            let (written, bits) = state.put_macroblock(&mut writer, &slice, column, &trial.macroblock);
            match trial.macroblock.mode {
                _ if !written => statistics.skipped += 1,
                Mode::Intra => statistics.intra += 1,
                Mode::Inter(_) => statistics.inter += 1,
            }
            statistics.motion_bits += bits.motion;
            statistics.coefficient_bits += bits.coefficients;
            for (i, block) in trial.reconstruction.iter().enumerate() {
                let (plane, stride, first) = match i {
                    0..4 => (&mut *out.luma, 16 * columns, 16 * column + 8 * (i & 1) + 16 * columns * 8 * (i >> 1)),
                    4 => (&mut *out.cb, 8 * columns, 8 * column),
                    _ => (&mut *out.cr, 8 * columns, 8 * column),
                };
                for (y, line) in block.chunks_exact(8).enumerate() {
                    plane[first + y * stride..][..8].copy_from_slice(line);
                }
            }
        }
        debug_assert!(writer.bits() > 38, "a slice has a macroblock");
        (writer.into_bytes(), statistics)
    }
}
