//! Clusters that the receivers of a bundle share.
//!
//! Shared clusters are gathered once, four at a time, in the order in which every receiver reads them. Each receiver of
//! a group bounds the undecided clusters itself. Clusters within its threshold are used like common clusters. Below the
//! other clusters, the receiver continues with its own [walk](super::walk).
//!
//! Estimates of shared clusters are almost half of the work. Their operands are contiguous, so they are computed [eight
//! lanes](Width) at a time where the processor supports it. This saves a seventh of the time of a shared lightcut.
//!
//! Time relative to independent lightcuts (`examples/measure.rs` on conference, 152 043 lights, blocks of 8×8 pixels):
//!
//! | method | time |
//! |---|---|
//! | eight lanes, undecided clusters gathered once | 0.32 … 0.33 |
//! | two clusters at a time, undecided clusters gathered per receiver | 0.41 … 0.42 |

use glam::{BVec4A, Vec4};

use super::halves::{Arriving, Halves};
use super::walk::Walk;
use super::{Lightcut, Scratch, ShadowRay, missing, padded};
use crate::error_bound::{ClusterBounds, error_bound};
use crate::lanes::{EightLanes, Kernel, Vector3, Width};
use crate::receiver::Receiver;
use crate::tree::LightTree;

/// Number of consecutive receivers in a group.
pub(super) const GROUP: usize = 16;

/// Number of groups of four clusters that are evaluated before halves are chosen for the first group. Each step from
/// square root to ray position depends on the previous step, and the processor looks ahead further over short loops.
/// This saves a tenth of the time of a shared lightcut.
const AHEAD: usize = 8;

/// Neighboring receivers, such as the pixels of a block, and the threshold of each.
#[derive(Debug)]
pub struct Receivers<'a, R> {
    /// Receivers, at most 64. Sharing saves most if consecutive receivers are close together.
    pub receivers: &'a [R],
    /// Largest allowed error bound of a cluster for each receiver, as luminance \[W·m⁻²·sr⁻¹\].
    pub thresholds: &'a [f32],
}

impl<R> Clone for Receivers<'_, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<R> Copy for Receivers<'_, R> {}

/// One receiver of a group.
pub(super) struct Member<'a, R> {
    pub receiver: &'a R,
    pub threshold: f32,
    /// Index of the receiver in the group.
    pub k: usize,
}

impl<R> Clone for Member<'_, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<R> Copy for Member<'_, R> {}

/// Clusters that several receivers share.
#[derive(Clone, Debug, Default)]
pub(super) struct Shares {
    /// Nodes that are in every lightcut.
    pub common: Vec<u32>,
    /// Nodes that only some of the receivers refine.
    pub undecided: Vec<u32>,
    /// Gathered common clusters, then gathered undecided clusters.
    fours: Vec<FourShared>,
    /// Nodes that the common walk has not refined yet.
    pub pending: Vec<u32>,
}

/// Four clusters that are estimated together. A shorter group repeats its last cluster.
#[derive(Clone, Copy, Debug)]
struct FourShared {
    halves: Halves,
    /// For each receiver of a group, the bit set of the clusters that it does not use.
    left_out: [u8; GROUP],
}

/// Shadow rays of a receiver, and the unoccluded radiance of each.
pub(super) type Estimated<'a> = (&'a [ShadowRay], &'a [Vec4]);

impl Shares {
    pub fn clear(&mut self) {
        let Self { common, undecided, fours, pending } = self;
        [common, undecided, pending].into_iter().for_each(Vec::clear);
        fours.clear();
    }

    /// Returns the undecided clusters that the k-th receiver of the group refines.
    fn refined_by(&self, k: usize) -> impl Iterator<Item = u32> {
        let fours = &self.fours[self.common.len().div_ceil(4)..];
        self.undecided.chunks(4).zip(fours).flat_map(move |(nodes, four)| {
            let refined = nodes.iter().enumerate().filter(move |(which, _)| four.left_out[k] >> which & 1 != 0);
            refined.map(|(_, &node)| node)
        })
    }
}

impl LightTree {
    /// Gathers the common clusters.
    pub(super) fn gather_common(&self, shares: &mut Shares) {
        let Shares { common, fours, .. } = shares;
        fours.extend(
            common
                .chunks(4)
                .map(|four| FourShared { halves: self.halves(padded(four)), left_out: [missing(four) as u8; GROUP] }),
        );
    }

