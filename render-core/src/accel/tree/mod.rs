//! BVH with eight boxes per node, and the traversal by a single ray.
//!
//! The boxes of a node are stored next to each other. One step tests a ray against all eight (Wald, Benthin & Boulos
//! 2008).
//!
//! # Why all traversals return the same hit
//!
//! A single ray, a ray in a packet and a ray without vector instructions visit boxes in different orders. Each
//! traversal skips boxes beyond the nearest hit so far. The hits are bit-identical for four reasons:
//!
//! - A ray enters a box no later than any box inside it: subtraction, multiplication, minimum and maximum are monotonic
//!   under rounding.
//! - The distance of a hit is never less than the distance at which the ray enters the box of the leaf.
//! - Among equally near hits, the hit with the lower index wins.
//! - If the distances of other hits differ only by rounding, [`super::ties`] selects one hit by a rule independent of
//!   the order of visits.

mod build;

pub(super) use build::Costs;

use super::ray::Ray;
use lanes::{LANES, Lanes};

/// Tree node: eight boxes and their contents.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct WideNode {
    /// Minimum x, y, z and maximum x, y, z of each box. An empty slot has minimum ∞ and maximum −∞, so no ray hits it.
    pub(super) planes: [[f32; LANES]; 6],
    pub(super) children: [Child; LANES],
}

/// Index of a node, or the content of a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Child(u32);

/// Decoded [`Child`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ChildKind {
    /// Index of a node.
    Node(usize),
    /// Content assigned by the owner of the tree.
    Leaf(u32),
}

impl Child {
    const LEAF: u32 = 1 << 31;

    #[inline(always)]
    pub(super) fn kind(self) -> ChildKind {
        if self.0 & Self::LEAF == 0 { ChildKind::Node(self.0 as usize) } else { ChildKind::Leaf(self.0 & !Self::LEAF) }
    }
}

/// Tree with the root at node 0.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub(super) nodes: Vec<WideNode>,
}

/// Number of entries in a [`Stack`] before it allocates memory.
const COMMON: usize = 32;

/// Stack of unvisited boxes. It is nearly always short, and it grows if needed.
pub(super) struct Stack<T> {
    entries: [T; COMMON],
    length: usize,
    /// Overflow entries, which only trees of adversarial scenes need.
    spill: Vec<T>,
}

impl<T: Copy + Default> Stack<T> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { entries: [T::default(); COMMON], length: 0, spill: Vec::new() }
    }

    #[inline(always)]
    pub(super) fn push(&mut self, entry: T) {
        match self.entries.get_mut(self.length) {
            Some(place) => {
                *place = entry;
                self.length += 1;
            }
            None => self.spill.push(entry),
        }
    }

    #[inline(always)]
    pub(super) fn pop(&mut self) -> Option<T> {
        if self.length == COMMON
            && let Some(entry) = self.spill.pop()
        {
            return Some(entry);
        }
        self.length = self.length.checked_sub(1)?;
        self.entries.get(self.length).copied()
    }
}

/// Returns sort keys of the boxes in `bits`, farthest first, and the number of boxes. The bit patterns of nonnegative
/// distances are in the order of the distances.
#[inline(always)]
pub(super) fn farthest_first(mut bits: u32, near: &[f32; LANES]) -> ([u64; LANES], usize) {
    let (mut keys, mut count) = ([0u64; LANES], 0);
    while bits != 0 {
        let lane = bits.trailing_zeros() as usize & (LANES - 1);
        bits &= bits - 1;
        let key = u64::from(near[lane].to_bits()) << 32 | lane as u64;
        // Sort by insertion: a node has at most eight boxes.
        let mut place = count;
        while place > 0 && keys[place - 1] < key {
            keys[place] = keys[place - 1];
            place -= 1;
        }
        keys[place] = key;
        count += 1;
    }
    (keys, count)
}

/// Visitor of the leaves in [`Tree::walk`].
pub(super) trait Visit {
    /// Receives a leaf, the distance to its box and the current limit. Returns the new limit. A negative limit ends the
    /// traversal.
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, near: f32, limit: f32) -> f32;
}

impl WideNode {
    /// Returns the near and the far planes of the eight boxes. `near_plane` contains the indices of the planes that a
    /// ray crosses first.
    #[inline(always)]
    pub(super) fn slabs<L: Lanes>(&self, lanes: L, near_plane: [usize; 3]) -> ([L::F; 3], [L::F; 3]) {
        let [x, y, z] = near_plane;
        (
            lanes.load3([&self.planes[x], &self.planes[y], &self.planes[z]]),
            lanes.load3([&self.planes[(x + 3) % 6], &self.planes[(y + 3) % 6], &self.planes[(z + 3) % 6]]),
        )
    }
}

impl Tree {
    /// Visits every leaf with a box that the ray enters within `limit`, nearer leaves first.
    #[inline(always)]
    pub(super) fn walk<L: Lanes>(&self, lanes: L, ray: &Ray, mut limit: f32, visitor: &mut impl Visit) {
        let from = lanes.splat3(ray.origin.to_array());
        let inverse_near = lanes.splat3(ray.inverse_near);
        let inverse_far = lanes.splat3(ray.inverse_far);
        let mut stack = Stack::<(u32, Child)>::new();
        let mut at = 0;
        loop {
            // Test the ray against all eight boxes of the node.
            let node = &self.nodes[at];
            let (near, far) = node.slabs(lanes, ray.near_plane);
            let near = lanes.greatest(lanes.mul3(lanes.sub3(near, from), inverse_near), lanes.splat(0.0));
            let far = lanes.least(lanes.mul3(lanes.sub3(far, from), inverse_far), lanes.splat(limit));
            let bits = lanes.bits(lanes.le(near, far));
            let near = lanes.store(near);
            let mut next = if bits == 0 {
                stack.pop()
            } else if bits & (bits - 1) == 0 {
                // Skip sorting if only one box is hit, which is the usual case.
                let lane = bits.trailing_zeros() as usize & (LANES - 1);
                Some((near[lane].to_bits(), node.children[lane]))
            } else if bits.count_ones() == 2 {
                // Sort two boxes by one comparison.
                let entry = |lane: usize| (near[lane].to_bits(), node.children[lane]);
                let a = entry(bits.trailing_zeros() as usize & (LANES - 1));
                let b = entry((31 - bits.leading_zeros()) as usize & (LANES - 1));
                let a_first = a.0 <= b.0;
                stack.push(if a_first { b } else { a });
                Some(if a_first { a } else { b })
            } else {
                // Push all boxes but the nearest, farthest first.
                let (keys, count) = farthest_first(bits, &near);
                let entry = |key: u64| ((key >> 32) as u32, node.children[key as usize & (LANES - 1)]);
                for &key in &keys[..count - 1] {
                    stack.push(entry(key));
                }
                Some(entry(keys[count - 1]))
            };
            // Visit leaves until the next inner node within the limit.
            at = loop {
                let Some((near, child)) = next else { return };
                let near = f32::from_bits(near);
                if near <= limit {
                    match child.kind() {
                        ChildKind::Node(index) => break index,
                        ChildKind::Leaf(content) => {
                            limit = visitor.leaf(lanes, content, near, limit);
                            if limit < 0.0 {
                                return;
                            }
                        }
                    }
                }
                next = stack.pop();
            };
        }
    }
}
