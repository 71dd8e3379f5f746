//! Clusters of a lightcut with an absolute threshold, found with bounds only, four nodes at a time.
//!
//! Two nodes to refine leave the queue together, and their four children are bounded together. The queue is first in,
//! first out. The next nodes are known long before they are needed, so the processor works on several groups of four at
//! once without speculation. With a stack, each group of four depends on the previous group. A version with a stack took
//! 1.5 times as long.

use glam::Vec4;

use super::{Lightcut, Scratch};
use crate::error_bound::{ClusterBounds, error_bound};
use crate::lanes::Vector3;
use crate::receiver::Receiver;
use crate::tree::LightTree;

/// Queue size: number of refined nodes per cluster of the largest lightcut. A lightcut without dark clusters refines
/// one node less than its number of clusters. If the queue is too small, best-first refinement replaces the walk.
const QUEUE_PER_CLUSTER: usize = 4;

impl LightTree {
    /// Collects the nodes of the lightcut in `scratch.selected`. Returns `None` if they exceed the maximum size.
    pub(super) fn walk<R: Receiver>(&self, receiver: &R, threshold: f32, scratch: &mut Scratch) -> Option<Lightcut> {
        let most = scratch.max_size as usize;
        let mut walk = Walk::new(self, receiver, threshold, scratch);
        walk.start_at(self.roots());
        walk.finish_walk(most).then(|| walk.finish())
    }
}

/// A walk in progress: nodes to refine, and the lightcut so far.
///
/// Branches decide where each node is stored. A branch-free version that writes each node to both queue and selection
/// took a third more time.
pub(super) struct Walk<'a, R> {
    tree: &'a LightTree,
    receiver: &'a R,
    position: Vector3<Vec4>,
    threshold: f32,
    /// First children of the nodes to refine.
    queue: &'a mut [u32],
    /// Index of the next node to leave the queue, and end of the queue.
    head: usize,
    tail: usize,
    selected: &'a mut [u32],
    selected_count: &'a mut usize,
    inner_count: &'a mut usize,
    pub cut: Lightcut,
}

impl<'a, R: Receiver> Walk<'a, R> {
    #[inline(always)]
    pub fn new(tree: &'a LightTree, receiver: &'a R, threshold: f32, scratch: &'a mut Scratch) -> Self {
        let Scratch { max_size, pending, selected, selected_count, inner_count, .. } = scratch;
        let most = *max_size as usize;
        // Grow the buffers on the first walk. Later walks reuse them.
        pending.resize(pending.len().max(QUEUE_PER_CLUSTER * (most + 8)), 0);
        selected.resize(selected.len().max(most + 8), 0);
        (*selected_count, *inner_count) = (0, 0);
        Self {
            tree,
            receiver,
            position: Vector3::splat(receiver.position()),
            threshold: threshold.max(0.0),
            queue: pending,
            head: 0,
            tail: 0,
            selected,
            selected_count,
            inner_count,
            cut: Lightcut::default(),
        }
    }

    /// Starts the walk with one or two nodes.
    #[inline(always)]
    pub fn start_at(&mut self, nodes: std::ops::Range<usize>) {
        let (first, last) = (nodes.start, nodes.end - 1);
        self.visit([first, last, first, first], nodes.len());
    }

    /// Starts with a node that must be refined. Returns whether the queue had room for it.
    #[inline(always)]
    pub fn refine(&mut self, node: u32) -> bool {
        let room = self.tail < self.queue.len();
        if room {
            self.queue[self.tail] = self.tree.nodes[node as usize].children() as u32;
            self.tail += 1;
        }
        room
    }

    /// Visits the first `count` of four nodes.
    #[inline(always)]
    fn visit(&mut self, indices: [usize; 4], count: usize) {
        let nodes = self.tree.four(indices);
        let geometry_term_bound = Vec4::splat(self.tree.geometry_term_bound);
        let bounds = error_bound(self.receiver, self.position, &ClusterBounds::four(nodes), geometry_term_bound);
        self.cut.nodes_visited += count as u32;
        self.place(indices, bounds, count);
    }

    /// Selects, queues or drops each of the first `count` nodes.
    #[inline(always)]
    fn place(&mut self, indices: [usize; 4], bounds: Vec4, count: usize) {
        for (k, bound) in bounds.to_array().into_iter().enumerate().take(count) {
            let index = indices[k] as u32;
            let leaf = self.tree.nodes[indices[k]].is_leaf();
            if bound > self.threshold && !leaf {
                // Queue the first child. The second child follows it in the array.
                self.queue[self.tail] = self.tree.nodes[indices[k]].children() as u32;
                self.tail += 1;
            } else if bound > 0.0 {
                self.selected[*self.selected_count] = index;
                *self.selected_count += 1;
                if !leaf {
                    *self.inner_count += 1;
                    self.cut.total_bound += bound;
                    self.cut.largest_bound = self.cut.largest_bound.max(bound);
                }
            }
        }
    }

    /// Returns whether four more nodes fit in the selection and in the queue.
    #[inline(always)]
    fn has_room(&self, most: usize) -> bool {
        *self.selected_count <= most && self.tail + 4 < self.queue.len()
    }

    /// Refines all nodes in the queue. Returns false if the lightcut has more than `most` clusters or the queue is
    /// full.
    #[inline(always)]
    pub fn finish_walk(&mut self, most: usize) -> bool {
        while self.head < self.tail {
            if !self.has_room(most) {
                return false;
            }
            // Visit the children of two queued nodes at once, to fill four lanes.
            let a = self.queue[self.head] as usize;
            if self.head + 1 < self.tail {
                let b = self.queue[self.head + 1] as usize;
                self.head += 2;
                self.visit([a, a + 1, b, b + 1], 4);
            } else {
                self.head += 1;
                self.visit([a, a + 1, a, a], 2);
            }
        }
        *self.selected_count <= most
    }

    /// Returns the size and bounds of the lightcut. Its nodes are in `scratch.selected`.
    #[inline(always)]
    pub fn finish(self) -> Lightcut {
        Lightcut { size: *self.selected_count as u32, ..self.cut }
    }
}
