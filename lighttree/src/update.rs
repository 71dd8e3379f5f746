//! New intensities for an old tree.
//!
//! `[Herzog08]` R. Herzog, S. Kinuwaki, K. Myszkowski, H.-P. Seidel: Render2MPEG: a perception-based framework towards
//! integrating rendering and video compression. Eurographics 2008, section on the temporal light tree.
//!
//! # Differs from the paper
//!
//! Nothing in the rule. As it compares only the two present intensities, the first update also turns those draws of
//! [`LightTree::build`] round in which the much dimmer child had won.

use glam::Vec3;

use crate::light::{accepted_intensity, luminance};
use crate::tree::{LightTree, Node, sibling};

/// C_I of \[Herzog08\]: the representative child may be this much dimmer than its sibling.
const SWAP_RATIO: f32 = 0.7;

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
                let swap =
                    luminance(self.nodes[chosen].intensity) < SWAP_RATIO * luminance(self.nodes[other].intensity);
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
