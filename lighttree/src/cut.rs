//! The lightcut: refine the worst cluster until all are below the threshold \[Walter05, section 4\].
//!
//! # Differs from the paper
//!
//! * With an absolute threshold the order of refinement does not matter: a node is refined if its bound and those of
//!   all its ancestors exceed the threshold. So no heap is needed; the tree is walked depth first by bounds alone, and
//!   only then are the chosen representatives evaluated, each once. Cuts that would exceed the largest size, and
//!   relative thresholds, go best first as in the paper.
//!   (The walk branches, so that the processor runs ahead on a guess of the next node: branch-free it took 24 ns per
//!   node instead of 15.)
//! * A cluster whose bound is exactly zero contributes exactly nothing. It is dropped: no estimate, no shadow ray, no
//!   place in the size of the cut.

mod best_first;

use glam::{Vec3, Vec3A};

use crate::error_bound::error_bound;
use crate::light::{Light, unshadowed};
use crate::receiver::Receiver;
use crate::tree::LightTree;
use best_first::Refined;

/// Largest cut of \[Walter05\].
const PAPER_MAX_SIZE: u32 = 1000;

/// When a cut is fine enough. Either way it also ends at the largest size the [`Scratch`] allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// No cluster may be wrong by more than this luminance \[W·m⁻²·sr⁻¹\]; 0 asks for every light.
    Absolute(f32),
    /// No cluster may be wrong by more than a fraction of the pixel's luminance: the paper's rule, with 2 %.
    Relative {
        /// Share of the luminance that a cluster may be wrong by; 0.02 in the paper.
        fraction: f32,
        /// Luminance already known to be at this pixel, to which the cut adds \[W·m⁻²·sr⁻¹\].
        known_luminance: f32,
    },
}

/// The result of a cut at one receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cut {
    /// Reflected radiance, linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Vec3,
    /// Clusters in the cut, single lights included; those that provably contribute nothing are not counted.
    pub size: u32,
    /// Calls of `visible`, at most one per light. An absolute cut asks for its own clusters only, a relative one also
    /// for clusters on its way that turn out dark.
    pub shadow_rays: u32,
    /// Largest error bound of a cluster in the cut, as luminance \[W·m⁻²·sr⁻¹\].
    pub largest_bound: f32,
    /// Sum of all error bounds: the luminance of `radiance` is at most this far from the sum over every light.
    pub total_bound: f32,
    /// Nodes that were looked at, for a bound or an estimate.
    pub nodes_visited: u32,
}

/// A cluster of a cut. It outlives the cut: positions in a tree never change, intensities come with each update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cluster {
    node: u32,
    /// Index of the light that stood for the cluster.
    pub light: u32,
}

/// Memory of a cut, kept by the caller from one to the next: one per thread.
#[derive(Clone, Debug)]
pub struct Scratch {
    max_size: u32,
    /// Nodes still to be refined.
    pending: Vec<u32>,
    /// Nodes in the cut.
    selected: Vec<u32>,
    refined: Refined,
}

impl Default for Scratch {
    /// Cuts of 1000 clusters at most, as in the paper.
    fn default() -> Self {
        Self::with_max_size(PAPER_MAX_SIZE)
    }
}

impl Scratch {
    /// Cuts of this many clusters at most (at least one).
    pub fn with_max_size(max_size: u32) -> Self {
        Self { max_size: max_size.max(1), pending: Vec::new(), selected: Vec::new(), refined: Refined::default() }
    }

    /// The largest cut \[clusters\].
    pub fn max_size(&self) -> u32 {
        self.max_size
    }
}

impl LightTree {
    /// Light reflected at a receiver from all lights of the tree, to the accuracy that `stop` asks for.
    ///
    /// `visible(light, index)` casts the shadow ray between the receiver's position and the light; it is asked only for
    /// lights that would contribute. The result depends on its arguments alone. Nothing is allocated once the scratch
    /// has served a cut in this tree.
    pub fn lightcut<R: Receiver>(
        &self,
        receiver: &R,
        stop: Stop,
        visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) -> Cut {
        self.lightcut_with(receiver, stop, visible, scratch, |_, _| {})
    }

