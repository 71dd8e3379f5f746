//! Quick decision for a macroblock of a P picture: the macroblock is predicted directly into the output. A block is then coded
//! only if it is worth its bits.
//!
//! Samples are read once, in place, and no alternatives are coded for comparison. Poor predictions may need intra coding and
//! are left to the full decision.

use super::{
    Tools, in_coefficients,
    quick::{FINE, INTRA_BITS, VECTOR_BITS},
};
use crate::{
    Picture,
    block::Block,
    dct,
    kernel::{self, ReferenceBlock},
    macroblock::{Macroblock, Mode, SliceParameters, SliceState},
    predict::place_of,
    quant::{Quantiser, Transformed},
    vector::{HalfSample, Range},
};

/// Samples of the three planes in one row of macroblocks.
pub(crate) struct RowMut<'a> {
    pub luma: &'a mut [u8],
    pub cb: &'a mut [u8],
    pub cr: &'a mut [u8],
}

/// Input of the decision for a macroblock.
pub(crate) struct InPlace<'a> {
    pub slice: &'a SliceParameters,
    pub state: &'a SliceState,
    pub quantiser: &'a Quantiser,
    /// quantiser_scale_code of the macroblock.
    pub code: u8,
    pub tools: Tools,
    /// Price of a bit, as returned by [`lambda`](super::lambda).
    pub lambda: i64,
    pub source: &'a Picture,
    pub reference: &'a Picture,
    pub column: usize,
    pub row: usize,
}

