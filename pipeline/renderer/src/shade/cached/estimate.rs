//! Irradiance and gradients of a record, computed from the clusters of the record's lightcut.

use super::recipe::Recipe;
use super::tree_light::{FINENESS, TreeLight};
use crate::shade::gradient_sum::GradientSum;
use glam::Vec3;
use lighttree::{Cluster, Emission, IrradianceTerm, Light, irradiance_term};
use render_core::cache::LocalIrradiance;
use render_core::{Anchor, Gathered, PACKET, ShadingPoint, luminance};

/// Minimum contribution of a dynamic anchor for which a shadow ray is traced, as a fraction of the irradiance. Anchors
/// below it are treated as visible; two dozen of them add less than 0.5 %.
const UNTRACED_SHARE: f32 = 2e-4;

impl TreeLight<'_> {
    /// Returns the irradiance from the visible clusters at their current intensities, plus bias compensation \[W·m⁻²\].
    pub fn estimate(&self, receiver: &ShadingPoint, recipe: &Recipe) -> LocalIrradiance {
        let frame = self.visible.frame;
        let (position, normal): (Vec3, Vec3) = (receiver.position.into(), receiver.normal.into());
        // Sum the visible clusters and the dynamic anchors, with their derivatives.
        let mut sum = GradientSum::ZERO;
        for cluster in recipe.seen_clusters() {
            let light = &frame.tree.lights()[cluster.light as usize];
            let term = irradiance_term(position, normal, light, frame.tree.geometry_term_bound());
            sum.add(frame.tree.cluster_intensity(cluster), &term);
        }
        self.add_moving_anchors(receiver, &mut sum);
        sum.add_all(&recipe.reflected);
        let by_normal = sum.by_normal_and_horizon(normal);

        // Add the light from nearby surfaces that clamping has removed, measured by final gather.
        let Gathered { harmonic_mean, nearest, .. } = recipe.surroundings;
        if self.compensates {
            let missing = frame.gather.compensation(&recipe.surroundings);
            sum.irradiance += missing.irradiance;
            sum.by_position += missing.by_position;
        }
        let GradientSum { irradiance, by_position, .. } = sum;
        // Convert the threshold: a record's threshold is a fraction of its pixels' threshold.
        let tolerance = recipe.threshold / FINENESS;
        LocalIrradiance { irradiance, by_normal, by_position, harmonic_mean, nearest, tolerance }
    }

    /// Adds the light of dynamic anchors, which are not in the tree.
    fn add_moving_anchors(&self, receiver: &ShadingPoint, sum: &mut GradientSum) {
        let dynamic = self.visible.frame.direct.dynamic();
        let (position, normal) = (receiver.position.into(), receiver.normal.into());
        // Treat anchors with tiny contributions as visible, without a ray.
        let untraced = UNTRACED_SHARE * luminance(sum.irradiance);
        let mut rays = 0;
        for anchors in dynamic.anchors.chunks(PACKET) {
            // Mark the anchors that light the record, and the bright ones, which need a shadow ray.
            let mut terms = [IrradianceTerm::default(); PACKET];
            let (mut active, mut gives) = (0, 0);
            for (i, (anchor, intensity)) in anchors.iter().enumerate() {
                let emission = Emission::Cosine(anchor.normal.into());
                let lamp = Light { position: anchor.position.into(), emission, intensity: *intensity };
                terms[i] = irradiance_term(position, normal, &lamp, dynamic.geometry_term_bound);
                gives |= u64::from(terms[i].value > 0.0) << i;
                active |= u64::from(luminance(*intensity * terms[i].value) > untraced) << i;
            }

            // Trace the shadow rays of a packet together.
            rays += active.count_ones();
            let place = |(anchor, _): &(Anchor, Vec3)| anchor.position;
            let seen = gives & !active | self.visibility.seen_among(receiver, anchors, place, active);
            for (i, (_, intensity)) in anchors.iter().enumerate() {
                if seen >> i & 1 == 1 {
                    sum.add(*intensity, &terms[i]);
                }
            }
        }
        self.counts.count_rays(rays);
    }

    /// Returns the contribution of the lightcut to [`TreeLight::estimate`].
    pub fn cut_irradiance(&self, receiver: &ShadingPoint, recipe: &Recipe) -> Vec3 {
        let tree = &self.visible.frame.tree;
        let (position, normal) = (receiver.position.into(), receiver.normal.into());
        let of = |cluster: Cluster| {
            let light = &tree.lights()[cluster.light as usize];
            tree.cluster_intensity(cluster) * irradiance_term(position, normal, light, tree.geometry_term_bound()).value
        };
        recipe.seen_clusters().map(of).sum()
    }
}
