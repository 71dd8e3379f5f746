//! Rivals of the cut, in one call: every light, a cut whose representatives are drawn anew for each receiver, and
//! plain importance sampling of the tree.
//!
//! `[Yuksel19]` C. Yuksel: Stochastic lightcuts. High-Performance Graphics 2019.
//!
//! A light of a cluster is drawn by going down from the cluster's node: at each step the child i is taken with
//! probability w_i / (w_0 + w_1), and the light found counts I_light / p times, p being the product of them all.
//!
//! # Differs from the paper
//!
//! * \[Yuksel19\] weighs children by intensity over squared distance, with the largest distance close by. Here w is
//!   the mean of a child's error bound, as a share of both, and of its share of the intensity times a floor: a child is
//!   left out only where its bound proves it dark, so the estimate is unbiased.
//! * Random numbers are a function of (seed, stream, node) and of nothing else: with the pixel as the stream they stay
//!   from frame to frame, and the picture does not flicker where nothing changes.

use glam::{DVec3, Vec3};

use crate::cut::{Cluster, Cut, KeptCluster, Scratch, Stop};
use crate::error_bound::{ClusterBounds, error_bound};
use crate::light::{Light, luminance, unshadowed};
use crate::race::uniform;
use crate::receiver::Receiver;
use crate::tree::LightTree;

/// How much of its share of the intensity a child is drawn by at least: bounds may be far too large, and a light that is
/// drawn much too rarely is a bright spot.
const FLOOR: f32 = 0.05;

/// Estimator of the light at a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Every light.
    Exhaustive,
    /// [`LightTree::lightcut`].
    Lightcut(Stop),
    /// The clusters of a cut, each by a light drawn for this receiver alone \[Yuksel19\]: errors become noise that
    /// differs between streams, where the cut's own representatives are wrong alike for all neighbors.
    Stochastic {
        /// Chooses the clusters. The thresholds bound errors of the clusters as they do for cuts.
        stop: Stop,
        /// Number of the random sequence, such as the pixel's index.
        stream: u64,
    },
    /// Independent lights drawn by importance from the root.
    Sampled {
        /// How many, at least one.
        samples: u32,
        /// Number of the random sequence, such as the pixel's index.
        stream: u64,
    },
}

/// A node that was drawn by importance: a leaf, or a node below which all is dark.
#[derive(Clone, Copy, Debug)]
struct Drawn {
    node: usize,
    /// Probability of drawing it.
    probability: f64,
}

impl LightTree {
    /// Light reflected at a receiver, by the method of choice. [`Cut::size`] counts lights that stood for clusters;
    /// bounds are those of clusters where there are any.
    pub fn illuminate<R: Receiver>(
        &self,
        receiver: &R,
        method: Method,
        mut visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) -> Cut {
        match method {
            Method::Exhaustive => {
                let mut cut = Cut { size: self.len() as u32, ..Cut::default() };
                cut.radiance = self.exhaustive(receiver, |light, index| {
                    cut.shadow_rays += 1;
                    visible(light, index)
                });
                cut
            }
            Method::Lightcut(stop) => self.lightcut(receiver, stop, visible, scratch),
            Method::Stochastic { stop, stream } => {
                // The cut is chosen by bounds; where it follows the estimate, by the estimate without shadows.
                let cut = self.lightcut_kept(receiver, stop, |_, _| true, scratch);
                let drawn = self.stochastic(receiver, &scratch.kept, stream, visible);
                let nodes_visited = cut.nodes_visited + drawn.nodes_visited;
                Cut { radiance: drawn.radiance, shadow_rays: drawn.shadow_rays, nodes_visited, ..cut }
            }
            Method::Sampled { samples, stream } => self.sampled(receiver, samples.max(1), stream, visible),
        }
    }

    /// The clusters of a cut, each by a light drawn for this receiver: radiance, and what it takes.
    fn stochastic<R: Receiver>(
        &self,
        receiver: &R,
        clusters: &[KeptCluster],
        stream: u64,
        mut visible: impl FnMut(&Light, usize) -> bool,
    ) -> Cut {
        let mut cut = Cut::default();
        let mut sum = DVec3::ZERO;
        for &KeptCluster { cluster: Cluster { node, .. }, .. } in clusters {
            let draw = uniform(self.seed ^ stream.wrapping_mul(0xd134_2543_de82_ef95), u64::from(node));
            let drawn = self.draw(receiver, node as usize, draw, &mut cut.nodes_visited);
            sum += self.share(receiver, drawn, &mut visible, &mut cut.shadow_rays);
        }
        cut.radiance = sum.as_vec3();
        cut
    }

