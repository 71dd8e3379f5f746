//! Bottom-up greedy clustering: the two clusters whose union costs least become one, until one is left.
//!
//! `[Walter05]` B. Walter, S. Fernandez, A. Arbree, K. Bala, M. Donikian, D. P. Greenberg: Lightcuts: a scalable
//! approach to illumination. SIGGRAPH 2005, section 5.
//! `[Walter08]` B. Walter, K. Bala, M. Kulkarni, K. Pingali: Fast agglomerative clustering for rendering. RT 2008.
//!
//! ```text
//! cost = I · (α² + c² (1 − cos β)²)
//!   I  luminance of the cluster          α  diagonal of its box
//!   β  half-angle of its cone            c  diagonal of the scene
//! ```
//!
//! The cost of a union never falls when a part grows. So a cluster's nearest partner, once found, is a lower bound
//! for ever, and a heap of such bounds, corrected only when the partner is gone, gives the exact greedy order.
//!
//! # Differs from the papers
//!
//! * Omni and oriented lights share one tree. A cluster of both has a cone of all directions (β = 180°), the largest
//!   cost there is, so that they meet near the root; c is zero for clusters of omni lights alone.
//! * c is the diagonal of the oriented lights' box: a far dome of omni lights must not make orientation dear.
//! * I has a floor of [`LUMINANCE_FLOOR`] of the mean light, so that lights which are dark now still find sensible
//!   neighbours; α² has one of [`COINCIDENCE`]² of the scene's, so that coincident lights merge dimmest first, into
//!   a balanced tree. Neither touches intensities or representatives.
//! * The nearest-partner search uses a static median-split tree that is made anew each time the clusters have halved.

mod cluster;
mod nearest;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::{Vec3, Vec3A};

use crate::bounds::Cone;
use crate::light::{Emission, Fitness, Light, luminance};
use crate::tree::{LightTree, Node};
use cluster::{Cluster, Metric};
use nearest::Neighborhood;

/// Ours: smallest weight of a light in the cost, in mean lights.
const LUMINANCE_FLOOR: f32 = 1e-3;
/// Ours: smallest diagonal of a cluster in the cost, in scene diagonals.
const COINCIDENCE: f32 = 1e-6;
/// Ours: softening is at least this, so that G stays in the range of `f32` \[m²\].
const SMALLEST_SOFTENING2: f32 = 1e-12;

/// What a tree is built with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildParams {
    /// s² in G = cos θ / (r² + s²) \[m²\]: the squared radius of the disc that a light stands for, which is the lit
    /// area divided by π and the number of lights. Values below 1e-12 (and NaN) count as that.
    pub softening2: f32,
    /// Seed of the draw of representatives.
    pub seed: u64,
}

impl LightTree {
    /// Builds the tree over the lights; index k stays the name of light k in [`update`](LightTree::update) and in
    /// visibility queries.
    ///
    /// On one core 10 000 lights take some 40 ms, 100 000 some 0.6 s (`benches/cut.rs`), if they lie on surfaces;
    /// 150 000 without any order of positions and axes take more than 10 s.
    ///
    /// Lights with fields that are not finite, with negative intensity, without an axis, or beyond 10¹⁵ m or
    /// 10²⁵ W·sr⁻¹ get no intensity; [`LightTree::rejected`] counts them.
    ///
    /// The representative of a cluster is one child's, drawn with probability in proportion to the children's
    /// luminance: so each light of a cluster represents it in proportion to its own.
    ///
    /// # Panics
    ///
    /// If there are 2³¹ lights or more.
    pub fn build(lights: &[Light], params: BuildParams) -> Self {
        assert!(lights.len() < 1 << 31, "{} lights, expected fewer than 2^31", lights.len());
        let (lights, fitness): (Vec<_>, Vec<_>) = lights.iter().map(|light| light.accepted()).unzip();
        let misplaced = (0u32..).zip(&fitness).filter(|&(_, &f)| f == Fitness::Misplaced).map(|(k, _)| k).collect();
        let rejected = fitness.iter().filter(|&&f| f != Fitness::Good).count();
        let (metric, leaves) = leaf_clusters(&lights);
        let mut tree = Self {
            nodes: Vec::new(),
            extents: Vec::new(),
            lights,
            softening2: params.softening2.max(SMALLEST_SOFTENING2),
            depth: 0,
            cost_at_build: 0.0,
            misplaced,
            rejected,
            seed: params.seed,
        };
        tree.assemble(&agglomerate(leaves, &metric), &metric, params.seed);
        tree.cost_at_build = tree.relative_cost();
        tree
    }

