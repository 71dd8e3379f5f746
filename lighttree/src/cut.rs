//! The lightcut: refine the worst cluster until all are below the threshold \[Walter05, section 4\].
//!
//! # Differs from the paper
//!
//! * With an absolute threshold the order of refinement does not matter: a node is refined if its bound and those of
//!   all its ancestors exceed the threshold. So no heap is needed; the tree is [walked](walk) depth first by bounds
//!   alone, four nodes at a time, and only then are the chosen representatives evaluated, each once, four at a time.
//!   Cuts that would exceed the largest size, and relative thresholds, go [best first](best_first) as in the paper.
//! * A cluster whose bound is exactly zero contributes exactly nothing. It is dropped: no estimate, no shadow ray, no
//!   place in the size of the cut. In [walked](walk) cuts that holds for single lights too.
//! * A cluster is estimated by [both of its halves](halves), with one shadow ray. Clusters that are handed out to be
//!   kept are those of the paper, with one representative.
//! * Receivers close together can [share](bundle) most of their walk.

mod best_first;
mod bundle;
mod evaluate;
mod group;
mod halves;
mod walk;

use glam::{Vec3, Vec4};

use crate::error_bound::{ClusterBounds, error_bound};
use crate::light::{Light, luminance};
use crate::race::uniform;
use crate::receiver::Receiver;
use crate::tree::LightTree;
use best_first::Refined;
use bundle::Shared;
pub use evaluate::ShadowRay;
pub use group::Receivers;

/// Largest cut of \[Walter05\].
const PAPER_MAX_SIZE: u32 = 1000;

/// When a cut is fine enough. Either way it also ends at the largest size the [`Scratch`] allows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Stop {
    /// No cluster may be wrong by more than this luminance \[W·m⁻²·sr⁻¹\]; with 0 the cut holds every light.
    Absolute(f32),
    /// No cluster may be wrong by more than a fraction of the pixel's luminance: the paper's rule, with 2 %.
    Relative {
        /// Share of the luminance that a cluster may be wrong by; 0.02 in the paper.
        fraction: f32,
        /// Luminance already known to be at this pixel, to which the cut adds \[W·m⁻²·sr⁻¹\].
        known_luminance: f32,
    },
}

impl Stop {
    /// The most that a cluster may be wrong by where the cut finds a `luminance` \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn threshold_at(self, luminance: f32) -> f32 {
        match self {
            Self::Absolute(threshold) => threshold,
            Self::Relative { fraction, known_luminance } => fraction * (known_luminance + luminance),
        }
    }

    /// The same rule with `factor` times the threshold.
    #[must_use]
    pub fn scaled(self, factor: f32) -> Self {
        match self {
            Self::Absolute(threshold) => Self::Absolute(factor * threshold),
            Self::Relative { fraction, known_luminance } => {
                Self::Relative { fraction: factor * fraction, known_luminance }
            }
        }
    }
}

/// The result of a cut at one receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Cut {
    /// Reflected radiance, linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Vec3,
    /// Clusters in the cut, single lights included; those that provably contribute nothing are not counted.
    /// At most what the [`Scratch`] allows, and one more where a tree holds directional and other lights.
    pub size: u32,
    /// Calls of `visible`, at most one per light. An absolute cut traces rays for its own clusters only. A relative one, and
    /// one that reaches the largest size, also for clusters on its way that turn out dark and for halves it leaves again.
    pub shadow_rays: u32,
    /// Largest error bound of a cluster in the cut, as luminance \[W·m⁻²·sr⁻¹\].
    pub largest_bound: f32,
    /// Sum of all error bounds: the luminance of `radiance` is at most this far from the sum over every light.
    pub total_bound: f32,
    /// Nodes that were visited, for a bound or an estimate.
    pub nodes_visited: u32,
}

/// A cluster of a cut. It outlives the cut: positions in a tree never change, intensities come with each update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Cluster {
    pub(crate) node: u32,
    /// Index of the light that stood for the cluster.
    pub light: u32,
}

