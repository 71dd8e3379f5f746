//! Search for the vector of one block.

use crate::{
    kernel::{self, ReferenceBlock},
    predict::place_of,
    vector::{HalfSample, Range},
};
use plane::Plane;

/// Steps of half a sample in four directions.
pub(super) const CROSS: [(i32, i32); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
/// Steps of half a sample in eight directions.
const NEIGHBORS: [(i32, i32); 8] = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
/// Steps of one sample in four directions.
const DIAMOND: [(i32, i32); 4] = [(-2, 0), (2, 0), (0, -2), (0, 2)];
/// Length of the longest step in these tables, in half samples.
const FARTHEST_STEP: i32 = 2;
/// A vector's transformed difference is computed if its plain difference is less than this many eighths of the best one's. With
/// 9, the compared vectors and the result depend on the starting point.
const WORTH_A_TRANSFORM_EIGHTHS: u64 = 12;
/// Steps of half a sample and of one sample.
const NEIGHBORS_AND_DIAMOND: [(i32, i32); 12] = {
    let mut steps = [(0, 0); 12];
    let (first, last) = steps.split_at_mut(NEIGHBORS.len());
    first.copy_from_slice(&NEIGHBORS);
    last.copy_from_slice(&DIAMOND);
    steps
};
/// Maximum number of rounds of [`Search::settle`]. After two rounds, searches from different vectors sometimes still have
/// different results.
const SETTLED: usize = 4;
/// Fractions of the error of a poor match, for quick searches. Up to the first fraction, a given vector is accepted immediately.
/// Above the second fraction, the block may show moving light. The fractions were tuned on the clips of README.md: accepting
/// everything below a poor match takes 12 % more bits on plain walls.
const TRUSTED_16THS: u32 = 2;
const LIGHT_16THS: u32 = 4;

/// Position of a block in a grid of blocks.
#[derive(Clone, Copy)]
pub(crate) struct BlockPosition {
    pub column: usize,
    pub row: usize,
}

/// Search for one block of N×N samples.
pub(crate) struct Search<'a, const N: usize> {
    source: ReferenceBlock<'a>,
    reference: &'a Plane<u8>,
    x2: i32,
    y2: i32,
    range: Range,
    predicted: HalfSample,
    price: u32,
    pub best: HalfSample,
    best_cost: u32,
    /// Sum of absolute differences: plain at first, transformed later.
    pub best_error: u32,
    best_plain: u32,
    transformed: bool,
}