    fn sampled<R: Receiver>(
        &self,
        receiver: &R,
        samples: u32,
        stream: u64,
        mut visible: impl FnMut(&Light, usize) -> bool,
    ) -> Cut {
        let mut cut = Cut { size: samples, ..Cut::default() };
        let mut sum = DVec3::ZERO;
        let roots = self.roots();
        for sample in 0..samples {
            // One random number in each of as many equal parts.
            let offset = uniform(self.seed ^ stream.wrapping_mul(0xd134_2543_de82_ef95), u64::from(sample));
            let draw = (f64::from(sample) + offset) / f64::from(samples);
            for root in roots.clone() {
                let drawn = self.draw(receiver, root, draw, &mut cut.nodes_visited);
                sum += self.share(receiver, drawn, &mut visible, &mut cut.shadow_rays);
            }
        }
        cut.radiance = (sum / f64::from(samples)).as_vec3();
        cut
    }

    /// Goes down from a node by the number `draw` in 0 … 1, which is stretched again at each step.
    fn draw<R: Receiver>(&self, receiver: &R, node: usize, mut draw: f64, visited: &mut u32) -> Drawn {
        let (mut index, mut probability) = (node, 1.0);
        while !self.nodes[index].is_leaf() {
            let first = self.nodes[index].children();
            let position = receiver.position().into();
            let [a, b] = [first, first + 1].map(|child| {
                let node = &self.nodes[child];
                let bound = error_bound(receiver, position, &ClusterBounds::one(node), self.geometry_term_bound);
                (f64::from(bound), f64::from(luminance(node.intensity)))
            });
            *visited += 2;
            let (bounds, intensities) = (a.0 + b.0, a.1 + b.1);
            if bounds <= 0.0 {
                break;
            }
            let weight = |child: (f64, f64)| {
                if child.0 > 0.0 { child.0 / bounds + f64::from(FLOOR) * child.1 / intensities } else { 0.0 }
            };
            let share = weight(a) / (weight(a) + weight(b));
            if draw < share {
                draw /= share;
                probability *= share;
                index = first;
            } else {
                draw = (draw - share) / (1.0 - share);
                probability *= 1.0 - share;
                index = first + 1;
            }
        }
        Drawn { node: index, probability }
    }

