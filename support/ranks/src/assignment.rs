//! Assignment of the items of a shared loop to any number of ranks.

/// 2³²/φ, where φ is the golden ratio.
const GOLDEN: u32 = 0x9e37_79b9;

/// Rule that assigns an item of a shared loop to a rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Assignment {
    /// Item k belongs to rank k mod R.
    InOrder(u32),
    /// Item k belongs to rank ⌊R frac(k/φ)⌋, where φ is the golden ratio. This spreads consecutive items, and items at
    /// constant intervals, evenly over the ranks.
    Golden(u32),
}

impl Assignment {
    /// Returns the rank, of `count` ranks, that computes the item.
    #[must_use]
    pub fn owner(self, count: usize) -> usize {
        match self {
            Self::InOrder(number) => number as usize % count,
            Self::Golden(number) => {
                // The wrapped product is frac(k/φ) as a multiple of 2⁻³².
                let fraction = u64::from(number.wrapping_mul(GOLDEN));
                ((fraction * count as u64) >> 32) as usize
            }
        }
    }
}

/// Assigns `count` items in order: item k belongs to rank k mod R.
#[must_use]
pub fn in_order(count: usize) -> Vec<Assignment> {
    (0..count as u32).map(Assignment::InOrder).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Products of k and 2³²/φ give the same owners as exact multiples of 1/φ, except near a border between ranks.
    #[test]
    fn owners_are_those_of_their_formulas() {
        let golden = (5f64.sqrt() - 1.0) / 2.0;
        for count in [1, 2, 3, 5, 64] {
            for number in 0..1000u32 {
                assert_eq!(Assignment::InOrder(number).owner(count), number as usize % count);
                let exactly = count as f64 * (f64::from(number) * golden).fract();
                if (exactly - exactly.round()).abs() > 1e-4 {
                    assert_eq!(Assignment::Golden(number).owner(count), exactly as usize, "{number} on {count} ranks");
                }
            }
        }
    }
}
