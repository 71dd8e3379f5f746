//! The quick choice for a macroblock of a B picture: the prediction that differs least, and of its blocks what is worth its bits,
//! each by itself. [`in_place`](super::in_place) does so in P pictures.
//!
//! Nothing is coded twice to compare. What is predicted poorly goes the long way, since it may have to be intra.

use super::{Decision, Workspace, in_coefficients};
use crate::{PictureType, block::Block, dct, kernel, macroblock::Mode, quant::Transformed, vector::HalfSample};

/// Bits that an intra macroblock takes, or nearly so, on the clips of README.md: what differs less than these are worth is not
/// intra.
pub(super) const INTRA_BITS: i64 = 150;

/// The price in bits of a macroblock that has a vector and nothing else: less than it takes, since later pictures inherit what a
/// skipped one lacks. With 8, plain walls take 5 % more bits.
pub(super) const VECTOR_BITS: i64 = 2;

/// The last quantiser_scale at which rounding to whole samples counts.
pub(super) const FINE: i32 = 6;

impl Decision<'_> {
    /// False if it takes a closer look to decide.
    pub(super) fn decide_quickly(&self, [forward, backward]: [HalfSample; 2], work: &mut Workspace) -> bool {
        work.predictions.order.clear();
        let quantiser = self.quantisers.of(self.quantiser);
        match self.slice.picture_type {
            PictureType::I | PictureType::P => return false,
            PictureType::B => {
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
        let Some(&(mode, error, index)) = work.predictions.order.first() else { return false };
        if in_coefficients(error) > INTRA_BITS * self.lambda && self.tools.may_be_intra(error, self.activity()) {
            return false;
        }
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
                    // Where steps are fine, what is left after rounding is not what coefficients predict.
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
            // What takes no bits at all may do as well.
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
