//! Top-down clustering: recursively splits the lights where the cost is lowest.
//!
//! `[Conty18]` A. Conty Estévez, C. Kulla: Importance sampling of many lights with adaptive tree splitting. HPG 2018.
//!
//! ```text
//! cost of a split = I_a (α_a² + c² (1 − cos β_a)²) + I_b (α_b² + c² (1 − cos β_b)²)
//! ```
//!
//! Symbols and metric are defined in [bottom-up](super::agglomerate). Candidate splits are the borders between [`BINS`]
//! slabs along each coordinate of position and axis.
//!
//! # Differences from the paper
//!
//! \[Conty18\] weighs surface area and solid angle, for sampling. This builder uses the metric of Lightcuts and splits
//! axes like positions, as points in six dimensions. Cones of candidate splits are bounded by the box of their axes, at
//! the cost of six comparisons. The cones of the final tree are exact.

use glam::Vec3A;

use super::cluster::{Cluster, Kind, Metric};

/// Number of slabs along a coordinate.
const BINS: usize = 16;
/// Minimum size of subtrees built in parallel \[lights\]. Smaller subtrees would finish before another thread wakes.
const PARALLEL: usize = 4096;

/// A light during the partition.
#[derive(Clone, Copy)]
struct Item {
    position: Vec3A,
    /// Axis of the light, or zero for lights without an axis.
    axis: Vec3A,
    luminance: f32,
    id: u32,
}

/// Returns the merges of the tree, numbered from `first_merge`. Children precede their parents.
pub(super) fn divide(leaves: Vec<Cluster>, metric: &Metric, first_merge: u32) -> Vec<[u32; 2]> {
    let (mut omni, mut oriented): (Vec<Item>, Vec<Item>) = (Vec::new(), Vec::new());
    for leaf in &leaves {
        let item = Item { position: leaf.low, axis: Vec3A::ZERO, luminance: leaf.luminance, id: leaf.id };
        match leaf.kind {
            Kind::Oriented => oriented.push(Item { axis: leaf.axis, ..item }),
            Kind::Omni | Kind::Mixed => omni.push(item),
        }
    }
    let mut merges = vec![[0; 2]; leaves.len().saturating_sub(1)];
    if omni.is_empty() || oriented.is_empty() {
        let items = if omni.is_empty() { &mut oriented } else { &mut omni };
        split(items, &mut merges, first_merge, metric);
        return merges;
    }
    // A cluster with both omni and oriented lights has a cone of all directions and the largest cost. Split it first.
    let (of_omni, rest) = merges.split_at_mut(omni.len() - 1);
    let (of_oriented, last) = rest.split_at_mut(oriented.len() - 1);
    let a = split(&mut omni, of_omni, first_merge, metric);
    let b = split(&mut oriented, of_oriented, first_merge + of_omni.len() as u32, metric);
    last[0] = [a, b];
    merges
}

/// Splits the items and returns the number of the root of their tree. `merges` has one entry less than `items`. The
/// last entry is the root.
fn split(items: &mut [Item], merges: &mut [[u32; 2]], first_merge: u32, metric: &Metric) -> u32 {
    match items {
        [] => return u32::MAX,
        [item] => return item.id,
        _ => {}
    }
    let middle = partition(items, metric);
    let (left, right) = items.split_at_mut(middle);
    let root = first_merge + merges.len() as u32 - 1;
    let (below, last) = merges.split_at_mut(left.len() + right.len() - 2);
    let (of_left, of_right) = below.split_at_mut(left.len() - 1);
    let second = first_merge + of_left.len() as u32;
    let (large, first) = (left.len() + right.len() > PARALLEL, first_merge);
    last[0] = if large {
        let (a, b) = threads::join(|| split(left, of_left, first, metric), || split(right, of_right, second, metric));
        [a, b]
    } else {
        [split(left, of_left, first, metric), split(right, of_right, second, metric)]
    };
    root
}

/// Bounds and total luminance of a group of lights.
#[derive(Clone, Copy)]
struct LightGroup {
    low: Vec3A,
    high: Vec3A,
    axis_low: Vec3A,
    axis_high: Vec3A,
    luminance: f32,
    count: usize,
}

impl LightGroup {
    const EMPTY: Self = Self {
        low: Vec3A::INFINITY,
        high: Vec3A::NEG_INFINITY,
        axis_low: Vec3A::INFINITY,
        axis_high: Vec3A::NEG_INFINITY,
        luminance: 0.0,
        count: 0,
    };

