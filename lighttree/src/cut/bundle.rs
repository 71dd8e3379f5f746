//! Cuts for receivers that lie close together: one walk for what they have in common, and the rest for each.
//!
//! A cluster's bound for the whole bundle is its bound for the box of positions and the cone of normals of all
//! receivers. With it, and with the bounds for a few receivers of the bundle, a node of the common walk is
//!
//! * *common*, if the bundle's bound is within every threshold (or it is a single light): part of every cut;
//! * *refined*, if of four receivers at least three would refine it (cuts are 1 % larger than with all four, with a
//!   quarter fewer visits; `examples/measure.rs`);
//! * *undecided* otherwise: every receiver looks at it with its own bound and goes on from there alone;
//! * *dark*, if the bundle's bound is zero.
//!
//! A few receivers do not speak for all. But refining is always right: no cluster of any cut is
//! ever wrong by more than the threshold. Common and undecided clusters are gathered once, in the order in which they
//! are read, by every receiver.

use glam::{Vec3, Vec4};

use super::halves::Halves;
use super::walk::Walk;
use super::{Cut, Scratch, ShadowRay, Stop};
use crate::error_bound::{Cluster, error_bound, error_bound_of_bundle};
use crate::lanes::Vector3;
use crate::light::Light;
use crate::receiver::{Bundled, Receiver};
use crate::tree::LightTree;

/// Receivers that are asked whether a node is to be refined.
const PROBES: usize = 4;

/// Memory of a bundle.
#[derive(Clone, Debug, Default)]
pub(super) struct Shared {
    pending: Vec<u32>,
    common: Vec<u32>,
    undecided: Vec<u32>,
    /// The common clusters, two by two; of an odd number the last is there twice.
    halves: Vec<Halves>,
    /// The undecided clusters; the last four are filled up by repetition.
    bounds: Vec<Cluster<Vec4>>,
    /// Unshadowed, of the common clusters that are not dark for one receiver; the fourth number does not matter.
    radiance: Vec<Vec4>,
}

impl LightTree {
    /// Cuts for receivers that lie close together, such as the pixels of a block, each to its own absolute threshold
    /// \[W·m⁻²·sr⁻¹\]: what [`LightTree::lightcut`] would find for each alone, with fewer nodes visited.
    ///
    /// `visible(receiver, lights, rays)` sets [`ShadowRay::visible`] of each ray of one receiver, called once for each.
    /// `cuts` is cleared and gets one cut for each receiver. A cut is never coarser than one made alone and may be a
    /// little finer; [`Cut::nodes_visited`] of the first includes the common walk.
    ///
    /// # Panics
    ///
    /// If there is not one threshold per receiver.
    pub fn lightcuts<R: Bundled>(
        &self,
        receivers: &[R],
        thresholds: &[f32],
        mut visible: impl FnMut(usize, &[Light], &mut [ShadowRay]),
        scratch: &mut Scratch,
        cuts: &mut Vec<Cut>,
    ) {
        assert_eq!(thresholds.len(), receivers.len(), "one threshold per receiver");
        cuts.clear();
        if self.nodes.is_empty() || receivers.is_empty() {
            cuts.resize(receivers.len(), Cut::default());
            return;
        }
        let mut common = self.walk_together(receivers, thresholds, scratch);
        for (index, (receiver, &threshold)) in receivers.iter().zip(thresholds).enumerate() {
            let visible = |lights: &[Light], rays: &mut [ShadowRay]| visible(index, lights, rays);
            let own = common.and_then(|_| self.walk_on(receiver, threshold, scratch));
            let cut = match (common, own) {
                (Some(common), Some(own)) => self.evaluate_shared(receiver, visible, scratch, plus(common, own)),
                _ => self.lightcut_batched(receiver, Stop::Absolute(threshold), visible, scratch),
            };
            cuts.push(cut);
            if let Some(common) = &mut common {
                common.nodes_visited = 0;
            }
        }
    }

    /// The common walk: fills `common` and `undecided`; `None` if that alone is more than the largest cut.
    fn walk_together<R: Bundled>(&self, receivers: &[R], thresholds: &[f32], scratch: &mut Scratch) -> Option<Cut> {
        let Scratch { max_size, shared, .. } = scratch;
        let Shared { pending, common, undecided, halves, bounds, .. } = shared;
        [&mut *pending, common, undecided].into_iter().for_each(Vec::clear);
        halves.clear();
        bounds.clear();
        let positions = receivers.iter().map(|r| r.position());
        let corners = [positions.clone().reduce(Vec3::min)?, positions.reduce(Vec3::max)?].map(Vector3::splat);
        let bundle = R::bundle(receivers);
        let smallest = thresholds.iter().fold(f32::INFINITY, |a, &b| a.min(b)).max(0.0);
        let softening2 = Vec4::splat(self.softening2);
        let mut cut = Cut::default();
        let mut look = |indices: [usize; 4], count: usize, pending: &mut Vec<u32>| {
            let clusters = Cluster::four(indices.map(|index| &self.nodes[index]));
            let of_bundle = error_bound_of_bundle(&bundle, corners, &clusters, softening2).to_array();
            cut.nodes_visited += count as u32;
            let mut refined = None;
            for k in 0..count {
                let (index, bound, leaf) = (indices[k] as u32, of_bundle[k], self.nodes[indices[k]].is_leaf());
                if bound > smallest && !leaf {
                    let refined = *refined.get_or_insert_with(|| self.most_refine(receivers, thresholds, &clusters));
                    if refined[k] { pending.push(index) } else { undecided.push(index) }
                } else if bound > 0.0 {
                    common.push(index);
                    if !leaf {
                        cut.nodes_visited += 2;
                        cut.total_bound += bound;
                        cut.largest_bound = cut.largest_bound.max(bound);
                    }
                }
            }
            common.len() <= *max_size as usize
        };
        let roots = self.roots();
        let (first, last) = (roots.start, roots.end - 1);
        let mut fits = look([first, last, first, first], roots.len(), pending);
        while fits && let Some(a) = pending.pop() {
            let a = self.nodes[a as usize].children();
            fits = match pending.pop().map(|b| self.nodes[b as usize].children()) {
                Some(b) => look([a, a + 1, b, b + 1], 4, pending),
                None => look([a, a + 1, a, a], 2, pending),
            };
        }
        if !fits {
            return None;
        }
        for four in undecided.chunks(4) {
            bounds.push(Cluster::four(padded(four).map(|index| &self.nodes[index as usize])));
        }
        for two in common.chunks(2) {
            halves.push(self.halves([two[0], two[two.len() - 1]]));
        }
        Some(cut)
    }

