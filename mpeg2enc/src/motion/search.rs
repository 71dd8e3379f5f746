//! The search for the vector of one block.

use crate::{
    kernel::{self, ReferenceBlock},
    predict::place_of,
    vector::{HalfSample, Range},
};
use plane::Plane;

/// A step of half a sample in each of four directions.
pub(super) const CROSS: [(i32, i32); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
/// A step of half a sample in each of eight directions.
const NEIGHBORS: [(i32, i32); 8] = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
/// Steps of the search by whole samples.
const DIAMOND: [(i32, i32); 4] = [(-2, 0), (2, 0), (0, -2), (0, 2)];
/// The longest of these steps.
const FARTHEST_STEP: i32 = 2;
/// A vector's differences are transformed if, as they are, they are less than this many eighths of the best one's. With 9
/// the vectors that are compared depend on where a search began, and with them its result.
const WORTH_A_TRANSFORM_EIGHTHS: u64 = 12;
/// Both kinds of steps.
const NEIGHBORS_AND_DIAMOND: [(i32, i32); 12] = {
    let mut steps = [(0, 0); 12];
    let (first, last) = steps.split_at_mut(NEIGHBORS.len());
    first.copy_from_slice(&NEIGHBORS);
    last.copy_from_slice(&DIAMOND);
    steps
};
/// The most rounds of [`Search::settle`]: after two, searches from different vectors still end apart now and then.
const SETTLED: usize = 4;
/// Shares of the error of a poor match. A given vector with at most the first is taken as it is where all is to be quick; one
/// with more than the second may lie where light moves. Ours, tuned on the clips of README.md: with trust in all that is
/// no poor match, plain walls take 12 % more bits.
const TRUSTED_16THS: u32 = 2;
const LIGHT_16THS: u32 = 4;

/// The position of a block in a grid of blocks.
#[derive(Clone, Copy)]
pub(crate) struct BlockPosition {
    pub column: usize,
    pub row: usize,
}

/// The search for one block of N×N samples.
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
    /// Sum of absolute differences, plain at first and then transformed.
    pub best_error: u32,
    best_plain: u32,
    transformed: bool,
}

impl<'a, const N: usize> Search<'a, N> {
    /// For a block of `source`; `quantiser_scale` determines the price of bits.
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
            // The root of the price of a bit in squared errors, 0.4·quantiser_scale, in sixteenths.
            price: (6 * quantiser_scale).max(1),
            best: HalfSample::ZERO,
            best_cost: u32::MAX,
            best_error: u32::MAX,
            best_plain: u32::MAX,
            transformed: false,
        }
    }

    /// The vector where one is given, and little is to be tried around it.
    pub fn around(mut self, given: HalfSample, poor: u32) -> HalfSample {
        self.try_vector(given);
        if self.best_error <= poor * TRUSTED_16THS / 16 {
            return self.best;
        }
        // Highlights and shadows move otherwise than their surface.
        let may_be_light = self.best_error > poor * LIGHT_16THS / 16;
        if may_be_light {
            self.try_vector(self.predicted);
        }
        // Where no half step helps, no whole one will.
        if self.try_around(CROSS) && may_be_light && self.try_around(DIAMOND) {
            self.descend();
            self.try_around(CROSS);
        }
        self.best
    }

    /// Tries a vector, brought into range; true if it is the best so far.
    pub fn try_vector(&mut self, vector: HalfSample) -> bool {
        let vector = self.range.clamp(vector);
        (vector != self.best || self.best_cost == u32::MAX) && self.try_allowed(vector)
    }

    /// Tries a vector within range; true if it is the best so far.
    fn try_allowed(&mut self, vector: HalfSample) -> bool {
        let price = self.price_of(vector);
        if price >= self.best_cost {
            return false;
        }
        let plain = self.plain_error(vector);
        let error = match self.transformed {
            false => plain,
            // What differs much more will not differ less when transformed.
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

    /// The price of the bits of a vector.
    fn price_of(&self, vector: HalfSample) -> u32 {
        let bits = component_bits(vector.x - self.predicted.x) + component_bits(vector.y - self.predicted.y);
        (self.price * bits) >> 4
    }

    /// Follows the steepest of four whole-sample steps until none is better.
    pub fn descend(&mut self) {
        for _ in 0..24 {
            if !self.try_around(DIAMOND) {
                break;
            }
        }
    }

    /// Tries four vectors around the best one; true if one of them is better.
    pub fn try_around(&mut self, steps: [(i32, i32); 4]) -> bool {
        let center = self.best;
        let vectors = steps.map(|(x, y)| center.offset(x, y));
        if self.transformed || !self.range.contains_around(center, FARTHEST_STEP) {
            for vector in vectors {
                if self.range.contains(vector) {
                    self.try_allowed(vector);
                }
            }
            return self.best != center;
        }
        let errors = kernel::absolute_differences::<N>(self.source, vectors.map(|vector| self.place(vector)));
        for (vector, error) in vectors.into_iter().zip(errors) {
            let cost = error + self.price_of(vector);
            if cost < self.best_cost {
                (self.best, self.best_cost, self.best_error, self.best_plain) = (vector, cost, error, error);
            }
        }
        self.best != center
    }

    /// Tries the half-sample neighbors, twice if one is better.
    pub fn refine(&mut self) {
        self.follow(NEIGHBORS, 2);
    }

    /// Follows half- and whole-sample steps until none is better.
    ///
    /// Half positions smooth the reference, noise in it too, and whole ones do not: differences then lie lower on one kind
    /// of position than on the other. Steps to neighbors, all of the other kind, would end on any position of the better
    /// kind, depending on where they began, so steps to the next of the same kind are tried as well.
    pub fn settle(&mut self) {
        self.follow(NEIGHBORS_AND_DIAMOND, SETTLED);
    }

    /// Goes to the best of `steps` from the best vector, and on from there; no vector is tried twice.
    fn follow<const STEPS: usize>(&mut self, steps: [(i32, i32); STEPS], rounds: usize) {
        let start = self.best;
        // A bit for each vector around the start, farther than the rounds reach.
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

    /// From here on compares by transformed differences, which are nearer to what coefficients cost.
    pub fn transform_differences(&mut self) {
        self.transformed = true;
        self.best_cost -= self.best_error;
        self.best_error = self.transformed_error(self.best);
        self.best_cost += self.best_error;
    }

    fn place(&self, vector: HalfSample) -> ReferenceBlock<'_> {
        place_of(self.reference, self.x2 + vector.x, self.y2 + vector.y)
    }

    /// Sum of absolute differences.
    fn plain_error(&self, vector: HalfSample) -> u32 {
        kernel::absolute_difference::<N>(self.source, self.place(vector))
    }

    /// Sum of absolute transformed differences.
    fn transformed_error(&self, vector: HalfSample) -> u32 {
        kernel::transformed_difference::<N>(self.source, self.place(vector))
    }
}

/// About the bits of a vector difference, for a middling f_code.
fn component_bits(delta: i32) -> u32 {
    2 * (32 - delta.unsigned_abs().leading_zeros()) + 1
}
