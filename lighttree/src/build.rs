//! Tree construction: the clusters and their properties.
//!
//! Two builders choose the clusters, [bottom-up](agglomerate) and [top-down](top_down). They share the node layout, the
//! bounds, the sums and the draw of representatives.
//!
//! Directional lights have a separate tree over their directions. If other lights exist too, one more node joins both
//! trees.

mod agglomerate;
mod cluster;
mod nearest;
mod top_down;

use glam::Vec3A;

use crate::bounds::Cone;
use crate::draw::Draws;
use crate::light::{Emission, Fitness, Light, luminance};
use crate::node::Node;
use crate::race::arrivals;
use crate::sites::Sites;
use crate::tree::LightTree;
use agglomerate::on_threads;
use cluster::{Cluster, Metric};

/// Minimum luminance of a light in the cost, as a fraction of the mean luminance. It is not in the papers.
const LUMINANCE_FLOOR: f32 = 1e-3;
/// Minimum diagonal of a cluster in the cost, as a fraction of the scene's diagonal. It is not in the papers.
const COINCIDENCE: f32 = 1e-6;
/// Minimum s² \[m²\], which keeps G in the range of `f32`. It is not in the papers.
pub(crate) const SMALLEST_BOUND: f32 = 1e-12;

/// Loop of the searches of a build: `searches(count, search)` returns `search(0)` to `search(count - 1)` in order.
pub type SearchLoop<'a> = &'a dyn Fn(usize, &(dyn Fn(usize) -> u64 + Sync)) -> Vec<u64>;

/// Parameters of a build.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuildParams {
    /// s² in G = cos θ / (r² + s²) \[m²\], which limits the geometry term to 1/s². It is the squared radius of the disc
    /// that a light represents. NaN and values below 1e-12 are replaced by 1e-12.
    pub geometry_term_bound: f32,
    /// Seed for the draw of representatives, 0 by default.
    pub seed: u64,
}

impl BuildParams {
    /// Returns parameters for lights that represent equal fractions of a surface with this area \[m²\]: virtual lights,
    /// or samples of an area light. Each light counts as a disc of `area / lights`, so that s² = area / (π · lights).
    ///
    /// ```
    /// use lighttree::BuildParams;
    ///
    /// let room = BuildParams::for_area(94.0, 10_000).with_seed(7);
    /// assert!((room.geometry_term_bound - 0.00299).abs() < 1e-5);
    /// ```
    #[must_use]
    pub fn for_area(area: f32, lights: usize) -> Self {
        Self::bounded_by(area / (std::f32::consts::PI * lights.max(1) as f32))
    }

    /// Returns parameters with this `geometry_term_bound` \[m²\] and seed 0.
    #[must_use]
    pub const fn bounded_by(geometry_term_bound: f32) -> Self {
        Self { geometry_term_bound, seed: 0 }
    }

    /// Returns the same parameters with another seed.
    #[must_use]
    pub const fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }
}

/// Algorithm that chooses the clusters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Builder {
    /// Repeatedly joins the two clusters with the lowest cost until one cluster remains.
    BottomUp,
    /// Recursively splits the lights where the cost is lowest. It is many times faster than `BottomUp`.
    TopDown,
}

impl LightTree {
    /// Builds the tree over the lights, bottom-up. Light k has the index k in [`update`](LightTree::update) and in
    /// visibility queries.
    ///
    /// The intensity of a light becomes zero if a field is not finite, its intensity is negative, or it has no axis.
    /// The same applies to coordinates beyond 10¹⁵ m and intensities beyond 10²⁵ W·sr⁻¹. [`LightTree::rejected`] counts
    /// these lights.
    ///
    /// The representative of a cluster is one of its lights, drawn with probability proportional to luminance.
    ///
    /// # Panics
    ///
    /// If there are 2³¹ lights or more.
    #[must_use]
    pub fn build(lights: &[Light], params: BuildParams) -> Self {
        Self::build_by(Builder::BottomUp, lights, params)
    }