impl<'a, const N: usize> Search<'a, N> {
    /// Starts a search for a block of `source`; `quantiser_scale` determines the price of bits.
    pub fn new(
        [source, reference]: [&'a Plane<u8>; 2],
        block: BlockPosition,
        range: Range,
        predicted: HalfSample,
        quantiser_scale: u32,
    ) -> Self {
        let (x2, y2) = ((2 * N * block.column) as i32, (2 * N * block.row) as i32);
        Self {
            source: place_of(source, x2, y2),
            reference,
            x2,
            y2,
            range,
            predicted,
            // Square root of the price of a bit in squared errors, 0.4·quantiser_scale, in sixteenths.
            price: (6 * quantiser_scale).max(1),
            best: HalfSample::ZERO,
            best_cost: u32::MAX,
            best_error: u32::MAX,
            best_plain: u32::MAX,
            transformed: false,
        }
    }

    /// Returns the best vector near a given one after a few trials.
    pub fn around(mut self, given: HalfSample, poor: u32) -> HalfSample {
        self.try_vector(given);
        if self.best_error <= poor * TRUSTED_16THS / 16 {
            return self.best;
        }
        // Highlights and shadows move differently from their surface.
        let may_be_light = self.best_error > poor * LIGHT_16THS / 16;
        if may_be_light {
            self.try_vector(self.predicted);
        }
        // If no half-sample step improves the vector, no whole-sample step will.
        if self.try_around(CROSS) && may_be_light && self.try_around(DIAMOND) {
            self.descend();
            self.try_around(CROSS);
        }
        self.best
    }

    /// Tries a vector, clamped to the range; returns whether it is the best so far.
    pub fn try_vector(&mut self, vector: HalfSample) -> bool {
        let vector = self.range.clamp(vector);
        (vector != self.best || self.best_cost == u32::MAX) && self.try_allowed(vector)
    }

    /// Tries a vector within the range; returns whether it is the best so far.
    fn try_allowed(&mut self, vector: HalfSample) -> bool {
        let price = self.price_of(vector);
        if price >= self.best_cost {
            return false;
        }
        let plain = self.plain_error(vector);
        let error = match self.transformed {
            false => plain,
            // A much larger plain difference will not be the smallest after the transform.
            true if u64::from(plain) * 8 > u64::from(self.best_plain) * WORTH_A_TRANSFORM_EIGHTHS => return false,
            true => self.transformed_error(vector),
        };
        let cost = error + price;
        if cost < self.best_cost {
            (self.best, self.best_cost, self.best_error, self.best_plain) = (vector, cost, error, plain);
            return true;
        }
        false
    }

    /// Returns the price of the bits of a vector.
    fn price_of(&self, vector: HalfSample) -> u32 {
        let bits = component_bits(vector.x - self.predicted.x) + component_bits(vector.y - self.predicted.y);
        (self.price * bits) >> 4
    }

    /// Follows the steepest of four whole-sample steps until none improves the vector.
    pub fn descend(&mut self) {
        for _ in 0..24 {
            if !self.try_around(DIAMOND) {
                break;
            }
        }
    }

    /// Tries four vectors around the best one; returns whether one is better.
    pub fn try_around(&mut self, steps: [(i32, i32); 4]) -> bool {
        let center = self.best;
        let vectors = steps.map(|(x, y)| center.offset(x, y));
        // Near the border, or with transformed differences, test the vectors one by one.
        if self.transformed || !self.range.contains_around(center, FARTHEST_STEP) {
            for vector in vectors {
                if self.range.contains(vector) {
                    self.try_allowed(vector);
                }
            }
            return self.best != center;
        }
        // Read the source once for all four plain differences.
        let errors = kernel::absolute_differences::<N>(self.source, vectors.map(|vector| self.place(vector)));
        for (vector, error) in vectors.into_iter().zip(errors) {
            let cost = error + self.price_of(vector);
            if cost < self.best_cost {
                (self.best, self.best_cost, self.best_error, self.best_plain) = (vector, cost, error, error);
            }
        }
        self.best != center
    }

    /// Tries the half-sample neighbors, in a second round if one is better.
    pub fn refine(&mut self) {
        self.follow(NEIGHBORS, 2);
    }

    /// Follows half- and whole-sample steps until none improves the vector.
    ///
    /// Half-sample positions smooth the reference and its noise; whole-sample positions do not. One kind of position therefore
    /// has lower differences. Steps of half a sample all lead to the other kind, so a search could end at any position of the
    /// better kind. Whole-sample steps lead to the same kind and avoid this.
    pub fn settle(&mut self) {
        self.follow(NEIGHBORS_AND_DIAMOND, SETTLED);
    }

    /// Moves from the best vector to the best of `steps`, repeatedly; no vector is tried twice.
    fn follow<const STEPS: usize>(&mut self, steps: [(i32, i32); STEPS], rounds: usize) {
        let start = self.best;
        // Keep one bit for each vector around the start, beyond the reach of the rounds.
        let mut tried = [0u32; 32];
        for _ in 0..rounds {
            let center = self.best;
            for (x, y) in steps {
                let next = center.offset(x, y);
                let (row, bit) = (((next.y - start.y) & 31) as usize, 1 << ((next.x - start.x) & 31));
                if tried[row] & bit == 0 && self.range.contains(next) {
                    tried[row] |= bit;
                    self.try_allowed(next);
                }
            }
            if self.best == center {
                break;
            }
        }
    }

    /// Switches to transformed differences, which approximate the cost of coefficients better.
    pub fn transform_differences(&mut self) {
        self.transformed = true;
        self.best_cost -= self.best_error;
        self.best_error = self.transformed_error(self.best);
        self.best_cost += self.best_error;
    }

    fn place(&self, vector: HalfSample) -> ReferenceBlock<'_> {
        place_of(self.reference, self.x2 + vector.x, self.y2 + vector.y)
    }

    /// Returns the sum of absolute differences between the block and its prediction.
    fn plain_error(&self, vector: HalfSample) -> u32 {
        kernel::absolute_difference::<N>(self.source, self.place(vector))
    }

    /// Returns the sum of absolute transformed differences between the block and its prediction.
    fn transformed_error(&self, vector: HalfSample) -> u32 {
        kernel::transformed_difference::<N>(self.source, self.place(vector))
    }
}

/// Returns the approximate number of bits of a vector difference, for a medium f_code.
fn component_bits(delta: i32) -> u32 {
    2 * (32 - delta.unsigned_abs().leading_zeros()) + 1
}
