//! The lightcut and two other methods behind one function: a lightcut with representatives drawn for each receiver, and
//! plain importance sampling of the tree.
//!
//! `[Yuksel19]` C. Yuksel: Stochastic lightcuts. High-Performance Graphics 2019.
//!
//! A light of a cluster is drawn by descending from the cluster's node. Each step selects child i with probability w_i
//! / (w_0 + w_1). The drawn light contributes I_light / p, where p is the product of these probabilities.
//!
//! # Differences from the paper
//!
//! * \[Yuksel19\] weighs children by intensity over squared distance, and uses the largest distance at close range. In
//!   this module w has two terms: the child's fraction of both error bounds, and its fraction of the intensity times
//!   `FLOOR`. The bound of a single light is its unshadowed contribution. Only children with a bound of zero are
//!   excluded, so the estimate is unbiased.
//! * Random numbers depend only on the stream and a counter.

#![allow(dead_code, reason = "examples and tests use parts of it")]

use glam::{DVec3, Vec3};
use lighttree::{Cluster, Light, LightTree, Receiver, Scratch, Stop, exhaustive, luminance};

/// Minimum weight of a child, relative to its fraction of the intensity. One child's bound may be far too large, so
/// that the other child would be drawn far too rarely. A light that is drawn too rarely appears as a bright spot.
const FLOOR: f32 = 0.05;

/// Estimator of the light at a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// A deterministic lightcut, computed by [`LightTree::lightcut`].
    Lightcut(Stop),
    /// The clusters of a lightcut, each estimated by a light drawn for this receiver \[Yuksel19\]. Errors become noise
    /// that differs between streams. The lightcut's own representatives cause equal errors in all neighbors.
    Stochastic {
        /// Stopping rule of the lightcut. Its threshold bounds the error of each cluster.
        stop: Stop,
        /// Index of the random sequence, such as the pixel's index.
        stream: u64,
    },
    /// Independent lights, drawn by importance from the root.
    Sampled {
        /// Number of samples, at least 1.
        samples: u32,
        /// Index of the random sequence, such as the pixel's index.
        stream: u64,
    },
}

/// Light at a receiver, and its cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lit {
    /// Reflected radiance, linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Vec3,
    /// Number of calls of `visible`.
    pub shadow_rays: u32,
}

/// Returns the light reflected at a receiver, computed by `method`.
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
            // Choose the lightcut by bounds. A relative threshold uses the unshadowed estimate.
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
                // Draw stratified samples: one random number per stratum.
                let number = (f64::from(sample) + uniform(stream, u64::from(sample))) / f64::from(samples);
                tree.root_clusters().for_each(|root| sum.add(root, number));
            }
            sum.mean_of(samples)
        }
    }
}

/// Accumulated samples of light for one receiver.
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

    /// Adds the light that the number `number`, 0 … 1, draws from a cluster.
    fn add(&mut self, cluster: Cluster, number: f64) {
        let drawn = draw(self.tree, self.receiver, cluster, number);
        let radiance = self.share(&drawn);
        self.radiance += radiance;
    }

    /// Returns the radiance represented by the light of a drawn leaf. It is zero if the descent ended in a dark
    /// cluster.
    pub fn share(&mut self, drawn: &Drawn) -> DVec3 {
        let &Drawn { cluster, probability } = drawn;
        // Rounding may select a dark child with probability zero.
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

/// A cluster drawn by importance: a single light, or a completely dark cluster.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    pub cluster: Cluster,
    /// Probability of this draw.
    probability: f64,
}

/// Descends from a cluster with the random number `draw`, 0 … 1, which is rescaled at each step.
pub fn draw<R: Receiver>(tree: &LightTree, receiver: &R, from: Cluster, mut draw: f64) -> Drawn {
    let (mut cluster, mut probability) = (from, 1.0);
    while let Some(children) = tree.children(cluster) {
        // The bound of a single light is its unshadowed contribution.
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
        // Choose a child, and rescale the number for the next step.
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

/// Returns the radiance reflected from one light \[W·m⁻²·sr⁻¹\].
fn alone<R: Receiver>(
    tree: &LightTree,
    receiver: &R,
    index: usize,
    visible: impl FnMut(&Light, usize) -> bool,
) -> Vec3 {
    exhaustive(&tree.lights()[index..=index], tree.geometry_term_bound(), receiver, visible)
}

/// Returns a number in the open interval (0, 1) that depends only on the stream and a counter (the finalizer of
/// SplitMix64).
fn uniform(stream: u64, counter: u64) -> f64 {
    let seed = stream.wrapping_mul(0xd134_2543_de82_ef95);
    let mut z = seed.wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}
