//! Where the representatives of clusters are, in the order of the nodes.
//!
//! An estimate reads the representatives of a cluster's two children. By light they would lie anywhere, each in a cache
//! line and a page of its own; here both are in one line, next to those of clusters nearby. (A cut over 150 000 lights
//! takes a tenth less time than with the sites in the order of the lights.)

use glam::Vec4;

use crate::light::{Light, Site, StoredSite};
use crate::node::Node;
use crate::race::delay;

/// The site of each node's representative.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sites {
    /// The first holds the root's alone, as its second.
    pairs: Vec<Pair>,
}

/// A cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Pair([StoredSite; 2]);

impl Sites {
    /// For nodes whose representatives are known. Nodes and lights may come from a file that is not checked yet:
    /// what points nowhere has its site nowhere.
    pub fn new(nodes: &[Node], lights: &[Light], seed: u64) -> Self {
        let mut sites = Self { pairs: vec![Pair([StoredSite::NOWHERE; 2]); nodes.len() / 2 + 1] };
        // Children lie after their parents.
        for (index, node) in nodes.iter().enumerate().rev() {
            if node.is_leaf() {
                *sites.slot(index) = Self::of_leaf(node, lights, seed);
            } else if (node.representative_child as usize) < nodes.len() {
                sites.inherit(index, node.representative_child as usize);
            }
        }
        sites
    }

    /// The site of a leaf's light.
    pub fn of_leaf(leaf: &Node, lights: &[Light], seed: u64) -> StoredSite {
        let light = lights.get(leaf.representative as usize);
        let delay = delay(seed, leaf.representative.into());
        light.map_or(StoredSite::NOWHERE, |light| StoredSite { delay, ..StoredSite::new(light) })
    }

    /// Gives a node its child's.
    #[inline]
    pub fn inherit(&mut self, node: usize, child: usize) {
        *self.slot(node) = *self.of(child);
    }

    #[inline(always)]
    pub fn of(&self, node: usize) -> &StoredSite {
        let (pair, which) = place(node);
        &self.pairs[pair].0[which]
    }

    /// Sites of four nodes, side by side.
    #[inline(always)]
    pub fn four(&self, [a, b, c, d]: [usize; 4]) -> Site<Vec4> {
        StoredSite::four([self.of(a), self.of(b), self.of(c), self.of(d)])
    }

    fn slot(&mut self, node: usize) -> &mut StoredSite {
        let (pair, which) = place(node);
        &mut self.pairs[pair].0[which]
    }
}

/// Pair of a node, and which of the pair it is. The children of a node are an odd index and the even one after it.
#[inline(always)]
fn place(node: usize) -> (usize, usize) {
    let slot = node + 1;
    (slot / 2, slot % 2)
}
