//! Mode decision: the cheapest way to code a macroblock as intra, inter or skipped, and its quantiser.
//!
//! ```text
//! J = D + λ·R      D squared error of all samples      R bits in the stream      λ price of a bit
//! ```

pub(crate) mod in_place;
mod quick;

use crate::{
    PictureType,
    block::{Block, BlockKind},
    dct, kernel,
    macroblock::{Macroblock, Mode, SliceParameters, SliceState},
    predict::{MacroblockSamples, References, mean, predict, squared_errors},
    quant::{Quantiser, Quantisers, Rounding, Transformed},
    vector::{HalfSample, Range},
};

/// Price of a bit in squared errors: 0.23 times quantiser_scale², stored with twice [`dct::COEFFICIENT_BITS`] fractional bits.
/// The standard does not define the factor; it was tuned on the clips of README.md. 0.16, the factor of the y262 encoder, takes
/// 0.5 % more bits. At high quality, 0.31 takes more bits too.
const LAMBDA: i64 = 15;
/// A prediction is coded for comparison only if its error is less than this many tenths of the least error.
const WORTH_A_TRIAL_TENTHS: u64 = 14;

/// Alternatives that are tried for a macroblock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tools {
    /// Whether only predictions from the given vectors are tried; see [`quick`].
    pub quick: bool,
    /// Whether levels are chosen by shortest path instead of rounding.
    pub trellis: bool,
    /// Whether zero vectors and cheaper vectors nearby are tried too.
    pub predicts_more: bool,
    /// Number of predictions that are coded for comparison.
    pub trials: usize,
    /// Threshold of the prediction error, in halves of the intra `activity`, above which intra coding is tried.
    pub intra_halves: u32,
    /// Whether quantisers other than the requested one are tried.
    pub quantiser_choice: bool,
    /// Squared error in quarters of quantiser_scale² below which a predicted block is not transformed, because its few levels are
    /// not worth their bits.
    pub worth_a_transform_quarters: i64,
}

impl Tools {
    /// Returns whether a prediction of this squared error is compared with intra coding of this `activity`.
    fn may_be_intra(self, error: u32, activity: u32) -> bool {
        2 * u64::from(error) > u64::from(activity) * u64::from(self.intra_halves)
    }

    /// Returns the method of choosing levels if the price of a bit is `lambda`.
    fn rounding(self, lambda: i64) -> Rounding {
        if self.trellis { Rounding::Trellis { lambda } } else { Rounding::DeadZone }
    }
}

/// One way to code a macroblock, and its cost.
struct Trial {
    macroblock: Macroblock,
    cost: i64,
    /// Coefficients of the blocks, for trials of other quantisers.
    coefficients: [[i32; 64]; 6],
    /// Squared error of each block if all its levels become zero.
    energies: [i64; 6],
    /// Whether each block was transformed; blocks that almost certainly become zero are not.
    is_transformed: [bool; 6],
}

impl Trial {
    const fn new() -> Self {
        Self {
            macroblock: Macroblock { mode: Mode::Intra, quantiser: 1, blocks: [Block::EMPTY; 6] },
            cost: i64::MAX,
            coefficients: [[0; 64]; 6],
            energies: [0; 6],
            is_transformed: [false; 6],
        }
    }
}

/// Buffers for the decisions of a slice, reused for every macroblock to avoid large moves.
pub(crate) struct Workspace {
    predictions: Predictions,
    /// Cheapest trial so far.
    best: Box<Trial>,
    /// Trial in progress.
    other: Box<Trial>,
    /// Macroblock that is predicted without coefficients.
    uncoded: Macroblock,
    /// Decoded macroblock.
    pub reconstruction: MacroblockSamples,
}

