//! Lightcuts for neighboring receivers: one common walk, then a walk for each receiver.
//!
//! The bound of a cluster for the whole bundle covers the box of positions and the cone of normals of all receivers.
//! Based on this bound and the bounds for a few receivers, a node of the common walk is
//!
//! * *common*, if the bundle's bound is within every threshold or the node is a single light: it is in every lightcut.
//! * *refined*, if at least three of four receivers would refine it. Compared with requiring all four, lightcuts are
//!   1 % larger and need a quarter fewer visits (`examples/measure.rs`).
//! * *undecided* otherwise: every receiver tests it with its own bound, and selects it or continues below it.
//! * *dark*, if the bundle's bound is zero.
//!
//! The walk continues from the undecided clusters, first for each [group](super::group) of receivers, then for each
//! receiver. Shadow rays are traced light by light, for all receivers that need the light. Most lights belong to common
//! clusters, to which half of the receivers trace a ray. Rays between a light and a small area are coherent and cheap.
//!
//! Four receivers do not represent all receivers. But refining is always safe: no cluster of any lightcut exceeds its
//! threshold.

use glam::{Vec3, Vec4};

use super::group::{GROUP, Member, Receivers, Shares};
use super::halves::sum_of_seen;
use super::{Lightcut, Scratch, ShadowRay, Stop, padded};
use crate::error_bound::{ClusterBounds, error_bound, error_bound_of_bundle};
use crate::lanes::Vector3;
use crate::light::Light;
use crate::receiver::{Bundled, Receiver};
use crate::tree::LightTree;

/// Maximum number of receivers in a bundle.
const MOST: usize = 64;
/// Number of receivers that decide whether a node is refined.
const PROBES: usize = 4;

/// Reusable memory of a bundle.
#[derive(Clone, Debug, Default)]
pub(super) struct Shared {
    of_all: Shares,
    of_group: Shares,
    /// For each receiver of a group, the lightcut of the undecided clusters that it selects.
    begun: Vec<Lightcut>,
    shadow_rays: ShadowRays,
}

/// Shadow rays of a bundle.
#[derive(Clone, Debug, Default)]
struct ShadowRays {
    /// Rays of all receivers, receiver by receiver.
    rays: Vec<ShadowRay>,
    /// Unoccluded radiance of each ray.
    radiance: Vec<Vec4>,
    /// End of each receiver's rays in `rays`.
    ends: Vec<usize>,
    /// For each light, a bit set of receivers: before tracing, the receivers with a ray to the light; afterwards, the
    /// receivers that see it.
    receivers_of: Vec<u64>,
    /// Indices of the lights to which rays are traced.
    lights: Vec<u32>,
}

impl ShadowRays {
    fn clear(&mut self, lights: usize) {
        // Clear only the bits of listed lights, because the tree may have many more.
        for light in self.lights.drain(..) {
            self.receivers_of[light as usize] = 0;
        }
        if self.receivers_of.len() != lights {
            self.receivers_of.clear();
            self.receivers_of.resize(lights, 0);
        }
        self.rays.clear();
        self.radiance.clear();
        self.ends.clear();
    }

    /// Adds the rays of a receiver.
    fn add(&mut self, receiver: usize, rays: &[ShadowRay], radiance: &[Vec4]) {
        self.rays.extend_from_slice(rays);
        self.radiance.extend_from_slice(radiance);
        // List each light once, with the bit set of its receivers.
        for ray in rays {
            let receivers = &mut self.receivers_of[ray.light as usize];
            if *receivers == 0 {
                self.lights.push(ray.light);
            }
            *receivers |= 1 << receiver;
        }
    }

    /// Adds the visible radiance to the lightcuts.
    fn add_to(&mut self, cuts: &mut [Lightcut]) {
        let mut begin = 0;
        for (receiver, (cut, &end)) in cuts.iter_mut().zip(&self.ends).enumerate() {
            // Read the visibility of each ray from the bit set of its light.
            let rays = &mut self.rays[begin..end];
            for ray in &mut *rays {
                ray.visible = self.receivers_of[ray.light as usize] >> receiver & 1 == 1;
            }
            cut.radiance += sum_of_seen(rays, &self.radiance[begin..end]).truncate();
            begin = end;
        }
    }
}