    /// As [`LightTree::lightcut`], and hands every cluster of the finished cut to `each`, with M · G · V of its
    /// representative: radiance per intensity \[m⁻²\], zero where it is hidden. The cut's radiance is the sum of that times
    /// [`LightTree::cluster_intensity`].
    pub fn lightcut_with<R: Receiver>(
        &self,
        receiver: &R,
        stop: Stop,
        mut visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
        mut each: impl FnMut(Cluster, Vec3),
    ) -> Cut {
        if self.nodes.is_empty() {
            return Cut::default();
        }
        match stop {
            Stop::Absolute(threshold) => match self.select(receiver, threshold, scratch) {
                Some(cut) => self.evaluate(receiver, &mut visible, &scratch.selected, cut, &mut each),
                None => self.best_first(receiver, |_| threshold, &mut visible, scratch, &mut each),
            },
            Stop::Relative { fraction, known_luminance } => {
                let threshold = |estimate: f32| fraction * (known_luminance + estimate);
                self.best_first(receiver, threshold, &mut visible, scratch, &mut each)
            }
        }
    }

    /// Intensity that a cluster has now, after any [`update`](LightTree::update) since the cut that it comes from
    /// \[W·sr⁻¹\].
    ///
    /// # Panics
    ///
    /// If the cluster comes from a larger tree.
    #[inline]
    pub fn cluster_intensity(&self, cluster: Cluster) -> Vec3 {
        self.nodes[cluster.node as usize].intensity
    }

    /// Collects the nodes of the cut, by bounds alone; `None` if they are too many.
    fn select<R: Receiver>(&self, receiver: &R, threshold: f32, scratch: &mut Scratch) -> Option<Cut> {
        let position = Vec3A::from(receiver.position());
        let threshold = threshold.max(0.0);
        let Scratch { max_size, pending, selected, .. } = scratch;
        pending.clear();
        selected.clear();
        pending.reserve(self.depth + 1);
        selected.reserve(*max_size as usize + 2);
        let mut cut = Cut { nodes_visited: 1, ..Cut::default() };
        // A child is part of the cut, to be refined, or dark.
        let place = |index: usize, pending: &mut Vec<u32>, selected: &mut Vec<u32>, cut: &mut Cut| {
            let node = &self.nodes[index];
            if node.is_leaf() {
                selected.push(index as u32);
                return;
            }
            let bound = error_bound(receiver, position, node, self.softening2);
            if bound > threshold {
                pending.push(index as u32);
            } else if bound > 0.0 {
                selected.push(index as u32);
                cut.total_bound += bound;
                cut.largest_bound = cut.largest_bound.max(bound);
            }
        };
        place(0, pending, selected, &mut cut);
        while let Some(index) = pending.pop() {
            let first = self.nodes[index as usize].children();
            place(first, pending, selected, &mut cut);
            place(first + 1, pending, selected, &mut cut);
            cut.nodes_visited += 2;
            if selected.len() > *max_size as usize {
                return None;
            }
        }
        cut.size = selected.len() as u32;
        Some(cut)
    }

    /// Sums the estimates of the selected nodes: M · G · V of the representative times the cluster's intensity.
    fn evaluate<R: Receiver>(
        &self,
        receiver: &R,
        visible: &mut impl FnMut(&Light, usize) -> bool,
        selected: &[u32],
        mut cut: Cut,
        each: &mut impl FnMut(Cluster, Vec3),
    ) -> Cut {
        for &index in selected {
            let node = &self.nodes[index as usize];
            let unit = self.representative_term(receiver, node.representative, visible, &mut cut.shadow_rays);
            cut.radiance += unit * node.intensity;
            each(Cluster { node: index, light: node.representative }, unit);
        }
        cut
    }

