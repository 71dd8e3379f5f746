//! Probability density over the four-dimensional unit cube, fitted to weighted samples: a tree of boxes.
//!
//! A box is split at the edge of empty space. Otherwise, it is split at its weighted median if that gains more than
//! chance would. The density is positive everywhere: empty space keeps a small fraction of the weight.

use glam::Vec4;

/// Minimum number of samples in each half of a split box. At 16 samples, random deviations of the density are a
/// quarter.
const LEAF: usize = 16;
/// Minimum side of a box that may be split.
const NARROW: f32 = 1e-4;
/// Minimum fraction of a side that may be split off as empty.
const LARGE: f32 = 0.25;
/// Fraction of the weight that empty space keeps when it is split off.
const EMPTY: f32 = 0.03;
/// Margin around the samples that counts as occupied, as a fraction of the samples' spread. The margin is at least
/// twice the mean distance between samples.
const MARGIN: f32 = 0.1;
/// Minimum gain of a split. By chance, the median of 32 uniformly distributed samples deviates from the middle, with a
/// gain of 0.016.
const LEAST_GAIN: f32 = 0.04;

/// Boxes that fill the four-dimensional unit cube.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Boxes {
    nodes: Vec<BoxNode>,
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum BoxNode {
    /// Split at coordinate `at` along `axis`. The lower half has the fraction `low` of the weight, and is the first of
    /// the `children`.
    Halves { axis: usize, at: f32, low: f32, children: [u32; 2] },
    /// Density in a leaf box.
    Leaf(f32),
}

/// Box that has no node yet.
struct Open {
    samples: Vec<(Vec4, f64)>,
    low: Vec4,
    high: Vec4,
    /// Fraction of the total weight in the box.
    share: f32,
}

/// Position at which a box is split, and the fraction of the box's weight below it.
struct Cut {
    axis: usize,
    at: f32,
    low: f32,
}

impl Boxes {
    /// Builds the tree around weighted `samples`, or returns `None` for too few samples.
    pub fn around(samples: Vec<(Vec4, f64)>) -> Option<Self> {
        if samples.len() < 2 * LEAF {
            return None;
        }
        let mut boxes = Self { nodes: Vec::new() };
        boxes.add(Open { samples, low: Vec4::ZERO, high: Vec4::ONE, share: 1.0 });
        Some(boxes)
    }

    /// Adds a box and all its descendants. Returns the index of the box's node.
    fn add(&mut self, open: Open) -> u32 {
        let number = self.nodes.len() as u32;
        let extent = open.high - open.low;
        self.nodes.push(BoxNode::Leaf(open.share / (extent.x * extent.y * extent.z * extent.w)));
        let Some(Cut { axis, at, low }) = open.empty_side().or_else(|| open.halves()) else { return number };

        // Split the box and its samples. Each half receives its fraction of the weight.
        let Open { samples, low: begin, high: end, share } = open;
        let (below, above) = samples.into_iter().partition(|(point, _)| point[axis] < at);
        let (mut middle_end, mut middle_begin) = (end, begin);
        (middle_end[axis], middle_begin[axis]) = (at, at);
        let children = [
            self.add(Open { samples: below, low: begin, high: middle_end, share: share * low }),
            self.add(Open { samples: above, low: middle_begin, high: end, share: share * (1.0 - low) }),
        ];
        self.nodes[number as usize] = BoxNode::Halves { axis, at, low, children };
        number
    }

    /// Returns the density at `point`. The mean density over the cube is 1.
    #[cfg(test)]
    fn density(&self, point: Vec4) -> f32 {
        let mut number = 0;
        loop {
            match self.nodes[number as usize] {
                BoxNode::Leaf(density) => return density,
                BoxNode::Halves { axis, at, children, .. } => number = children[usize::from(point[axis] >= at)],
            }
        }
    }

    /// Draws a point with this density, and returns the point and its density. `which` in 0…1 selects the box, and
    /// `place` the point in the box.
    pub fn draw(&self, mut which: f32, place: Vec4) -> (Vec4, f32) {
        // Descend to a leaf. The number `which` is rescaled at each split and stays uniform in 0…1.
        let (mut number, mut begin, mut end) = (0, Vec4::ZERO, Vec4::ONE);
        loop {
            match self.nodes[number as usize] {
                BoxNode::Leaf(density) => return (begin + (end - begin) * place, density),
                BoxNode::Halves { axis, at, low, children } if which < low => {
                    (which, number, end[axis]) = (which / low, children[0], at);
                }
                BoxNode::Halves { axis, at, low, children } => {
                    (which, number, begin[axis]) = ((which - low) / (1.0 - low), children[1], at);
                }
            }
        }
    }
}

