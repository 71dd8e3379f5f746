//! Intra, inter or skipped, and how coarse: the cheapest way to code a macroblock.
//!
//! ```text
//! J = D + λ·R      D squared error of all samples      R bits as they will be written      λ price of a bit
//! ```

use crate::{
    dct,
    header::PictureType,
    macroblock::{Macroblock, Mode, SliceParameters, SliceState},
    motion::{HalfSample, Range},
    predict::{References, Samples, block_squared_error, predict_mode, squared_error},
    quant::{Block, Kind, Quantiser, Quantisers, Rounding},
};

/// Price of a bit in squared errors: 0.23 times quantiser_scale², here with twice [`dct::COEFFICIENT_BITS`] fractional
/// bits. Ours, tuned on the clips of README.md: 0.16, the factor of the y262 encoder, takes 0.5 % more bits, and 0.31
/// as many where quality is high.
const LAMBDA: i64 = 15;
/// A prediction is coded for comparison if its error is less than this many tenths of the least.
const WORTH_A_TRIAL_TENTHS: u64 = 14;

/// What is tried for a macroblock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tools {
    /// Levels by shortest path instead of rounding.
    pub trellis: bool,
    /// Predictions that are coded for comparison.
    pub trials: usize,
    /// Other quantisers than the one asked for, where they cost less.
    pub quantiser_choice: bool,
}

/// A way to code a macroblock.
#[derive(Clone)]
struct Trial {
    macroblock: Macroblock,
    cost: i64,
    /// Coefficients of what the blocks code, for a second look; `None` if there are none to code.
    coefficients: Option<[[i32; 64]; 6]>,
}

/// A macroblock as it will be written, and what the decoder will show.
pub(crate) struct Decided {
    pub macroblock: Macroblock,
    pub reconstruction: Samples,
}

/// What a decision looks at.
pub(crate) struct Decision<'a> {
    pub slice: &'a SliceParameters,
    pub state: &'a SliceState,
    pub quantisers: &'a Quantisers,
    pub tools: Tools,
    /// quantiser_scale_code asked for.
    pub quantiser: u8,
    /// Price of a bit, as [`lambda`] gives it.
    pub lambda: i64,
    pub references: References<'a>,
    pub column: usize,
    pub row: usize,
    pub source: &'a Samples,
}

/// The price of a bit where quantiser_scale, in sixteenths, is asked for.
pub(crate) fn lambda(scale_x16: u32) -> i64 {
    (LAMBDA * i64::from(scale_x16) * i64::from(scale_x16) / 256).max(1)
}

/// Predictions to choose from, the best first.
struct Predictions {
    list: Vec<(Mode, Samples, u32)>,
}

impl Predictions {
    fn consider(&mut self, decision: &Decision, mode: Mode) {
        if self.list.iter().any(|entry| entry.0 == mode) || !decision.is_allowed(mode) {
            return;
        }
        let predicted = predict_mode(&decision.references, decision.column, decision.row, mode);
        let error = squared_error(decision.source, &predicted);
        let place = self.list.partition_point(|entry| entry.2 <= error);
        self.list.insert(place, (mode, predicted, error));
    }
}

