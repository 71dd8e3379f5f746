//! Traversal of a tree by a single ray.

use super::super::ray::Ray;
use super::{Child, ChildKind, Stack, Tree, WideNode, farthest_first};
use lanes::{LANES, Lanes};

/// Visitor of the leaves in [`Tree::walk`].
pub(in super::super) trait Visit {
    /// Receives a leaf, the distance to its box and the current limit. Returns the new limit. A negative limit ends the
    /// traversal.
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, near: f32, limit: f32) -> f32;
}

/// Visitor of the leaves in [`Tree::stops`].
pub(in super::super) trait VisitAny {
    /// Returns whether the leaf stops the ray.
    fn stops<L: Lanes>(&self, lanes: L, content: u32) -> bool;
}

/// Ray in all lanes.
struct Broadcast<L: Lanes> {
    lanes: L,
    near_plane: [usize; 3],
    origin: [L::F; 3],
    inverse_near: [L::F; 3],
    inverse_far: [L::F; 3],
}

impl<L: Lanes> Broadcast<L> {
    #[inline(always)]
    fn new(lanes: L, ray: &Ray) -> Self {
        Self {
            lanes,
            near_plane: ray.near_plane,
            origin: lanes.splat3(ray.origin.to_array()),
            inverse_near: lanes.splat3(ray.inverse_near),
            inverse_far: lanes.splat3(ray.inverse_far),
        }
    }

    /// Tests the ray against all eight boxes of a node. Returns the mask of the boxes that the ray enters within the
    /// distance `limit`, and the distances of all boxes, which are at least +0.
    #[inline(always)]
    fn meet(&self, node: &WideNode, limit: L::F) -> (u32, L::F) {
        let Self { lanes, near_plane, origin, inverse_near, inverse_far } = *self;
        let (near, far) = node.slabs(lanes, near_plane);
        let near = lanes.greatest(lanes.mul3(lanes.sub3(near, origin), inverse_near), lanes.splat(0.0));
        let far = lanes.least(lanes.mul3(lanes.sub3(far, origin), inverse_far), limit);
        (lanes.bits(lanes.le(near, far)), near)
    }
}

/// Unvisited box: the bit pattern of the distance to the box in the high half, and its content in the low half. The
/// bit patterns of distances from +0 are in the order of the distances.
#[derive(Clone, Copy, Default)]
struct Unvisited(u64);

impl Unvisited {
    #[inline(always)]
    fn new(near: f32, child: Child) -> Self {
        Self(u64::from(near.to_bits()) << 32 | u64::from(child.0))
    }

    #[inline(always)]
    fn near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn child(self) -> Child {
        Child(self.0 as u32)
    }
}

/// Returns two boxes, nearer first.
#[inline(always)]
fn ordered(a: Unvisited, b: Unvisited) -> [Unvisited; 2] {
    [Unvisited(a.0.min(b.0)), Unvisited(a.0.max(b.0))]
}

impl WideNode {
    /// Returns the nearest of the boxes in `bits`, and pushes the others, farthest first. `near` contains the distances
    /// of all boxes.
    #[inline(always)]
    fn entered(
        &self,
        bits: u32,
        near: &[f32; LANES],
        stack: &mut Stack<Unvisited>,
        top: &mut usize,
    ) -> Option<Unvisited> {
        if bits == 0 {
            return None;
        }
        let take = |left: &mut u32| {
            let lane = left.trailing_zeros() as usize & (LANES - 1);
            *left &= *left - 1;
            Unvisited::new(near[lane], self.children[lane])
        };
        // Sort few boxes by exchanges without branches, which would be mispredicted.
        let left = &mut { bits };
        let a = take(left);
        if *left == 0 {
            return Some(a);
        }
        let [a, b] = ordered(a, take(left));
        if *left == 0 {
            stack.push(top, b);
            return Some(a);
        }
        let c = take(left);
        if *left == 0 {
            let [b, c] = ordered(b, c);
            let [a, b] = ordered(a, b);
            stack.push(top, c);
            stack.push(top, b);
            return Some(a);
        }
        let d = take(left);
        if *left == 0 {
            let [c, d] = ordered(c, d);
            let [a, c] = ordered(a, c);
            let [b, d] = ordered(b, d);
            let [b, c] = ordered(b, c);
            stack.push(top, d);
            stack.push(top, c);
            stack.push(top, b);
            return Some(a);
        }
        let (keys, count) = farthest_first(bits, near);
        let entry =
            |key: u64| Unvisited::new(f32::from_bits((key >> 32) as u32), self.children[key as usize & (LANES - 1)]);
        for &key in &keys[..count - 1] {
            stack.push(top, entry(key));
        }
        Some(entry(keys[count - 1]))
    }
}

