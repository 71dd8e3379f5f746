//! The part of each receiver of a bundle in the clusters that it shares.
//!
//! Shared clusters are gathered once, by fours, in the order in which every receiver reads them. Each receiver of a group
//! bounds the undecided ones for itself. Those within its threshold it takes from there like the common ones; below the
//! others it [walks](super::walk) on alone.
//!
//! Estimates of shared clusters are almost half of the work. Nothing has to be fetched for them from here and there, so
//! they are computed [eight numbers](Width) at a time where the processor can, which takes a seventh off a shared cut.
//! (`examples/measure.rs` on conference, 152 043 lights, blocks of 8×8 pixels: shared cuts take 0.32 … 0.33 of the time of
//! cuts made alone; 0.41 … 0.42 with estimates two by two, and undecided clusters gathered by each receiver again.)

use glam::{BVec4A, Vec4};

use super::halves::{Arriving, Halves};
use super::walk::Walk;
use super::{Cut, Scratch, ShadowRay, missing, padded};
use crate::error_bound::{ClusterBounds, error_bound};
use crate::lanes::{Kernel, PartOfEight, Vector3, Width};
use crate::receiver::Receiver;
use crate::tree::LightTree;

/// Receivers of a group: those that follow each other in a bundle.
pub(super) const GROUP: usize = 16;

/// Fours that are lit before halves are chosen of the first. From root and quotient to the place of a ray each step waits
/// for the last one, and a processor looks ahead over shorter loops further (a shared cut takes a tenth less time).
const AHEAD: usize = 8;

/// Receivers that lie close together, such as the pixels of a block, and the threshold of each.
#[derive(Debug)]
pub struct Receivers<'a, R> {
    /// At most 64. Sharing saves most where those that follow each other are the closest.
    pub receivers: &'a [R],
    /// Largest error bound of a cluster for each receiver, as luminance \[W·m⁻²·sr⁻¹\].
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
    /// Its place in the group.
    pub k: usize,
}

impl<R> Clone for Member<'_, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<R> Copy for Member<'_, R> {}

/// Clusters that some receivers have in common.
#[derive(Clone, Debug, Default)]
pub(super) struct Shares {
    /// Nodes that are part of every cut.
    pub common: Vec<u32>,
    /// Nodes that some refine and some do not.
    pub undecided: Vec<u32>,
    /// The common ones, then the undecided ones.
    fours: Vec<FourShared>,
    /// Nodes that the common walk still has to refine.
    pub pending: Vec<u32>,
}

/// Clusters that are estimated side by side; the last ones are repeated where there are fewer.
#[derive(Clone, Copy, Debug)]
struct FourShared {
    halves: Halves,
    /// Bits of the clusters that each receiver of a group leaves out.
    left_out: [u8; GROUP],
}

/// Shadow rays of a receiver, and what arrives by each if it is free.
pub(super) type Estimated<'a> = (&'a [ShadowRay], &'a [Vec4]);

impl Shares {
    pub fn clear(&mut self) {
        let Self { common, undecided, fours, pending } = self;
        [common, undecided, pending].into_iter().for_each(Vec::clear);
        fours.clear();
    }

    /// The undecided clusters that the k-th receiver of the group refines.
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

    /// Every receiver of a group visits the undecided clusters; they are gathered after the common ones.
    /// `begun` gets the part of its cut that each takes of them; their halves are counted with the first.
    pub(super) fn decide<R: Receiver>(&self, group: Receivers<R>, shares: &mut Shares, begun: &mut Vec<Cut>) {
        let Shares { undecided, fours, .. } = shares;
        begun.clear();
        let looked_at = undecided.len() as u32;
        begun.resize(group.receivers.len(), Cut { nodes_visited: looked_at, ..Cut::default() });
        // None of them is a single light.
        begun[0].nodes_visited += 2 * looked_at;
        let geometry_term_bound = Vec4::splat(self.geometry_term_bound);
        for four in undecided.chunks(4) {
            let clusters = ClusterBounds::four(padded(four).map(|node| &self.nodes[node as usize]));
            let repeated = BVec4A::from_array(std::array::from_fn(|k| k >= four.len()));
            let mut left_out = [0; GROUP];
            let receivers = group.receivers.iter().zip(group.thresholds);
            for (((receiver, &threshold), left_out), begun) in receivers.zip(&mut left_out).zip(&mut *begun) {
                let bounds = error_bound(receiver, Vector3::splat(receiver.position()), &clusters, geometry_term_bound);
                let not_taken = bounds.cmpgt(Vec4::splat(threshold.max(0.0))) | repeated;
                let taken = Vec4::select(not_taken, Vec4::ZERO, bounds);
                *left_out = not_taken.bitmask() as u8;
                begun.size += taken.cmpgt(Vec4::ZERO).bitmask().count_ones();
                begun.total_bound += taken.element_sum();
                begun.largest_bound = begun.largest_bound.max(taken.max_element());
            }
            fours.push(FourShared { halves: self.halves(padded(four)), left_out });
        }
    }

    /// The walk of one receiver below the undecided clusters that it refines: fills `selected`; `None` if that is more than
    /// `most`.
    #[inline(always)]
    pub(super) fn walk_on<R: Receiver>(
        &self,
        member: Member<R>,
        shares: &Shares,
        most: usize,
        scratch: &mut Scratch,
    ) -> Option<Cut> {
        let mut walk = Walk::new(self, member.receiver, member.threshold, scratch);
        let queued = shares.refined_by(member.k).all(|node| walk.refine(node));
        (queued && walk.finish_walk(most)).then(|| walk.finish())
    }

    /// Estimates of the shared clusters that a receiver takes, and of those that it selected alone. No shadow ray is traced
    /// yet: the radiance of the cut is still zero.
    #[inline(always)]
    pub(super) fn estimate_shared<'a, R: Receiver>(
        &self,
        Member { receiver, k, .. }: Member<R>,
        shares: [&Shares; 2],
        scratch: &'a mut Scratch,
        mut cut: Cut,
    ) -> (Cut, Estimated<'a>) {
        scratch.begin_estimate();
        let (fours, geometry_term_bound) = (shares.map(|shares| &shares.fours[..]), self.geometry_term_bound);
        let arriving = Arriving::after(0, &mut scratch.rays, &mut scratch.radiance);
        let of_shared = Width::best().run(EstimateShared { receiver, fours, k, geometry_term_bound, arriving });
        scratch.ray_count = of_shared;
        cut.nodes_visited += self.estimate_halves(receiver, scratch);
        let count = scratch.ray_count;
        cut.shadow_rays = count as u32;
        (cut, (&scratch.rays[..count], &scratch.radiance[..count]))
    }
}

/// Appends the estimates of what a receiver takes of `fours`, and returns how many there are then.
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
    fn run<F: PartOfEight>(mut self) -> usize {
        for fours in self.fours {
            for fours in fours.chunks(AHEAD) {
                let mut arriving = [Vector3::ZERO; AHEAD];
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
