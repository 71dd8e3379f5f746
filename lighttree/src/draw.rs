//! Random draws of a cluster's lights, in proportion to luminance.
//!
//! A draw descends from a cluster to a light. It needs the luminance and the children of each node on its way: 8 of the
//! 64 bytes of a [`Node`](crate::node::Node), and often from memory. The copies here fit in a processor's cache.

use crate::light::luminance;
use crate::node::Node;
use crate::race::uniform;

/// Luminance and children of all nodes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Draws {
    nodes: Vec<DrawNode>,
}

#[derive(Clone, Copy, Debug)]
struct DrawNode {
    luminance: f32,
    below: Below,
}

/// Index of a node's first child, or of a leaf's light.
#[derive(Clone, Copy, Debug)]
struct Below(u32);

impl Below {
    const LEAF: u32 = 1 << 31;

    fn of(node: &Node) -> Self {
        if node.is_leaf() { Self(Self::LEAF | node.representative) } else { Self(node.children() as u32) }
    }

    /// Returns the light of a leaf.
    #[inline]
    fn light(self) -> u32 {
        self.0 & !Self::LEAF
    }
}

impl Draws {
    /// Copies the luminance and the children of `nodes`. The tree must be valid before the first draw.
    pub fn new(nodes: &[Node]) -> Self {
        let copy = |node: &Node| DrawNode { luminance: luminance(node.intensity), below: Below::of(node) };
        Self { nodes: nodes.iter().map(copy).collect() }
    }

    /// Draws one light of `node`. The draw depends only on the tree, the node and `seed`.
    pub fn light(&self, node: u32, seed: u64) -> u32 {
        let DrawNode { luminance, below } = self.nodes[node as usize];
        let draw = uniform(seed, u64::from(node));
        if luminance > 0.0 { self.lit(below, draw * f64::from(luminance)) } else { self.dark(below, draw) }
    }

    /// Returns the light at `draw`, from 0 to the luminance of the lights below.
    fn lit(&self, mut below: Below, mut draw: f64) -> u32 {
        loop {
            let Some([a, b]) = self.children(below) else { return below.light() };
            // Rounding of sums may leave the draw beyond both children. A dark child is never chosen.
            let is_first = draw < f64::from(a.luminance) || b.luminance == 0.0;
            draw -= if is_first { 0.0 } else { f64::from(a.luminance) };
            below = if is_first { a.below } else { b.below };
        }
    }

    /// Returns the light at `draw`, 0…1, of a cluster without luminance: each child has a probability of ½.
    fn dark(&self, mut below: Below, mut draw: f64) -> u32 {
        loop {
            let Some([a, b]) = self.children(below) else { return below.light() };
            below = if draw < 0.5 { a.below } else { b.below };
            draw = (2.0 * draw).fract();
        }
    }

    /// Returns the children of a node; `None` for a leaf.
    #[inline]
    fn children(&self, below: Below) -> Option<[DrawNode; 2]> {
        let first = below.0 as usize;
        (below.0 & Below::LEAF == 0).then(|| [self.nodes[first], self.nodes[first + 1]])
    }
}
