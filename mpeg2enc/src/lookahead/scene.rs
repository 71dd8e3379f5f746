//! Detection of shot changes.

use super::{Lookahead, away};
use crate::{
    kernel::{self, ReferenceBlock},
    predict::place_of,
    vector::Range,
};

/// Cost of prediction from the previous frame above which a shot change is detected, in quarters of the intra cost.
const SCENE_CUT_QUARTERS: u64 = 3;
/// Step between measured macroblocks for quick measurements with given motion. 7 has no common factor with usual widths in
/// macroblocks (32 or 45, for example), so the samples form diagonals.
const SAMPLED: usize = 7;

impl Lookahead {
    /// Returns whether a shot change precedes this frame.
    pub fn is_scene_cut(&mut self, index: usize) -> bool {
        let (predicted, total) =
            if self.quick { self.sampled_costs(index) } else { None }.unwrap_or_else(|| self.all_costs(index));
        predicted * 4 > total * SCENE_CUT_QUARTERS && total > 0
    }

    /// Returns two total costs of all macroblocks: the cheaper of predicted and intra, and intra alone.
    fn all_costs(&mut self, index: usize) -> (u64, u64) {
        let matches = self.matches(index, -1);
        let intra = self.intra_costs(index);
        let total = intra.iter().map(|&cost| u64::from(cost)).sum();
        (matches.iter().zip(intra.iter()).map(|(m, &cost)| u64::from(m.cost.min(cost))).sum(), total)
    }

    /// Returns both total costs of sampled macroblocks, predicted with their first given vectors; `None` without given motion.
    fn sampled_costs(&self, index: usize) -> Option<(u64, u64)> {
        let known = self.is_known(index, -1)?;
        let (source, reference) = (self.get(index).source.luma(), self.get(away(index, -1)).source.luma());
        let columns = self.columns();
        let (mut predicted, mut total) = (0, 0);
        for i in (0..known.len()).step_by(SAMPLED) {
            let (column, row) = (i % columns, i / columns);
            let block: [[u8; 16]; 16] = std::array::from_fn(|y| {
                source.row(16 * row + y)[16 * column..][..16].try_into().expect("a macroblock is inside the picture")
            });
            // Vectors of a motion field may leave the picture, so clamp them.
            let range = Range::new(reference, column, row, super::block_search::REACH);
            let vector = range.clamp(known[i].vectors().first().copied().unwrap_or_default());
            let place = place_of(reference, 32 * column as i32 + vector.x, 32 * row as i32 + vector.y);
            let here = ReferenceBlock::whole(block.as_flattened(), 16);
            // Estimate the intra cost by the differences from the mean.
            let sum: u32 = block.as_flattened().iter().map(|&sample| u32::from(sample)).sum();
            let mean = ((sum + 128) / 256) as u8;
            let intra: u32 = block.as_flattened().iter().map(|&sample| u32::from(sample.abs_diff(mean))).sum();
            predicted += u64::from(kernel::absolute_difference::<16>(here, place).min(intra));
            total += u64::from(intra);
        }
        Some((predicted, total))
    }
}
