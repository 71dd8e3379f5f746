//! Vectors between waiting frames.

use super::{
    cost::BLOCK,
    waiting::{Match, Waiting},
};
use crate::{
    motion::{BlockPosition, Candidates, CoarseSearch, Search},
    vector::{HalfSample, Range},
};

/// quantiser_scale, a medium quality, from which [`Search::new`] derives the price of vector bits in the look-ahead.
const SEARCH_QUANTISER_SCALE: u32 = 8;
/// Mean absolute difference per sample above which a wider search is made.
const POOR_MATCH: u32 = 6;
/// Maximum reach of vectors in half-size pictures, similar to the limits of High Level. The true range is enforced later.
pub(super) const REACH: [u32; 2] = [9, 8];

/// Search for the blocks of one frame in another.
pub(super) struct BlockSearch<'a> {
    pub frame: &'a Waiting,
    pub reference: &'a Waiting,
    /// Whether poor matches trigger a wider search.
    pub wide: bool,
    /// Whether costs are transformed differences instead of plain ones.
    pub transformed: bool,
}

impl BlockSearch<'_> {
    /// Returns the best match of a block. `left` is the vector of the block to the left, and `before` the block's vector in the
    /// previous frame.
    pub fn best(
        &self,
        block: BlockPosition,
        left: HalfSample,
        candidates: &Candidates,
        before: Option<HalfSample>,
    ) -> Match {
        let &Self { frame, reference, wide, transformed } = self;
        let BlockPosition { column, row } = block;
        let range = Range::of_block(reference.half(), BLOCK, column, row, REACH);
        let mut search =
            Search::<BLOCK>::new([frame.half(), reference.half()], block, range, left, SEARCH_QUANTISER_SCALE);
        // Candidates are in units of the full-size picture.
        search.try_vector(HalfSample::ZERO);
        for vector in candidates.vectors() {
            search.try_vector(HalfSample { x: (vector.x + 1) >> 1, y: (vector.y + 1) >> 1 });
        }
        // If motion is not uniform, search around the best candidate, and widely if it matches poorly.
        if !candidates.one_motion && search.best_error > 0 {
            search.try_vector(left);
            if let Some(before) = before {
                search.try_vector(before);
            }
            search.descend();
            if wide && search.best_error > (BLOCK * BLOCK) as u32 * POOR_MATCH {
                let coarse =
                    CoarseSearch { source: frame.quarter(), reference: reference.quarter() }.search(column, row);
                if search.try_vector(HalfSample { x: coarse.x / 2, y: coarse.y / 2 }) {
                    search.descend();
                }
            }
        }
        // Transformed differences become the cost of the match.
        if transformed {
            if !candidates.one_motion {
                search.refine();
            }
            search.transform_differences();
        }
        Match { vector: search.best, cost: search.best_error }
    }
}
