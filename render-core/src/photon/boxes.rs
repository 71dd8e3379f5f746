//! A density over four numbers in 0…1, from weighted samples: a tree of boxes.
//!
//! A box is cut where space without samples begins, and halved where half of the weight is, as long as that makes the density more
//! uneven than chance would. The density is nowhere zero: empty space keeps a small share.

use glam::Vec4;

/// Samples of a box that is not halved any more: their number is off by a quarter by chance.
const LEAF: usize = 16;
/// Least side of a box that is cut.
const NARROW: f32 = 1e-4;
/// Least share of a side that is cut off as empty.
const LARGE: f32 = 0.25;
/// Share of the weight that empty space gets when it is cut off.
const EMPTY: f32 = 0.03;
/// Samples are taken to lie up to so far beyond the outermost of them, as a share of their spread, and at least twice the mean
/// distance between them.
const MARGIN: f32 = 0.1;
/// Least gain of a halving: the median of 32 samples of an even density lies off the middle by so much that it gains 0.016.
const LEAST_GAIN: f32 = 0.04;

/// The boxes, which fill the unit cube of four dimensions.
#[derive(Clone, Debug)]
pub(super) struct Boxes {
    nodes: Vec<BoxNode>,
}

#[derive(Clone, Copy, Debug)]
enum BoxNode {
    /// Parted at `at` along `axis`; the lower part has the share `low` of the weight and the first of the `children`.
    Halves { axis: usize, at: f32, low: f32, children: [u32; 2] },
    /// Density here.
    Leaf(f32),
}

/// A box that is not made yet.
struct Open {
    samples: Vec<(Vec4, f64)>,
    low: Vec4,
    high: Vec4,
    /// Share of all weight.
    share: f32,
}

/// Where a box is parted, and the share of its weight below.
struct Cut {
    axis: usize,
    at: f32,
    low: f32,
}

impl Boxes {
    /// Around `samples` with their weights; `None` where they are too few.
    pub fn around(samples: Vec<(Vec4, f64)>) -> Option<Self> {
        if samples.len() < 2 * LEAF {
            return None;
        }
        let mut boxes = Self { nodes: Vec::new() };
        boxes.add(Open { samples, low: Vec4::ZERO, high: Vec4::ONE, share: 1.0 });
        Some(boxes)
    }

    /// Makes a box and all that is in it; returns its number.
    fn add(&mut self, open: Open) -> u32 {
        let number = self.nodes.len() as u32;
        let extent = open.high - open.low;
        self.nodes.push(BoxNode::Leaf(open.share / (extent.x * extent.y * extent.z * extent.w)));
        let Some(Cut { axis, at, low }) = open.empty_side().or_else(|| open.halves()) else { return number };

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

    /// Density at `point`; its mean over the cube is 1.
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

    /// A point drawn with this density: `which` in 0…1 chooses the box, `place` the point in it. And the density there.
    pub fn draw(&self, mut which: f32, place: Vec4) -> (Vec4, f32) {
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
    /// The largest side without samples, if that is large.
    fn empty_side(&self) -> Option<Cut> {
        let Self { samples, low, high, .. } = self;
        let (mut least, mut most) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
        for (point, _) in samples {
            (least, most) = (least.min(*point), most.max(*point));
        }
        let margin = ((most - least) * MARGIN.max(2.0 / samples.len() as f32)).max(Vec4::splat(NARROW));
        let (least, most) = (least - margin, most + margin);
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

    /// The halving that makes the density most uneven:  gain = Σ s ln(s / v) over both parts, with shares s of the weight and v of
    /// the volume.
    fn halves(&self) -> Option<Cut> {
        let Self { samples, low, high, .. } = self;
        let count = samples.len();
        let total: f64 = samples.iter().map(|(_, weight)| weight).sum();
        if count < 2 * LEAF || total <= 0.0 {
            return None;
        }
        let (mut most, mut best) = (LEAST_GAIN, None);
        for axis in 0..4 {
            // Half of the weight lies below the cut, or about half: samples are not cut through.
            let mut sorted: Vec<(f32, f64)> = samples.iter().map(|(point, weight)| (point[axis], *weight)).collect();
            sorted.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            let (mut below, mut number) = (0.0, 0);
            while number < count - LEAF && (number < LEAF || below < total / 2.0) {
                below += sorted[number].1;
                number += 1;
            }
            let at = (sorted[number - 1].0 + sorted[number].0) / 2.0;
            let (extent, share) = (high[axis] - low[axis], (below / total) as f32);
            let volume = (at - low[axis]) / extent;
            let parts = sorted[number - 1].0 < at && at <= sorted[number].0;
            if !parts || extent < NARROW || !(0.0..1.0).contains(&share) || !(0.0..1.0).contains(&volume) {
                continue;
            }
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

    /// Half of the samples lie in a corner of a ten-thousandth of the cube.
    fn crowded() -> Boxes {
        let samples = (0..2000).map(|k| (random(k) * if k % 2 == 0 { 1.0 } else { 0.1 }, 1.0));
        Boxes::around(samples.collect()).unwrap()
    }

    #[test]
    fn densities_sum_to_one_and_are_those_of_the_draws() {
        let boxes = crowded();
        // ∫ f dx = E[f / p] for points drawn with density p; f = 1, and f = x₀.
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