    #[inline]
    fn add(&mut self, item: &Item) {
        self.low = self.low.min(item.position);
        self.high = self.high.max(item.position);
        self.axis_low = self.axis_low.min(item.axis);
        self.axis_high = self.axis_high.max(item.axis);
        self.luminance += item.luminance;
        self.count += 1;
    }

    fn union(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            axis_low: self.axis_low.min(other.axis_low),
            axis_high: self.axis_high.max(other.axis_high),
            luminance: self.luminance + other.luminance,
            count: self.count + other.count,
        }
    }

    /// Returns the cost of the group: I (α² + c² (1 − cos β)²).
    fn cost(&self, metric: &Metric) -> f32 {
        let diagonal2 = (self.high - self.low).length_squared();
        let spread = 1.0 - self.cone_cosine();
        self.luminance * (metric.coincidence2 + diagonal2 + metric.orientation2 * spread * spread)
    }

    /// Returns a lower bound of cos β, or 1 for lights without axes.
    ///
    /// Let m be the center of the box of axes and h its half diagonal. A unit axis a in the box satisfies |a − m| ≤ h,
    /// therefore a · m ≥ (1 + m² − h²)/2.
    fn cone_cosine(&self) -> f32 {
        let middle = 0.5 * (self.axis_low + self.axis_high);
        let half2 = 0.25 * (self.axis_high - self.axis_low).length_squared();
        let middle2 = middle.length_squared();
        if half2 == 0.0 {
            return 1.0;
        }
        if middle2 < 1e-12 {
            return -1.0;
        }
        ((1.0 + middle2 - half2) / (2.0 * middle2.sqrt())).clamp(-1.0, 1.0)
    }
}

/// Sorts the items into the two halves of the cheapest split. Returns the length of the first half, which is between 1
/// and `items.len() - 1`.
fn partition(items: &mut [Item], metric: &Metric) -> usize {
    let mut all = LightGroup::EMPTY;
    items.iter().for_each(|item| all.add(item));
    let mut best = (f32::INFINITY, 0, 0);
    let bins_in_use = BINS.min(2 * items.len());
    // Find the cheapest border between slabs along all six coordinates.
    for dimension in 0..6 {
        let (low, high) =
            (coordinate_of(all.low, all.axis_low, dimension), coordinate_of(all.high, all.axis_high, dimension));
        if high <= low {
            continue;
        }
        let bin_of = binning(low, high, dimension, bins_in_use);
        let mut bins = [LightGroup::EMPTY; BINS];
        for item in items.iter() {
            bins[bin_of(item)].add(item);
        }
        let mut above = [LightGroup::EMPTY; BINS];
        let mut sum = LightGroup::EMPTY;
        for k in (1..bins_in_use).rev() {
            sum = sum.union(&bins[k]);
            above[k] = sum;
        }
        let mut below = LightGroup::EMPTY;
        for k in 1..bins_in_use {
            below = below.union(&bins[k - 1]);
            if below.count == 0 || above[k].count == 0 {
                continue;
            }
            let cost = below.cost(metric) + above[k].cost(metric);
            if cost < best.0 {
                best = (cost, dimension, k);
            }
        }
    }
    let (cost, dimension, border) = best;
    // If all items coincide, or costs overflow `f32`, any split is equally good.
    if cost == f32::INFINITY {
        return items.len() / 2;
    }
    let (low, high) =
        (coordinate_of(all.low, all.axis_low, dimension), coordinate_of(all.high, all.axis_high, dimension));
    let bin_of = binning(low, high, dimension, bins_in_use);
    // Partition in place. The result does not depend on the number of threads.
    let mut middle = 0;
    for k in 0..items.len() {
        if bin_of(&items[k]) < border {
            items.swap(k, middle);
            middle += 1;
        }
    }
    middle
}

#[inline]
fn coordinate_of(position: Vec3A, axis: Vec3A, dimension: usize) -> f32 {
    if dimension < 3 { position[dimension] } else { axis[dimension - 3] }
}

/// Returns the function from an item to the index of its slab.
fn binning(low: f32, high: f32, dimension: usize, bins: usize) -> impl Fn(&Item) -> usize {
    let scale = bins as f32 / (high - low);
    move |item| {
        let x = coordinate_of(item.position, item.axis, dimension);
        // A scale that overflows may give NaN, which `as` converts to 0. The upper border belongs to the last slab.
        (((x - low) * scale) as usize).min(bins - 1)
    }
}