    /// Builds the same tree as [`LightTree::build`], with `searches` as the loop of its searches, such as a loop that
    /// several processes share.
    ///
    /// A build runs some dozens of such loops, one after the other. The results of a loop have the same bits in every
    /// process.
    ///
    /// ```
    /// use lighttree::{BuildParams, Emission, Light, LightTree};
    ///
    /// # use glam::Vec3;
    /// # let at = |k: i32| Light { position: Vec3::X * k as f32, emission: Emission::Omni, intensity: Vec3::ONE };
    /// let lights: Vec<Light> = (0..1000).map(at).collect();
    /// let params = BuildParams::for_area(94.0, lights.len());
    /// let tree = LightTree::build_with(&lights, params, &|count, search| (0..count).map(search).collect());
    /// assert!(tree.lights().len() == 1000 && tree.depth() == LightTree::build(&lights, params).depth());
    /// ```
    ///
    /// # Panics
    ///
    /// If there are 2³¹ lights or more, or a loop does not return `count` results of `search`.
    #[must_use]
    pub fn build_with(lights: &[Light], params: BuildParams, searches: SearchLoop) -> Self {
        Self::build_from(lights, params, |lights, metrics| merges(Builder::BottomUp, lights, metrics, searches))
    }

    /// Builds the tree like [`LightTree::build`], with the given builder. The tree does not depend on the number of
    /// threads.
    ///
    /// # Panics
    ///
    /// If there are 2³¹ lights or more.
    #[must_use]
    pub fn build_by(builder: Builder, lights: &[Light], params: BuildParams) -> Self {
        Self::build_from(lights, params, |lights, metrics| merges(builder, lights, metrics, &on_threads))
    }

    /// Builds the tree with the merges of a function.
    fn build_from(
        lights: &[Light],
        params: BuildParams,
        merges: impl FnOnce(&[Light], &Metrics) -> Vec<[u32; 2]>,
    ) -> Self {
        assert!(lights.len() < 1 << 31, "{} lights, expected fewer than 2^31", lights.len());
        let (lights, fitness): (Vec<_>, Vec<_>) = lights.iter().map(|light| light.accepted()).unzip();
        let mut misplaced = Vec::new();
        for (k, &fitness) in (0u32..).zip(&fitness) {
            if fitness == Fitness::Misplaced {
                misplaced.push(k);
            }
        }
        let rejected = fitness.iter().filter(|&&f| f != Fitness::Good).count();
        let metrics = Metrics::of(&lights);
        let merges = merges(&lights, &metrics);
        let mut tree = Self {
            nodes: Vec::new(),
            extents: Vec::new(),
            sites: Sites::default(),
            draws: Draws::default(),
            lights,
            geometry_term_bound: params.geometry_term_bound.max(SMALLEST_BOUND),
            depth: 0,
            cost_at_build: 0.0,
            misplaced,
            rejected,
            seed: params.seed,
        };
        tree.assemble(&merges, &metrics);
        tree.cost_at_build = tree.relative_cost();
        tree
    }

    /// Orders the nodes: parents first, siblings next to each other, subtrees close together. Cluster k < n is light k,
    /// and cluster n + k is the k-th merge.
    fn assemble(&mut self, merges: &[[u32; 2]], metrics: &Metrics) {
        let leaf_count = self.lights.len();
        if leaf_count == 0 {
            return;
        }
        self.nodes = vec![Node::BLANK; leaf_count + merges.len()];
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
        self.fill(metrics);
    }

    /// Computes bounds, sums and representatives of all nodes, children before parents.
    pub(crate) fn fill(&mut self, metrics: &Metrics) {
        let count = self.nodes.len();
        let arrivals = arrivals(self.seed, &self.lights);
        let joint = self.is_joint_by_lights();
        let mut cones = vec![Cone::SPHERE; count];
        let mut oriented = vec![false; count];
        self.extents = vec![0.0; count];
        // Children follow their parents, so the reverse order visits children first.
        for index in (0..count).rev() {
            let mut node = self.nodes[index];
            if node.is_leaf() {
                let light = &self.lights[node.representative as usize];
                node.set_light(light);
                if let Emission::Cosine(axis) = light.emission {
                    cones[index] = Cone::ray(axis);
                    oriented[index] = true;
                }
            } else {
                let first = node.children();
                let (a, b) = (&self.nodes[first], &self.nodes[first + 1]);
                node.low = a.low.min(b.low);
                node.high = a.high.max(b.high);
                node.intensity = a.intensity + b.intensity;
                // The child whose representative arrives earlier wins the race.
                let chosen = if arrivals[b.representative as usize] < arrivals[a.representative as usize] {
                    first + 1
                } else {
                    first
                };
                node.representative_child = chosen as u32;
                node.representative = self.nodes[chosen].representative;
                // Directional clusters have no cone. The node that joins both trees is not directional.
                let diagonal2 = (node.high - node.low).length_squared();
                if a.is_directional() && !(joint && index == 0) {
                    (node.axis, node.cone_cosine, node.cone_sine) = (a.axis, a.cone_cosine, a.cone_sine);
                    self.extents[index] = diagonal2 * metrics.unit_length2;
                } else {
                    cones[index] = cones[first].union(cones[first + 1]);
                    oriented[index] = oriented[first] || oriented[first + 1];
                    node.set_cone(cones[index]);
                    let spread = if oriented[index] { 1.0 - node.cone_cosine } else { 0.0 };
                    self.extents[index] = diagonal2 + metrics.points.orientation2 * spread * spread;
                }
            }
            self.nodes[index] = node;
        }
        self.sites = Sites::new(&self.nodes, &self.lights, self.seed);
        self.draws = Draws::new(&self.nodes);
    }