impl LightTree {
    /// Computes lightcuts for neighboring receivers, each with its own absolute threshold. The lightcuts correspond to
    /// [`LightTree::lightcut`] for each receiver, with fewer node visits.
    ///
    /// `visible(light, index, rays)` traces shadow rays between a light and the receivers in the bit set `rays`. It
    /// returns the bit set of the receivers that see the light.
    ///
    /// `cuts` is cleared and receives one lightcut per receiver. Its clusters are never coarser than in an independent
    /// lightcut and may be slightly finer. [`Lightcut::nodes_visited`] of the first lightcut includes the common walk.
    ///
    /// # Panics
    ///
    /// If there are more than 64 receivers, or the number of thresholds differs from the number of receivers.
    pub fn lightcuts<R: Bundled>(
        &self,
        together: Receivers<R>,
        mut visible: impl FnMut(&Light, usize, u64) -> u64,
        scratch: &mut Scratch,
        cuts: &mut Vec<Lightcut>,
    ) {
        let Receivers { receivers, thresholds } = together;
        assert_eq!(thresholds.len(), receivers.len(), "one threshold per receiver");
        assert!(receivers.len() <= MOST, "{} receivers in a bundle of at most {MOST}", receivers.len());
        cuts.clear();
        if self.nodes.is_empty() || receivers.is_empty() {
            cuts.resize(receivers.len(), Lightcut::default());
            return;
        }
        // Move the shared memory out, because the walks borrow the rest of the scratch.
        let mut shared = std::mem::take(&mut scratch.shared);
        let Shared { of_all, of_group, begun, shadow_rays } = &mut shared;
        shadow_rays.clear(self.lights.len());
        let most = scratch.max_size as usize;
        // A bundle with a single group needs no walk for all receivers.
        let roots = [self.roots().start as u32, self.roots().end as u32 - 1];
        let roots = &roots[..self.roots().len()];
        let mut all = if receivers.len() > GROUP {
            self.walk_together(together, roots, most, of_all)
        } else {
            of_all.clear();
            of_all.undecided.extend(roots);
            Some(Lightcut::default())
        };
        // Continue the walk for each group, then for each receiver. Lightcuts above the maximum size are computed
        // independently.
        for (receivers, thresholds) in receivers.chunks(GROUP).zip(thresholds.chunks(GROUP)) {
            let group = Receivers { receivers, thresholds };
            let mut common = all.and_then(|all| {
                let most = most - of_all.common.len();
                Some(plus(all, self.walk_together(group, &of_all.undecided, most, of_group)?))
            });
            if common.is_some() {
                self.decide(group, of_group, begun);
            }
            for (k, (receiver, &threshold)) in receivers.iter().zip(thresholds).enumerate() {
                let which = cuts.len();
                let member = Member { receiver, threshold, k };
                let cut = match common.and_then(|common| {
                    let shared = begun[k].size as usize + of_all.common.len() + of_group.common.len();
                    let own = self.walk_on(member, of_group, most.checked_sub(shared)?, scratch)?;
                    Some(Lightcut { size: shared as u32 + own.size, ..plus(plus(common, begun[k]), own) })
                }) {
                    Some(cut) => {
                        let (cut, (rays, radiance)) = self.estimate_shared(member, [of_all, of_group], scratch, cut);
                        shadow_rays.add(which, rays, radiance);
                        cut
                    }
                    None => {
                        // Trace this receiver's rays immediately, outside the common batch.
                        let sees = |light: &Light, index: usize| visible(light, index, 1 << which) != 0;
                        self.lightcut(receiver, Stop::Absolute(threshold), sees, scratch)
                    }
                };
                shadow_rays.ends.push(shadow_rays.rays.len());
                cuts.push(cut);
                // Count the common walks once, with the first lightcut.
                for walk in [&mut all, &mut common].into_iter().flatten() {
                    walk.nodes_visited = 0;
                }
            }
        }
        // Trace the shadow rays light by light.
        for &light in &shadow_rays.lights {
            let receivers = &mut shadow_rays.receivers_of[light as usize];
            *receivers = visible(&self.lights[light as usize], light as usize, *receivers);
        }
        shadow_rays.add_to(cuts);
        scratch.shared = shared;
    }

