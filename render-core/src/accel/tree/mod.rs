//! A tree of boxes, eight to a node, and the way of one ray through it.
//!
//! The boxes of a node lie side by side, so that a ray meets all eight at once (Wald, Benthin & Boulos 2008).
//!
//! # What makes every walk find the same
//!
//! A walk alone, one in a packet, and one without vector instructions visit boxes in different orders, and skip what
//! lies behind the nearest hit so far. They agree to the last bit because (a) a ray enters a box no later than any
//! box within it: subtracting, multiplying, minimum and maximum keep order when they round; (b) a hit counts as no
//! nearer than its leaf's box is entered; (c) of equally near hits the one of the lower index wins.

mod build;

pub(super) use build::Costs;

use super::lanes::{LANES, Lanes};
use super::ray::Direction;
use glam::Vec3A;

/// Eight boxes and what is in them.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct Node {
    /// Least x, y, z and greatest x, y, z. An empty place has least = ∞ and greatest = −∞, which no ray meets.
    pub(super) planes: [[f32; LANES]; 6],
    pub(super) children: [Child; LANES],
}

/// A node, or a leaf and what its owner keeps there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Child(u32);

/// [`Child`] taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Index of a node.
    Node(usize),
    /// What the owner of the tree gave.
    Leaf(u32),
}

impl Child {
    const LEAF: u32 = 1 << 31;

    #[inline(always)]
    pub(super) fn kind(self) -> Kind {
        if self.0 & Self::LEAF == 0 { Kind::Node(self.0 as usize) } else { Kind::Leaf(self.0 & !Self::LEAF) }
    }
}

/// The tree. The first node is its root.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
}

/// As many entries as a [`Stack`] has room for without asking the system for memory.
const COMMON: usize = 96;

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

impl Tree {
    /// Takes the ray from `origin` to every leaf whose box it enters within `limit`, the nearer ones first.
    ///
    /// `leaf` is given the leaf, the way to its box and the limit, and answers with the limit from there on;
    /// a negative one ends the walk.
    #[inline(always)]
    pub(super) fn walk<L: Lanes>(
        &self,
        lanes: L,
        origin: Vec3A,
        direction: &Direction,
        mut limit: f32,
        mut leaf: impl FnMut(u32, f32, f32) -> f32,
    ) {
        let from = origin.to_array().map(|x| lanes.splat(x));
        let inverse = direction.inverse_near.map(|x| lanes.splat(x));
        let inverse_far = direction.inverse_far.map(|x| lanes.splat(x));
        let (nx, ny, nz) = (direction.near_plane[0], direction.near_plane[1], direction.near_plane[2]);
        let mut stack = Stack::<(u32, Child)>::new();
        let mut at = 0;
        loop {
            let node = &self.nodes[at];
            let way = |plane: usize, inverse: [L::F; 3]| {
                lanes.mul(lanes.sub(lanes.load(&node.planes[plane]), from[plane % 3]), inverse[plane % 3])
            };
            let near =
                lanes.max(lanes.max(way(nx, inverse), way(ny, inverse)), lanes.max(way(nz, inverse), lanes.splat(0.0)));
            let far = lanes.min(
                lanes.min(way((nx + 3) % 6, inverse_far), way((ny + 3) % 6, inverse_far)),
                lanes.min(way((nz + 3) % 6, inverse_far), lanes.splat(limit)),
            );
            let bits = lanes.bits(lanes.le(near, far));
            if bits != 0 {
                let (keys, count) = farthest_first(bits, &lanes.store(near));
                for key in &keys[..count] {
                    stack.push(((key >> 32) as u32, node.children[*key as usize & (LANES - 1)]));
                }
            }
            at = loop {
                let Some((near, child)) = stack.pop() else { return };
                let near = f32::from_bits(near);
                if near > limit {
                    continue;
                }
                match child.kind() {
                    Kind::Node(index) => break index,
                    Kind::Leaf(content) => {
                        limit = leaf(content, near, limit);
                        if limit < 0.0 {
                            return;
                        }
                    }
                }
            };
        }
    }
}
