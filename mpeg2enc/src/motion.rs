//! Vectors of a picture: candidates from outside or from neighbours, and a search around them.

mod coarse;
mod field;

pub(crate) use {
    coarse::{CoarseSearch, quarter},
    field::{Candidates, all_candidates},
};

use crate::{
    Effort, Picture,
    kernel::{self, Place},
    predict::place_of,
};
use plane::Plane;
use rayon::prelude::*;

/// A vector in half luma samples, as coded (7.6.3): from a macroblock to its place in the reference picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct HalfSample {
    pub x: i32,
    pub y: i32,
}

impl HalfSample {
    pub const ZERO: Self = Self { x: 0, y: 0 };

    pub fn offset(self, x: i32, y: i32) -> Self {
        Self { x: self.x + x, y: self.y + y }
    }

    /// Whether the vector is no longer than sums of some vectors over the largest picture are.
    pub fn is_plausible(&self) -> bool {
        self.x.unsigned_abs().max(self.y.unsigned_abs()) <= 1 << 24
    }
}

/// The vectors that a macroblock may have.
#[derive(Clone, Copy)]
pub(crate) struct Range {
    x: (i32, i32),
    y: (i32, i32),
}

impl Range {
    /// Of the macroblock at `(column, row)`.
    pub fn new(reference: &Plane<u8>, column: usize, row: usize, f_code_max: [u32; 2]) -> Self {
        Self::of_block(reference, 16, column, row, f_code_max)
    }

    /// Of a block of `block`² samples: inside of the reference picture (7.6.3.8), and within the reach of the largest
    /// f_code of the level.
    pub fn of_block(reference: &Plane<u8>, block: usize, column: usize, row: usize, f_code_max: [u32; 2]) -> Self {
        let range = |size: usize, position: usize, f_code: u32| {
            let reach = 16 << (f_code - 1);
            let (first, last) = (-2 * position as i32, 2 * (size - block - position) as i32);
            (first.max(-reach), last.min(reach - 1))
        };
        Self {
            x: range(reference.width(), block * column, f_code_max[0]),
            y: range(reference.height(), block * row, f_code_max[1]),
        }
    }

    pub fn contains(&self, vector: HalfSample) -> bool {
        (self.x.0..=self.x.1).contains(&vector.x) && (self.y.0..=self.y.1).contains(&vector.y)
    }

    /// Does the range hold all vectors up to `distance` away in each component?
    fn contains_around(&self, vector: HalfSample, distance: i32) -> bool {
        self.contains(vector.offset(-distance, -distance)) && self.contains(vector.offset(distance, distance))
    }

    pub fn clamp(&self, vector: HalfSample) -> HalfSample {
        HalfSample { x: vector.x.clamp(self.x.0, self.x.1), y: vector.y.clamp(self.y.0, self.y.1) }
    }
}

/// The smallest f_code whose reach holds every vector component (Table 7-8).
pub(crate) fn f_code(components: impl Iterator<Item = i32>) -> u32 {
    let (low, high) = components.fold((0, 0), |(low, high), c| (low.min(c), high.max(c)));
    (1..).find(|f_code| -low <= 16 << (f_code - 1) && high < 16 << (f_code - 1)).expect("some reach is enough")
}

/// What the search of one picture in one reference picture knows.
pub(crate) struct Estimate<'a> {
    /// The picture to be coded, in whole macroblocks.
    pub source: &'a Picture,
    /// The reconstructed reference picture.
    pub reference: &'a Picture,
    /// Vectors worth trying in every macroblock, or empty.
    pub candidates: &'a [Candidates],
    /// Vectors of the picture before, or empty.
    pub before: &'a [HalfSample],
    /// Quarter-size pictures for what nothing foretells.
    pub coarse: Option<CoarseSearch<'a>>,
    pub quantiser_scale: u32,
    pub f_code_max: [u32; 2],
    /// Best effort compares half-sample positions by transformed differences; fast effort takes what is given.
    pub effort: Effort,
}

