//! Rate-distortion optimal levels of a block: minimum squared error plus price of bits.
//!
//! Each coefficient may keep its level, decrease it by one, or become zero. The bits of a level depend on the preceding run of
//! zeros. The best choice is therefore a shortest path (Viterbi) between non-zero levels, with the lengths of Tables B.14 and
//! B.15.

use crate::{
    block::BlockKind,
    dct::COEFFICIENT_BITS,
    vlc::{Codes, coefficient_bits, end_of_block_bits, first_coefficient_bits},
};

/// A path that ends with a non-zero level, or before the first coefficient.
#[derive(Clone, Copy)]
struct PathNode {
    /// Price of the bits minus the error saved, compared with all zeros.
    cost: i64,
    level: i32,
    /// Position that follows the level.
    next: u8,
    /// Index of the previous node.
    from: u8,
}

/// Prices of a level's bits.
#[derive(Clone, Copy)]
pub(crate) struct BitPrice {
    pub codes: Codes,
    /// Price of one bit, in squared errors with twice [`COEFFICIENT_BITS`] fractional bits.
    pub lambda: i64,
}

/// Calls `keep` with the position and value of each remaining level of a block, from last to first.
///
/// `nonzero` yields positions in transmission order, coefficient magnitudes with [`COEFFICIENT_BITS`] fractional bits, and
/// their nearest non-zero levels. `restore` is the inverse quantisation of a level at a position. The DC coefficient of an
/// intra block is excluded.
pub(crate) fn choose(
    nonzero: impl Iterator<Item = (usize, i32, i32)>,
    kind: BlockKind,
    BitPrice { codes, lambda }: BitPrice,
    restore: impl Fn(usize, i32) -> i32,
    mut keep: impl FnMut(usize, i32),
) {
    let start = if kind == BlockKind::Intra { 1 } else { 0 };
    // An empty inter block needs no End of block; an intra block always has one.
    let end_bits = if kind == BlockKind::Intra { 0 } else { i64::from(end_of_block_bits(codes)) };
    let mut best_end = (0, 0);
    let mut nodes = [PathNode { cost: 0, level: 0, next: start, from: 0 }; 65];
    let mut alive = [0u8; 65];
    let mut alive_count = 1;
    // Extend the best path to each level or its predecessor, from every useful earlier node.
    for (number, (i, magnitude, level)) in (1u8..).zip(nonzero) {
        let magnitude = i64::from(magnitude);
        let mut best = PathNode { cost: i64::MAX, level, next: i as u8 + 1, from: 0 };
        for candidate in (level - 1).max(1)..=level {
            let error = magnitude - (i64::from(restore(i, candidate)) << COEFFICIENT_BITS);
            let saved = error * error - magnitude * magnitude;
            for &from in &alive[..alive_count] {
                let node = &nodes[usize::from(from)];
                let run = i - usize::from(node.next);
                let bits = if kind == BlockKind::Inter && from == 0 {
                    first_coefficient_bits(codes, run, candidate as u32)
                } else {
                    coefficient_bits(codes, run, candidate as u32)
                };
                let cost = node.cost + saved + lambda * i64::from(bits);
                if cost < best.cost {
                    best = PathNode { level: candidate, cost, from, ..best };
                }
            }
        }
        nodes[usize::from(number)] = best;
        if best.cost + end_bits * lambda < best_end.0 {
            best_end = (best.cost + end_bits * lambda, number);
        }
        // Drop more expensive earlier paths: a later, cheaper path also has the shorter run.
        while alive_count > 0 && nodes[usize::from(alive[alive_count - 1])].cost >= best.cost {
            alive_count -= 1;
        }
        alive[alive_count] = number;
        alive_count += 1;
    }
    // Follow the cheapest path back to the start.
    let mut node = best_end.1;
    while node != 0 {
        let PathNode { next, level, from, .. } = nodes[usize::from(node)];
        keep(usize::from(next) - 1, level);
        node = from;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CoefficientTable, Standard};

    const CODES: Codes = Codes { table: CoefficientTable::Zero, standard: Standard::Mpeg2 };

    /// Returns the levels that the trellis chooses from the levels of an inter block.
    fn chosen(
        magnitudes: &[i32; 64],
        levels: &[i32; 64],
        lambda: i64,
        restore: impl Fn(usize, i32) -> i32,
    ) -> [i32; 64] {
        let nonzero = (0..64).map(|i| (i, magnitudes[i], levels[i])).filter(|entry| entry.2 != 0);
        let mut out = [0; 64];
        choose(nonzero, BlockKind::Inter, BitPrice { codes: CODES, lambda }, restore, |place, level| {
            out[place] = level
        });
        out
    }

    #[test]
    fn nothing_changes_when_bits_are_free() {
        let magnitudes: [i32; 64] = std::array::from_fn(|i| if i % 3 == 0 { 8 * (10 * i as i32 + 15) } else { 0 });
        let restore = |_: usize, level: i32| (2 * level + 1) * 5;
        let levels: [i32; 64] = std::array::from_fn(|i| magnitudes[i] / 80);
        assert_eq!(chosen(&magnitudes, &levels, 0, restore), levels);
    }

    #[test]
    fn nothing_is_left_when_bits_are_dear() {
        assert_eq!(chosen(&[100; 64], &[1; 64], 1 << 30, |_, level| 12 * level), [0; 64]);
    }

    #[test]
    fn no_choice_of_a_small_block_is_cheaper() {
        // Try all combinations of level, level − 1 and zero over five coefficients.
        let lambda = 700;
        let restore = |_: usize, level: i32| (2 * level + 1) * 4;
        for seed in 0..200 {
            let mut magnitudes = [0; 64];
            for (i, magnitude) in magnitudes.iter_mut().take(5).enumerate() {
                *magnitude = (seed * 37 + i as i32 * 101 + seed * i as i32 * 13) % 200;
            }
            let nearest = magnitudes.map(|m| m / 64);
            let cost = |levels: &[i32; 64]| {
                let (mut cost, mut run, mut first, mut any) = (0i64, 0, true, false);
                for i in 0..5 {
                    let restored = if levels[i] == 0 { 0 } else { restore(i, levels[i]) << COEFFICIENT_BITS };
                    cost += i64::from(magnitudes[i] - restored).pow(2);
                    if levels[i] == 0 {
                        run += 1;
                    } else {
                        let level = levels[i] as u32;
                        let bits = if first {
                            first_coefficient_bits(CODES, run, level)
                        } else {
                            coefficient_bits(CODES, run, level)
                        };
                        cost += lambda * i64::from(bits);
                        (run, first, any) = (0, false, true);
                    }
                }
                cost + if any { 2 * lambda } else { 0 }
            };
            let mut least = i64::MAX;
            for combination in 0..3i32.pow(5) {
                let mut levels = [0; 64];
                for i in 0..5 {
                    let choice = combination / 3i32.pow(i as u32) % 3;
                    levels[i] = if choice == 2 { 0 } else { (nearest[i] - choice).max(0) };
                }
                least = least.min(cost(&levels));
            }
            let found = cost(&chosen(&magnitudes, &nearest, lambda, restore));
            assert!(found <= least + lambda, "{found} instead of {least} for {magnitudes:?}");
        }
    }
}