impl Workspace {
    pub fn new() -> Self {
        Self {
            predictions: Predictions {
                samples: [[[0; 64]; 6]; PREDICTIONS],
                errors: [[0; 6]; PREDICTIONS],
                order: Vec::with_capacity(PREDICTIONS),
            },
            best: Box::new(Trial::new()),
            other: Box::new(Trial::new()),
            uncoded: Trial::new().macroblock,
            reconstruction: [[0; 64]; 6],
        }
    }

    /// Returns the macroblock as it will be written.
    pub fn macroblock(&self) -> &Macroblock {
        &self.best.macroblock
    }

    /// Returns the macroblock as it will be written, so that other decisions can modify it.
    pub fn macroblock_mut(&mut self) -> &mut Macroblock {
        &mut self.best.macroblock
    }

    /// Swaps the trials if the one in progress is cheaper; returns whether it is.
    fn keep_cheaper(&mut self) -> bool {
        let is_cheaper = self.other.cost < self.best.cost;
        if is_cheaper {
            std::mem::swap(&mut self.best, &mut self.other);
        }
        is_cheaper
    }
}

/// Input of the decision for a macroblock.
pub(crate) struct Decision<'a> {
    pub slice: &'a SliceParameters,
    pub state: &'a SliceState,
    pub quantisers: &'a Quantisers,
    pub tools: Tools,
    /// Requested quantiser_scale_code.
    pub quantiser: u8,
    /// Price of a bit, from [`lambda`].
    pub lambda: i64,
    pub references: References<'a>,
    pub column: usize,
    pub row: usize,
    pub source: &'a MacroblockSamples,
}

/// Returns the price of a bit for a requested quantiser_scale in sixteenths.
pub(crate) fn lambda(scale_x16: u32) -> i64 {
    (LAMBDA * i64::from(scale_x16) * i64::from(scale_x16) / 256).max(1)
}

/// Upper bound on the number of predictions: one for a skipped macroblock, and six in a B picture.
const PREDICTIONS: usize = 8;

/// Predictions to choose from.
struct Predictions {
    samples: [MacroblockSamples; PREDICTIONS],
    /// Squared error of each block of each prediction.
    errors: [[u32; 6]; PREDICTIONS],
    /// Mode, squared error and index in `samples` of each prediction, in order of error.
    order: Vec<(Mode, u32, usize)>,
}

/// A prediction used without coefficients.
struct Uncoded {
    cost: i64,
    mode: Mode,
    /// Index in [`Predictions::samples`].
    index: usize,
}

impl Predictions {
    fn consider(&mut self, decision: &Decision, mode: Mode) {
        if self.order.iter().any(|entry| entry.0 == mode) || !decision.is_allowed(mode) {
            return;
        }
        let index = self.order.len();
        self.predict(decision, mode, index);
        self.errors[index] = squared_errors(decision.source, &self.samples[index]);
        let error = self.errors[index].iter().sum();
        // Keep the predictions sorted by error.
        let place = self.order.partition_point(|entry| entry.1 <= error);
        self.order.insert(place, (mode, error, index));
    }

    /// Stores the prediction of a non-intra mode at `index`, after the existing ones (7.6.7).
    fn predict(&mut self, decision: &Decision, mode: Mode, index: usize) {
        let (made, new) = self.samples.split_at_mut(index);
        match mode {
            Mode::Intra => unreachable!("an intra macroblock is not predicted"),
            Mode::Forward(vector) => decision.predict(0, vector, &mut new[0]),
            Mode::Backward(vector) => decision.predict(1, vector, &mut new[0]),
            Mode::Both(forward, backward) => {
                let mut both = [[[0; 64]; 6]; 2];
                let modes = [Mode::Forward(forward), Mode::Backward(backward)];
                let [forward, backward] = std::array::from_fn(|s| {
                    // The one-sided prediction usually exists already.
                    let place = self.order.iter().find(|entry| entry.0 == modes[s]).map(|entry| entry.2);
                    if place.is_none() {
                        decision.predict(s, [forward, backward][s], &mut both[s]);
                    }
                    place
                });
                let side = |s: usize, place: Option<usize>| place.map_or(&both[s], |place| &made[place]);
                mean(side(0, forward), side(1, backward), &mut new[0]);
            }
        }
    }
}