impl InPlace<'_> {
    /// Decides how to code the macroblock and writes the reconstruction to `out`. Returns false if the full decision is needed;
    /// the results are then invalid.
    pub fn decide(&self, vector: HalfSample, macroblock: &mut Macroblock, out: &mut RowMut) -> bool {
        debug_assert!(Range::new(self.reference.luma(), self.column, self.row, self.slice.f_code[0]).contains(vector));
        let stride = self.source.width();
        let [place, chroma_place] = [16 * self.column, 8 * self.column];
        // Predict directly into the output, which may already be the final result.
        let luma = self.predict_luma(vector, &mut out.luma[place..], stride);
        let cb = self.predict_chroma(vector, 0, &mut out.cb[chroma_place..], stride / 2);
        let cr = self.predict_chroma(vector, 1, &mut out.cr[chroma_place..], stride / 2);
        let errors = [luma[0], luma[1], luma[2], luma[3], cb, cr];
        let error: u32 = errors.iter().sum();
        if in_coefficients(error) > INTRA_BITS * self.lambda && self.tools.may_be_intra(error, self.activity()) {
            return false;
        }
        (macroblock.mode, macroblock.quantiser) = (Mode::Forward(vector), self.code);
        // Each block is coded only if it gains more than its bits cost.
        let mut is_coded = false;
        for (i, block) in macroblock.blocks.iter_mut().enumerate() {
            let kept = !self.quantiser.leaves_nothing(errors[i], self.tools.worth_a_transform_quarters)
                && self.code(i, errors[i], block, out);
            if !kept {
                block.clear();
            }
            is_coded |= kept;
        }
        if !is_coded && vector != HalfSample::ZERO && self.state.skipped_mode(self.slice, self.column).is_some() {
            // A skipped macroblock takes no bits and may be as good.
            let allowed = in_coefficients(error) + VECTOR_BITS * self.lambda;
            if self.stay(allowed, out) {
                macroblock.mode = Mode::STILL;
            }
        }
        true
    }

    /// Codes the difference between block `i` and its prediction, if it is worth its bits.
    fn code(&self, i: usize, error: u32, block: &mut Block, out: &mut RowMut) -> bool {
        let width = self.source.width();
        let (stride, x, y) = if i < 4 { (width, 8 * (i & 1), 8 * (i >> 1)) } else { (width / 2, 0, 0) };
        let (source, shown) = match i {
            0..4 => (self.luma(self.source, HalfSample::ZERO), &mut out.luma[16 * self.column..]),
            4 => (self.chroma(self.source, 0, HalfSample::ZERO), &mut out.cb[8 * self.column..]),
            _ => (self.chroma(self.source, 1, HalfSample::ZERO), &mut out.cr[8 * self.column..]),
        };
        // The output currently contains the prediction.
        let source = kernel::gathered(&source.samples[y * stride + x..], stride);
        let shown = &mut shown[y * stride + x..];
        let predicted = kernel::gathered(shown, stride);
        let energy = in_coefficients(error);
        let coefficients = dct::forward_difference(&source, &predicted);
        let (rounding, mut restored) = (self.tools.rounding(self.lambda), [0; 64]);
        let transformed = Transformed { coefficients: &coefficients, energy };
        self.quantiser.quantise_predicted(transformed, rounding, block, &mut restored);
        // Compare the cost with the error of the uncoded block.
        let price = self.lambda * i64::from(block.bits);
        if !block.is_coded() || block.error + price >= energy {
            return false;
        }
        let mut samples = [0; 64];
        dct::inverse_onto(&restored, &predicted, &mut samples);
        // With fine steps, rounding to samples makes the true error differ from the error of the coefficients.
        if self.quantiser.scale <= FINE
            && in_coefficients(kernel::squared_difference(&source, &samples)) + price >= energy
        {
            return false;
        }
        kernel::scatter(&samples, shown, stride);
        true
    }

    /// Copies the macroblock at the same position of the reference if the squared error is at most `allowed`.
    fn stay(&self, allowed: i64, out: &mut RowMut) -> bool {
        let still = HalfSample::ZERO;
        // The sum of 256 squares is at least the squared sum divided by 256.
        let difference =
            kernel::absolute_difference::<16>(self.luma(self.source, still), self.luma(self.reference, still));
        if in_coefficients(difference * difference / 256) > allowed {
            return false;
        }
        let (mut luma, mut cb, mut cr) = ([0; 256], [0; 64], [0; 64]);
        let mut error = self.predict_luma(still, &mut luma, 16).iter().sum::<u32>();
        if in_coefficients(error) <= allowed {
            error += self.predict_chroma(still, 0, &mut cb, 8) + self.predict_chroma(still, 1, &mut cr, 8);
        }
        // Write the output only if the whole macroblock is good enough.
        let stays = in_coefficients(error) <= allowed;
        if stays {
            let width = self.source.width();
            copy_rows::<16>(&luma, &mut out.luma[16 * self.column..], width);
            copy_rows::<8>(&cb, &mut out.cb[8 * self.column..], width / 2);
            copy_rows::<8>(&cr, &mut out.cr[8 * self.column..], width / 2);
        }
        stays
    }

    /// Predicts luma into `out`, with rows `stride` apart, and returns the squared errors of its blocks.
    fn predict_luma(&self, vector: HalfSample, out: &mut [u8], stride: usize) -> [u32; 4] {
        let (source, reference) = (self.luma(self.source, HalfSample::ZERO), self.luma(self.reference, vector));
        kernel::predict_onto::<16>(source, reference, out, stride)
    }

    /// Predicts Cb (0) or Cr (1) into `out` and returns the squared error. The vector is half of the luma vector, rounded toward
    /// zero (7.6.3.7).
    fn predict_chroma(&self, vector: HalfSample, which: usize, out: &mut [u8], stride: usize) -> u32 {
        let vector = HalfSample { x: vector.x / 2, y: vector.y / 2 };
        let source = self.chroma(self.source, which, HalfSample::ZERO);
        kernel::predict_onto::<8>(source, self.chroma(self.reference, which, vector), out, stride)[0]
    }

    /// Returns the luma samples at the macroblock's position plus `vector`.
    fn luma<'a>(&self, frame: &'a Picture, vector: HalfSample) -> ReferenceBlock<'a> {
        place_of(frame.luma(), 32 * self.column as i32 + vector.x, 32 * self.row as i32 + vector.y)
    }

    /// Returns the samples of Cb (0) or Cr (1) at the macroblock's position plus `vector`.
    fn chroma<'a>(&self, frame: &'a Picture, which: usize, vector: HalfSample) -> ReferenceBlock<'a> {
        let plane = if which == 0 { frame.cb() } else { frame.cr() };
        place_of(plane, 16 * self.column as i32 + vector.x, 16 * self.row as i32 + vector.y)
    }

    /// Returns the squared error of the blocks from their means, which estimates the cost of intra coding.
    fn activity(&self) -> u32 {
        kernel::deviation(&crate::predict::samples(self.source, self.column, self.row))
    }
}

/// Copies N rows of N samples to the start of `out`, with rows `stride` apart.
fn copy_rows<const N: usize>(samples: &[u8], out: &mut [u8], stride: usize) {
    for (row, out) in samples.as_chunks::<N>().0.iter().zip(out.chunks_mut(stride)) {
        out[..N].copy_from_slice(row);
    }
}