/// A step of half a sample in each of four directions.
const CROSS: [(i32, i32); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
/// A step of half a sample in each of eight directions.
const NEIGHBOURS: [(i32, i32); 8] = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
/// Steps of the search by whole samples.
const DIAMOND: [(i32, i32); 4] = [(-2, 0), (2, 0), (0, -2), (0, 2)];
/// The longest of these steps.
const FARTHEST_STEP: i32 = 2;
/// A vector's differences are transformed if, as they are, they are less than this many eighths of the best one's. With 9
/// it depends on where a search began which vectors are asked for, and with it where the search ends.
const WORTH_A_TRANSFORM_EIGHTHS: u64 = 12;
/// Both kinds of steps.
const NEIGHBOURS_AND_DIAMOND: [(i32, i32); 12] = {
    let mut steps = [(0, 0); 12];
    let (first, last) = steps.split_at_mut(NEIGHBOURS.len());
    first.copy_from_slice(&NEIGHBOURS);
    last.copy_from_slice(&DIAMOND);
    steps
};
/// The most rounds of [`Search::settle`]: after two, searches from different vectors still end apart now and then.
const SETTLED: usize = 4;
/// Half samples that highlights and shadows are taken to move over a surface at most, whose own motion is known. Farther, the
/// vectors of the picture before are those of other things.
const LIGHT_MOVES: i32 = 8;
/// Mean absolute difference a sample above which more is tried, and what each step of quantiser_scale adds in eighths:
/// a coarse reference differs that much from its own source. Ours, tuned by the example `mpeg2enc`.
const POOR_MATCH: u32 = 2;
const POOR_MATCH_EIGHTHS: u32 = 1;
/// Of that limit: a given vector that leaves no more is taken as it is where all is to be quick, and one that leaves more than
/// the second may lie where light moves. Ours, tuned on the clips of README.md: with trust in all that is no poor match, plain
/// walls take 12 % more bits.
const TRUSTED_16THS: u32 = 2;
const LIGHT_16THS: u32 = 4;

impl Estimate<'_> {
    /// The vector of every macroblock in raster order; rows do not depend on each other.
    pub fn vectors(&self) -> Vec<HalfSample> {
        let (columns, rows) = (self.source.width() / 16, self.source.height() / 16);
        (0..rows)
            .into_par_iter()
            .flat_map_iter(|row| {
                let mut left = HalfSample::ZERO;
                (0..columns).map(move |column| {
                    left = self.vector(column, row, left);
                    left
                })
            })
            .collect()
    }

    fn vector(&self, column: usize, row: usize, left: HalfSample) -> HalfSample {
        let range = Range::new(self.reference.luma(), column, row, self.f_code_max);
        let (source, reference) = (self.source.luma(), self.reference.luma());
        let poor = 256 * POOR_MATCH + 256 * POOR_MATCH_EIGHTHS * self.quantiser_scale / 8;
        let index = row * (self.source.width() / 16) + column;
        let candidates = self.candidates.get(index).unwrap_or(&Candidates::NONE);
        let mut search = Search::<16>::new(source, reference, (column, row), range, left, self.quantiser_scale);
        if self.effort == Effort::Fast
            && candidates.one_motion
            && let Some(&given) = candidates.vectors().first()
        {
            return search.around(given, poor);
        }
        search.try_vector(HalfSample::ZERO);
        if search.best_error == 0 {
            return HalfSample::ZERO;
        }
        search.try_vector(left);
        for &vector in candidates.vectors() {
            search.try_vector(vector);
        }
        // Where every pixel moved alike nothing foretells better than they do. Highlights and shadows move otherwise than
        // their surface: what matches poorly is still looked for near by.
        let known = candidates.one_motion;
        if search.best_error > poor / 4 {
            let columns = self.source.width() / 16;
            let neighbours = [Some(index), index.checked_sub(columns), Some(index + 1), Some(index + columns)];
            let surface = search.best;
            let over_it = |vector: HalfSample| (vector.x - surface.x).abs().max((vector.y - surface.y).abs());
            for neighbour in neighbours.into_iter().flatten() {
                if let Some(&vector) = self.before.get(neighbour).filter(|&&v| !known || over_it(v) <= LIGHT_MOVES) {
                    search.try_vector(vector);
                }
            }
            if !known || search.best != surface {
                search.descend();
            }
        }
        if search.best_error > poor && !known {
            let found = self.coarse.as_ref().map(|coarse| coarse.search(column, row));
            if found.is_some_and(|found| search.try_vector(found)) {
                search.descend();
            }
        }
        if self.effort == Effort::Best {
            // Even around what is given: a field need not be right.
            search.transform_differences();
            search.settle();
        } else {
            for _ in 0..if known { 1 } else { 2 } {
                search.try_around(CROSS);
            }
        }
        search.best
    }
}

