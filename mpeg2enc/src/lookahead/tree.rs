//! Macroblock tree: better quality for macroblocks that later pictures inherit.
//!
//! Finer quantisation pays off in a macroblock from which others are predicted. Later pictures inherit its quality along the
//! motion, as far as predictions match. After F. Glaser, "A macroblock-tree algorithm for high-performance optimization of
//! dependent video coding in H.264/AVC":
//!
//! ```text
//! passed by a block = (intra + inherited) · (1 − inter / intra)
//!   intra, inter   its costs without and with prediction      inherited   sum passed to it by its dependants
//! ```
//!
//! # Differences from the paper
//! The factor of quantiser_scale follows the y262 encoder, which uses a root instead of a power of two. All arithmetic is integer.

use super::{Lookahead, plan::Span};
use crate::vector::HalfSample;
use std::collections::BTreeMap;

/// Strength of the effect: factor = 1 / (1 + STRENGTH·(√(1 + inherited / intra) − 1)), in 256ths. The standard does not define
/// this value; it was tuned on the clips of README.md. Static scenes would benefit from a higher value, and moving scenes from a
/// lower value.
const STRENGTH_256THS: u64 = 125;
/// Minimum factor on the requested quantiser, in 256ths.
const FACTOR_MIN_256THS: u64 = 100;
/// Offset that is added to every block's cost. It avoids division by zero in flat blocks and suppresses their noise.
const FLOOR: u64 = 16;

impl Lookahead {
    /// Computes the factors of quantiser_scale, in 256ths, for every macroblock of the first anchor of `spans`.
    pub fn factors(&mut self, last_anchor: Option<usize>, spans: &[Span]) -> Vec<u32> {
        let count = self.macroblocks();
        let columns = self.columns();
        let mut inherited: BTreeMap<usize, Vec<u64>> = BTreeMap::new();
        let distance = |a: usize, b: usize| b as isize - a as isize;
        // Process pictures in reverse order of coding, so that each has received the costs from its dependants.
        for (i, span) in spans.iter().enumerate().rev() {
            let from = if i > 0 { Some(spans[i - 1].anchor) } else { last_anchor };
            let Some(from) = from else { continue };
            // B pictures inherit nothing and pass their gain to both anchors.
            for index in from + 1..span.anchor {
                let (back, ahead) = (distance(index, from), distance(index, span.anchor));
                let found = self.two_sided(index, back, ahead);
                let vectors = [self.matches(index, back), self.matches(index, ahead)];
                let intra = self.intra_costs(index).clone();
                for block in 0..count {
                    let (cost, intra) = (u64::from(found[block].cost) + FLOOR, u64::from(intra[block]) + FLOOR);
                    let passed = intra.saturating_sub(cost);
                    for (s, reference) in [from, span.anchor].into_iter().enumerate() {
                        let share = passed * u64::from(found[block].shares[s]) / 2;
                        let amounts = inherited.entry(reference).or_insert_with(|| vec![0; count]);
                        pass(amounts, columns, block, vectors[s][block].vector, share);
                    }
                }
            }
            // An I picture ends the chain; the first anchor is the result.
            if span.is_intra || i == 0 {
                continue;
            }
            let matches = self.matches(span.anchor, distance(span.anchor, from));
            // P pictures also pass the fraction of their inheritance that they predict.
            let intra = self.intra_costs(span.anchor).clone();
            let own = inherited.remove(&span.anchor).unwrap_or_else(|| vec![0; count]);
            let amounts = inherited.entry(from).or_insert_with(|| vec![0; count]);
            for block in 0..count {
                let (cost, intra) = (u64::from(matches[block].cost) + FLOOR, u64::from(intra[block]) + FLOOR);
                let passed = (intra + own[block]) * intra.saturating_sub(cost) / intra;
                pass(amounts, columns, block, matches[block].vector, passed);
            }
        }
        let anchor = spans[0].anchor;
        let own = inherited.remove(&anchor).unwrap_or_else(|| vec![0; count]);
        let intra = self.intra_costs(anchor);
        own.iter().zip(intra.iter()).map(|(&own, &intra)| factor(own, u64::from(intra) + FLOOR)).collect()
    }
}

/// Adds `amount` to the blocks covered by the displaced block in its reference, in proportion to area.
fn pass(amounts: &mut [u64], columns: usize, block: usize, vector: HalfSample, amount: u64) {
    if amount == 0 {
        return;
    }
    let rows = amounts.len() / columns;
    // A block measures 16 half samples of the half-size picture.
    let (x, y) = (16 * (block % columns) as i32 + vector.x, 16 * (block / columns) as i32 + vector.y);
    let (right, below) = ((x & 15) as u64, (y & 15) as u64);
    for (dx, dy, area) in [
        (0, 0, (16 - right) * (16 - below)),
        (1, 0, right * (16 - below)),
        (0, 1, (16 - right) * below),
        (1, 1, right * below),
    ] {
        let (column, row) = ((x >> 4) + dx, (y >> 4) + dy);
        if (0..columns as i32).contains(&column) && (0..rows as i32).contains(&row) {
            amounts[row as usize * columns + column as usize] += amount * area / 256;
        }
    }
}

/// Returns the factor of quantiser_scale, in 256ths.
fn factor(inherited: u64, intra: u64) -> u32 {
    // The root of 1 + inherited / intra is at least 1, so the factor is at most 1.
    let root_256ths = (65536 * (intra + inherited) / intra).isqrt();
    let factor = 256 * 256 * 256 / (256 * 256 + STRENGTH_256THS * (root_256ths - 256));
    factor.max(FACTOR_MIN_256THS) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_passed_by_area() {
        let mut amounts = vec![0; 12];
        pass(&mut amounts, 4, 5, HalfSample { x: 4, y: -8 }, 1000);
        assert_eq!(amounts, [0, 375, 125, 0, 0, 375, 125, 0, 0, 0, 0, 0]);
        // Amounts outside the picture are lost.
        let mut amounts = vec![0; 12];
        pass(&mut amounts, 4, 0, HalfSample { x: -8, y: -8 }, 1000);
        assert_eq!(amounts[0], 250);
        assert_eq!(amounts.iter().sum::<u64>(), 250);
    }

    #[test]
    fn inherited_macroblocks_are_finer() {
        assert_eq!(factor(0, 100), 256);
        let factors: Vec<u32> = [10, 100, 1000, 10_000, 1_000_000].map(|inherited| factor(inherited, 100)).into();
        assert!(factors.is_sorted_by(|a, b| a >= b) && factors[0] < 256);
        assert_eq!(u64::from(factors[4]), FACTOR_MIN_256THS);
        // √(1 + 3) − 1 = 1.
        assert_eq!(u64::from(factor(300, 100)), 256 * 256 / (256 + STRENGTH_256THS));
    }
}
