//! Slices of a picture: one per macroblock row, coded in parallel.

use crate::{
    Picture, PictureType,
    bits::{BitSink, BitWriter},
    block::BlockKind,
    decide::{
        Decision, Tools, Workspace,
        in_place::{InPlace, RowMut},
        lambda,
    },
    frame::squared_error,
    header::{PictureHeader, put_slice_header},
    kernel,
    macroblock::{Mode, SliceParameters, SliceState},
    predict::{MacroblockSamples, References, samples},
    quant::Quantisers,
    quantiser_scale::nearest_code,
    vector::HalfSample,
};
use threads::prelude::*;

/// Numbers of macroblocks in a picture, and bits by purpose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PictureStatistics {
    /// Number of macroblocks coded without a prediction.
    pub intra: u32,
    /// Number of macroblocks coded with a prediction.
    pub inter: u32,
    /// Number of predicted macroblocks that take no bits.
    pub skipped: u32,
    /// Number of bits of the types and vectors of predicted macroblocks.
    pub motion_bits: u64,
    /// Number of bits of coefficients and coded block patterns.
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

/// Input for coding a picture.
pub(crate) struct PictureCoder<'a> {
    pub header: PictureHeader,
    /// Picture extended to whole macroblocks.
    pub source: &'a Picture,
    pub references: References<'a>,
    /// Forward and backward vector of every macroblock, or an empty list.
    pub vectors: [&'a [HalfSample]; 2],
    pub quantisers: &'a Quantisers,
    /// Requested quantiser_scale of every macroblock, in sixteenths.
    pub scales_x16: &'a [u32],
    pub tools: Tools,
    /// horizontal_size and vertical_size of the sequence header, before padding.
    pub size: (usize, usize),
}

/// A coded picture.
pub(crate) struct CodedPicture {
    /// Bytes of all slices.
    pub slices: Vec<u8>,
    pub quantiser_scales: Vec<Scales>,
    pub macroblocks: Vec<CodedMacroblock>,
    pub statistics: PictureStatistics,
    /// Sum of squared errors of luma, without padding.
    pub luma_error: u64,
}

/// A coded slice, with the results of its row of macroblocks.
struct CodedSlice {
    bytes: Vec<u8>,
    quantiser_scales: Vec<Scales>,
    macroblocks: Vec<CodedMacroblock>,
    statistics: PictureStatistics,
    luma_error: u64,
}

/// Coding of a macroblock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MacroblockKind {
    /// Intra coded, without other pictures.
    Intra,
    /// Predicted from other pictures.
    Inter,
    /// Predicted and omitted from the stream.
    #[default]
    Skipped,
}

/// quantiser_scale at a macroblock, and the one that produced its levels, even if all are zero.
pub(crate) type Scales = (u8, u8);

/// Coding of a macroblock, and the positions of its coded luma levels in transmission order.
pub(crate) type CodedMacroblock = (MacroblockKind, [u64; 4]);

