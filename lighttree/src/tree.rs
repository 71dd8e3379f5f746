//! The tree: flat nodes, their lights, and what is stored once.

use glam::Vec3;

use crate::light::Light;
use crate::node::Node;
use crate::sites::Sites;

/// A binary tree over lights, each node a cluster with bounds, total intensity and one representative light
/// \[Walter05\].
///
/// Directional lights have a tree of their own, in their own space: the unit sphere. Where there are others too, the
/// root joins both trees and is itself no cluster.
///
/// Made by [`LightTree::build`], given new intensities by [`LightTree::update`], read by [`LightTree::lightcut`].
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "crate::store::Stored"))]
pub struct LightTree {
    pub(crate) nodes: Vec<Node>,
    pub(crate) lights: Vec<Light>,
    /// Sites of the representatives, which estimates read.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) sites: Sites,
    /// s² in G, see [`BuildParams`](crate::BuildParams).
    pub(crate) geometry_term_bound: f32,
    /// Cost of each node per luminance \[m²\]; it depends on positions and axes only.
    pub(crate) extents: Vec<f32>,
    pub(crate) depth: usize,
    /// Cost of the tree per total luminance when it was built; zero for a dark tree.
    pub(crate) cost_at_build: f64,
    /// Lights without a usable position or axis, which stay dark, in ascending order.
    pub(crate) misplaced: Vec<u32>,
    pub(crate) rejected: usize,
    /// Seed of the draws of representatives.
    pub(crate) seed: u64,
}

impl LightTree {
    /// The lights in the caller's order, with their present intensities and normalized axes.
    #[must_use]
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Number of lights.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether there is no light at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// Number of nodes on the longest way from root to leaf; 0 for the empty tree.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Whether the root joins a tree of directional lights and one of others, and is no cluster.
    #[inline]
    pub(crate) fn is_joint(&self) -> bool {
        self.nodes.len() > 2 && self.nodes[1].is_directional() != self.nodes[2].is_directional()
    }

    /// The nodes that cover all lights and are clusters: one, or two where the root is a joint; none without lights.
    #[inline]
    pub(crate) fn roots(&self) -> std::ops::Range<usize> {
        if self.is_joint() { 1..3 } else { 0..self.nodes.len().min(1) }
    }

    /// Four nodes. (Written out: a closure that can panic would stay a call.)
    #[inline(always)]
    pub(crate) fn four(&self, [a, b, c, d]: [usize; 4]) -> [&Node; 4] {
        [&self.nodes[a], &self.nodes[b], &self.nodes[c], &self.nodes[d]]
    }

    /// Sum of all intensities \[W·sr⁻¹; irradiances of directional lights are added as they are\].
    #[must_use]
    pub fn total_intensity(&self) -> Vec3 {
        self.nodes.first().map_or(Vec3::ZERO, |root| root.intensity)
    }

    /// s² \[m²\], which bounds the geometry term: see [`BuildParams`](crate::BuildParams).
    #[must_use]
    pub fn geometry_term_bound(&self) -> f32 {
        self.geometry_term_bound
    }

    /// How many lights came into [`LightTree::build`] with an unusable field and went into the tree without intensity.
    /// An [`update`](LightTree::update) can light those again whose intensity alone was at fault.
    #[must_use]
    pub fn rejected(&self) -> usize {
        self.rejected
    }
}