    /// Which of four clusters all of the probes but one at most would refine.
    #[inline(always)]
    fn most_refine<R: Receiver>(&self, receivers: &[R], thresholds: &[f32], clusters: &Cluster<Vec4>) -> [bool; 4] {
        let probes = PROBES.min(receivers.len());
        let mut votes = [0; 4];
        for probe in 0..probes {
            let which = probe * (receivers.len() - 1) / (probes - 1).max(1);
            let (receiver, threshold) = (&receivers[which], thresholds[which].max(0.0));
            let position = Vector3::splat(receiver.position());
            let bounds = error_bound(receiver, position, clusters, Vec4::splat(self.softening2)).to_array();
            for (votes, bound) in votes.iter_mut().zip(bounds) {
                *votes += usize::from(bound > threshold);
            }
        }
        votes.map(|votes| votes + 1 >= probes)
    }

    /// What one receiver does with the undecided clusters: fills `selected`; `None` if the cut gets too large.
    #[inline(always)]
    fn walk_on<R: Receiver>(&self, receiver: &R, threshold: f32, scratch: &mut Scratch) -> Option<Cut> {
        // Taken out while the walk holds the rest of the scratch.
        let shared = std::mem::take(&mut scratch.shared);
        let most = scratch.max_size as usize - shared.common.len();
        let mut walk = Walk::new(self, receiver, threshold, scratch);
        let position = Vector3::splat(receiver.position());
        let mut fits = true;
        walk.cut.nodes_visited = shared.undecided.len() as u32;
        for (four, clusters) in shared.undecided.chunks(4).zip(&shared.bounds) {
            let bounds = error_bound(receiver, position, clusters, Vec4::splat(self.softening2));
            fits = fits && walk.has_room(most);
            if fits {
                walk.place(padded(four).map(|index| index as usize), bounds, four.len());
            }
        }
        fits = fits && walk.finish_walk(most);
        let cut = walk.finish();
        scratch.shared = shared;
        fits.then_some(cut)
    }

    /// Estimates of the common clusters and of those selected by the receiver alone.
    #[inline(always)]
    fn evaluate_shared<R: Receiver>(
        &self,
        receiver: &R,
        mut visible: impl FnMut(&[Light], &mut [ShadowRay]),
        scratch: &mut Scratch,
        mut cut: Cut,
    ) -> Cut {
        scratch.begin_estimate();
        let Scratch { rays, ray_count, shared: Shared { common, halves, radiance, .. }, .. } = scratch;
        radiance.resize(radiance.len().max(rays.len()), Vec4::ZERO);
        let position = Vector3::splat(receiver.position());
        for (two, halves) in common.chunks(2).zip(&*halves) {
            for (_, (ray, value)) in two.iter().zip(halves.estimates(receiver, position, self.softening2)) {
                rays[*ray_count] = ray;
                radiance[*ray_count] = value;
                *ray_count += usize::from(value.w > 0.0);
            }
        }
        let of_common = *ray_count;
        cut.nodes_visited += self.estimate_halves(receiver, scratch);
        let Scratch { rays, ray_count, terms, shared, selected_count, .. } = scratch;
        let rays = &mut rays[..*ray_count];
        if !rays.is_empty() {
            visible(&self.lights, rays);
        }
        let (of_common, own) = rays.split_at(of_common);
        let mut sum = Vec4::ZERO;
        for (ray, &value) in of_common.iter().zip(&shared.radiance) {
            sum += if ray.visible { value } else { Vec4::ZERO };
        }
        for (ray, &(value, _)) in own.iter().zip(&*terms) {
            sum += if ray.visible { value } else { Vec4::ZERO };
        }
        cut.radiance = sum.truncate();
        cut.shadow_rays = rays.len() as u32;
        cut.size = (shared.common.len() + *selected_count) as u32;
        cut
    }
}

/// Four of them, the last repeated.
fn padded(four: &[u32]) -> [u32; 4] {
    std::array::from_fn(|k| four[k.min(four.len() - 1)])
}

/// Bounds and counts of both together.
fn plus(a: Cut, b: Cut) -> Cut {
    Cut {
        largest_bound: a.largest_bound.max(b.largest_bound),
        total_bound: a.total_bound + b.total_bound,
        nodes_visited: a.nodes_visited + b.nodes_visited,
        ..Cut::default()
    }
}
