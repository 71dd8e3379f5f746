//! Quick decision for a macroblock of a B picture: the prediction with the least error. A block is coded only if it is worth its
//! bits. [`in_place`](super::in_place) is the counterpart for P pictures.
//!
//! No alternatives are coded for comparison. Poor predictions may need intra coding and are left to the full decision.

use super::{Decision, Workspace, in_coefficients};
use crate::{PictureType, block::Block, dct, kernel, macroblock::Mode, quant::Transformed, vector::HalfSample};

/// Approximate bits of an intra macroblock on the clips of README.md. A macroblock with an error worth fewer bits is not intra
/// coded.
pub(super) const INTRA_BITS: i64 = 150;

/// Price in bits of a macroblock with only a vector. It is below the true value because later pictures inherit the error of a
/// skipped macroblock. With a price of 8, plain walls take 5 % more bits.
pub(super) const VECTOR_BITS: i64 = 2;

/// Maximum quantiser_scale at which the error of rounding to integer samples is considered.
pub(super) const FINE: i32 = 6;

impl Decision<'_> {
    /// Decides quickly; returns false if the full decision is needed.
    pub(super) fn decide_quickly(&self, [forward, backward]: [HalfSample; 2], work: &mut Workspace) -> bool {
        work.predictions.order.clear();
        let quantiser = self.quantisers.of(self.quantiser);
        match self.slice.picture_type {
            PictureType::I | PictureType::P => return false,
            PictureType::B => {
                // A skipped macroblock with a small error needs no further trials.
                if let Some(mode) = self.state.skipped_mode(self.slice, self.column) {
                    work.predictions.consider(self, mode);
                    if let Some(&(_, _, index)) = work.predictions.order.first()
                        && work.predictions.errors[index]
                            .iter()
                            .all(|&error| quantiser.leaves_nothing(error, self.tools.worth_a_transform_quarters))
                    {
                        self.finish_uncoded(mode, index, work);
                        return true;
                    }
                }
                work.predictions.consider(self, Mode::Forward(forward));
                work.predictions.consider(self, Mode::Backward(backward));
                work.predictions.consider(self, Mode::Both(forward, backward));
            }
        }
        // Leave poor predictions to the full decision, which also tries intra coding.
        let Some(&(mode, error, index)) = work.predictions.order.first() else { return false };
        if in_coefficients(error) > INTRA_BITS * self.lambda && self.tools.may_be_intra(error, self.activity()) {
            return false;
        }
        // Each block is coded only if it gains more than its bits cost.
        let macroblock = &mut work.best.macroblock;
        (macroblock.mode, macroblock.quantiser) = (mode, self.quantiser);
        for (i, block) in macroblock.blocks.iter_mut().enumerate() {
            let (source, predicted) = (&self.source[i], &work.predictions.samples[index][i]);
            let error = work.predictions.errors[index][i];
            if !quantiser.leaves_nothing(error, self.tools.worth_a_transform_quarters) {
                let coefficients = dct::forward_difference(source, predicted);
                let energy = in_coefficients(error);
                let mut restored = [0; 64];
                let transformed = Transformed { coefficients: &coefficients, energy };
                quantiser.quantise_predicted(transformed, self.rounding(), block, &mut restored);
                let coded = &*block;
                if coded.is_coded() && coded.error + self.lambda * i64::from(coded.bits) < energy {
                    dct::inverse_onto(&restored, predicted, &mut work.reconstruction[i]);
                    // With fine steps, rounding to samples makes the true error differ from the error of the coefficients.
                    let left = || kernel::squared_difference(source, &work.reconstruction[i]);
                    if quantiser.scale > FINE || in_coefficients(left()) + self.lambda * i64::from(coded.bits) < energy
                    {
                        continue;
                    }
                }
            }
            block.clear();
            work.reconstruction[i] = *predicted;
        }
        if !work.best.macroblock.blocks.iter().any(Block::is_coded)
            && let Some(skipped) = self.state.skipped_mode(self.slice, self.column)
            && skipped != mode
        {
            // A skipped macroblock takes no bits and may be as good.
            work.predictions.consider(self, skipped);
            let entry = work.predictions.order.iter().find(|entry| entry.0 == skipped);
            if let Some(&(_, skipped_error, index)) = entry
                && in_coefficients(skipped_error) <= in_coefficients(error) + VECTOR_BITS * self.lambda
            {
                self.finish_uncoded(skipped, index, work);
            }
        }
        true
    }
}