/// A cluster of a cut that was kept, with the transport of light from it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct KeptCluster {
    /// The cluster.
    pub cluster: Cluster,
    /// M · G · V of its representative: radiance per intensity \[m⁻²\], zero where the light is hidden. The cut's radiance
    /// is the sum of this times [`LightTree::cluster_intensity`].
    pub transport: Vec3,
}

/// Memory of a cut, kept by the caller from one to the next: one per thread.
#[derive(Clone, Debug)]
pub struct Scratch {
    max_size: u32,
    /// First children of the nodes that were to be refined, in the order of refinement.
    pending: Vec<u32>,
    /// Nodes in the cut, `selected_count` of them, and room for the largest.
    selected: Vec<u32>,
    selected_count: usize,
    /// How many of these are no single lights.
    inner_count: usize,
    /// Shadow rays, `ray_count` of them, and room for those of the largest cut.
    rays: Vec<ShadowRay>,
    ray_count: usize,
    /// Radiance that arrives by each of the `rays` if it is free; the fourth number is not zero.
    radiance: Vec<Vec4>,
    /// M · G of the light of each of the `rays`, where clusters are kept, and its node; the fourth number does not matter.
    terms: Vec<(Vec4, u32)>,
    /// Clusters of the last cut that kept them.
    pub(crate) kept: Vec<KeptCluster>,
    refined: Refined,
    shared: Shared,
}

impl Default for Scratch {
    /// Cuts of 1000 clusters at most, as in the paper.
    fn default() -> Self {
        Self::with_max_size(PAPER_MAX_SIZE)
    }
}

impl Scratch {
    /// Cuts of this many clusters at most (at least one); takes memory for as many.
    #[must_use]
    pub fn with_max_size(max_size: u32) -> Self {
        Self {
            max_size: max_size.max(1),
            pending: Vec::new(),
            selected: Vec::new(),
            selected_count: 0,
            inner_count: 0,
            rays: Vec::new(),
            ray_count: 0,
            radiance: Vec::new(),
            terms: Vec::new(),
            kept: Vec::new(),
            refined: Refined::default(),
            shared: Shared::default(),
        }
    }

    /// Clusters of the last [`LightTree::lightcut_kept`].
    #[must_use]
    pub fn kept(&self) -> &[KeptCluster] {
        &self.kept
    }

    /// The largest cut \[clusters\].
    #[must_use]
    pub fn max_size(&self) -> u32 {
        self.max_size
    }
}

impl LightTree {
    /// Light reflected at a receiver from all lights of the tree, to the accuracy that `stop` demands.
    ///
    /// `visible(light, index)` traces the shadow ray between the receiver's position and the light; it is called only for
    /// lights that would contribute. The result depends on its arguments alone. Nothing is allocated once the scratch
    /// has served a cut in this tree.
    pub fn lightcut<R: Receiver>(
        &self,
        receiver: &R,
        stop: Stop,
        mut visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) -> Cut {
        if self.nodes.is_empty() {
            return Cut::default();
        }
        if let Stop::Absolute(threshold) = stop
            && let Some(cut) = self.walk(receiver, threshold, scratch)
        {
            return self.evaluate_halves(receiver, visible, scratch, cut);
        }
        let threshold = |estimate: f32| match stop {
            Stop::Absolute(threshold) => threshold,
            Stop::Relative { fraction, known_luminance } => fraction * (known_luminance + estimate),
        };
        self.best_first::<false, R>(receiver, threshold, &mut visible, scratch)
    }

    /// [`LightTree::lightcut`] whose clusters are kept: [`Scratch::kept`] has them afterwards, so that they can be summed
    /// again with other intensities.
    ///
    /// The estimate is that of the paper, each cluster by its one representative. `lightcut` estimates by both halves of a
    /// cluster and is nearer to the truth.
    pub fn lightcut_kept<R: Receiver>(
        &self,
        receiver: &R,
        stop: Stop,
        mut visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) -> Cut {
        scratch.kept.clear();
        match stop {
            _ if self.nodes.is_empty() => Cut::default(),
            Stop::Absolute(threshold) => match self.walk(receiver, threshold, scratch) {
                Some(cut) => self.evaluate(receiver, visible, scratch, cut),
                None => self.best_first::<true, R>(receiver, |_| threshold, &mut visible, scratch),
            },
            Stop::Relative { fraction, known_luminance } => {
                let threshold = |estimate: f32| fraction * (known_luminance + estimate);
                self.best_first::<true, R>(receiver, threshold, &mut visible, scratch)
            }
        }
    }

