//! Refinement in the paper's order, for thresholds relative to the estimate and for lightcuts that reach the maximum
//! size.

use glam::{DVec3, Vec3, Vec4};

use super::halves::Estimates;
use super::{Cluster, KeptCluster, Lightcut, Scratch, ShadowRay};
use crate::error_bound::{ClusterBounds, error_bound};
use crate::lanes::Vector3;
use crate::light::{Light, luminance, unshadowed};
use crate::node::sibling;
use crate::receiver::Receiver;
use crate::tree::LightTree;

/// Clusters of a growing lightcut, and a heap of the clusters that can be refined.
#[derive(Clone, Debug, Default)]
pub(super) struct Refined {
    clusters: Vec<Evaluated>,
    /// Free slots in `clusters`.
    free: Vec<u32>,
    /// Binary max-heap of (bit pattern of the bound, slot). Bounds are not negative, so their bit patterns have the
    /// same order.
    heap: Vec<u64>,
}

/// A cluster with its estimate.
#[derive(Clone, Copy, Debug)]
struct Evaluated {
    node: u32,
    /// Traced shadow ray, or `None` in a free slot.
    ray: Option<ShadowRay>,
    /// Shadow ray to the other half's light, if it was traced for an ancestor.
    spare: Option<ShadowRay>,
    /// M · G · V of the cluster's representative \[m⁻²\], for kept clusters.
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
        self.clusters[slot as usize].ray = None;
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
        // Bits of non-negative floats are in the order of the floats. The slot breaks ties.
        let key = u64::from(bound.to_bits()) << 32 | u64::from(slot);
        let mut hole = self.heap.len();
        self.heap.push(key);
        while hole > 0 {
            // Move smaller parents down until the key fits.
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
        // Fill the gap at the root with the last key.
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
            // Move the larger child up into the gap.
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
    /// Refines the cluster with the largest bound until that bound is below `threshold` of the estimated luminance, or
    /// the lightcut has its maximum size.
    ///
    /// With `KEPT`, clusters are estimated by their representatives, as in the paper, and stored in the scratch.
    /// Otherwise both [halves](super::halves) are used.
    pub(super) fn best_first<const KEPT: bool, R: Receiver>(
        &self,
        receiver: &R,
        threshold: impl Fn(f32) -> f32,
        visible: &mut impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) -> Lightcut {
        let Scratch { max_size, refined, kept, .. } = scratch;
        let max_size = *max_size;
        refined.clear(max_size);
        let mut cut = Lightcut::default();
        // A running sum in `f64` does not drift. It is used only for the threshold. The result is summed at the end.
        let mut estimate = 0.0f64;
        let mut place =
            |cluster: Unshadowed, bound: f32, known: Option<ShadowRay>, refined: &mut Refined, cut: &mut Lightcut| {
                let Unshadowed { node: index, light, unit, radiance } = cluster;
                // A leaf has no error. An inner cluster with bound 0 has no contribution.
                let leaf = self.nodes[index as usize].is_leaf();
                let bound = if leaf { 0.0 } else { bound };
                cut.nodes_visited += 1;
                if !leaf && bound == 0.0 {
                    return 0.0;
                }
                // Reuse the ray of the ancestor if it was traced to the same light, which is then the representative.
                let visible = match known {
                    _ if radiance == Vec3::ZERO => false,
                    Some(ray) if ray.light == light => ray.visible,
                    _ => {
                        cut.shadow_rays += 1;
                        visible(&self.lights[light as usize], light as usize)
                    }
                };
                // Keep the rays to both lights, because a child may have either as its representative.
                let seen = f32::from(visible);
                let (unit, radiance) = (unit * seen, radiance * seen);
                let ray = Some(ShadowRay { light, visible });
                let slot = refined.insert(Evaluated { node: index, ray, spare: known, unit, radiance });
                if bound > 0.0 {
                    refined.push(bound, slot);
                }
                f64::from(luminance(radiance))
            };
        // Estimate two siblings at once, with one or two lights per cluster.
        let estimates = |clusters: [usize; 2]| {
            if KEPT {
                clusters.map(|cluster| self.by_representative(receiver, cluster))
            } else {
                self.by_halves(receiver, clusters.map(|cluster| cluster as u32))
            }
        };
        // Start at the roots and refine the largest bound first.
        for root in self.roots() {
            let ([cluster, _], [bound, _]) = (estimates([root; 2]), self.bounds(receiver, [root; 2]));
            estimate += place(cluster, bound, None, refined, &mut cut);
        }
        while refined.largest_bound() > threshold(estimate.max(0.0) as f32).max(0.0) && refined.size() < max_size {
            let Some(slot) = refined.pop() else { break };
            // Replace the cluster by its children.
            let cluster = refined.remove(slot);
            estimate -= f64::from(luminance(cluster.radiance));
            let chosen = self.nodes[cluster.node as usize].representative_child as usize;
            let children = [chosen, sibling(chosen)];
            for (child, bound) in estimates(children).into_iter().zip(self.bounds(receiver, children)) {
                // Reuse a shadow ray that was already traced to the child's representative.
                let representative = self.nodes[child.node as usize].representative;
                let mut answers = [cluster.ray, cluster.spare].into_iter().flatten();
                let known = answers.find(|ray| ray.light == representative);
                estimate += place(child, bound, known, refined, &mut cut);
            }
        }
        // Sum the final clusters.
        cut.radiance = refined.clusters.iter().map(|c| c.radiance.as_dvec3()).sum::<DVec3>().as_vec3();
        // Store the kept clusters, or count the nodes of the halves.
        for (cluster, ray) in refined.clusters.iter().filter_map(|cluster| Some((cluster, cluster.ray?))) {
            if KEPT {
                let transport = cluster.unit;
                kept.push(KeptCluster { cluster: Cluster { node: cluster.node, light: ray.light }, transport });
            } else if !self.nodes[cluster.node as usize].is_leaf() {
                cut.nodes_visited += 2;
            }
        }
        cut.size = refined.size();
        cut.largest_bound = refined.largest_bound();
        cut.total_bound = refined.heap.iter().map(|&key| bound_of(key)).sum();
        cut
    }

    /// Returns the error bounds of two clusters.
    fn bounds<R: Receiver>(&self, receiver: &R, clusters: [usize; 2]) -> [f32; 2] {
        let [a, b] = clusters.map(|cluster| &self.nodes[cluster]);
        let position = Vector3::splat(receiver.position());
        let bounds =
            error_bound(receiver, position, &ClusterBounds::four([a, b, a, b]), Vec4::splat(self.geometry_term_bound));
        [bounds.x, bounds.y]
    }

    fn by_halves<R: Receiver>(&self, receiver: &R, clusters: [u32; 2]) -> [Unshadowed; 2] {
        let Estimates { lights, radiance, .. } = self.estimates_of_two(receiver, clusters);
        let estimate = |k: usize| Unshadowed {
            node: clusters[k],
            light: lights[k],
            unit: Vec3::ZERO,
            radiance: radiance[k].truncate(),
        };
        [estimate(0), estimate(1)]
    }

    fn by_representative<R: Receiver>(&self, receiver: &R, cluster: usize) -> Unshadowed {
        let node = &self.nodes[cluster];
        let site = self.sites.of(cluster).one();
        let unit = Vec3::from(unshadowed(receiver, receiver.position().into(), &site, self.geometry_term_bound));
        Unshadowed { node: cluster as u32, light: node.representative, unit, radiance: unit * node.intensity }
    }
}

/// Light of a cluster, computed without visibility.
struct Unshadowed {
    node: u32,
    light: u32,
    unit: Vec3,
    radiance: Vec3,
}
