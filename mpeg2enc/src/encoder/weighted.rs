//! Quantiser scales that follow weights of macroblocks, with a fixed geometric mean.
//!
//! ```text
//! scale = existing scale next to base · weight     weight  factor of quantiser_scale, from `weights::given`
//!                                                  base    sets the geometric mean of all scales to quantiser_scale
//! ```
//! The row selects one of the two neighboring scales, as with a mean quantiser. Rounding to the nearest scale could miss the mean
//! by half a step of the table if few weights occur. Without a look-ahead no later stage corrects the bits. Integer arithmetic
//! produces the same result on every processor.

use crate::quantiser_scale::{QuantiserScaleCode, neighbors, one_of, quantiser_scale_of};

/// Maximum of `base`, in 4096ths, which maps the least factor, a sixteenth, to scale 112.
const BASE_MAX: u64 = 112 * 16 * 4096;

/// Returns quantiser_scale of all macroblocks in sixteenths, for their `factors` in 256ths. Equal factors change nothing.
pub(super) fn scales_x16(factors: &[u32], columns: usize, quantiser_scale: u32, q_scale_type: bool) -> Vec<u32> {
    let table = Table::new(q_scale_type);
    let counts = counts(factors, columns);
    // The sum of logarithms grows with the base, so bisection finds the mean.
    let sum = |base: u64| {
        let of = |&((factor, row), count): &((u32, usize), u64)| {
            count * table.logarithms[table.scale_x16(base, factor, row) as usize / 16]
        };
        counts.iter().map(of).sum::<u64>()
    };
    let wanted = factors.len() as u64 * logarithm(quantiser_scale);
    let (below, above) = around(&sum, wanted);
    let base = if wanted.abs_diff(sum(below)) <= wanted.abs_diff(sum(above)) { below } else { above };
    factors.iter().enumerate().map(|(i, &factor)| table.scale_x16(base, factor, i / columns)).collect()
}

/// Existing quantiser scales of one table.
struct Table {
    finest_x16: u32,
    /// The two existing scales around each sixteenth, from the finest to the coarsest scale.
    neighbors: Vec<[u32; 2]>,
    /// Logarithms of the numbers from 0, which counts as 1, to the coarsest scale.
    logarithms: Vec<u64>,
}

impl Table {
    fn new(q_scale_type: bool) -> Self {
        let [finest, coarsest] = [1, 31].map(|code| quantiser_scale_of(QuantiserScaleCode { q_scale_type, code }));
        Self {
            finest_x16: 16 * finest,
            neighbors: (16 * finest..=16 * coarsest).filter_map(|x16| neighbors(q_scale_type, x16)).collect(),
            logarithms: (0..=coarsest).map(|scale| logarithm(scale.max(1))).collect(),
        }
    }

    /// Returns the scale of a macroblock in this row, in sixteenths.
    fn scale_x16(&self, base: u64, factor: u32, row: usize) -> u32 {
        // Convert the product of 4096ths and 256ths to sixteenths.
        let wanted = (base * u64::from(factor) / 65_536) as u32;
        let place = (wanted.saturating_sub(self.finest_x16) as usize).min(self.neighbors.len() - 1);
        one_of(self.neighbors[place], self.finest_x16 + place as u32, row)
    }
}

/// Counts the occurrences of each pair of factor and row of macroblocks.
fn counts(factors: &[u32], columns: usize) -> Vec<((u32, usize), u64)> {
    let mut sorted: Vec<(u32, usize)> = factors.iter().enumerate().map(|(i, &factor)| (factor, i / columns)).collect();
    sorted.sort_unstable();
    sorted.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as u64)).collect()
}

/// Returns the largest base with a `sum` below `wanted`, and its successor; `sum` must not decrease.
fn around(sum: &impl Fn(u64) -> u64, wanted: u64) -> (u64, u64) {
    let (mut below, mut above) = (0, BASE_MAX);
    while above - below > 1 {
        let middle = (below + above) / 2;
        if sum(middle) < wanted { below = middle } else { above = middle }
    }
    (below, above)
}

/// Returns the logarithm to base 2, in 65536ths, rounded down.
fn logarithm(scale: u32) -> u64 {
    let whole = scale.ilog2();
    // `rest` is in [1, 2), in units of 2⁻³¹. Each squaring yields one more bit.
    let mut rest = u64::from(scale) << (31 - whole);
    let mut bits = u64::from(whole);
    for _ in 0..16 {
        rest = (rest * rest) >> 31;
        let bit = rest >> 32;
        rest >>= bit;
        bits = 2 * bits + bit;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geometric_mean(scales_x16: &[u32]) -> f64 {
        let sum: f64 = scales_x16.iter().map(|&scale| (f64::from(scale) / 16.0).log2()).sum();
        (sum / scales_x16.len() as f64).exp2()
    }

    #[test]
    fn logarithms_are_the_true_ones() {
        for scale in 1..=112 {
            let error = logarithm(scale) as f64 / 65_536.0 - f64::from(scale).log2();
            assert!((-2e-5..=0.0).contains(&error), "{scale}: {error}");
        }
    }

    #[test]
    fn equal_factors_change_nothing() {
        for (q_scale_type, code) in [false, true].into_iter().flat_map(|table| (1..=31).map(move |code| (table, code)))
        {
            let scale = quantiser_scale_of(QuantiserScaleCode { q_scale_type, code });
            for factor in [16, 17, 255, 256, 257, 1000, 4096] {
                assert_eq!(scales_x16(&[factor; 6], 2, scale, q_scale_type), [16 * scale; 6], "factor {factor}");
            }
        }
    }

    #[test]
    fn the_geometric_mean_stays() {
        // Use weights over two octaves, all different.
        let factors: Vec<u32> = (0..400).map(|i| 128 + (i * 149) % 389).collect();
        for (scale, q_scale_type) in [(8, false), (16, false), (30, false), (3, true), (16, true), (64, true)] {
            let scales = scales_x16(&factors, 20, scale, q_scale_type);
            let mean = geometric_mean(&scales) / f64::from(scale);
            assert!((mean - 1.0).abs() < 0.005, "{mean} of {scale}");
        }
    }

    #[test]
    fn scales_are_legal_and_follow_factors() {
        for (scale, q_scale_type, legal) in
            [(2, false, 2..=62), (8, false, 2..=62), (62, false, 2..=62), (5, true, 1..=112)]
        {
            let scales = scales_x16(&[16, 100, 256, 1000, 4096], 5, scale, q_scale_type);
            assert!(scales.is_sorted(), "{scales:?}");
            assert!(scales.iter().all(|&scale| scale % 16 == 0 && legal.contains(&(scale / 16))), "{scales:?}");
        }
    }
}