impl PictureCoder<'_> {
    /// Codes picture_data() (6.2.3): all slices. `reconstruction` receives the decoded picture extended to whole macroblocks.
    pub fn code(&self, reconstruction: &mut Picture) -> CodedPicture {
        let width = self.source.width();
        // Slices only share the source and the references, so rows are independent.
        let rows = {
            let [luma, cb, cr] = reconstruction.samples_mut();
            let (cb, cr) = (cb.par_chunks_mut(4 * width), cr.par_chunks_mut(4 * width));
            luma.par_chunks_mut(16 * width)
                .zip(cb.zip(cr))
                .enumerate()
                .map_init(Workspace::new, |work, (row, (luma, (cb, cr)))| {
                    self.code_slice(row, RowMut { luma, cb, cr }, work)
                })
                .collect::<Vec<_>>()
        };
        // Join the rows in order; they were coded by several threads.
        let mut coded = CodedPicture {
            slices: Vec::new(),
            quantiser_scales: Vec::new(),
            macroblocks: Vec::new(),
            statistics: PictureStatistics::default(),
            luma_error: 0,
        };
        for slice in rows {
            coded.slices.extend(slice.bytes);
            coded.quantiser_scales.extend(slice.quantiser_scales);
            coded.macroblocks.extend(slice.macroblocks);
            coded.statistics += slice.statistics;
            coded.luma_error += slice.luma_error;
        }
        coded
    }

    /// Codes slice() (6.2.4) of one row of macroblocks.
    fn code_slice(&self, row: usize, mut out: RowMut, work: &mut Workspace) -> CodedSlice {
        let columns = self.source.width() / 16;
        let scales_x16 = &self.scales_x16[row * columns..][..columns];
        let parameters = &self.quantisers.parameters;
        let slice = SliceParameters {
            picture_type: self.header.picture_type,
            f_code: self.header.f_code,
            dc_reset: parameters.dc_reset(),
            codes: [BlockKind::Intra, BlockKind::Inter].map(|kind| parameters.codes(kind)),
            quantiser: nearest_code(parameters.q_scale_type, scales_x16[0]),
            last_column: columns - 1,
        };
        // A slice begins with the quantiser of its first macroblock.
        let mut writer = BitWriter::default();
        let mut statistics = PictureStatistics::default();
        let mut quantiser_scales = Vec::with_capacity(columns);
        let mut macroblocks = Vec::with_capacity(columns);
        put_slice_header(&mut writer, row, self.size.1, slice.quantiser);
        let mut state = SliceState::new(&slice);
        let mut quantiser = (scales_x16[0], slice.quantiser);
        for (column, &scale_x16) in scales_x16.iter().enumerate() {
            let vectors = self.vectors.map(|vectors| vectors.get(row * columns + column).copied().unwrap_or_default());
            // Neighboring scales are often equal, so search the table only at changes.
            if scale_x16 != quantiser.0 {
                quantiser = (scale_x16, nearest_code(parameters.q_scale_type, scale_x16));
            }
            let lambda = lambda(scale_x16);
            // P pictures with quick decisions predict directly into the output.
            let is_shown = self.tools.quick
                && slice.picture_type == PictureType::P
                && InPlace {
                    slice: &slice,
                    state: &state,
                    quantiser: self.quantisers.of(quantiser.1),
                    code: quantiser.1,
                    tools: self.tools,
                    lambda,
                    source: self.source,
                    reference: self.references[0].expect("a P picture has a reference"),
                    column,
                    row,
                }
                .decide(vectors[0], work.macroblock_mut(), &mut out);
            // Compare alternatives in the workspace, and copy the cheapest one to the output.
            if !is_shown {
                let decision = Decision {
                    slice: &slice,
                    state: &state,
                    quantisers: self.quantisers,
                    tools: self.tools,
                    quantiser: quantiser.1,
                    lambda,
                    references: self.references,
                    column,
                    row,
                    source: &samples(self.source, column, row),
                };
                decision.decide(vectors, work);
                self.show(&work.reconstruction, column, &mut out);
            }
            // Packets report the current quantiser and the one that produced the levels.
            let macroblock = work.macroblock();
            let (written, bits) = state.put_macroblock(&mut writer, &slice, column, macroblock);
            let has_levels = macroblock.mode == Mode::Intra || macroblock.coded_block_pattern() != 0;
            let of_levels = if has_levels { state.quantiser } else { quantiser.1 };
            quantiser_scales.push([state.quantiser, of_levels].map(|code| self.quantisers.of(code).scale as u8).into());
            // Collect the statistics from which rate control learns.
            let (kind, count) = match macroblock.mode {
                _ if !written => (MacroblockKind::Skipped, &mut statistics.skipped),
                Mode::Intra => (MacroblockKind::Intra, &mut statistics.intra),
                _ => (MacroblockKind::Inter, &mut statistics.inter),
            };
            *count += 1;
            macroblocks.push((kind, std::array::from_fn(|i| macroblock.blocks[i].places)));
            statistics.motion_bits += bits.motion;
            statistics.coefficient_bits += bits.coefficients;
        }
        debug_assert!(writer.bits() > 38, "a slice has a macroblock");
        let luma_error = self.luma_error(row, out.luma);
        CodedSlice { bytes: writer.into_bytes(), quantiser_scales, macroblocks, statistics, luma_error }
    }

    /// Returns the sum of squared errors of a row of luma macroblocks, without padding. The row is still in the cache.
    fn luma_error(&self, row: usize, shown: &[u8]) -> u64 {
        let (width, height) = self.size;
        let rows = 16 * row..(16 * row + 16).min(height);
        rows.zip(shown.chunks(self.source.width()))
            .map(|(y, shown)| squared_error(&self.source.luma().row(y)[..width], &shown[..width]))
            .sum()
    }

    /// Copies the blocks of a macroblock to their positions in the picture.
    fn show(&self, blocks: &MacroblockSamples, column: usize, out: &mut RowMut) {
        let width = self.source.width();
        for (i, block) in blocks.iter().enumerate() {
            let (plane, stride, first) = match i {
                0..4 => (&mut *out.luma, width, 16 * column + 8 * (i & 1) + width * 8 * (i >> 1)),
                4 => (&mut *out.cb, width / 2, 8 * column),
                _ => (&mut *out.cr, width / 2, 8 * column),
            };
            kernel::scatter(block, &mut plane[first..], stride);
        }
    }
}