    /// Lays the clusters out: parents first, pairs of children side by side, subtrees close together.
    /// Cluster k < n is light k, cluster n + k the k-th merge.
    fn assemble(&mut self, merges: &[[u32; 2]], metric: &Metric, seed: u64) {
        let leaf_count = self.lights.len();
        if leaf_count == 0 {
            return;
        }
        let blank = Node {
            low: Vec3::ZERO,
            representative_child: 0,
            high: Vec3::ZERO,
            representative: 0,
            axis: Vec3::Z,
            cone_cosine: 1.0,
            intensity: Vec3::ZERO,
            cone_sine: 0.0,
        };
        self.nodes = vec![blank; leaf_count + merges.len()];
        let mut stack = vec![(leaf_count + merges.len() - 1, 0, 1)];
        let mut next_pair = 1;
        while let Some((cluster, index, level)) = stack.pop() {
            self.depth = self.depth.max(level);
            if cluster < leaf_count {
                self.nodes[index].representative = cluster as u32;
            } else {
                self.nodes[index].representative_child = next_pair as u32;
                let [a, b] = merges[cluster - leaf_count];
                stack.push((b as usize, next_pair + 1, level + 1));
                stack.push((a as usize, next_pair, level + 1));
                next_pair += 2;
            }
        }
        self.fill(metric, seed);
    }

    /// Bounds, sums and representatives of all nodes, children first.
    fn fill(&mut self, metric: &Metric, seed: u64) {
        let count = self.nodes.len();
        let mut cones = vec![Cone::SPHERE; count];
        let mut leaf_counts = vec![1u32; count];
        let mut oriented = vec![false; count];
        self.extents = vec![0.0; count];
        for index in (0..count).rev() {
            let mut node = self.nodes[index];
            if node.is_leaf() {
                let light = &self.lights[node.representative as usize];
                (node.low, node.high, node.intensity) = (light.position, light.position, light.intensity);
                if let Emission::Cosine(axis) = light.emission {
                    cones[index] = Cone::ray(axis);
                    oriented[index] = true;
                }
                node.set_cone(cones[index]);
            } else {
                let first = node.children();
                let (a, b) = (&self.nodes[first], &self.nodes[first + 1]);
                node.low = a.low.min(b.low);
                node.high = a.high.max(b.high);
                node.intensity = a.intensity + b.intensity;
                cones[index] = cones[first].union(cones[first + 1]);
                leaf_counts[index] = leaf_counts[first] + leaf_counts[first + 1];
                oriented[index] = oriented[first] || oriented[first + 1];
                // Among dark lights each has the same chance.
                let weights = match [luminance(a.intensity), luminance(b.intensity)] {
                    [0.0, 0.0] => [leaf_counts[first] as f32, leaf_counts[first + 1] as f32],
                    weights => weights,
                };
                let draw = uniform(seed, index as u64) * (f64::from(weights[0]) + f64::from(weights[1]));
                let chosen = if draw < f64::from(weights[0]) { first } else { first + 1 };
                node.representative_child = chosen as u32;
                node.representative = self.nodes[chosen].representative;
                node.set_cone(cones[index]);
                let diagonal2 = (node.high - node.low).length_squared();
                let spread = if oriented[index] { 1.0 - node.cone_cosine } else { 0.0 };
                self.extents[index] = diagonal2 + metric.orientation2 * spread * spread;
            }
            self.nodes[index] = node;
        }
    }
}

