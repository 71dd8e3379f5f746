//! BVH with eight boxes per node. The module `walk` traverses it with a single ray.
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
mod walk;

pub(super) use build::Costs;
pub(super) use walk::{Visit, VisitAny};

use lanes::{LANES, Lanes};

/// Tree node: eight boxes and their contents, in four cache lines.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
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

/// Stack of unvisited boxes. It is nearly always short, and it grows if needed. The caller has the number of its
/// entries in a variable `top`, which stays in a register.
pub(super) struct Stack<T> {
    entries: [T; COMMON],
    /// Overflow entries, which only trees of adversarial scenes need.
    spill: Vec<T>,
}

impl<T: Copy + Default> Stack<T> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { entries: [T::default(); COMMON], spill: Vec::new() }
    }

    #[inline(always)]
    pub(super) fn push(&mut self, top: &mut usize, entry: T) {
        match self.entries.get_mut(*top) {
            Some(place) => *place = entry,
            None => self.spill.push(entry),
        }
        *top += 1;
    }

    #[inline(always)]
    pub(super) fn pop(&mut self, top: &mut usize) -> Option<T> {
        *top = top.checked_sub(1)?;
        match self.entries.get(*top) {
            Some(&entry) => Some(entry),
            None => self.spill.pop(),
        }
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
