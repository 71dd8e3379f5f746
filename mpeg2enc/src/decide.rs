//! Intra, inter or skipped: the cheapest way to code a macroblock.

use crate::{
    Frame, dct,
    header::PictureType,
    macroblock::{Macroblock, Mode, SliceParameters, SliceState},
    motion::HalfSample,
    predict::{Samples, block_squared_error, predict, squared_error},
    quant::{Block, Kind, Quantiser},
};

/// A way to code a macroblock, and what comes of it.
pub(crate) struct Trial {
    pub macroblock: Macroblock,
    /// What the decoder will show.
    pub reconstruction: Samples,
    /// Squared error plus the price of the bits, in the units of [`Quantiser::lambda`].
    cost: u64,
}

/// What a decision looks at.
pub(crate) struct Decision<'a> {
    pub slice: &'a SliceParameters,
    pub state: &'a SliceState,
    pub quantiser: &'a Quantiser,
    pub column: usize,
    pub row: usize,
    pub source: &'a Samples,
}

impl Decision<'_> {
    /// The cheapest way in an I picture (the only one), or in a P picture with `vector` found for it.
    pub fn decide(&self, reference: Option<&Frame>, vector: HalfSample) -> Trial {
        let Some(reference) = reference.filter(|_| self.slice.picture_type == PictureType::P) else {
            return self.intra();
        };
        let still = predict(reference, self.column, self.row, HalfSample::ZERO);
        let still_error = squared_error(self.source, &still);
        let mut best = self.uncoded(HalfSample::ZERO, &still, still_error);
        if still_error == 0 {
            return best;
        }
        let mut least_error = still_error;
        let mut consider = |trial: Trial| {
            if trial.cost < best.cost {
                best = trial;
            }
        };
        let mut moving = vector;
        for _ in 0..2 {
            if moving != HalfSample::ZERO {
                let predicted = predict(reference, self.column, self.row, moving);
                let error = squared_error(self.source, &predicted);
                // The second vector is worth a trial only if it predicts nearly as well.
                if moving != vector && u64::from(error) * 8 > u64::from(least_error) * 9 {
                    break;
                }
                least_error = least_error.min(error);
                consider(self.uncoded(moving, &predicted, error));
                consider(self.coded(moving, &predicted));
            }
            // A vector like its neighbour's costs less.
            let prediction = self.state.motion_prediction;
            let near = (prediction.x - vector.x).abs().max((prediction.y - vector.y).abs()) <= 2;
            if !near || prediction == vector || !self.is_inside(reference, prediction) {
                break;
            }
            moving = prediction;
        }
        if u64::from(still_error) * 4 <= u64::from(least_error) * 5 {
            consider(self.coded(HalfSample::ZERO, &still));
        }
        if u64::from(least_error) * 2 > u64::from(self.activity()) {
            consider(self.intra());
        }
        best
    }

    fn is_inside(&self, reference: &Frame, vector: HalfSample) -> bool {
        let (x2, y2) = (32 * self.column as i32 + vector.x, 32 * self.row as i32 + vector.y);
        (0..=2 * (reference.width() as i32 - 16)).contains(&x2)
            && (0..=2 * (reference.height() as i32 - 16)).contains(&y2)
    }

    /// Squared error if each block were its mean: what intra coding starts from.
    fn activity(&self) -> u32 {
        self.source
            .iter()
            .map(|block| {
                let sum: u32 = block.iter().map(|&sample| u32::from(sample)).sum();
                block_squared_error(block, &[((sum + 32) / 64) as u8; 64])
            })
            .sum()
    }

    fn trial(&self, macroblock: Macroblock, reconstruction: Samples) -> Trial {
        let error = squared_error(self.source, &reconstruction);
        let bits = self.state.count(self.slice, self.column, &macroblock);
        Trial { cost: self.cost(error, bits), macroblock, reconstruction }
    }

    fn cost(&self, error: u32, bits: u64) -> u64 {
        (u64::from(error) << (2 * dct::COEFFICIENT_BITS)) + self.quantiser.lambda as u64 * bits
    }

    /// The prediction and nothing else.
    fn uncoded(&self, vector: HalfSample, predicted: &Samples, error: u32) -> Trial {
        let macroblock = Macroblock { mode: Mode::Inter(vector), blocks: [Block::EMPTY; 6] };
        let bits = self.state.count(self.slice, self.column, &macroblock);
        Trial { cost: self.cost(error, bits), macroblock, reconstruction: *predicted }
    }

    /// The prediction and what the quantiser leaves of the difference.
    fn coded(&self, vector: HalfSample, predicted: &Samples) -> Trial {
        let mut reconstruction = *predicted;
        let blocks = std::array::from_fn(|i| {
            let (source, predicted) = (&self.source[i], &predicted[i]);
            if self.quantiser.leaves_nothing(block_squared_error(source, predicted)) {
                return Block::EMPTY;
            }
            let residual = std::array::from_fn(|k| i32::from(source[k]) - i32::from(predicted[k]));
            let block = self.quantiser.quantise(&dct::forward(&residual), Kind::Inter);
            if block.end > 0 {
                let restored = dct::inverse(&self.quantiser.dequantise(&block, Kind::Inter));
                reconstruction[i] =
                    std::array::from_fn(|k| (i32::from(predicted[k]) + restored[k]).clamp(0, 255) as u8);
            }
            block
        });
        self.trial(Macroblock { mode: Mode::Inter(vector), blocks }, reconstruction)
    }

    fn intra(&self) -> Trial {
        let mut reconstruction = [[0; 64]; 6];
        let blocks = std::array::from_fn(|i| {
            let block = self.quantiser.quantise(&dct::forward(&self.source[i].map(i32::from)), Kind::Intra);
            let restored = dct::inverse(&self.quantiser.dequantise(&block, Kind::Intra));
            reconstruction[i] = restored.map(|sample| sample.clamp(0, 255) as u8);
            block
        });
        self.trial(Macroblock { mode: Mode::Intra, blocks }, reconstruction)
    }
}
