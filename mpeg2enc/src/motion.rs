//! Motion estimation of a picture: candidates given or taken from neighbors, and a search around them.

mod coarse;
mod field;
mod search;
mod supplied;

pub use supplied::SuppliedMotion;
pub(crate) use {
    coarse::{CoarseSearch, quarter},
    field::{Candidates, all_candidates},
    search::{BlockPosition, Search},
};

use crate::{
    Effort, Picture,
    vector::{HalfSample, Range},
};
use search::CROSS;
use threads::prelude::*;

/// Motion search of one picture in one reference picture.
pub(crate) struct Estimate<'a> {
    /// Picture to be coded, extended to whole macroblocks.
    pub source: &'a Picture,
    /// Reconstructed reference picture.
    pub reference: &'a Picture,
    /// Vectors worth trying in every macroblock, or an empty list.
    pub candidates: &'a [Candidates],
    /// Vectors of the previous picture, or an empty list.
    pub before: &'a [HalfSample],
    /// Quarter-size pictures for macroblocks without good candidates.
    pub coarse: Option<CoarseSearch<'a>>,
    pub quantiser_scale: u32,
    pub f_code_max: [u32; 2],
    /// Best effort compares half-sample positions by transformed differences; fast effort uses given vectors.
    pub effort: Effort,
}

/// Maximum motion of highlights and shadows over a surface with known motion, in half samples. Vectors of the previous picture
/// that differ more belong to other objects.
const LIGHT_MOVES: i32 = 8;
/// Mean absolute difference per sample above which more vectors are tried, at quantiser_scale 0. The value was tuned with the
/// example `mpeg2enc`.
const POOR_MATCH: u32 = 2;
/// Increase of [`POOR_MATCH`] per step of quantiser_scale, in eighths, because coding noise in the reference has about this size.
const POOR_MATCH_EIGHTHS: u32 = 1;
impl Estimate<'_> {
    /// Returns the vector of every macroblock in raster order; rows are independent of each other.
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
        let block = BlockPosition { column, row };
        let mut search = Search::<16>::new([source, reference], block, range, left, self.quantiser_scale);
        // With uniform motion the fast search only tests the given vector and its neighborhood.
        if self.effort == Effort::Fast
            && candidates.one_motion
            && let Some(&given) = candidates.vectors().first()
        {
            return search.around(given, poor);
        }
        // Stop at a perfect match of the zero vector, as in static areas.
        search.try_vector(HalfSample::ZERO);
        if search.best_error == 0 {
            return HalfSample::ZERO;
        }
        // Try the left neighbor's vector and the given vectors as starting points.
        search.try_vector(left);
        for &vector in candidates.vectors() {
            search.try_vector(vector);
        }
        // If all pixels had equal motion, no other vector predicts better. Highlights and shadows move differently from their
        // surface, so poor matches still try nearby vectors.
        let known = candidates.one_motion;
        if search.best_error > poor / 4 {
            let columns = self.source.width() / 16;
            let neighbors = [Some(index), index.checked_sub(columns), Some(index + 1), Some(index + columns)];
            let surface = search.best;
            let over_it = |vector: HalfSample| (vector.x - surface.x).abs().max((vector.y - surface.y).abs());
            for neighbor in neighbors.into_iter().flatten() {
                if let Some(&vector) = self.before.get(neighbor).filter(|&&v| !known || over_it(v) <= LIGHT_MOVES) {
                    search.try_vector(vector);
                }
            }
            if !known || search.best != surface {
                search.descend();
            }
        }
        // Search widely if nothing matches.
        if search.best_error > poor && !known {
            let found = self.coarse.as_ref().map(|coarse| coarse.search(column, row));
            if found.is_some_and(|found| search.try_vector(found)) {
                search.descend();
            }
        }
        // Refine the vector to half samples, with more trials at best effort.
        if self.effort == Effort::Best {
            // Search even around given vectors, because a motion field may be wrong.
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

#[cfg(test)]
mod tests {
    use super::*;
    use plane::{Correspondence, Plane};

    /// Returns aperiodic noise of two scales, interpolated between integer positions.
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
                // Expect the true vector wherever the range contains it.
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