    /// M · G · V of one light.
    #[inline]
    fn representative_term<R: Receiver>(
        &self,
        receiver: &R,
        light: u32,
        visible: &mut impl FnMut(&Light, usize) -> bool,
        shadow_rays: &mut u32,
    ) -> Vec3 {
        let site = &self.lights[light as usize];
        let unit = unshadowed(receiver, site, self.softening2);
        if unit == Vec3::ZERO {
            return unit;
        }
        *shadow_rays += 1;
        if visible(site, light as usize) { unit } else { Vec3::ZERO }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::BuildParams;
    use crate::light::Emission;
    use crate::receiver::Lambert;

    fn ceiling(side: u32) -> LightTree {
        let lights: Vec<Light> = (0..side * side)
            .map(|k| Light {
                position: Vec3::new((k % side) as f32, (k / side) as f32, side as f32),
                emission: Emission::Cosine(Vec3::NEG_Z),
                intensity: Vec3::ONE,
            })
            .collect();
        LightTree::build(&lights, BuildParams { softening2: 0.3, seed: 3 })
    }

    /// Both ways through the tree give the same cut where both can be taken.
    #[test]
    fn order_of_refinement_does_not_matter() {
        let tree = ceiling(40);
        let mut scratch = Scratch::default();
        for k in 0..40 {
            let position = Vec3::new(k as f32, 13.0, 0.1);
            let receiver = Lambert { position, normal: Vec3::Z, reflectance: Vec3::ONE };
            let mut visible = |_: &Light, index: usize| index & 3 != 0;
            let threshold = 0.005;
            let depth_first = tree.lightcut(&receiver, Stop::Absolute(threshold), &mut visible, &mut scratch);
            let best_first = tree.best_first(&receiver, |_| threshold, &mut visible, &mut scratch, &mut |_, _| {});
            assert_eq!(depth_first.size, best_first.size);
            assert_eq!(depth_first.largest_bound, best_first.largest_bound);
            assert_eq!(depth_first.nodes_visited, best_first.nodes_visited);
            assert!(depth_first.size > 20, "{depth_first:?}");
            assert!(best_first.radiance.abs_diff_eq(depth_first.radiance, 1e-5 * depth_first.radiance.x));
        }
    }

    /// The clusters handed out are the cut: their number, and their sum to the last bit but rounding; and they take new
    /// intensities as the tree does.
    #[test]
    fn clusters_sum_to_the_cut() {
        let mut tree = ceiling(30);
        let receiver = Lambert { position: Vec3::new(9.0, 13.0, 0.1), normal: Vec3::Z, reflectance: Vec3::ONE };
        let mut scratch = Scratch::default();
        for stop in [Stop::Absolute(0.005), Stop::Relative { fraction: 0.02, known_luminance: 0.0 }] {
            let mut clusters = Vec::new();
            let visible = |_: &Light, index: usize| index & 3 != 0;
            let cut = tree.lightcut_with(&receiver, stop, visible, &mut scratch, |c, unit| clusters.push((c, unit)));
            assert_eq!(clusters.len(), cut.size as usize);
            let sum =
                |tree: &LightTree| clusters.iter().map(|&(c, unit)| unit * tree.cluster_intensity(c)).sum::<Vec3>();
            assert!(sum(&tree).abs_diff_eq(cut.radiance, 1e-5 * cut.radiance.x), "{} {}", sum(&tree), cut.radiance);
            let before = sum(&tree);
            let doubled: Vec<Vec3> = tree.lights().iter().map(|light| light.intensity * 2.0).collect();
            tree.update_drawn(&doubled);
            assert_eq!(sum(&tree), before * 2.0);
        }
    }

    /// After the first cut in a tree no buffer grows, whatever the threshold.
    #[test]
    fn scratch_is_reused() {
        let tree = ceiling(50);
        let mut scratch = Scratch::with_max_size(200);
        let receiver = Lambert { position: Vec3::new(20.0, 20.0, 49.0), normal: Vec3::Z, reflectance: Vec3::ONE };
        let capacities =
            |scratch: &Scratch| (scratch.pending.capacity(), scratch.selected.capacity(), scratch.refined.capacities());
        tree.lightcut(&receiver, Stop::Absolute(1.0), |_, _| true, &mut scratch);
        tree.lightcut(&receiver, Stop::Relative { fraction: 1.0, known_luminance: 0.0 }, |_, _| true, &mut scratch);
        let before = capacities(&scratch);
        for threshold in [1e3, 1.0, 1e-3, 0.0] {
            let cut = tree.lightcut(&receiver, Stop::Absolute(threshold), |_, _| true, &mut scratch);
            assert!(cut.size <= 200);
            assert_eq!(capacities(&scratch), before);
        }
    }
}