/// One cluster per light, and the constants of the cost.
fn leaf_clusters(lights: &[Light]) -> (Metric, Vec<Cluster>) {
    let brightest = lights.iter().map(|light| luminance(light.intensity)).fold(0.0, f32::max);
    // Relative to the brightest, costs stay in the range of f32 whatever the unit of the scene.
    let relative = |light: &Light| if brightest > 0.0 { luminance(light.intensity) / brightest } else { 1.0 };
    let mean = lights.iter().map(|light| f64::from(relative(light))).sum::<f64>() / lights.len().max(1) as f64;
    let floor = LUMINANCE_FLOOR * mean as f32;
    let clusters =
        (0u32..).zip(lights).map(|(id, light)| Cluster::leaf(id, light, relative(light).max(floor))).collect();
    let scene2 = diagonal2(lights.iter());
    let metric = Metric {
        // A scene of one point has only orientation and luminance to go by.
        coincidence2: if scene2 > 0.0 { COINCIDENCE * COINCIDENCE * scene2 } else { 1.0 },
        orientation2: diagonal2(lights.iter().filter(|light| light.emission != Emission::Omni)),
    };
    (metric, clusters)
}

fn diagonal2<'a>(lights: impl Iterator<Item = &'a Light>) -> f32 {
    let empty = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (low, high) = lights.map(|light| Vec3A::from(light.position)).fold(empty, |(l, h), p| (l.min(p), h.max(p)));
    if low.cmple(high).all() { (high - low).length_squared() } else { 0.0 }
}

/// Merges until one cluster is left; the k-th merge makes cluster n + k. The exact greedy order, ties aside.
fn agglomerate(leaves: Vec<Cluster>, metric: &Metric) -> Vec<[u32; 2]> {
    let leaf_count = leaves.len();
    if leaf_count == 0 {
        return Vec::new();
    }
    let mut merges = Vec::with_capacity(leaf_count - 1);
    let mut cones: Vec<Cone> = leaves.iter().map(Cluster::leaf_cone).collect();
    let mut partner = vec![u32::MAX; 2 * leaf_count - 1];
    let mut neighborhood = Neighborhood::new(leaves, 2 * leaf_count - 1, metric);
    // Costs are not negative, so their bits sort as they do; the cluster's number breaks ties.
    let mut heap = BinaryHeap::with_capacity(leaf_count);
    let find = |id: u32, neighborhood: &Neighborhood, partner: &mut Vec<u32>| {
        let (cost, nearest) = neighborhood.nearest(id)?;
        partner[id as usize] = nearest;
        Some(Reverse(u64::from(cost.to_bits()) << 32 | u64::from(id)))
    };
    heap.extend((0..leaf_count as u32).filter_map(|id| find(id, &neighborhood, &mut partner)));
    while let Some(Reverse(key)) = heap.pop() {
        let id = key as u32;
        if !neighborhood.is_alive(id) {
            continue;
        }
        let nearest = partner[id as usize];
        if neighborhood.is_alive(nearest) {
            let merged = (leaf_count + merges.len()) as u32;
            let cone = cones[id as usize].union(cones[nearest as usize]);
            cones.push(cone);
            merges.push([id, nearest]);
            neighborhood.merge(id, nearest, merged, cone);
            if neighborhood.is_sparse() {
                neighborhood.rebuild();
            }
            heap.extend(find(merged, &neighborhood, &mut partner));
        } else {
            heap.extend(find(id, &neighborhood, &mut partner));
        }
    }
    merges
}

/// A number in 0 … 1 that depends on seed and counter alone (the finalizer of SplitMix64).
pub(crate) fn uniform(seed: u64, counter: u64) -> f64 {
    let mut z = seed.wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests;
