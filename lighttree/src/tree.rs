//! The tree: flat nodes of one cache line each, and the invariants between them.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::bounds::Cone;
use crate::light::{DIRECTIONAL, Emission, Light, StoredSite};
use crate::sites::Sites;

/// A cluster of lights, one cache line.
///
/// Node 0 is the root; the two children of a node lie side by side, at an odd index and the even one after it,
/// always behind their parent. So a pass over the array from its end sees children before parents.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
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
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(from = "Stored")]
pub struct LightTree {
    pub(crate) nodes: Vec<Node>,
    pub(crate) lights: Vec<Light>,
    /// What estimates read of the representatives.
    #[serde(skip)]
    pub(crate) sites: Sites,
    /// s² in G, see [`BuildParams`](crate::BuildParams).
    pub(crate) softening2: f32,
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

/// A tree as it is stored.
#[derive(Deserialize)]
struct Stored {
    nodes: Vec<Node>,
    lights: Vec<Light>,
    softening2: f32,
    extents: Vec<f32>,
    depth: usize,
    cost_at_build: f64,
    misplaced: Vec<u32>,
    rejected: usize,
    seed: u64,
}

impl From<Stored> for LightTree {
    fn from(stored: Stored) -> Self {
        let Stored { nodes, lights, softening2, extents, depth, cost_at_build, misplaced, rejected, seed } = stored;
        let sites = Sites::new(&nodes, &lights, seed);
        Self { nodes, lights, sites, softening2, extents, depth, cost_at_build, misplaced, rejected, seed }
    }
}

impl LightTree {
    /// The lights in the caller's order, with their present intensities and normalized axes.
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Number of lights.
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether there is no light at all.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// Number of nodes on the longest way from root to leaf; 0 for the empty tree.
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
    pub fn total_intensity(&self) -> Vec3 {
        self.nodes.first().map_or(Vec3::ZERO, |root| root.intensity)
    }

    /// Softening s² of the geometric term \[m²\].
    pub fn softening2(&self) -> f32 {
        self.softening2
    }

    /// How many lights came into [`LightTree::build`] with an unusable field and went into the tree without intensity.
    /// An [`update`](LightTree::update) can light those again whose intensity alone was at fault.
    pub fn rejected(&self) -> usize {
        self.rejected
    }

    /// Walks the whole tree and checks what everything else relies on: each light in one leaf; boxes, cones and sums
    /// cover the children's; the representative is the chosen child's. The message names the first node that fails.
    pub fn validate(&self) -> Result<(), String> {
        let expected = (2 * self.lights.len()).saturating_sub(1);
        if self.nodes.len() != expected {
            return Err(format!("{} nodes for {} lights, expected {expected}", self.nodes.len(), self.lights.len()));
        }
        if self.extents.len() != self.nodes.len() {
            return Err(format!("{} extents for {} nodes", self.extents.len(), self.nodes.len()));
        }
        if let Some(k) = self.misplaced.iter().find(|&&k| k as usize >= self.lights.len()) {
            return Err(format!("light {k} is misplaced, but there are {}", self.lights.len()));
        }
        let mut reached = vec![false; self.nodes.len()];
        let mut found = vec![false; self.lights.len()];
        let mut stack = if expected > 0 { vec![(0, 1)] } else { Vec::new() };
        let mut depth = 0;
        while let Some((index, level)) = stack.pop() {
            depth = depth.max(level);
            if std::mem::replace(&mut reached[index], true) {
                return Err(format!("node {index} has two parents"));
            }
            let node = &self.nodes[index];
            if node.is_leaf() {
                self.validate_leaf(index, &mut found)?;
                if *self.sites.of(index) != Sites::of_leaf(node, &self.lights, self.seed) {
                    return Err(format!("leaf {index} has the site {:?}", self.sites.of(index)));
                }
                continue;
            }
            let first = node.children();
            if first <= index || first + 1 >= self.nodes.len() {
                return Err(format!("node {index} has children at {first}"));
            }
            if node.representative_child as usize != first && node.representative_child as usize != first + 1 {
                return Err(format!("node {index} is represented by node {}, no child", node.representative_child));
            }
            let chosen = self.nodes[node.representative_child as usize].representative;
            if node.representative != chosen {
                return Err(format!("node {index} has representative {}, its child {chosen}", node.representative));
            }
            if self.sites.of(index) != self.sites.of(node.representative_child as usize) {
                return Err(format!("node {index} has the site {:?}, not its child's", self.sites.of(index)));
            }
            let sum = self.nodes[first].intensity + self.nodes[first + 1].intensity;
            if node.intensity != sum {
                return Err(format!("node {index} has intensity {}, its children {sum}", node.intensity));
            }
            for child in [first, first + 1] {
                if index == 0 && self.is_joint() {
                    stack.push((child, level + 1));
                    continue;
                }
                check_inside(node, &self.nodes[child]).map_err(|e| format!("node {index}, child {child}: {e}"))?;
                stack.push((child, level + 1));
            }
        }
        if depth != self.depth {
            return Err(format!("depth is {depth}, stored {}", self.depth));
        }
        Ok(())
    }

    fn validate_leaf(&self, index: usize, found: &mut [bool]) -> Result<(), String> {
        let node = &self.nodes[index];
        let light = self.lights.get(node.representative as usize).ok_or(format!("leaf {index} has no light"))?;
        if std::mem::replace(&mut found[node.representative as usize], true) {
            return Err(format!("light {} is in two leaves", node.representative));
        }
        let site = StoredSite::new(light);
        let cone_fits = match light.emission {
            Emission::Omni => node.cone_cosine == -1.0,
            Emission::Cosine(axis) => node.axis.dot(axis) > 1.0 - 1e-6 && node.cone_cosine == 1.0,
            Emission::Directional(_) => node.is_directional(),
        };
        if node.low != site.position || node.high != site.position || node.intensity != light.intensity || !cone_fits {
            return Err(format!("leaf {index} is {node:?}, its light {light:?}"));
        }
        Ok(())
    }
}

/// The child's box and cone lie in the parent's.
fn check_inside(parent: &Node, child: &Node) -> Result<(), String> {
    if parent.low.cmpgt(child.low).any() || parent.high.cmplt(child.high).any() {
        return Err(format!("box {}…{} in {}…{}", child.low, child.high, parent.low, parent.high));
    }
    if parent.is_directional() || child.is_directional() {
        let both = parent.is_directional() && child.is_directional();
        return if both { Ok(()) } else { Err("a directional cluster and one of other lights".into()) };
    }
    let angle = |node: &Node| f64::from(node.cone_sine).atan2(f64::from(node.cone_cosine));
    let between = parent.axis.as_dvec3().angle_between(child.axis.as_dvec3());
    // Axes and angles are rounded to f32 in the nodes.
    if parent.cone_cosine > -1.0 && between + angle(child) > angle(parent) + 1e-3 {
        return Err(format!("cone {} ± {} in {} ± {}", child.axis, angle(child), parent.axis, angle(parent)));
    }
    Ok(())
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
