//! A new tree for lights that have moved their energy, built while frames go on with the old one.
//!
//! [`Rebuild`] clusters the lights in a thread of its own. When its tree is taken is the caller's choice, at a frame
//! border, and never the clock's: a film must not depend on how fast it was made.
//!
//! The clusters of the new tree are others, and so are their errors, each below its threshold. [`Handover`] fades from
//! one tree to the other over some frames, so that the difference comes in steps that are as much smaller.
//! As representatives are [drawn by light](crate::race) and not by node, clusters that both trees have give the same.

use std::thread::JoinHandle;

use glam::Vec3;

use crate::build::{BuildParams, Builder};
use crate::cut::{Cut, Scratch, Stop};
use crate::light::Light;
use crate::receiver::Receiver;
use crate::tree::LightTree;
use crate::update::UpdateStats;

/// A tree that is being built in the background.
#[derive(Debug)]
pub struct Rebuild {
    thread: JoinHandle<LightTree>,
}

impl Rebuild {
    /// Begins to cluster the lights of `tree` with the intensities that they have now.
    #[must_use]
    pub fn start(tree: &LightTree, builder: Builder) -> Self {
        let (lights, params) =
            (tree.lights.clone(), BuildParams::bounded_by(tree.geometry_term_bound).with_seed(tree.seed));
        Self { thread: std::thread::spawn(move || LightTree::build_by(builder, &lights, params)) }
    }

    /// Whether [`Rebuild::finish`] would not have to wait. What a film looks like must not depend on it.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.thread.is_finished()
    }

    /// The new tree, after waiting for it if need be, with what has become of the lights in `tree` since: intensities,
    /// lights inserted and removed.
    ///
    /// # Panics
    ///
    /// If `tree` has fewer lights than the one that the rebuild began with.
    #[must_use]
    pub fn finish(self, tree: &LightTree) -> LightTree {
        let mut fresh = self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        let known = fresh.len();
        fresh.insert(&tree.lights[known..]);
        fresh.misplaced.clone_from(&tree.misplaced);
        fresh.rejected = tree.rejected;
        let intensities: Vec<Vec3> = tree.lights.iter().map(|light| light.intensity).collect();
        fresh.update_drawn(&intensities);
        fresh.cost_at_build = fresh.relative_cost();
        fresh
    }
}

/// The frames in which one tree takes over from another.
#[derive(Clone, Debug)]
pub struct Handover {
    from: LightTree,
    to: LightTree,
    step: u32,
    steps: u32,
}

impl Handover {
    /// Fades from one tree to the other in `steps` frames, one at least: in the k-th of them the new tree counts
    /// k / (steps + 1).
    #[must_use]
    pub fn new(from: LightTree, to: LightTree, steps: u32) -> Self {
        Self { from, to, step: 1, steps: steps.max(1) }
    }

    /// Share of the new tree in this frame, 0 … 1.
    #[must_use]
    pub fn share(&self) -> f32 {
        self.step as f32 / (self.steps + 1) as f32
    }

    /// Both trees.
    #[must_use]
    pub fn trees(&self) -> [&LightTree; 2] {
        [&self.from, &self.to]
    }

    /// Goes on to the next frame.
    pub fn advance(&mut self) {
        self.step = (self.step + 1).min(self.steps + 1);
    }

    /// Whether the new tree is all there is.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.step > self.steps
    }

    /// The new tree.
    #[must_use]
    pub fn into_new(self) -> LightTree {
        self.to
    }

    /// [`LightTree::update_drawn`] for both; the figures are the new tree's.
    ///
    /// # Panics
    ///
    /// If there is not one intensity per light.
    pub fn update_drawn(&mut self, intensities: &[Vec3]) -> UpdateStats {
        self.from.update_drawn(intensities);
        self.to.update_drawn(intensities)
    }

    /// A [`lightcut`](LightTree::lightcut) in each tree, mixed. Bounds are mixed alike and hold for the mixture; sizes
    /// and rays are those of both.
    pub fn lightcut<R: Receiver>(
        &self,
        receiver: &R,
        stop: Stop,
        mut visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) -> Cut {
        let a = self.from.lightcut(receiver, stop, &mut visible, scratch);
        let b = self.to.lightcut(receiver, stop, &mut visible, scratch);
        let mix = |a: f32, b: f32| a + (b - a) * self.share();
        Cut {
            radiance: a.radiance.lerp(b.radiance, self.share()),
            size: a.size + b.size,
            shadow_rays: a.shadow_rays + b.shadow_rays,
            largest_bound: mix(a.largest_bound, b.largest_bound),
            total_bound: mix(a.total_bound, b.total_bound),
            nodes_visited: a.nodes_visited + b.nodes_visited,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Emission, Lambert, luminance};

    fn wall(time: f32) -> Vec<Light> {
        (0..900)
            .map(|k| {
                let position = Vec3::new((k % 30) as f32, (k / 30) as f32, 8.0);
                let spot = Vec3::new(15.0 + 14.0 * time.cos(), 15.0 + 14.0 * time.sin(), 8.0);
                let intensity = Vec3::splat((-0.05 * position.distance_squared(spot)).exp() + 0.01);
                Light { position, emission: Emission::Cosine(Vec3::NEG_Z), intensity }
            })
            .collect()
    }

    /// The fade's steps are an (n + 1)-th of the jump each, begin at the old tree's picture and end at the new one's.
    #[test]
    fn a_handover_has_no_jump() {
        let params = BuildParams::bounded_by(0.3).with_seed(4);
        let mut old = LightTree::build(&wall(0.0), params);
        let rebuild = Rebuild::start(&old, Builder::TopDown);
        let now: Vec<Vec3> = wall(2.0).iter().map(|light| light.intensity).collect();
        old.update_drawn(&now);
        let extra = old.insert(&[Light { position: Vec3::splat(9.0), ..wall(0.0)[0] }]);
        old.remove(&[17]);
        let new = rebuild.finish(&old);
        assert_eq!((new.validate(), new.lights() == old.lights(), extra), (Ok(()), true, 900..901));

        let receivers: Vec<Lambert> = (0..100)
            .map(|k| Lambert {
                position: Vec3::new((k % 10) as f32 * 3.0, (k / 10) as f32 * 3.0, 0.0),
                normal: Vec3::Z,
                reflectance: Vec3::ONE,
            })
            .collect();
        let mut scratch = Scratch::default();
        let stop = Stop::Absolute(0.01);
        let picture = |tree: &LightTree, scratch: &mut Scratch| -> Vec<f32> {
            receivers.iter().map(|r| luminance(tree.lightcut(r, stop, |_, _| true, scratch).radiance)).collect()
        };
        let largest = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let (first, last) = (picture(&old, &mut scratch), picture(&new, &mut scratch));
        let jump = largest(&first, &last);
        assert!(jump > 0.0);

        let mut before = first;
        let mut handover = Handover::new(old, new, 7);
        loop {
            let now: Vec<f32> = receivers
                .iter()
                .map(|r| {
                    let cut = handover.lightcut(r, stop, |_, _| true, &mut scratch);
                    let truth = luminance(handover.to.exhaustive(r, |_, _| true));
                    assert!((luminance(cut.radiance) - truth).abs() <= cut.total_bound);
                    luminance(cut.radiance)
                })
                .collect();
            assert!(largest(&before, &now) <= jump / 8.0 * 1.001 + 1e-6, "{} of {jump}", largest(&before, &now));
            before = now;
            handover.advance();
            if handover.is_over() {
                break;
            }
        }
        assert!(largest(&before, &last) <= jump / 8.0 * 1.001 + 1e-6);
    }
}