    /// Whether a cluster may come from this tree: its node and its representative are there.
    #[must_use]
    pub fn may_hold(&self, cluster: Cluster) -> bool {
        (cluster.node as usize) < self.nodes.len() && (cluster.light as usize) < self.lights().len()
    }

    /// The clusters that together hold all lights: none, one, or two where directional lights have a tree of their own.
    pub fn root_clusters(&self) -> impl Iterator<Item = Cluster> {
        self.roots().map(|node| self.cluster(node))
    }

    /// The two halves of a cluster; `None` for a single light.
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    #[must_use]
    pub fn children(&self, cluster: Cluster) -> Option<[Cluster; 2]> {
        let node = &self.nodes[cluster.node as usize];
        (!node.is_leaf()).then(|| [0, 1].map(|k| self.cluster(node.children() + k)))
    }

    /// The cluster of a node, with its present representative.
    fn cluster(&self, node: usize) -> Cluster {
        Cluster { node: node as u32, light: self.nodes[node].representative }
    }

    /// Intensity that a cluster has now, after any [`update`](LightTree::update) since the cut that it comes from
    /// \[W·sr⁻¹\].
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    #[inline]
    #[must_use]
    pub fn cluster_intensity(&self, cluster: Cluster) -> Vec3 {
        self.nodes[cluster.node as usize].intensity
    }

    /// The cluster by another draw of its representative, in proportion to luminance as every draw: a function of the tree,
    /// the cluster and `seed`.
    ///
    /// Cuts of one tree share its draws, and with them their errors. Receivers that draw anew err apart.
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    #[must_use]
    pub fn drawn_anew(&self, cluster: Cluster, seed: u64) -> Cluster {
        let mut index = cluster.node as usize;
        let mut draw = uniform(seed, u64::from(cluster.node));
        while !self.nodes[index].is_leaf() {
            let first = self.nodes[index].children();
            let [a, b] = [first, first + 1].map(|child| f64::from(luminance(self.nodes[child].intensity)));
            // Without light in either child, both have the same chance.
            let share = if a + b > 0.0 { a / (a + b) } else { 0.5 };
            // The number is stretched again at each step.
            (index, draw) =
                if draw < share { (first, draw / share) } else { (first + 1, (draw - share) / (1.0 - share)) };
        }
        Cluster { light: self.nodes[index].representative, ..cluster }
    }

    /// The lights of a cluster.
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    #[must_use]
    pub fn cluster_lights(&self, cluster: Cluster) -> Vec<u32> {
        let (mut lights, mut below) = (Vec::new(), vec![cluster.node as usize]);
        while let Some(node) = below.pop() {
            if self.nodes[node].is_leaf() {
                lights.push(self.nodes[node].representative);
            } else {
                let first = self.nodes[node].children();
                below.extend([first + 1, first]);
            }
        }
        lights
    }

    /// How wrong the estimate of a cluster can be at a receiver \[W·m⁻²·sr⁻¹, as luminance\]: its error bound, which
    /// is zero for a single light.
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    pub fn cluster_bound<R: Receiver>(&self, receiver: &R, cluster: Cluster) -> f32 {
        let node = &self.nodes[cluster.node as usize];
        if node.is_leaf() {
            return 0.0;
        }
        error_bound(receiver, receiver.position().into(), &ClusterBounds::one(node), self.geometry_term_bound)
    }
}

/// Four of them, the last repeated.
#[inline(always)]
fn padded(four: &[u32]) -> [u32; 4] {
    std::array::from_fn(|k| four[k.min(four.len() - 1)])
}

/// Bits of the lanes of four that repeat another.
#[inline(always)]
fn missing(four: &[u32]) -> u32 {
    0b1111 << four.len() & 0b1111
}

#[cfg(test)]
mod tests;