    /// Runs the common walk from the nodes `from`. Returns `None` if it finds more than `most` common clusters.
    fn walk_together<R: Bundled>(
        &self,
        together: Receivers<R>,
        from: &[u32],
        most: usize,
        shares: &mut Shares,
    ) -> Option<Lightcut> {
        shares.clear();
        let Shares { common, undecided, pending, .. } = shares;
        // Bound the whole bundle by its box of positions and its cone of normals.
        let positions = together.receivers.iter().map(|r| r.position());
        let corners = [positions.clone().reduce(Vec3::min)?, positions.reduce(Vec3::max)?].map(Vector3::splat);
        let bundle = R::bundle(together.receivers);
        let smallest = together.thresholds.iter().fold(f32::INFINITY, |a, &b| a.min(b)).max(0.0);
        let geometry_term_bound = Vec4::splat(self.geometry_term_bound);
        let mut cut = Lightcut::default();
        let mut visit = |indices: [usize; 4], count: usize, pending: &mut Vec<u32>| {
            let clusters = ClusterBounds::four(indices.map(|index| &self.nodes[index]));
            let of_bundle = error_bound_of_bundle(&bundle, corners, &clusters, geometry_term_bound).to_array();
            cut.nodes_visited += count as u32;
            // Query the probes only if the common bound is above a threshold.
            let mut refined = None;
            for k in 0..count {
                // Classify the node: refined, undecided, common or dark.
                let (index, bound, leaf) = (indices[k] as u32, of_bundle[k], self.nodes[indices[k]].is_leaf());
                if bound > smallest && !leaf {
                    let refined = *refined.get_or_insert_with(|| self.most_refine(together, &clusters));
                    if refined[k] { pending.push(index) } else { undecided.push(index) }
                } else if bound > 0.0 {
                    // All receivers use this cluster.
                    common.push(index);
                    if !leaf {
                        cut.nodes_visited += 2;
                        cut.total_bound += bound;
                        cut.largest_bound = cut.largest_bound.max(bound);
                    }
                }
            }
            common.len() <= most
        };
        // Visit the start nodes, then the children of two pending nodes at a time.
        let mut fits = true;
        for four in from.chunks(4) {
            fits = fits && visit(padded(four).map(|index| index as usize), four.len(), pending);
        }
        while fits && let Some(a) = pending.pop() {
            let a = self.nodes[a as usize].children();
            fits = match pending.pop().map(|b| self.nodes[b as usize].children()) {
                Some(b) => visit([a, a + 1, b, b + 1], 4, pending),
                None => visit([a, a + 1, a, a], 2, pending),
            };
        }
        if !fits {
            return None;
        }
        self.gather_common(shares);
        Some(cut)
    }

    /// For four clusters, returns whether all probes, or all but one, would refine the cluster.
    #[inline(always)]
    fn most_refine<R: Receiver>(&self, together: Receivers<R>, clusters: &ClusterBounds<Vec4>) -> [bool; 4] {
        let Receivers { receivers, thresholds } = together;
        let probes = PROBES.min(receivers.len());
        let mut votes = [0; 4];
        for probe in 0..probes {
            // Spread the probes evenly over the bundle.
            let which = probe * (receivers.len() - 1) / (probes - 1).max(1);
            let (receiver, threshold) = (&receivers[which], thresholds[which].max(0.0));
            let position = Vector3::splat(receiver.position());
            let bounds = error_bound(receiver, position, clusters, Vec4::splat(self.geometry_term_bound)).to_array();
            for (votes, bound) in votes.iter_mut().zip(bounds) {
                *votes += usize::from(bound > threshold);
            }
        }
        votes.map(|votes| votes + 1 >= probes)
    }
}

/// Combines the bounds and counts of two lightcuts.
fn plus(a: Lightcut, b: Lightcut) -> Lightcut {
    Lightcut {
        largest_bound: a.largest_bound.max(b.largest_bound),
        total_bound: a.total_bound + b.total_bound,
        nodes_visited: a.nodes_visited + b.nodes_visited,
        ..Lightcut::default()
    }
}
