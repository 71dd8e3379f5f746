//! New intensities for an old tree.
//!
//! `[Herzog08]` R. Herzog, S. Kinuwaki, K. Myszkowski, H.-P. Seidel: Render2MPEG: a perception-based framework towards
//! integrating rendering and video compression. Eurographics 2008, section on the temporal light tree.
//!
//! # Differs from the paper
//!
//! Nothing in the rule of [`LightTree::update`]. As it compares only the two present intensities, the first update also
//! turns those draws of [`LightTree::build`] round in which the much dimmer child had won.
//! [`LightTree::update_drawn`] is ours: it keeps the draws.

use glam::Vec3;

use crate::build::uniform;
use crate::light::{accepted_intensity, luminance};
use crate::tree::{LightTree, Node, sibling};

/// C_I of \[Herzog08\]: the representative child may be this much dimmer than its sibling.
const SWAP_RATIO: f32 = 0.7;

/// What decides about a node's representative.
struct Drawn {
    index: u64,
    first_chosen: bool,
}

/// What an update did, and how well the old clusters fit the new intensities.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// Cost of the clusters below the root per total luminance, relative to what it was when built: 1 is as good as
    /// new. Intensity that moves into spread-out clusters makes it grow, and a rebuild then pays.
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
        self.update_by(intensities, |_, chosen, other| chosen < SWAP_RATIO * other)
    }

    /// As [`LightTree::update`], but a node keeps the random number it was built with, and swaps when that number now
    /// falls on its other child.
    ///
    /// So the representative stays drawn in proportion to intensity, where the paper's rule leans to the brighter child
    /// and with it the errors of all clusters to one side; and a swap still happens only where the balance moved.
    ///
    /// # Panics
    ///
    /// If there is not one intensity per light.
    pub fn update_drawn(&mut self, intensities: &[Vec3]) -> UpdateStats {
        let seed = self.seed;
        self.update_by(intensities, |node: &Drawn, chosen, other| {
            let sum = chosen + other;
            // Of the first child, as when the tree was built.
            let share = if node.first_chosen { chosen } else { other };
            sum > 0.0 && (uniform(seed, node.index) * f64::from(sum) < f64::from(share)) != node.first_chosen
        })
    }

    /// `swap` decides from the node and the luminances of its chosen and its other child.
    fn update_by(&mut self, intensities: &[Vec3], swap: impl Fn(&Drawn, f32, f32) -> bool) -> UpdateStats {
        assert_eq!(intensities.len(), self.lights.len(), "update needs one intensity per light");
        let mut stats = UpdateStats::default();
        for (light, &intensity) in self.lights.iter_mut().zip(intensities) {
            let usable;
            (light.intensity, usable) = accepted_intensity(intensity);
            stats.rejected += usize::from(!usable);
        }
        for &k in &self.misplaced {
            let light = &mut self.lights[k as usize];
            stats.rejected += usize::from(light.intensity != Vec3::ZERO);
            light.intensity = Vec3::ZERO;
        }
        // Children lie behind their parents.
        for index in (0..self.nodes.len()).rev() {
            let mut node = self.nodes[index];
            if node.is_leaf() {
                node.intensity = self.lights[node.representative as usize].intensity;
            } else {
                let first = node.children();
                node.intensity = self.nodes[first].intensity + self.nodes[first + 1].intensity;
                let chosen = node.representative_child as usize;
                let other = sibling(chosen);
                let drawn = Drawn { index: index as u64, first_chosen: chosen == first };
                let swap =
                    swap(&drawn, luminance(self.nodes[chosen].intensity), luminance(self.nodes[other].intensity));
                let chosen = if swap { other } else { chosen };
                let representative = self.nodes[chosen].representative;
                stats.swapped += usize::from(swap);
                stats.representatives_changed += usize::from(representative != node.representative);
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
        LightTree::build(&lights, BuildParams { softening2: 0.1, seed })
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
