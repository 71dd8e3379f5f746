//! Light tree: a flat array of nodes, the lights, and values of the whole tree.

use glam::Vec3;

use crate::draw::Draws;
use crate::light::Light;
use crate::node::Node;
use crate::sites::Sites;

/// Binary tree over lights. Each node is a cluster with bounds, total intensity and one representative light
/// \[Walter05\].
///
/// Directional lights have a separate tree over the unit sphere. If other lights exist too, the root joins both trees
/// and is not a cluster.
///
/// A tree is built by [`LightTree::build`], updated by [`LightTree::update`] and read by [`LightTree::lightcut`].
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "crate::store::Stored"))]
pub struct LightTree {
    pub(crate) nodes: Vec<Node>,
    pub(crate) lights: Vec<Light>,
    /// Positions and axes of the clusters' representatives, derived from `nodes` and `lights`.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) sites: Sites,
    /// Luminance and children of the nodes, derived from `nodes`.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) draws: Draws,
    /// s² of the geometry term G \[m²\], see [`BuildParams`](crate::BuildParams).
    pub(crate) geometry_term_bound: f32,
    /// Cost of each node per luminance \[m²\]. It depends only on positions and axes.
    pub(crate) extents: Vec<f32>,
    pub(crate) depth: usize,
    /// Cost of the tree per total luminance when it was built. It is zero for a dark tree.
    pub(crate) cost_at_build: f64,
    /// Indices of the lights without a usable position or axis, in ascending order. These lights stay dark.
    pub(crate) misplaced: Vec<u32>,
    pub(crate) rejected: usize,
    /// Seed for the draw of representatives.
    pub(crate) seed: u64,
}

impl LightTree {
    /// Lights in the caller's order, with their current intensities and normalized axes.
    #[must_use]
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Number of lights.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Returns whether the tree has no lights.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// Number of nodes on the longest path from root to leaf. It is 0 for the empty tree.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Returns whether the root joins a tree of directional lights with a tree of other lights. Such a root is not a
    /// cluster.
    #[inline]
    pub(crate) fn is_joint(&self) -> bool {
        self.nodes.len() > 2 && self.nodes[1].is_directional() != self.nodes[2].is_directional()
    }

    /// Returns the indices of the clusters that together contain all lights: none, one, or two if the root joins two
    /// trees.
    #[inline]
    pub(crate) fn roots(&self) -> std::ops::Range<usize> {
        if self.is_joint() { 1..3 } else { 0..self.nodes.len().min(1) }
    }

    /// Returns four nodes. The loop is unrolled by hand, because a closure that can panic is not inlined.
    #[inline(always)]
    pub(crate) fn four(&self, [a, b, c, d]: [usize; 4]) -> [&Node; 4] {
        [&self.nodes[a], &self.nodes[b], &self.nodes[c], &self.nodes[d]]
    }

    /// Sum of all intensities \[W·sr⁻¹\]. Irradiances of directional lights are added without conversion.
    #[must_use]
    pub fn total_intensity(&self) -> Vec3 {
        self.nodes.first().map_or(Vec3::ZERO, |root| root.intensity)
    }

    /// Parameter s² \[m²\], which limits the geometry term: see [`BuildParams`](crate::BuildParams).
    #[must_use]
    pub fn geometry_term_bound(&self) -> f32 {
        self.geometry_term_bound
    }

    /// Number of lights that [`LightTree::build`] made dark because a field was unusable. An
    /// [`update`](LightTree::update) can restore a light if only its intensity was unusable.
    #[must_use]
    pub fn rejected(&self) -> usize {
        self.rejected
    }
}
