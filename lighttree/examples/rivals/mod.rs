//! The cut and its rivals, in one call: a cut whose representatives are drawn anew for each receiver, and
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
//!   the sum of a child's error bound, as a share of both, and of its share of the intensity times a floor; the bound
//!   of a single light is its light. A child is left out only where its bound is zero, so the estimate is unbiased.
//! * Random numbers are a function of stream and counter alone.

#![allow(dead_code, reason = "examples and tests use parts of it")]

use glam::{DVec3, Vec3};
use lighttree::{Cluster, Light, LightTree, Receiver, Scratch, Stop, exhaustive, luminance};

/// How much of its share of the intensity a child is drawn by at least: bounds may be far too large, and a light that is
/// drawn much too rarely is a bright spot.
const FLOOR: f32 = 0.05;

/// Estimator of the light at a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
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

/// Light at a receiver, and what it took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lit {
    /// Reflected radiance, linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Vec3,
    /// Calls of `visible`.
    pub shadow_rays: u32,
}

/// Light reflected at a receiver, by the method of choice.
pub fn illuminate<R: Receiver>(
    tree: &LightTree,
    receiver: &R,
    method: Method,
    visible: impl FnMut(&Light, usize) -> bool,
    scratch: &mut Scratch,
) -> Lit {
    match method {
        Method::Lightcut(stop) => {
            let cut = tree.lightcut(receiver, stop, visible, scratch);
            Lit { radiance: cut.radiance, shadow_rays: cut.shadow_rays }
        }
        Method::Stochastic { stop, stream } => {
            // The cut is chosen by bounds; where it follows the estimate, by the estimate without shadows.
            tree.lightcut_kept(receiver, stop, |_, _| true, scratch);
            let mut sum = Sum::new(tree, receiver, visible);
            for (counter, kept) in (0..).zip(scratch.kept()) {
                sum.add(kept.cluster, uniform(stream, counter));
            }
            sum.mean_of(1)
        }
        Method::Sampled { samples, stream } => {
            let samples = samples.max(1);
            let mut sum = Sum::new(tree, receiver, visible);
            for sample in 0..samples {
                // One random number in each of as many equal parts.
                let number = (f64::from(sample) + uniform(stream, u64::from(sample))) / f64::from(samples);
                tree.root_clusters().for_each(|root| sum.add(root, number));
            }
            sum.mean_of(samples)
        }
    }
}

/// Draws of light for one receiver.
pub struct Sum<'a, R, V> {
    tree: &'a LightTree,
    receiver: &'a R,
    visible: V,
    radiance: DVec3,
    shadow_rays: u32,
}

impl<'a, R: Receiver, V: FnMut(&Light, usize) -> bool> Sum<'a, R, V> {
    pub fn new(tree: &'a LightTree, receiver: &'a R, visible: V) -> Self {
        Self { tree, receiver, visible, radiance: DVec3::ZERO, shadow_rays: 0 }
    }

    /// Adds the light that a `number` in 0 … 1 draws from a cluster.
    fn add(&mut self, cluster: Cluster, number: f64) {
        let drawn = draw(self.tree, self.receiver, cluster, number);
        let radiance = self.share(&drawn);
        self.radiance += radiance;
    }

    /// Radiance that the light of a drawn leaf stands for; zero where the way ended in the dark.
    pub fn share(&mut self, drawn: &Drawn) -> DVec3 {
        let &Drawn { cluster, probability } = drawn;
        // Rounding may lead to a dark child after all, with probability zero.
        if self.tree.children(cluster).is_some() || probability == 0.0 {
            return DVec3::ZERO;
        }
        let index = cluster.light as usize;
        let (visible, shadow_rays) = (&mut self.visible, &mut self.shadow_rays);
        let radiance = alone(self.tree, self.receiver, index, |light, _| {
            *shadow_rays += 1;
            visible(light, index)
        });
        radiance.as_dvec3() / probability
    }

    fn mean_of(self, samples: u32) -> Lit {
        Lit { radiance: (self.radiance / f64::from(samples)).as_vec3(), shadow_rays: self.shadow_rays }
    }
}

/// A cluster that was drawn by importance: a light, or a cluster in which all is dark.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    pub cluster: Cluster,
    /// Probability of drawing it.
    probability: f64,
}

/// Goes down from a cluster by the number `draw` in 0 … 1, which is stretched again at each step.
pub fn draw<R: Receiver>(tree: &LightTree, receiver: &R, from: Cluster, mut draw: f64) -> Drawn {
    let (mut cluster, mut probability) = (from, 1.0);
    while let Some(children) = tree.children(cluster) {
        let [a, b] = children.map(|child| {
            let bound = match tree.children(child) {
                Some(_) => tree.cluster_bound(receiver, child),
                None => luminance(alone(tree, receiver, child.light as usize, |_, _| true)),
            };
            (f64::from(bound), f64::from(luminance(tree.cluster_intensity(child))))
        });
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
            cluster = children[0];
        } else {
            draw = (draw - share) / (1.0 - share);
            probability *= 1.0 - share;
            cluster = children[1];
        }
    }
    Drawn { cluster, probability }
}

/// Radiance reflected from one light \[W·m⁻²·sr⁻¹\].
fn alone<R: Receiver>(
    tree: &LightTree,
    receiver: &R,
    index: usize,
    visible: impl FnMut(&Light, usize) -> bool,
) -> Vec3 {
    exhaustive(&tree.lights()[index..=index], tree.geometry_term_bound(), receiver, visible)
}

/// A number between 0 and 1, both excluded, that depends on stream and counter alone (the finalizer of SplitMix64).
fn uniform(stream: u64, counter: u64) -> f64 {
    let seed = stream.wrapping_mul(0xd134_2543_de82_ef95);
    let mut z = seed.wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}
