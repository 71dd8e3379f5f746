//! New intensities for an old tree.
//!
//! `[Herzog08]` R. Herzog, S. Kinuwaki, K. Myszkowski, H.-P. Seidel: Render2MPEG: a perception-based framework towards
//! integrating rendering and video compression. Eurographics 2008, section on the temporal light tree.
//!
//! # Differs from the paper
//!
//! Nothing in the rule of [`LightTree::update`]. As it compares only the two present intensities, the first update also
//! turns those draws of [`LightTree::build`] round in which the much dimmer child had won.
//! [`LightTree::update_drawn`] is ours: it keeps the draws (`race.rs`).

use glam::Vec3;

use crate::light::{accepted_intensity, luminance};
use crate::node::{Node, sibling};
use crate::race::arrivals;
use crate::tree::LightTree;

/// C_I of \[Herzog08\]: the representative child may be this much dimmer than its sibling.
const SWAP_RATIO: f32 = 0.7;

/// Changes of an update, and how well the old clusters fit the new intensities.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct UpdateStats {
    /// Nodes that now take their representative from the other child.
    pub swapped: usize,
    /// The same as a share of all nodes with children, 0 … 1.
    pub swapped_share: f64,
    /// Nodes whose representative light changed, by a swap in them or below.
    pub representatives_changed: usize,
    /// Lights that went dark because their new intensity was negative, not finite or too large,
    /// or because they have no usable position.
    pub rejected: usize,
    /// Cost of the clusters below the root per total luminance, relative to the cost at the build: 1 is as good as new.
    /// It grows where intensity moves into spread-out clusters. At a growth of 7, cuts are 2 to 7 % larger than in a new
    /// tree, at 11 they are 7 to 10 % larger (`examples/drift.rs`).
    pub cost_growth: f64,
}

impl LightTree {
    /// Gives light k the intensity `intensities[k]` \[W·sr⁻¹\], sums upward, and lets a node take the representative of
    /// its other child where the present one's intensity has fallen below 0.7 of the other's. Structure and bounds stay.
    ///
    /// # Panics
    ///
    /// If there is not one intensity per light.
    pub fn update(&mut self, intensities: &[Vec3]) -> UpdateStats {
        let rejected = self.accept(intensities);
        let dimmer =
            |chosen: &Node, other: &Node| luminance(chosen.intensity) < SWAP_RATIO * luminance(other.intensity);
        UpdateStats { rejected, ..self.sum_upward(dimmer) }
    }

    /// As [`LightTree::update`], but a node's representative stays the winner of its lights' race: a light keeps the
    /// random number it was built with, and whoever wins in the present intensities represents.
    ///
    /// So the representative stays drawn in proportion to intensity, where the paper's rule leans to the brighter child
    /// and with it the errors of all clusters to one side; and a swap still happens only where the balance moved.
    ///
    /// # Panics
    ///
    /// If there is not one intensity per light.
    pub fn update_drawn(&mut self, intensities: &[Vec3]) -> UpdateStats {
        let rejected = self.accept(intensities);
        let arrivals = arrivals(self.seed, &self.lights);
        let arrival = |node: &Node| arrivals[node.representative as usize];
        UpdateStats { rejected, ..self.sum_upward(|chosen, other| arrival(other) < arrival(chosen)) }
    }

    /// Takes over what is usable of the intensities and counts the rest.
    fn accept(&mut self, intensities: &[Vec3]) -> usize {
        assert_eq!(intensities.len(), self.lights.len(), "update needs one intensity per light");
        let mut rejected = 0;
        for (light, &intensity) in self.lights.iter_mut().zip(intensities) {
            let usable;
            (light.intensity, usable) = accepted_intensity(intensity);
            rejected += usize::from(!usable);
        }
        for &k in &self.misplaced {
            let light = &mut self.lights[k as usize];
            rejected += usize::from(light.intensity != Vec3::ZERO);
            light.intensity = Vec3::ZERO;
        }
        rejected
    }

