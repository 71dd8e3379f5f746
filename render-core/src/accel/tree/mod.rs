//! A tree of boxes, eight to a node, and the way of one ray through it.
//!
//! The boxes of a node lie side by side, so that a ray meets all eight at once (Wald, Benthin & Boulos 2008).
//!
//! # What makes every walk find the same
//!
//! A walk alone, one in a packet, and one without vector instructions visit boxes in different orders, and skip what
//! lies beyond the nearest hit so far. They agree to the last bit because (a) a ray enters a box no later than any
//! box within it: subtracting, multiplying, minimum and maximum keep order when they round; (b) a hit counts as no
//! nearer than its leaf's box is entered; (c) of equally near hits the one of the lower index wins; (d) where others lie
//! within roundings, [`super::ties`] chooses among all of them, in no order of visits.

mod build;

pub(super) use build::Costs;

use super::ray::Ray;
use lanes::{LANES, Lanes};

/// Eight boxes and what is in them.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct WideNode {
    /// Least x, y, z and greatest x, y, z. An empty place has least = ∞ and greatest = −∞, which no ray meets.
    pub(super) planes: [[f32; LANES]; 6],
    pub(super) children: [Child; LANES],
}

/// A node, or a leaf and what its owner keeps there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Child(u32);

/// [`Child`] taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ChildKind {
    /// Index of a node.
    Node(usize),
    /// Content that the owner of the tree gave.
    Leaf(u32),
}

impl Child {
    const LEAF: u32 = 1 << 31;

    #[inline(always)]
    pub(super) fn kind(self) -> ChildKind {
        if self.0 & Self::LEAF == 0 { ChildKind::Node(self.0 as usize) } else { ChildKind::Leaf(self.0 & !Self::LEAF) }
    }
}

/// The tree. The first node is its root.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub(super) nodes: Vec<WideNode>,
}

/// As many entries as a [`Stack`] has room for without an allocation.
const COMMON: usize = 32;

/// Where walks keep what they have yet to visit: nearly always short, and never too short.
pub(super) struct Stack<T> {
    entries: [T; COMMON],
    length: usize,
    /// Trees as deep as this needs come from scenes made to be hostile.
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

/// The boxes among `bits` with the way to each, farthest first: a distance that is no less than 0 orders as its bits do.
#[inline(always)]
pub(super) fn farthest_first(mut bits: u32, near: &[f32; LANES]) -> ([u64; LANES], usize) {
    let (mut keys, mut count) = ([0u64; LANES], 0);
    while bits != 0 {
        let lane = bits.trailing_zeros() as usize & (LANES - 1);
        bits &= bits - 1;
        let key = u64::from(near[lane].to_bits()) << 32 | lane as u64;
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

/// A visitor of the leaves of a [`Tree::walk`].
pub(super) trait Visit {
    /// Is given a leaf, the way to its box and the limit; answers with the limit from there on. A negative one ends
    /// the walk.
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, near: f32, limit: f32) -> f32;
}

impl WideNode {
    /// The planes of the eight boxes that a ray meets first, and those that it meets last.
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
    /// Takes the ray to every leaf whose box it enters within `limit`, the nearer ones first.
    #[inline(always)]
    pub(super) fn walk<L: Lanes>(&self, lanes: L, ray: &Ray, mut limit: f32, visitor: &mut impl Visit) {
        let from = lanes.splat3(ray.origin.to_array());
        let inverse_near = lanes.splat3(ray.inverse_near);
        let inverse_far = lanes.splat3(ray.inverse_far);
        let mut stack = Stack::<(u32, Child)>::new();
        let mut at = 0;
        loop {
            let node = &self.nodes[at];
            let (near, far) = node.slabs(lanes, ray.near_plane);
            let near = lanes.greatest(lanes.mul3(lanes.sub3(near, from), inverse_near), lanes.splat(0.0));
            let far = lanes.least(lanes.mul3(lanes.sub3(far, from), inverse_far), lanes.splat(limit));
            let bits = lanes.bits(lanes.le(near, far));
            let near = lanes.store(near);
            let mut next = if bits == 0 {
                stack.pop()
            } else if bits & (bits - 1) == 0 {
                // Most often one box is left, and then there is nothing to sort.
                let lane = bits.trailing_zeros() as usize & (LANES - 1);
                Some((near[lane].to_bits(), node.children[lane]))
            } else if bits.count_ones() == 2 {
                // Nor much to sort of two.
                let entry = |lane: usize| (near[lane].to_bits(), node.children[lane]);
                let a = entry(bits.trailing_zeros() as usize & (LANES - 1));
                let b = entry((31 - bits.leading_zeros()) as usize & (LANES - 1));
                let a_first = a.0 <= b.0;
                stack.push(if a_first { b } else { a });
                Some(if a_first { a } else { b })
            } else {
                let (keys, count) = farthest_first(bits, &near);
                let entry = |key: u64| ((key >> 32) as u32, node.children[key as usize & (LANES - 1)]);
                for &key in &keys[..count - 1] {
                    stack.push(entry(key));
                }
                Some(entry(keys[count - 1]))
            };
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