/// The search for one block of N×N samples.
pub(crate) struct Search<'a, const N: usize> {
    source: Place<'a>,
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
    /// For the block of `source` at `(column, row)` of a grid of blocks; `quantiser_scale` says what bits are worth.
    pub fn new(
        source: &'a Plane<u8>,
        reference: &'a Plane<u8>,
        (column, row): (usize, usize),
        range: Range,
        predicted: HalfSample,
        quantiser_scale: u32,
    ) -> Self {
        Self {
            source: place_of(source, (2 * N * column) as i32, (2 * N * row) as i32),
            reference,
            x2: (2 * N * column) as i32,
            y2: (2 * N * row) as i32,
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
    fn around(mut self, given: HalfSample, poor: u32) -> HalfSample {
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

    /// What the bits of a vector are worth.
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
    fn try_around(&mut self, steps: [(i32, i32); 4]) -> bool {
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

    /// Tries the half-sample neighbours, twice if one is better.
    pub fn refine(&mut self) {
        self.follow(NEIGHBOURS, 2);
    }

    /// Follows half- and whole-sample steps until none is better.
    ///
    /// Half positions smooth the reference, noise in it too, and whole ones do not: differences then lie lower on one kind
    /// of position than on the other. Steps to neighbours, all of the other kind, would end on any position of the better
    /// kind, depending on where they began, so steps to the next of the same kind are tried as well.
    pub fn settle(&mut self) {
        self.follow(NEIGHBOURS_AND_DIAMOND, SETTLED);
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

    fn place(&self, vector: HalfSample) -> Place<'_> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use plane::Correspondence;

    #[test]
    fn f_codes_at_the_borders_of_their_reach() {
        assert_eq!(f_code([].into_iter()), 1);
        assert_eq!(f_code([-16, 15].into_iter()), 1);
        assert_eq!(f_code([16].into_iter()), 2);
        assert_eq!(f_code([-17].into_iter()), 2);
        assert_eq!(f_code([-4096, 4095].into_iter()), 9);
    }

    /// Noise of two scales that does not repeat, blended between whole positions.
    fn texture(x: f64, y: f64) -> u8 {
        let hash = |x: i64, y: i64| {
            let mixed = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0x2545_f491_4f6c_dd1d);
            f64::from((mixed >> 40) as u8)
        };
        let smooth = |x: f64, y: f64| {
            let (i, j) = (x.floor() as i64, y.floor() as i64);
            let (u, v) = (x - x.floor(), y - y.floor());
            let upper = hash(i, j) * (1.0 - u) + hash(i + 1, j) * u;
            let lower = hash(i, j + 1) * (1.0 - u) + hash(i + 1, j + 1) * u;
            upper * (1.0 - v) + lower * v
        };
        (0.7 * smooth(x / 9.0, y / 9.0) + 0.3 * smooth(x / 3.0 + 50.0, y / 3.0)) as u8
    }

    fn moved(x: f64, y: f64) -> Picture {
        let luma = Plane::from_fn(128, 96, |i, j| texture(i as f64 + x, j as f64 + y));
        Picture::gray(luma)
    }

    #[test]
    fn a_pan_is_found_without_and_with_a_field() {
        for (x, y) in [(3.0, -2.0), (13.5, 7.0), (-24.0, 0.5)] {
            let (reference, source) = (moved(0.0, 0.0), moved(x, y));
            let known = Correspondence::from_motion(Plane::filled(128, 96, [x as f32, y as f32]));
            let quarters = [&source, &reference].map(|frame| quarter(frame.luma()));
            for (given, effort) in
                [(None, Effort::Fast), (Some(&known), Effort::Fast), (None, Effort::Best), (Some(&known), Effort::Best)]
            {
                let estimate = Estimate {
                    source: &source,
                    reference: &reference,
                    candidates: &given.map_or(Vec::new(), |known| all_candidates(known, 8, 6)),
                    before: &[],
                    coarse: Some(CoarseSearch { source: &quarters[0], reference: &quarters[1] }),
                    quantiser_scale: 4,
                    f_code_max: [7, 4],
                    effort,
                };
                let vectors = estimate.vectors();
                let truth = HalfSample { x: (2.0 * x) as i32, y: (2.0 * y) as i32 };
                for (i, &vector) in vectors.iter().enumerate() {
                    let range = Range::new(reference.luma(), i % 8, i / 8, [7, 4]);
                    assert!(range.contains(vector));
                    if range.contains(truth) {
                        assert_eq!(vector, truth, "macroblock {i}, given: {}", given.is_some());
                    }
                }
            }
        }
    }
}
