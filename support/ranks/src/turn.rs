//! Turns: the number of an item tells the rank that computes it, for any number of ranks.

/// 2³²/φ.
const GOLDEN: u32 = 0x9e37_79b9;

/// Turn of an item of a shared loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Number k is of rank k mod R.
    InOrder(u32),
    /// Number k is of rank ⌊R frac(k/φ)⌋, φ being the golden ratio. That spreads numbers one after the other, and those a constant
    /// number apart, too.
    Golden(u32),
}

impl Turn {
    /// The rank, of `count` in all, that computes the item.
    #[must_use]
    pub fn owner(self, count: usize) -> usize {
        match self {
            Self::InOrder(number) => number as usize % count,
            Self::Golden(number) => {
                let fraction = u64::from(number.wrapping_mul(GOLDEN));
                ((fraction * count as u64) >> 32) as usize
            }
        }
    }
}

/// Turns of `count` items in order: item k is that of rank k mod R.
#[must_use]
pub fn in_order(count: usize) -> Vec<Turn> {
    (0..count as u32).map(Turn::InOrder).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Multiples of 2³²/φ are as good as those of 1/φ in exact numbers, as long as these are not at a border.
    #[test]
    fn owners_are_those_of_their_formulas() {
        let golden = (5f64.sqrt() - 1.0) / 2.0;
        for count in [1, 2, 3, 5, 64] {
            for number in 0..1000u32 {
                assert_eq!(Turn::InOrder(number).owner(count), number as usize % count);
                let exactly = count as f64 * (f64::from(number) * golden).fract();
                if (exactly - exactly.round()).abs() > 1e-4 {
                    assert_eq!(Turn::Golden(number).owner(count), exactly as usize, "{number} on {count} ranks");
                }
            }
        }
    }
}