    fn is_joint_by_lights(&self) -> bool {
        let directional = self.lights.iter().filter(|light| is_directional(light)).count();
        directional > 0 && directional < self.lights.len()
    }
}

fn is_directional(light: &Light) -> bool {
    matches!(light.emission, Emission::Directional(_))
}

/// Constants of the cost functions: one metric for each tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Metrics {
    /// Metric for lights with a position.
    pub points: Metric,
    /// Metric for directional lights, on the unit sphere.
    pub directions: Metric,
    /// Squared length in the scene that equals a distance of 1 on the unit sphere \[m²\].
    unit_length2: f32,
}

impl Metrics {
    pub fn of(lights: &[Light]) -> Self {
        let placed = lights.iter().filter(|light| !is_directional(light));
        let scene2 = diagonal2(placed.clone());
        let points = Metric {
            // In a scene with a single light position, the cost depends only on orientation and luminance.
            coincidence2: if scene2 > 0.0 { COINCIDENCE * COINCIDENCE * scene2 } else { 1.0 },
            orientation2: diagonal2(placed.filter(|light| light.emission != Emission::Omni)),
        };
        let directions = Metric { coincidence2: COINCIDENCE * COINCIDENCE, orientation2: 0.0 };
        Self { points, directions, unit_length2: if scene2 > 0.0 { scene2 } else { 1.0 } }
    }
}

fn diagonal2<'a>(lights: impl Iterator<Item = &'a Light>) -> f32 {
    let empty = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (low, high) = lights.map(|light| Vec3A::from(light.position)).fold(empty, |(l, h), p| (l.min(p), h.max(p)));
    if low.cmple(high).all() { (high - low).length_squared() } else { 0.0 }
}

/// Returns the merges that form one tree. The k-th merge creates cluster n + k.
fn merges(builder: Builder, lights: &[Light], metrics: &Metrics, searches: SearchLoop) -> Vec<[u32; 2]> {
    let (far, near): (Vec<_>, Vec<_>) =
        leaf_clusters(lights).into_iter().partition(|leaf| is_directional(&lights[leaf.id as usize]));
    let mut merges = Vec::with_capacity(lights.len());
    let mut roots = Vec::new();
    for (leaves, metric) in [(near, &metrics.points), (far, &metrics.directions)] {
        let Some(only) = leaves.first().map(|leaf| leaf.id) else { continue };
        let next = (lights.len() + merges.len()) as u32;
        merges.extend(match builder {
            Builder::BottomUp => agglomerate::agglomerate(leaves, metric, next, searches),
            Builder::TopDown => top_down::divide(leaves, metric, next),
        });
        let end = (lights.len() + merges.len()) as u32;
        roots.push(if end == next { only } else { end - 1 });
    }
    if let [near, far] = roots[..] {
        merges.push([near, far]);
    }
    merges
}

/// Returns one cluster per light.
fn leaf_clusters(lights: &[Light]) -> Vec<Cluster> {
    let brightest = lights.iter().map(|light| luminance(light.intensity)).fold(0.0, f32::max);
    // With luminances relative to the brightest light, costs stay in the range of `f32` for any unit of the scene.
    let relative = |light: &Light| if brightest > 0.0 { luminance(light.intensity) / brightest } else { 1.0 };
    let mean = lights.iter().map(|light| f64::from(relative(light))).sum::<f64>() / lights.len().max(1) as f64;
    let floor = LUMINANCE_FLOOR * mean as f32;
    (0u32..).zip(lights).map(|(id, light)| Cluster::leaf(id, light, relative(light).max(floor))).collect()
}

#[cfg(test)]
mod tests;
