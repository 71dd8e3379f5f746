//! The lightcut: refines the worst cluster until all bounds are below the threshold \[Walter05, section 4\].
//!
//! # Differences from the paper
//!
//! * With an absolute threshold, the order of refinement has no effect: a node is refined if its bound and the bounds
//!   of all its ancestors exceed the threshold. The tree is therefore [walked](walk) with bounds only, four nodes at a
//!   time, without a heap. The representatives of the lightcut are evaluated afterwards, once each and four at a time.
//!   Lightcuts that would exceed the maximum size, and lightcuts with relative thresholds, are refined [best
//!   first](best_first) as in the paper.
//! * A cluster with a bound of exactly zero contributes nothing. It is dropped: it gets no estimate and no shadow ray,
//!   and does not count in the size. In [walked](walk) lightcuts this applies to single lights too.
//! * A cluster is estimated with [both of its halves](halves) and one shadow ray. Kept clusters use the paper's
//!   estimate with one representative.
//! * Neighboring receivers can [share](bundle) most of their walks.

mod best_first;
mod bundle;
mod evaluate;
mod group;
mod halves;
mod walk;

use glam::{Vec3, Vec4};

use crate::error_bound::{ClusterBounds, error_bound};
use crate::light::Light;
use crate::receiver::Receiver;
use crate::tree::LightTree;
use best_first::Refined;
use bundle::Shared;
pub use evaluate::ShadowRay;
pub use group::Receivers;

/// Maximum lightcut size in \[Walter05\].
const PAPER_MAX_SIZE: u32 = 1000;

/// Stopping rule of a lightcut. Each lightcut also ends at the maximum size of its [`Scratch`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Stop {
    /// Absolute limit of each cluster's error, as luminance \[W·m⁻²·sr⁻¹\]. With 0 the lightcut contains every light.
    Absolute(f32),
    /// Limit of each cluster's error as a fraction of the pixel's luminance, as in the paper.
    Relative {
        /// Maximum error of a cluster as a fraction of the luminance, 0.02 in the paper.
        fraction: f32,
        /// Luminance of the pixel from other sources \[W·m⁻²·sr⁻¹\]. It is added to the luminance of the lightcut.
        known_luminance: f32,
    },
}

impl Stop {
    /// Returns the error limit of a cluster for a lightcut with this `luminance` \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn threshold_at(self, luminance: f32) -> f32 {
        match self {
            Self::Absolute(threshold) => threshold,
            Self::Relative { fraction, known_luminance } => fraction * (known_luminance + luminance),
        }
    }

    /// Returns the same rule with the threshold multiplied by `factor`.
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

/// Result of a lightcut at one receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Lightcut {
    /// Reflected radiance, linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Vec3,
    /// Number of clusters in the lightcut, including single lights and excluding clusters that provably contribute
    /// nothing. At most the maximum of the [`Scratch`], plus one if the tree has both directional and other lights.
    pub size: u32,
    /// Number of calls of `visible`, at most one per light. A lightcut with an absolute threshold traces rays only for
    /// its own clusters. A lightcut with a relative threshold, or with the maximum size, also traces rays for clusters
    /// that it later refines.
    pub shadow_rays: u32,
    /// Largest error bound of a cluster in the lightcut, as luminance \[W·m⁻²·sr⁻¹\].
    pub largest_bound: f32,
    /// Sum of all error bounds \[W·m⁻²·sr⁻¹\]. It is the maximum difference between the luminance of `radiance` and the
    /// luminance of the sum over all lights.
    pub total_bound: f32,
    /// Number of nodes visited to compute a bound or an estimate.
    pub nodes_visited: u32,
}

/// Cluster of a lightcut. It remains valid after the lightcut, because positions in a tree never change and intensities
/// are updated in place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Cluster {
    pub(crate) node: u32,
    /// Index of the light that represented the cluster.
    pub light: u32,
}

/// Kept cluster of a lightcut, with its light transport.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct KeptCluster {
    /// Cluster of the lightcut.
    pub cluster: Cluster,
    /// M · G · V of the cluster's representative: radiance per intensity \[m⁻²\], zero if the light is occluded. The
    /// radiance of the lightcut is the sum of `transport` times [`LightTree::cluster_intensity`].
    pub transport: Vec3,
}

/// Reusable memory for lightcuts, one per thread.
#[derive(Clone, Debug)]
pub struct Scratch {
    max_size: u32,
    /// First children of the nodes to refine, in order of refinement.
    pending: Vec<u32>,
    /// Nodes in the lightcut: `selected_count` entries, and room for the largest lightcut.
    selected: Vec<u32>,
    selected_count: usize,
    /// Number of selected nodes that are not single lights.
    inner_count: usize,
    /// Shadow rays: `ray_count` entries, and room for the largest lightcut.
    rays: Vec<ShadowRay>,
    ray_count: usize,
    /// Unoccluded radiance of each of the `rays`. The fourth component is nonzero.
    radiance: Vec<Vec4>,
    /// M · G of the light of each of the `rays`, and the node of the light, for kept clusters. The fourth component is
    /// unused.
    terms: Vec<(Vec4, u32)>,
    /// Clusters of the last kept lightcut.
    pub(crate) kept: Vec<KeptCluster>,
    refined: Refined,
    shared: Shared,
}