    /// New sums and representatives; `swap` decides from a node's chosen and its other child.
    fn sum_upward(&mut self, swap: impl Fn(&Node, &Node) -> bool) -> UpdateStats {
        let mut stats = UpdateStats::default();
        // Children lie after their parents.
        for index in (0..self.nodes.len()).rev() {
            let mut node = self.nodes[index];
            if node.is_leaf() {
                node.intensity = self.lights[node.representative as usize].intensity;
            } else {
                let first = node.children();
                node.intensity = self.nodes[first].intensity + self.nodes[first + 1].intensity;
                let chosen = node.representative_child as usize;
                let other = sibling(chosen);
                let swap = swap(&self.nodes[chosen], &self.nodes[other]);
                let chosen = if swap { other } else { chosen };
                let representative = self.nodes[chosen].representative;
                stats.swapped += usize::from(swap);
                if representative != node.representative {
                    stats.representatives_changed += 1;
                    self.sites.inherit(index, chosen);
                }
                node.representative_child = chosen as u32;
                node.representative = representative;
            }
            self.nodes[index] = node;
        }
        let inner = self.lights.len().saturating_sub(1).max(1);
        stats.swapped_share = stats.swapped as f64 / inner as f64;
        let cost = self.relative_cost();
        stats.cost_growth = if self.cost_at_build > 0.0 && cost > 0.0 { cost / self.cost_at_build } else { 1.0 };
        stats
    }

    /// Cost of all clusters below the root, as the build counts it, divided by the total luminance; zero for a dark tree.
    /// The root's own share is the same for any intensities and larger than all else: it would hide what changes.
    pub(crate) fn relative_cost(&self) -> f64 {
        let cost = |(node, &extent): (&Node, &f32)| f64::from(luminance(node.intensity)) * f64::from(extent);
        let total: f64 = self.nodes.iter().zip(&self.extents).skip(1).map(cost).sum();
        let luminance = f64::from(luminance(self.total_intensity()));
        if luminance > 0.0 { total / luminance } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildParams, Emission, Light};

    fn build(intensities: &[f32], seed: u64) -> LightTree {
        let lights: Vec<Light> = (0..)
            .zip(intensities)
            .map(|(k, &i)| Light {
                position: Vec3::new(k as f32, (k * k % 5) as f32, 0.0),
                emission: Emission::Omni,
                intensity: Vec3::splat(i),
            })
            .collect();
        LightTree::build(&lights, BuildParams::bounded_by(0.1).with_seed(seed))
    }

    #[test]
    fn kept_draws_change_nothing_without_news_and_are_the_draws_of_a_fresh_tree() {
        for seed in 0..50 {
            let before: Vec<f32> = (0..30).map(|k| 1.0 + (k * 7 % 11) as f32).collect();
            let mut tree = build(&before, seed);
            let same: Vec<Vec3> = before.iter().map(|&i| Vec3::splat(i)).collect();
            assert_eq!(tree.update_drawn(&same).swapped, 0);
            // Out and back again: the first representatives return, and the structure never changed.
            let representatives: Vec<u32> = tree.nodes.iter().map(|node| node.representative).collect();
            let reversed: Vec<Vec3> = same.iter().rev().copied().collect();
            assert!(tree.update_drawn(&reversed).swapped > 0);
            tree.validate().unwrap();
            tree.update_drawn(&same);
            assert_eq!(tree.nodes.iter().map(|node| node.representative).collect::<Vec<_>>(), representatives);
        }
    }

    #[test]
    fn kept_draws_represent_in_proportion_to_the_new_intensity() {
        // A light with a fifth of the new sum should stand for all in a fifth of the trees.
        let mut count = [0u32; 4];
        for seed in 0..4000 {
            let mut tree = build(&[1.0; 4], seed);
            tree.update_drawn(&[1.0, 4.0, 2.0, 3.0].map(Vec3::splat));
            count[tree.nodes[0].representative as usize] += 1;
        }
        for (k, share) in [0.1, 0.4, 0.2, 0.3].iter().enumerate() {
            let found = f64::from(count[k]) / 4000.0;
            // Four standard deviations of a share of 4000 draws.
            assert!((found - share).abs() < 4.0 * (share * (1.0 - share) / 4000.0f64).sqrt(), "light {k}: {found}");
        }
    }
}
