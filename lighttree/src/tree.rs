//! The tree: flat nodes of one cache line each, and the invariants between them.

use glam::Vec3;

use crate::bounds::Cone;
use crate::light::{DIRECTIONAL, Light, StoredSite};
use crate::sites::Sites;

/// A cluster of lights, one cache line.
///
/// Node 0 is the root; the two children of a node lie side by side, at an odd index and the even one after it,
/// always after their parent. So a pass over the array from its end sees children before parents.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Box of positions; of the unit directions to them for directional lights.
    pub low: Vec3,
    /// Index of the child that hands its representative up; 0 marks a leaf.
    pub representative_child: u32,
    pub high: Vec3,
    /// Index of the representative light; a leaf's only light.
    pub representative: u32,
    /// Cone of emission axes: axis, cosine and sine of its half-angle; the whole sphere has cosine −1, directional
    /// lights have [`DIRECTIONAL`].
    pub axis: Vec3,
    pub cone_cosine: f32,
    /// Sum of the lights' intensities.
    pub intensity: Vec3,
    pub cone_sine: f32,
}

impl Node {
    /// A leaf without a light.
    pub const BLANK: Self = Self {
        low: Vec3::ZERO,
        representative_child: 0,
        high: Vec3::ZERO,
        representative: 0,
        axis: Vec3::Z,
        cone_cosine: 1.0,
        intensity: Vec3::ZERO,
        cone_sine: 0.0,
    };

    #[inline]
    pub fn is_leaf(&self) -> bool {
        self.representative_child == 0
    }

    /// Index of the first child; the second follows it.
    #[inline]
    pub fn children(&self) -> usize {
        first_of_pair(self.representative_child as usize)
    }

    /// Whether its lights are directional ones.
    #[inline]
    pub fn is_directional(&self) -> bool {
        self.cone_cosine == DIRECTIONAL
    }

    /// Bounds of a single light.
    pub fn set_light(&mut self, light: &Light) {
        let site = StoredSite::new(light);
        (self.low, self.high, self.intensity) = (site.position, site.position, light.intensity);
        (self.axis, self.cone_cosine, self.cone_sine) = (site.axis, site.kind, 0.0);
    }

    pub fn set_cone(&mut self, cone: Cone) {
        let (sine, cosine) = cone.half_angle.sin_cos();
        self.axis = cone.axis.as_vec3();
        self.cone_cosine = if cone.half_angle >= std::f64::consts::PI { -1.0 } else { cosine as f32 };
        self.cone_sine = (sine as f32).max(0.0);
    }
}

/// First index of the pair that holds this child.
#[inline]
pub(crate) fn first_of_pair(child: usize) -> usize {
    (child - 1) | 1
}

/// The other child of the pair.
#[inline]
pub(crate) fn sibling(child: usize) -> usize {
    ((child - 1) ^ 1) + 1
}

/// A binary tree over lights, each node a cluster with bounds, total intensity and one representative light
/// \[Walter05\].
///
/// Directional lights have a tree of their own, in their own space: the unit sphere. Where there are others too, the
/// root joins both trees and is itself no cluster.
///
/// Made by [`LightTree::build`], given new intensities by [`LightTree::update`], read by [`LightTree::lightcut`].
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "Stored"))]
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
    /// Lights that are dark for ever, in ascending order: removed, or without a usable position or axis.
    pub(crate) misplaced: Vec<u32>,
    pub(crate) rejected: usize,
    /// Of the draws of representatives.
    pub(crate) seed: u64,
}

/// A tree as it is stored: nothing is checked yet.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
pub(crate) struct Stored {
    nodes: Vec<Node>,
    lights: Vec<Light>,
    geometry_term_bound: f32,
    extents: Vec<f32>,
    depth: usize,
    cost_at_build: f64,
    misplaced: Vec<u32>,
    rejected: usize,
    seed: u64,
}

#[cfg(feature = "serde")]
impl TryFrom<Stored> for LightTree {
    type Error = crate::InvalidTree;

    fn try_from(stored: Stored) -> Result<Self, crate::InvalidTree> {
        let Stored { nodes, lights, geometry_term_bound, extents, depth, cost_at_build, misplaced, rejected, seed } =
            stored;
        let sites = Sites::new(&nodes, &lights, seed);
        let tree = Self {
            nodes,
            lights,
            sites,
            geometry_term_bound,
            extents,
            depth,
            cost_at_build,
            misplaced,
            rejected,
            seed,
        };
        tree.validate()?;
        Ok(tree)
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_is_a_cache_line() {
        assert_eq!((size_of::<Node>(), align_of::<Node>()), (64, 64));
    }

    #[test]
    fn pairs() {
        assert_eq!([1, 2, 3, 4, 5].map(first_of_pair), [1, 1, 3, 3, 5]);
        assert_eq!([1, 2, 3, 4].map(sibling), [2, 1, 4, 3]);
    }
}
