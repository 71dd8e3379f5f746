//! Refinement in the paper's order, for thresholds that move with the estimate and for cuts that reach their limit.

use glam::{DVec3, Vec3};

use super::{Cluster, Cut, Scratch};
use crate::error_bound::{Cluster as Bounds, error_bound};
use crate::light::{Light, luminance};
use crate::receiver::Receiver;
use crate::tree::{LightTree, sibling};

/// The clusters of a growing cut, and a heap over those that can be refined.
#[derive(Clone, Debug, Default)]
pub(super) struct Refined {
    clusters: Vec<Evaluated>,
    /// Slots in `clusters` to fill again.
    free: Vec<u32>,
    /// Binary max-heap of (bound's bits, slot): bounds are not negative, so their bits sort as they do.
    heap: Vec<u64>,
}

/// A cluster with the value of its representative.
#[derive(Clone, Copy, Debug)]
struct Evaluated {
    node: u32,
    /// Who stands for the cluster; none in a slot that is free.
    light: Option<u32>,
    /// M · G · V of the representative \[m⁻²\]; a child with the same representative takes it over.
    unit: Vec3,
    radiance: Vec3,
}

impl Refined {
    fn clear(&mut self, max_size: u32) {
        let capacity = max_size as usize + 2;
        self.clusters.clear();
        self.free.clear();
        self.heap.clear();
        self.clusters.reserve(capacity);
        self.free.reserve(capacity);
        self.heap.reserve(capacity);
    }

    fn insert(&mut self, cluster: Evaluated) -> u32 {
        if let Some(slot) = self.free.pop() {
            self.clusters[slot as usize] = cluster;
            return slot;
        }
        self.clusters.push(cluster);
        self.clusters.len() as u32 - 1
    }

    fn remove(&mut self, slot: u32) -> Evaluated {
        let cluster = self.clusters[slot as usize];
        self.clusters[slot as usize].radiance = Vec3::ZERO;
        self.clusters[slot as usize].light = None;
        self.free.push(slot);
        cluster
    }

    #[cfg(test)]
    pub fn capacities(&self) -> [usize; 3] {
        [self.clusters.capacity(), self.free.capacity(), self.heap.capacity()]
    }

    fn size(&self) -> u32 {
        (self.clusters.len() - self.free.len()) as u32
    }

    fn push(&mut self, bound: f32, slot: u32) {
        let key = u64::from(bound.to_bits()) << 32 | u64::from(slot);
        let mut hole = self.heap.len();
        self.heap.push(key);
        while hole > 0 {
            let parent = (hole - 1) / 2;
            if self.heap[parent] >= key {
                break;
            }
            self.heap[hole] = self.heap[parent];
            hole = parent;
        }
        self.heap[hole] = key;
    }

    fn largest_bound(&self) -> f32 {
        self.heap.first().map_or(0.0, |&key| bound_of(key))
    }

    fn pop(&mut self) -> Option<u32> {
        let top = *self.heap.first()?;
        let key = self.heap.pop()?;
        let heap = &mut self.heap[..];
        if heap.is_empty() {
            return Some(top as u32);
        }
        let mut hole = 0;
        loop {
            let left = 2 * hole + 1;
            if left >= heap.len() {
                break;
            }
            let right = (left + 1).min(heap.len() - 1);
            let child = if heap[right] > heap[left] { right } else { left };
            if heap[child] <= key {
                break;
            }
            heap[hole] = heap[child];
            hole = child;
        }
        heap[hole] = key;
        Some(top as u32)
    }
}

fn bound_of(key: u64) -> f32 {
    f32::from_bits((key >> 32) as u32)
}

impl LightTree {
    /// Refines the cluster of the largest bound until that is below `threshold` of the estimated luminance, or the
    /// cut is as large as the scratch allows.
    pub(super) fn best_first<R: Receiver>(
        &self,
        receiver: &R,
        threshold: impl Fn(f32) -> f32,
        visible: &mut impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
        each: &mut impl FnMut(Cluster, Vec3),
    ) -> Cut {
        let max_size = scratch.max_size;
        let refined = &mut scratch.refined;
        refined.clear(max_size);
        let position = receiver.position().into();
        let mut cut = Cut::default();
        // In f64 the running estimate does not drift; it steers the threshold, the result is summed at the end.
        let mut estimate = 0.0f64;
        let mut place = |index: usize, known: Option<Vec3>, refined: &mut Refined, cut: &mut Cut| {
            let node = &self.nodes[index];
            cut.nodes_visited += 1;
            let bound =
                if node.is_leaf() { 0.0 } else { error_bound(receiver, position, &Bounds::one(node), self.softening2) };
            if !node.is_leaf() && bound == 0.0 {
                return 0.0;
            }
            let unit = known.unwrap_or_else(|| {
                self.representative_term(receiver, node.representative, visible, &mut cut.shadow_rays)
            });
            let radiance = unit * node.intensity;
            let slot =
                refined.insert(Evaluated { node: index as u32, light: Some(node.representative), unit, radiance });
            if bound > 0.0 {
                refined.push(bound, slot);
            }
            f64::from(luminance(radiance))
        };
        for root in self.roots() {
            estimate += place(root, None, refined, &mut cut);
        }
        while refined.largest_bound() > threshold(estimate.max(0.0) as f32).max(0.0) && refined.size() < max_size {
            let Some(slot) = refined.pop() else { break };
            let cluster = refined.remove(slot);
            let chosen = self.nodes[cluster.node as usize].representative_child as usize;
            estimate -= f64::from(luminance(cluster.radiance));
            estimate += place(chosen, Some(cluster.unit), refined, &mut cut);
            estimate += place(sibling(chosen), None, refined, &mut cut);
        }
        cut.radiance = refined.clusters.iter().map(|c| c.radiance.as_dvec3()).sum::<DVec3>().as_vec3();
        for cluster in &refined.clusters {
            if let Some(light) = cluster.light {
                each(Cluster { node: cluster.node, light }, cluster.unit);
            }
        }
        cut.size = refined.size();
        cut.largest_bound = refined.largest_bound();
        cut.total_bound = refined.heap.iter().map(|&key| bound_of(key)).sum();
        cut
    }
}