impl Decision<'_> {
    /// Finds a cheap way to code the macroblock with the given forward and backward vectors. `work` receives the result and the
    /// reconstruction.
    pub fn decide(&self, vectors: [HalfSample; 2], work: &mut Workspace) {
        if !self.tools.quick || !self.decide_quickly(vectors, work) {
            self.decide_by_trials(vectors, work);
        }
    }

    /// Finds the cheapest of several ways to code the macroblock.
    fn decide_by_trials(&self, vectors: [HalfSample; 2], work: &mut Workspace) {
        work.predictions.order.clear();
        work.best.cost = i64::MAX;
        if let Some(mode) = self.state.skipped_mode(self.slice, self.column) {
            work.predictions.consider(self, mode);
            // A macroblock that quantises to zero and takes no bits is nearly optimal.
            let quantiser = self.quantisers.of(self.quantiser);
            if let Some(&(_, _, index)) = work.predictions.order.first()
                && work.predictions.errors[index]
                    .iter()
                    .all(|&error| quantiser.leaves_nothing(error, Quantiser::CERTAIN))
            {
                return self.finish_uncoded(mode, index, work);
            }
        }
        // Compare uncoded predictions with coded ones.
        self.consider_vectors(vectors, &mut work.predictions);
        let uncoded = self.cheapest_uncoded(work);
        let coded = self.cheapest_coded(work);
        if let Some(uncoded) = &uncoded
            && uncoded.cost <= work.best.cost
        {
            return self.finish_uncoded(uncoded.mode, uncoded.index, work);
        }
        if self.tools.quantiser_choice {
            self.choose_quantiser(work);
        }
        self.finish(coded, work);
        // Errors of coefficients and samples differ by rounding: fine levels may not change any sample.
        if let Some(uncoded) = uncoded
            && work.best.macroblock.mode != Mode::Intra
        {
            let bits_price = work.best.cost - work.best.macroblock.error();
            let error = in_coefficients(squared_errors(self.source, &work.reconstruction).iter().sum());
            if uncoded.cost <= error + bits_price {
                self.finish_uncoded(uncoded.mode, uncoded.index, work);
            }
        }
    }

    /// Adds predictions from the given vectors, and from cheaper vectors near them.
    fn consider_vectors(&self, [forward, backward]: [HalfSample; 2], predictions: &mut Predictions) {
        let [forward_prediction, backward_prediction] = self.state.motion_prediction;
        // A cheaper vector matches about as well only if it is close.
        let near = |a: HalfSample, b: HalfSample| (a.x - b.x).abs().max((a.y - b.y).abs()) <= 2;
        match self.slice.picture_type {
            PictureType::I => {}
            PictureType::P => {
                predictions.consider(self, Mode::Forward(forward));
                // The zero vector and the predicted vector take the fewest bits.
                if self.tools.predicts_more {
                    predictions.consider(self, Mode::STILL);
                    if near(forward, forward_prediction) {
                        predictions.consider(self, Mode::Forward(forward_prediction));
                    }
                }
            }
            PictureType::B => {
                predictions.consider(self, Mode::Forward(forward));
                predictions.consider(self, Mode::Backward(backward));
                predictions.consider(self, Mode::Both(forward, backward));
                // The predicted vectors take the fewest bits.
                if self.tools.predicts_more {
                    if near(forward, forward_prediction) {
                        predictions.consider(self, Mode::Forward(forward_prediction));
                    }
                    if near(backward, backward_prediction) {
                        predictions.consider(self, Mode::Backward(backward_prediction));
                    }
                    predictions.consider(self, Mode::Both(forward_prediction, backward_prediction));
                }
            }
        }
    }

    /// Returns the cheapest prediction without coefficients; `None` if there are no predictions.
    fn cheapest_uncoded(&self, work: &mut Workspace) -> Option<Uncoded> {
        let mut cheapest: Option<Uncoded> = None;
        for &(mode, error, index) in &work.predictions.order {
            work.uncoded.mode = mode;
            let bits = self.state.count(self.slice, self.column, &work.uncoded);
            let cost = in_coefficients(error) + self.lambda * bits as i64;
            if cheapest.as_ref().is_none_or(|least| cost < least.cost) {
                cheapest = Some(Uncoded { cost, mode, index });
            }
        }
        cheapest
    }

    /// Codes the best predictions, and tries intra coding if they are poor. `work.best` keeps the cheapest trial; returns the
    /// index of its prediction.
    fn cheapest_coded(&self, work: &mut Workspace) -> usize {
        let least = work.predictions.order.first().map(|entry| entry.1);
        let mut chosen = 0;
        for i in 0..work.predictions.order.len().min(self.tools.trials) {
            let (mode, error, index) = work.predictions.order[i];
            // A much worse prediction will not need fewer bits.
            if least.is_some_and(|least| u64::from(error) * 10 > u64::from(least) * WORTH_A_TRIAL_TENTHS) {
                break;
            }
            self.try_coded(mode, &work.predictions, index, &mut work.other);
            if work.keep_cheaper() {
                chosen = index;
            }
        }
        if least.is_none_or(|least| self.tools.may_be_intra(least, self.activity())) {
            self.try_intra(&mut work.other);
            work.keep_cheaper();
        }
        chosen
    }

    fn predict(&self, s: usize, vector: HalfSample, out: &mut MacroblockSamples) {
        predict(self.references[s].expect("a mode has its reference picture"), self.column, self.row, vector, out);
    }

    fn is_allowed(&self, mode: Mode) -> bool {
        for (s, vector) in mode.vectors().into_iter().enumerate() {
            let Some(vector) = vector else { continue };
            let Some(reference) = self.references[s] else { return false };
            let range = Range::new(reference.luma(), self.column, self.row, self.slice.f_code[s]);
            if !range.contains(vector) {
                return false;
            }
        }
        true
    }

    /// Returns the squared error of the blocks from their means, which estimates the cost of intra coding.
    fn activity(&self) -> u32 {
        kernel::deviation(self.source)
    }

    fn rounding(&self) -> Rounding {
        self.tools.rounding(self.lambda)
    }

    fn price(&self, trial: &mut Trial) {
        let bits = self.state.count(self.slice, self.column, &trial.macroblock);
        trial.cost = trial.macroblock.error() + self.lambda * bits as i64;
    }

    /// Codes prediction number `index` with the quantised difference.
    fn try_coded(&self, mode: Mode, predictions: &Predictions, index: usize, trial: &mut Trial) {
        let quantiser = self.quantisers.of(self.quantiser);
        (trial.macroblock.mode, trial.macroblock.quantiser) = (mode, self.quantiser);
        for (i, (source, predicted)) in self.source.iter().zip(&predictions.samples[index]).enumerate() {
            let error = predictions.errors[index][i];
            let energy = in_coefficients(error);
            trial.energies[i] = energy;
            // Transform a block only if its levels can be worth their bits.
            trial.is_transformed[i] = !quantiser.leaves_nothing(error, self.tools.worth_a_transform_quarters);
            let block = &mut trial.macroblock.blocks[i];
            if trial.is_transformed[i] {
                trial.coefficients[i] = dct::forward_difference(source, predicted);
                let transformed = Transformed { coefficients: &trial.coefficients[i], energy };
                quantiser.quantise(transformed, BlockKind::Inter, self.rounding(), block);
            } else {
                block.clear();
                block.error = energy;
            }
        }
        self.price(trial);
    }

    fn try_intra(&self, trial: &mut Trial) {
        let quantiser = self.quantisers.of(self.quantiser);
        (trial.macroblock.mode, trial.macroblock.quantiser) = (Mode::Intra, self.quantiser);
        trial.is_transformed = [true; 6];
        for (i, source) in self.source.iter().enumerate() {
            trial.coefficients[i] = dct::forward_difference(source, &[0; 64]);
            // Do not use the energy of the samples: the squared DC is so large that its rounding alone causes an error.
            trial.energies[i] = trial.coefficients[i][1..].iter().map(|&c| c * c).sum::<i32>().into();
            let block = &mut trial.macroblock.blocks[i];
            let transformed = Transformed { coefficients: &trial.coefficients[i], energy: trial.energies[i] };
            quantiser.quantise(transformed, BlockKind::Intra, self.rounding(), block);
        }
        self.price(trial);
    }

    /// Tries quantisers in steps from the requested one, without a change of mode, as long as the cost decreases.
    fn choose_quantiser(&self, work: &mut Workspace) {
        let mode = work.best.macroblock.mode;
        let kind = if mode == Mode::Intra { BlockKind::Intra } else { BlockKind::Inter };
        let (coefficients, energies, is_transformed) =
            (work.best.coefficients, work.best.energies, work.best.is_transformed);
        // Reuse the coefficients of the best trial with each quantiser.
        let mut is_cheaper = |code: u8| {
            let quantiser = self.quantisers.of(code);
            let trial = &mut *work.other;
            (trial.macroblock.mode, trial.macroblock.quantiser) = (mode, code);
            for i in 0..6 {
                let block = &mut trial.macroblock.blocks[i];
                if is_transformed[i] {
                    let transformed = Transformed { coefficients: &coefficients[i], energy: energies[i] };
                    quantiser.quantise(transformed, kind, self.rounding(), block);
                } else {
                    block.clear();
                    block.error = energies[i];
                }
            }
            self.price(trial);
            work.keep_cheaper()
        };
        // Keeping the current quantiser takes no bits.
        let current = self.state.quantiser;
        if current != self.quantiser && current.abs_diff(self.quantiser) <= 2 {
            is_cheaper(current);
        }
        // Step away from the requested quantiser in both directions while the cost decreases.
        for direction in [-1i8, 1] {
            for step in 1..=3 {
                let code = self.quantiser.checked_add_signed(direction * step);
                if !code.filter(|code| (1..=31).contains(code)).is_some_and(&mut is_cheaper) {
                    break;
                }
            }
        }
    }

    /// Chooses prediction number `index` without coefficients.
    fn finish_uncoded(&self, mode: Mode, index: usize, work: &mut Workspace) {
        let macroblock = &mut work.best.macroblock;
        (macroblock.mode, macroblock.quantiser) = (mode, self.quantiser);
        macroblock.blocks.iter_mut().for_each(Block::clear);
        work.reconstruction = work.predictions.samples[index];
    }

    /// Reconstructs the choice as a decoder does. Prediction number `index` is used, except for intra coding.
    fn finish(&self, index: usize, work: &mut Workspace) {
        let macroblock = &work.best.macroblock;
        let quantiser = self.quantisers.of(macroblock.quantiser);
        let is_intra = macroblock.mode == Mode::Intra;
        let kind = if is_intra { BlockKind::Intra } else { BlockKind::Inter };
        for (i, block) in macroblock.blocks.iter().enumerate() {
            let predicted = if is_intra { &[0; 64] } else { &work.predictions.samples[index][i] };
            if block.is_coded() {
                dct::inverse_onto(&quantiser.dequantise(block, kind), predicted, &mut work.reconstruction[i]);
            } else {
                work.reconstruction[i] = *predicted;
            }
        }
    }
}

/// Converts a squared error of samples to the scale of coefficients.
fn in_coefficients(error: u32) -> i64 {
    i64::from(error) << (2 * dct::COEFFICIENT_BITS)
}