    /// Tests the undecided clusters for every receiver of a group and gathers them after the common clusters. `begun`
    /// receives, for each receiver, the lightcut of the undecided clusters. Visits of the clusters' halves count for
    /// the first receiver.
    pub(super) fn decide<R: Receiver>(&self, group: Receivers<R>, shares: &mut Shares, begun: &mut Vec<Lightcut>) {
        let Shares { undecided, fours, .. } = shares;
        begun.clear();
        let looked_at = undecided.len() as u32;
        begun.resize(group.receivers.len(), Lightcut { nodes_visited: looked_at, ..Lightcut::default() });
        // None of the undecided clusters is a single light, so each has two halves.
        begun[0].nodes_visited += 2 * looked_at;
        let geometry_term_bound = Vec4::splat(self.geometry_term_bound);
        for four in undecided.chunks(4) {
            let clusters = ClusterBounds::four(padded(four).map(|node| &self.nodes[node as usize]));
            // Exclude lanes that only pad the last group of four.
            let repeated = BVec4A::from_array(std::array::from_fn(|k| k >= four.len()));
            let mut left_out = [0; GROUP];
            let receivers = group.receivers.iter().zip(group.thresholds);
            for (((receiver, &threshold), left_out), begun) in receivers.zip(&mut left_out).zip(&mut *begun) {
                let bounds = error_bound(receiver, Vector3::splat(receiver.position()), &clusters, geometry_term_bound);
                // Each receiver uses the clusters whose bound is within its own threshold.
                let not_taken = bounds.cmpgt(Vec4::splat(threshold.max(0.0))) | repeated;
                let taken = Vec4::select(not_taken, Vec4::ZERO, bounds);
                *left_out = not_taken.bitmask() as u8;
                begun.size += taken.cmpgt(Vec4::ZERO).bitmask().count_ones();
                begun.total_bound += taken.element_sum();
                begun.largest_bound = begun.largest_bound.max(taken.max_element());
            }
            // Gather the halves once for all receivers.
            fours.push(FourShared { halves: self.halves(padded(four)), left_out });
        }
    }

    /// Walks below the undecided clusters that one receiver refines and fills `selected`. Returns `None` if more than
    /// `most` clusters are selected.
    #[inline(always)]
    pub(super) fn walk_on<R: Receiver>(
        &self,
        member: Member<R>,
        shares: &Shares,
        most: usize,
        scratch: &mut Scratch,
    ) -> Option<Lightcut> {
        let mut walk = Walk::new(self, member.receiver, member.threshold, scratch);
        // Continue only below the clusters that this receiver left out.
        let queued = shares.refined_by(member.k).all(|node| walk.refine(node));
        (queued && walk.finish_walk(most)).then(|| walk.finish())
    }

    /// Estimates the shared clusters and the receiver's own clusters. No shadow ray is traced yet, so the radiance of
    /// the lightcut is still zero.
    #[inline(always)]
    pub(super) fn estimate_shared<'a, R: Receiver>(
        &self,
        Member { receiver, k, .. }: Member<R>,
        shares: [&Shares; 2],
        scratch: &'a mut Scratch,
        mut cut: Lightcut,
    ) -> (Lightcut, Estimated<'a>) {
        scratch.begin_estimate();
        let (fours, geometry_term_bound) = (shares.map(|shares| &shares.fours[..]), self.geometry_term_bound);
        let arriving = Arriving::after(0, &mut scratch.rays, &mut scratch.radiance);
        // Estimate the shared clusters, then append the receiver's own clusters.
        let of_shared = Width::best().run(EstimateShared { receiver, fours, k, geometry_term_bound, arriving });
        scratch.ray_count = of_shared;
        cut.nodes_visited += self.estimate_halves(receiver, scratch);
        let count = scratch.ray_count;
        cut.shadow_rays = count as u32;
        (cut, (&scratch.rays[..count], &scratch.radiance[..count]))
    }
}

/// Kernel that appends the estimates of a receiver's clusters in `fours` and returns the new number of rays.
struct EstimateShared<'a, R> {
    receiver: &'a R,
    fours: [&'a [FourShared]; 2],
    k: usize,
    geometry_term_bound: f32,
    arriving: Arriving<'a>,
}

impl<R: Receiver> Kernel for EstimateShared<'_, R> {
    type Output = usize;

    #[inline(always)]
    fn run<F: EightLanes>(mut self) -> usize {
        for fours in self.fours {
            for fours in fours.chunks(AHEAD) {
                let mut arriving = [Vector3::ZERO; AHEAD];
                // Compute several groups before their halves are chosen, as explained at `AHEAD`.
                for (arriving, four) in arriving.iter_mut().zip(fours) {
                    *arriving = four.halves.arriving::<F, R>(self.receiver, self.geometry_term_bound);
                }
                for (arriving, four) in arriving.iter().zip(fours) {
                    self.arriving.push(&four.halves.choose(arriving), !u32::from(four.left_out[self.k]));
                }
            }
        }
        self.arriving.count
    }
}
