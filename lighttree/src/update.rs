//! Updates of a tree with new intensities.
//!
//! `[Herzog08]` R. Herzog, S. Kinuwaki, K. Myszkowski, H.-P. Seidel: Render2MPEG: a perception-based framework towards
//! integrating rendering and video compression. Eurographics 2008, section on the temporal light tree.
//!
//! # Differences from the paper
//!
//! [`LightTree::update`] follows the paper's rule, which compares only the two current intensities. The first update
//! therefore also reverses draws of [`LightTree::build`] that the much dimmer child has won.
//!
//! [`LightTree::update_drawn`] is not in the paper. It preserves the draws (`race.rs`).

use glam::Vec3;

use crate::draw::Draws;
use crate::light::{accepted_intensity, luminance};
use crate::node::{Node, sibling};
use crate::race::arrivals;
use crate::tree::LightTree;

/// Constant C_I of \[Herzog08\]: minimum intensity of the representative child as a fraction of its sibling's
/// intensity.
const SWAP_RATIO: f32 = 0.7;

/// Changes of an update, and the fit of the old clusters to the new intensities.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct UpdateStats {
    /// Number of nodes that changed the child from which their representative comes.
    pub swapped: usize,
    /// Swapped nodes as a fraction of all nodes with children, 0 … 1.
    pub swapped_share: f64,
    /// Number of nodes with a new representative light, after a swap in the node or below it.
    pub representatives_changed: usize,
    /// Number of lights made dark. Their new intensity is negative, not finite or too large, or they have no usable
    /// position.
    pub rejected: usize,
    /// Cost of the clusters below the root per total luminance, relative to this cost when the tree was built. At 1 the
    /// tree fits like a new tree. The value grows when intensity moves into spread-out clusters. At a growth of 7,
    /// lightcuts are 2 to 7 % larger than in a new tree. At 11 they are 7 to 10 % larger (`examples/drift.rs`).
    pub cost_growth: f64,
}

impl LightTree {
    /// Sets the intensity of light k to `intensities[k]` \[W·sr⁻¹\] and updates the sums. A node switches to its other
    /// child's representative if the current child's intensity is below 0.7 times the other child's. Structure and
    /// bounds do not change.
    ///
    /// # Panics
    ///
    /// If the number of intensities differs from the number of lights.
    pub fn update(&mut self, intensities: &[Vec3]) -> UpdateStats {
        let rejected = self.accept(intensities);
        let dimmer =
            |chosen: &Node, other: &Node| luminance(chosen.intensity) < SWAP_RATIO * luminance(other.intensity);
        UpdateStats { rejected, ..self.sum_upward(dimmer) }
    }

    /// Updates the tree like [`LightTree::update`], but the representative of each node is the winner of the race
    /// between its lights. Each light keeps its random number from the build, and its speed is its current luminance.
    ///
    /// The representative is therefore still drawn in proportion to luminance. The paper's rule favors the brighter
    /// child, which biases the errors of all clusters to one side. Swaps still happen only where the balance of
    /// intensities has changed.
    ///
    /// # Panics
    ///
    /// If the number of intensities differs from the number of lights.
    pub fn update_drawn(&mut self, intensities: &[Vec3]) -> UpdateStats {
        let rejected = self.accept(intensities);
        let arrivals = arrivals(self.seed, &self.lights);
        let arrival = |node: &Node| arrivals[node.representative as usize];
        UpdateStats { rejected, ..self.sum_upward(|chosen, other| arrival(other) < arrival(chosen)) }
    }

    /// Stores usable intensities and replaces other intensities by zero. Returns the number of replaced intensities.
    fn accept(&mut self, intensities: &[Vec3]) -> usize {
        assert_eq!(intensities.len(), self.lights.len(), "update needs one intensity per light");
        let mut rejected = 0;
        for (light, &intensity) in self.lights.iter_mut().zip(intensities) {
            let usable;
            (light.intensity, usable) = accepted_intensity(intensity);
            rejected += usize::from(!usable);
        }
        // Misplaced lights keep zero intensity.
        for &k in &self.misplaced {
            let light = &mut self.lights[k as usize];
            rejected += usize::from(light.intensity != Vec3::ZERO);
            light.intensity = Vec3::ZERO;
        }
        rejected
    }

    /// Recomputes sums and representatives. `swap` compares a node's chosen child with the other child.
    fn sum_upward(&mut self, swap: impl Fn(&Node, &Node) -> bool) -> UpdateStats {
        let mut stats = UpdateStats::default();
        // Visit children before parents, because children follow their parents in the array.
        for index in (0..self.nodes.len()).rev() {
            let mut node = self.nodes[index];
            if node.is_leaf() {
                node.intensity = self.lights[node.representative as usize].intensity;
            } else {
                let first = node.children();
                node.intensity = self.nodes[first].intensity + self.nodes[first + 1].intensity;
                // Replace the chosen child if the other child now wins.
                let chosen = node.representative_child as usize;
                let other = sibling(chosen);
                let swap = swap(&self.nodes[chosen], &self.nodes[other]);
                let chosen = if swap { other } else { chosen };
                let representative = self.nodes[chosen].representative;
                stats.swapped += usize::from(swap);
                // A swap at a descendant can change the representative without a swap at this node.
                if representative != node.representative {
                    stats.representatives_changed += 1;
                    self.sites.inherit(index, chosen);
                }
                node.representative_child = chosen as u32;
                node.representative = representative;
            }
            self.nodes[index] = node;
        }
        self.draws = Draws::new(&self.nodes);
        // A tree of n lights has n − 1 inner nodes.
        let inner = self.lights.len().saturating_sub(1).max(1);
        stats.swapped_share = stats.swapped as f64 / inner as f64;
        // Report the growth of the cost, from which the caller decides on a rebuild.
        let cost = self.relative_cost();
        stats.cost_growth = if self.cost_at_build > 0.0 && cost > 0.0 { cost / self.cost_at_build } else { 1.0 };
        stats
    }

    /// Returns the cost of all clusters below the root, as in the build, divided by the total luminance. It is zero for
    /// a dark tree.
    ///
    /// The root's cost per luminance is constant and larger than all other costs. Including it would hide changes.
    pub(crate) fn relative_cost(&self) -> f64 {
        let cost = |(node, &extent): (&Node, &f32)| f64::from(luminance(node.intensity)) * f64::from(extent);
        let below_root = self.nodes.iter().zip(&self.extents).skip(1);
        let total: f64 = below_root.map(cost).sum();
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
            // Reverse the intensities and restore them. The first representatives return, and the structure is
            // unchanged.
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
        // A light with a fifth of the new sum represents the root in a fifth of the trees.
        let mut count = [0u32; 4];
        for seed in 0..4000 {
            let mut tree = build(&[1.0; 4], seed);
            tree.update_drawn(&[1.0, 4.0, 2.0, 3.0].map(Vec3::splat));
            count[tree.nodes[0].representative as usize] += 1;
        }
        for (k, share) in [0.1, 0.4, 0.2, 0.3].iter().enumerate() {
            let found = f64::from(count[k]) / 4000.0;
            // The tolerance is four standard deviations of a fraction of 4000 draws.
            assert!((found - share).abs() < 4.0 * (share * (1.0 - share) / 4000.0f64).sqrt(), "light {k}: {found}");
        }
    }
}