impl Decision<'_> {
    /// The cheapest way, with `vectors` found forward and backward.
    pub fn decide(&self, [forward, backward]: [HalfSample; 2]) -> Decided {
        let quantiser = self.quantisers.of(self.quantiser);
        let mut predictions = Predictions { list: Vec::with_capacity(8) };
        let skipped = self.state.skipped_mode(self.slice, self.column);
        if let Some(mode) = skipped {
            predictions.consider(self, mode);
            // What quantises to nothing and takes no bits cannot be beaten by much.
            if predictions.list.first().is_some_and(|(_, predicted, _)| self.leaves_nothing(quantiser, predicted)) {
                return self.finish(self.uncoded(mode, 0), &predictions);
            }
        }
        let [forward_prediction, backward_prediction] = self.state.motion_prediction;
        let near = |a: HalfSample, b: HalfSample| (a.x - b.x).abs().max((a.y - b.y).abs()) <= 2;
        match self.slice.picture_type {
            PictureType::I => {}
            PictureType::P => {
                predictions.consider(self, Mode::STILL);
                predictions.consider(self, Mode::Forward(forward));
                if near(forward, forward_prediction) {
                    predictions.consider(self, Mode::Forward(forward_prediction));
                }
            }
            PictureType::B => {
                predictions.consider(self, Mode::Forward(forward));
                predictions.consider(self, Mode::Backward(backward));
                predictions.consider(self, Mode::Both(forward, backward));
                if near(forward, forward_prediction) {
                    predictions.consider(self, Mode::Forward(forward_prediction));
                }
                if near(backward, backward_prediction) {
                    predictions.consider(self, Mode::Backward(backward_prediction));
                }
                predictions.consider(self, Mode::Both(forward_prediction, backward_prediction));
            }
        }
        let mut best: Option<Trial> = None;
        let mut keep = |trial: Trial| {
            if best.as_ref().is_none_or(|best| trial.cost < best.cost) {
                best = Some(trial);
            }
        };
        let uncoded = predictions.list.iter().map(|&(mode, _, error)| self.uncoded(mode, error));
        let uncoded = uncoded.min_by_key(|trial| trial.cost);
        if let Some(trial) = &uncoded {
            keep(trial.clone());
        }
        let least = predictions.list.first().map(|entry| entry.2);
        for (mode, predicted, error) in predictions.list.iter().take(self.tools.trials) {
            // A prediction that is much worse is not going to need fewer bits.
            if least.is_some_and(|least| u64::from(*error) * 10 > u64::from(least) * WORTH_A_TRIAL_TENTHS) {
                break;
            }
            keep(self.coded(*mode, predicted));
        }
        if least.is_none_or(|least| u64::from(least) * 2 > u64::from(self.activity())) {
            keep(self.intra());
        }
        let mut best = best.expect("intra is always possible");
        if self.tools.quantiser_choice {
            best = self.with_best_quantiser(best);
        }
        let bits_price = best.cost - best.macroblock.error();
        let decided = self.finish(best, &predictions);
        // Errors of coefficients foretell those of samples but for rounding: fine steps may change no sample at all.
        match uncoded {
            Some(uncoded) if decided.macroblock.mode != Mode::Intra => {
                let error =
                    i64::from(squared_error(self.source, &decided.reconstruction)) << (2 * dct::COEFFICIENT_BITS);
                if uncoded.cost <= error + bits_price { self.finish(uncoded, &predictions) } else { decided }
            }
            _ => decided,
        }
    }

    fn is_allowed(&self, mode: Mode) -> bool {
        mode.vectors().into_iter().enumerate().all(|(s, vector)| {
            vector.is_none_or(|vector| {
                self.references[s].is_some_and(|reference| {
                    let f_code = self.slice.f_code[s];
                    Range::new(&reference.luma, self.column, self.row, f_code).contains(vector)
                })
            })
        })
    }

    fn leaves_nothing(&self, quantiser: &Quantiser, predicted: &Samples) -> bool {
        self.source.iter().zip(predicted).all(|(a, b)| quantiser.leaves_nothing(block_squared_error(a, b)))
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

    fn rounding(&self) -> Rounding {
        if self.tools.trellis { Rounding::Trellis { lambda: self.lambda } } else { Rounding::DeadZone }
    }

    fn trial(&self, macroblock: Macroblock, coefficients: Option<[[i32; 64]; 6]>) -> Trial {
        let error = macroblock.error();
        let bits = self.state.count(self.slice, self.column, &macroblock);
        Trial { cost: error + self.lambda * bits as i64, macroblock, coefficients }
    }

    /// The prediction and nothing else.
    fn uncoded(&self, mode: Mode, error: u32) -> Trial {
        let mut blocks = [Block::EMPTY; 6];
        blocks[0].error = i64::from(error) << (2 * dct::COEFFICIENT_BITS);
        self.trial(Macroblock { mode, quantiser: self.quantiser, blocks }, None)
    }

    /// The prediction and what the quantiser leaves of the difference.
    fn coded(&self, mode: Mode, predicted: &Samples) -> Trial {
        let quantiser = self.quantisers.of(self.quantiser);
        let mut coefficients = [[0; 64]; 6];
        let blocks = std::array::from_fn(|i| {
            let (source, predicted) = (&self.source[i], &predicted[i]);
            let error = block_squared_error(source, predicted);
            if quantiser.leaves_nothing(error) {
                return Block { error: i64::from(error) << (2 * dct::COEFFICIENT_BITS), ..Block::EMPTY };
            }
            let residual = std::array::from_fn(|k| i32::from(source[k]) - i32::from(predicted[k]));
            coefficients[i] = dct::forward(&residual);
            quantiser.quantise(&coefficients[i], Kind::Inter, self.rounding())
        });
        self.trial(Macroblock { mode, quantiser: self.quantiser, blocks }, Some(coefficients))
    }

    fn intra(&self) -> Trial {
        let quantiser = self.quantisers.of(self.quantiser);
        let coefficients: [[i32; 64]; 6] = std::array::from_fn(|i| dct::forward(&self.source[i].map(i32::from)));
        let blocks = std::array::from_fn(|i| quantiser.quantise(&coefficients[i], Kind::Intra, self.rounding()));
        self.trial(Macroblock { mode: Mode::Intra, quantiser: self.quantiser, blocks }, Some(coefficients))
    }

    /// The same mode with the quantiser that costs least: steps away from the one asked for, as long as they pay.
    fn with_best_quantiser(&self, start: Trial) -> Trial {
        let Some(coefficients) = start.coefficients else { return start };
        let kind = if start.macroblock.mode == Mode::Intra { Kind::Intra } else { Kind::Inter };
        let with = |code: u8| {
            let quantiser = self.quantisers.of(code);
            let blocks = std::array::from_fn(|i| match (kind, &start.macroblock.blocks[i]) {
                // Left out before it was transformed: its error is known, its coefficients are not.
                (Kind::Inter, block) if coefficients[i] == [0; 64] => *block,
                _ => quantiser.quantise(&coefficients[i], kind, self.rounding()),
            });
            self.trial(Macroblock { mode: start.macroblock.mode, quantiser: code, blocks }, Some(coefficients))
        };
        let mut best: Option<Trial> = None;
        let least = |best: &Option<Trial>| best.as_ref().map_or(start.cost, |best| best.cost);
        // The one in force takes no bits to state.
        let current = self.state.quantiser;
        if current != self.quantiser && current.abs_diff(self.quantiser) <= 2 {
            let trial = with(current);
            if trial.cost < least(&best) {
                best = Some(trial);
            }
        }
        for direction in [-1i8, 1] {
            for step in 1..=3 {
                let Some(code) =
                    self.quantiser.checked_add_signed(direction * step).filter(|code| (1..=31).contains(code))
                else {
                    break;
                };
                let trial = with(code);
                if trial.cost >= least(&best) {
                    break;
                }
                best = Some(trial);
            }
        }
        best.unwrap_or(start)
    }

    /// What the decoder makes of the choice.
    fn finish(&self, trial: Trial, predictions: &Predictions) -> Decided {
        let macroblock = trial.macroblock;
        let quantiser = self.quantisers.of(macroblock.quantiser);
        let reconstruction = if macroblock.mode == Mode::Intra {
            std::array::from_fn(|i| {
                let restored = dct::inverse(&quantiser.dequantise(&macroblock.blocks[i], Kind::Intra));
                restored.map(|sample| sample.clamp(0, 255) as u8)
            })
        } else {
            let entry = predictions.list.iter().find(|entry| entry.0 == macroblock.mode);
            let mut reconstruction = entry.expect("the mode was predicted").1;
            for (samples, block) in reconstruction.iter_mut().zip(&macroblock.blocks) {
                if block.end > 0 {
                    let restored = dct::inverse(&quantiser.dequantise(block, Kind::Inter));
                    *samples = std::array::from_fn(|k| (i32::from(samples[k]) + restored[k]).clamp(0, 255) as u8);
                }
            }
            reconstruction
        };
        Decided { macroblock, reconstruction }
    }
}