impl Default for Scratch {
    /// Creates scratch memory for lightcuts of at most 1000 clusters, as in the paper.
    fn default() -> Self {
        Self::with_max_size(PAPER_MAX_SIZE)
    }
}

impl Scratch {
    /// Allocates memory for lightcuts of at most `max_size` clusters, at least one.
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

    /// Maximum lightcut size \[clusters\].
    #[must_use]
    pub fn max_size(&self) -> u32 {
        self.max_size
    }
}

impl LightTree {
    /// Returns the light reflected at a receiver from all lights of the tree, with the accuracy demanded by `stop`.
    ///
    /// `visible(light, index)` traces the shadow ray between the receiver's position and the light. It is called only
    /// for lights that contribute if visible. The result depends only on the arguments. After the first lightcut of
    /// this tree with the same scratch, no memory is allocated.
    pub fn lightcut<R: Receiver>(
        &self,
        receiver: &R,
        stop: Stop,
        mut visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) -> Lightcut {
        // A tree without lights has no root.
        if self.nodes.is_empty() {
            return Lightcut::default();
        }
        // A fixed threshold needs no order of refinement, so a queue replaces the heap.
        if let Stop::Absolute(threshold) = stop
            && let Some(cut) = self.walk(receiver, threshold, scratch)
        {
            return self.evaluate_halves(receiver, visible, scratch, cut);
        }
        // Refine the largest bound first if the threshold is relative or the walk exceeded its limits.
        let threshold = |estimate: f32| match stop {
            Stop::Absolute(threshold) => threshold,
            Stop::Relative { fraction, known_luminance } => fraction * (known_luminance + estimate),
        };
        self.best_first::<false, R>(receiver, threshold, &mut visible, scratch)
    }

    /// Computes a [`LightTree::lightcut`] and stores its clusters in [`Scratch::kept`], for summation with other
    /// intensities.
    ///
    /// The estimate follows the paper, with one representative per cluster. `lightcut` uses both halves of a cluster
    /// and has a smaller error.
    pub fn lightcut_kept<R: Receiver>(
        &self,
        receiver: &R,
        stop: Stop,
        mut visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) -> Lightcut {
        scratch.kept.clear();
        match stop {
            _ if self.nodes.is_empty() => Lightcut::default(),
            Stop::Absolute(threshold) => match self.walk(receiver, threshold, scratch) {
                Some(cut) => self.evaluate(receiver, visible, scratch, cut),
                // Spend a limited size on the largest bounds.
                None => self.best_first::<true, R>(receiver, |_| threshold, &mut visible, scratch),
            },
            Stop::Relative { fraction, known_luminance } => {
                let threshold = |estimate: f32| fraction * (known_luminance + estimate);
                self.best_first::<true, R>(receiver, threshold, &mut visible, scratch)
            }
        }
    }

    /// Returns whether the cluster's node and representative exist in this tree.
    #[must_use]
    pub fn may_hold(&self, cluster: Cluster) -> bool {
        (cluster.node as usize) < self.nodes.len() && (cluster.light as usize) < self.lights().len()
    }

    /// Root clusters, which together contain all lights: none, one, or two if directional lights have a separate tree.
    pub fn root_clusters(&self) -> impl Iterator<Item = Cluster> {
        self.roots().map(|node| self.cluster(node))
    }

    /// Returns the two children of a cluster, or `None` for a single light.
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    #[must_use]
    pub fn children(&self, cluster: Cluster) -> Option<[Cluster; 2]> {
        let node = &self.nodes[cluster.node as usize];
        (!node.is_leaf()).then(|| [0, 1].map(|k| self.cluster(node.children() + k)))
    }

    /// Returns the cluster of a node, with its current representative.
    fn cluster(&self, node: usize) -> Cluster {
        Cluster { node: node as u32, light: self.nodes[node].representative }
    }

    /// Returns the current intensity of a cluster \[W·sr⁻¹\]. It includes each later [`update`](LightTree::update).
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    #[inline]
    #[must_use]
    pub fn cluster_intensity(&self, cluster: Cluster) -> Vec3 {
        self.nodes[cluster.node as usize].intensity
    }

    /// Returns the cluster with another representative, drawn in proportion to luminance. The draw depends only on the
    /// tree, the cluster and `seed`.
    ///
    /// Lightcuts of one tree share their representatives and therefore have correlated errors. Receivers with separate
    /// draws have independent errors.
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    #[must_use]
    pub fn redrawn(&self, cluster: Cluster, seed: u64) -> Cluster {
        Cluster { light: self.draws.light(cluster.node, seed), ..cluster }
    }

    /// Returns the indices of the lights of a cluster.
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
                // Push the first child last, so that its lights are listed first.
                below.extend([first + 1, first]);
            }
        }
        lights
    }

    /// Returns the error bound of a cluster's estimate at a receiver, as luminance \[W·m⁻²·sr⁻¹\]. It is zero for a
    /// single light.
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

/// Returns up to four entries, filled up by repeating the last one.
#[inline(always)]
fn padded(four: &[u32]) -> [u32; 4] {
    std::array::from_fn(|k| four[k.min(four.len() - 1)])
}

/// Returns the bit mask of the lanes that [`padded`] fills up.
#[inline(always)]
fn missing(four: &[u32]) -> u32 {
    0b1111 << four.len() & 0b1111
}

#[cfg(test)]
mod tests;