    /// Radiance that the light of a drawn leaf stands for; zero where the way ended in the dark.
    fn share<R: Receiver>(
        &self,
        receiver: &R,
        drawn: Drawn,
        visible: &mut impl FnMut(&Light, usize) -> bool,
        shadow_rays: &mut u32,
    ) -> DVec3 {
        let Drawn { node, probability } = drawn;
        // Rounding may lead to a dark child after all, with probability zero.
        if !self.nodes[node].is_leaf() || probability == 0.0 {
            return DVec3::ZERO;
        }
        let index = self.nodes[node].representative as usize;
        let site = self.sites.of(node).one();
        let unit = Vec3::from(unshadowed(receiver, receiver.position().into(), &site, self.geometry_term_bound));
        if unit == Vec3::ZERO {
            return DVec3::ZERO;
        }
        *shadow_rays += 1;
        if !visible(&self.lights[index], index) {
            return DVec3::ZERO;
        }
        (unit * self.lights[index].intensity).as_dvec3() / probability
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::BuildParams;
    use crate::testing;

    impl LightTree {
        /// The mean of [`LightTree::share`] over all numbers that [`LightTree::draw`] may be given, without chance: what
        /// is drawn is the same within intervals of the number, whose ends are found by bisection.
        fn mean_of_draws(
            &self,
            receiver: &crate::Lambert,
            node: usize,
            mut visible: impl FnMut(&Light, usize) -> bool,
        ) -> DVec3 {
            let draw = |number| self.draw(receiver, node, number, &mut 0);
            let (mut sum, mut start) = (DVec3::ZERO, 0.0);
            while start < 1.0 {
                let drawn = draw(start);
                let (mut same, mut other) = (start, 1.0);
                while (same + other) / 2.0 > same && (same + other) / 2.0 < other {
                    let middle = (same + other) / 2.0;
                    if draw(middle).node == drawn.node { same = middle } else { other = middle }
                }
                sum += (other - start) * self.share(receiver, drawn, &mut visible, &mut 0);
                start = other;
            }
            sum
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        /// Light drawn from the roots is on average the sum over every light, however rarely one of them is drawn.
        #[test]
        fn drawn_lights_are_right_on_average(scene in testing::scene(1..40), shadow_seed: u64) {
            let tree = LightTree::build(&scene.lights, BuildParams::bounded_by(scene.geometry_term_bound).with_seed(scene.seed));
            let visible = |_: &Light, k: usize| testing::visible(shadow_seed, k);
            let truth = tree.exhaustive(&scene.receiver, visible).as_dvec3();
            let mean: DVec3 = tree.roots().map(|root| tree.mean_of_draws(&scene.receiver, root, visible)).sum();
            prop_assert!((mean - truth).abs().cmple(1e-4 * truth).all(), "{mean}, truth {truth}");
        }
    }

    /// The mean over many streams is the sum over every light, within five standard errors. The lights differ little, so
    /// that no rare one hides from the estimate of the standard error.
    #[test]
    fn streams_are_right_on_average() {
        let lights: Vec<Light> = (0..40)
            .map(|k| Light {
                position: Vec3::new((k % 8) as f32, (k / 8) as f32, 2.0),
                emission: crate::Emission::Cosine(Vec3::NEG_Z),
                intensity: Vec3::splat(1.0 + (k % 3) as f32),
            })
            .collect();
        let tree = LightTree::build(&lights, BuildParams::bounded_by(0.1).with_seed(1));
        let receiver = crate::Lambert { position: Vec3::new(3.0, 1.0, 0.0), normal: Vec3::Z, reflectance: Vec3::ONE };
        let visible = |_: &Light, k: usize| testing::visible(5, k);
        let truth = f64::from(luminance(tree.exhaustive(&receiver, visible)));
        let stop = Stop::Absolute(0.1 * truth as f32);
        type Choice = fn(u64, Stop) -> Method;
        let methods: [Choice; 2] =
            [|stream, stop| Method::Stochastic { stop, stream }, |stream, _| Method::Sampled { samples: 2, stream }];
        let mut scratch = Scratch::default();
        for method in methods {
            let streams = 40_000;
            let (mut sum, mut squares) = (0.0, 0.0);
            for stream in 0..streams {
                let cut = tree.illuminate(&receiver, method(stream, stop), visible, &mut scratch);
                let value = f64::from(luminance(cut.radiance));
                (sum, squares) = (sum + value, squares + value * value);
            }
            let mean = sum / streams as f64;
            let error = ((squares / streams as f64 - mean * mean).max(0.0) / streams as f64).sqrt();
            assert!(error < 0.01 * truth, "{error} says nothing beside {truth}");
            assert!((mean - truth).abs() <= 5.0 * error, "{mean} ± {error}, truth {truth}");
        }
    }

    /// The same stream gives the same bits, and another one another choice.
    #[test]
    fn streams_are_stable_and_differ() {
        let lights: Vec<Light> = (0..200)
            .map(|k| Light {
                position: Vec3::new((k % 20) as f32, (k / 20) as f32, 3.0),
                emission: crate::Emission::Cosine(Vec3::NEG_Z),
                intensity: Vec3::splat(1.0 + (k % 7) as f32),
            })
            .collect();
        let tree = LightTree::build(&lights, BuildParams::bounded_by(0.1).with_seed(1));
        let receiver = crate::Lambert { position: Vec3::ZERO, normal: Vec3::Z, reflectance: Vec3::ONE };
        let mut scratch = Scratch::default();
        let mut at = |stream| {
            let stop = Stop::Absolute(0.05);
            tree.illuminate(&receiver, Method::Stochastic { stop, stream }, |_, _| true, &mut scratch).radiance
        };
        assert_eq!(at(7), at(7));
        assert_ne!(at(7), at(8));
        let every = tree.illuminate(&receiver, Method::Exhaustive, |_, _| true, &mut Scratch::default());
        assert_eq!((every.radiance, every.shadow_rays), (tree.exhaustive(&receiver, |_, _| true), 200));
    }
}