impl Open {
    /// Returns the split at the largest empty side, if this side is large enough.
    fn empty_side(&self) -> Option<Cut> {
        let Self { samples, low, high, .. } = self;
        let (mut least, mut most) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
        for (point, _) in samples {
            (least, most) = (least.min(*point), most.max(*point));
        }
        // Extend the box of the samples by a margin, because further samples may lie slightly outside it.
        let margin = ((most - least) * MARGIN.max(2.0 / samples.len() as f32)).max(Vec4::splat(NARROW));
        let (least, most) = (least - margin, most + margin);

        // Compare the empty space at both ends of each axis, as a fraction of the side.
        let (mut largest, mut cut) = (LARGE, None);
        for axis in 0..4 {
            let extent = high[axis] - low[axis];
            for (share, at, below) in [
                ((least[axis] - low[axis]) / extent, least[axis], EMPTY),
                ((high[axis] - most[axis]) / extent, most[axis], 1.0 - EMPTY),
            ] {
                if share > largest && !samples.is_empty() {
                    (largest, cut) = (share, Some(Cut { axis, at, low: below }));
                }
            }
        }
        cut
    }

    /// Returns the split that makes the density most uneven. The gain is Σ s ln(s / v) over both halves. Each half has
    /// a fraction s of the weight and a fraction v of the volume.
    fn halves(&self) -> Option<Cut> {
        let Self { samples, low, high, .. } = self;
        // Too few samples yield no reliable median.
        let count = samples.len();
        let total: f64 = samples.iter().map(|(_, weight)| weight).sum();
        if count < 2 * LEAF || total <= 0.0 {
            return None;
        }
        let (mut most, mut best) = (LEAST_GAIN, None);
        for axis in 0..4 {
            // Split between samples, with about half of the weight below the split.
            let mut sorted: Vec<(f32, f64)> = samples.iter().map(|(point, weight)| (point[axis], *weight)).collect();
            sorted.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            let (mut below, mut number) = (0.0, 0);
            while number < count - LEAF && (number < LEAF || below < total / 2.0) {
                below += sorted[number].1;
                number += 1;
            }
            let at = (sorted[number - 1].0 + sorted[number].0) / 2.0;

            // Skip splits at equal coordinates, and splits of narrow or degenerate boxes.
            let (extent, share) = (high[axis] - low[axis], (below / total) as f32);
            let volume = (at - low[axis]) / extent;
            let parts = sorted[number - 1].0 < at && at <= sorted[number].0;
            if !parts || extent < NARROW || !(0.0..1.0).contains(&share) || !(0.0..1.0).contains(&volume) {
                continue;
            }

            // Choose the axis with the largest gain.
            let gain = share * (share / volume).ln() + (1.0 - share) * ((1.0 - share) / (1.0 - volume)).ln();
            if gain > most {
                (most, best) = (gain, Some(Cut { axis, at, low: share }));
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash_unit;

    fn random(key: u64) -> Vec4 {
        Vec4::new(hash_unit(1, key, 0), hash_unit(1, key, 1), hash_unit(1, key, 2), hash_unit(1, key, 3))
    }

    /// Returns boxes for samples of which half are in a corner with a ten-thousandth of the cube's volume.
    fn crowded() -> Boxes {
        let samples = (0..2000).map(|k| (random(k) * if k % 2 == 0 { 1.0 } else { 0.1 }, 1.0));
        Boxes::around(samples.collect()).unwrap()
    }

    #[test]
    fn densities_sum_to_one_and_are_those_of_the_draws() {
        let boxes = crowded();
        // Estimate ∫ f dx = E[f / p] from points drawn with density p, for f = 1 and f = x₀.
        let count = 100_000;
        let (mut volume, mut moment) = (0.0, 0.0);
        for k in 0..count {
            let (point, density) = boxes.draw(hash_unit(2, k, 0), random(7000 + k));
            assert_eq!(density, boxes.density(point));
            assert!(point.cmpge(Vec4::ZERO).all() && point.cmple(Vec4::ONE).all());
            volume += f64::from(1.0 / boxes.density(point));
            moment += f64::from(point.x / boxes.density(point));
        }
        let (volume, moment) = (volume / count as f64, moment / count as f64);
        assert!((volume - 1.0).abs() < 0.05 && (moment - 0.5).abs() < 0.03, "{volume}, {moment}");
    }

    #[test]
    fn density_is_high_where_samples_crowd() {
        let boxes = crowded();
        let inside = boxes.density(Vec4::splat(0.05));
        let outside = boxes.density(Vec4::splat(0.6));
        assert!(inside > 300.0 && (0.2..1.5).contains(&outside), "{inside}, {outside}");
        assert!(Boxes::around(vec![(Vec4::ZERO, 1.0); 3]).is_none());
        assert!(Boxes::around(vec![(Vec4::splat(0.5), 1.0); 300]).is_some(), "equal samples are not parted");
    }
}