impl Tree {
    /// Visits every leaf with a box that the ray enters within `limit`, nearer leaves first.
    #[inline(always)]
    pub(in super::super) fn walk<L: Lanes>(&self, lanes: L, ray: &Ray, mut limit: f32, visitor: &mut impl Visit) {
        let ray = Broadcast::new(lanes, ray);
        let (mut stack, mut top, mut at) = (Stack::<Unvisited>::new(), 0, 0);
        loop {
            // Descend through inner nodes to the next leaf. This loop is apart from the leaves, which need the same
            // registers.
            let within = lanes.splat(limit);
            let mut next = loop {
                let node = &self.nodes[at];
                let (bits, near) = ray.meet(node, within);
                let next = match node.entered(bits, &lanes.store(near), &mut stack, &mut top) {
                    Some(nearest) => nearest,
                    None => match pop_within(&mut stack, &mut top, limit) {
                        Some(next) => next,
                        None => return,
                    },
                };
                match next.child().kind() {
                    ChildKind::Node(index) => at = index,
                    ChildKind::Leaf(_) => break next,
                }
            };
            // Visit leaves until the next inner node within the limit.
            at = loop {
                match next.child().kind() {
                    ChildKind::Node(index) => break index,
                    ChildKind::Leaf(content) => limit = visitor.leaf(lanes, content, next.near(), limit),
                }
                if limit < 0.0 {
                    return;
                }
                match pop_within(&mut stack, &mut top, limit) {
                    Some(popped) => next = popped,
                    None => return,
                }
            };
        }
    }

    /// Visits leaves with a box that the ray enters within `limit`, in any order, until a leaf stops the ray. Returns
    /// whether one did. Without distances and order, this is faster than [`Tree::walk`].
    #[inline(always)]
    pub(in super::super) fn stops<L: Lanes>(&self, lanes: L, ray: &Ray, limit: f32, visitor: &impl VisitAny) -> bool {
        let ray = Broadcast::new(lanes, ray);
        let (mut stack, mut top, mut at) = (Stack::<Child>::new(), 0, 0);
        let limit = lanes.splat(limit);
        loop {
            // Descend through inner nodes to the next leaf.
            let mut content = loop {
                let node = &self.nodes[at];
                let (mut bits, _) = ray.meet(node, limit);
                let next = if bits == 0 {
                    match stack.pop(&mut top) {
                        Some(next) => next,
                        None => return false,
                    }
                } else {
                    // Continue with the last box, and push the others.
                    loop {
                        let child = node.children[bits.trailing_zeros() as usize & (LANES - 1)];
                        bits &= bits - 1;
                        if bits == 0 {
                            break child;
                        }
                        stack.push(&mut top, child);
                    }
                };
                match next.kind() {
                    ChildKind::Node(index) => at = index,
                    ChildKind::Leaf(content) => break content,
                }
            };
            // Visit leaves until the next inner node.
            at = loop {
                if visitor.stops(lanes, content) {
                    return true;
                }
                match stack.pop(&mut top).map(Child::kind) {
                    Some(ChildKind::Node(index)) => break index,
                    Some(ChildKind::Leaf(next)) => content = next,
                    None => return false,
                }
            };
        }
    }
}

/// Returns the topmost box that the ray enters within `limit`, and drops all boxes above it.
#[inline(always)]
fn pop_within(stack: &mut Stack<Unvisited>, top: &mut usize, limit: f32) -> Option<Unvisited> {
    let last = Unvisited::new(limit, Child(u32::MAX));
    loop {
        let next = stack.pop(top)?;
        if next.0 <= last.0 {
            return Some(next);
        }
    }
}
