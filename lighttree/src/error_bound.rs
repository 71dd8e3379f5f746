//! How wrong a cluster can be: an upper bound of M·G·I over it, visibility at most 1.
//!
//! The estimate and the truth of a cluster both lie between 0 and this bound, so it also bounds their difference
//! \[Walter05, section 4.1\].
//!
//! # Differs from the paper
//!
//! The cosine over a box is bounded by its furthest extent along the axis divided by the distance to its nearest
//! point, not by a box in rotated axes: three multiplications, the distance shared with G and between the cosines of
//! receiver and light. Measured with `examples/plane.rs`, 10 000 lights: cuts 5 % larger than with the paper's bound
//! in half of its time; the largest M·G anywhere in box and cone, searched by brute force, would save 16 … 20 %.

use glam::{Vec3, Vec3A};

use crate::bounds::Region;
use crate::light::luminance;
use crate::receiver::Receiver;
use crate::tree::Node;

/// Error bound of one inner node \[W·m⁻²·sr⁻¹, as luminance\]; exactly zero if nothing in it can reach the receiver.
#[inline]
pub(crate) fn error_bound<R: Receiver>(receiver: &R, position: Vec3A, node: &Node, softening2: f32) -> f32 {
    let region = Region::new(Vec3A::from(node.low) - position, Vec3A::from(node.high) - position);
    let emission = emission_bound(node, &region);
    if emission <= 0.0 {
        return 0.0;
    }
    let material: Vec3 = receiver.reflect_bound(&region);
    luminance(material * node.intensity) * (emission / (region.nearest_distance2() + softening2))
}

/// Largest cosine between the axis of any light in the cone and the way from any point of the box to the receiver;
/// 0 if all shine away.
///
/// ```text
/// φ  smallest angle between the cone's axis and those ways
/// β  half-angle of the cone             cos(max(0, φ − β))
/// ```
#[inline]
fn emission_bound(node: &Node, region: &Region) -> f32 {
    if node.cone_cosine <= -1.0 {
        return 1.0;
    }
    let cosine = region.max_cosine(-node.axis);
    if cosine >= node.cone_cosine {
        return 1.0;
    }
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    cosine * node.cone_cosine + sine * node.cone_sine
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::build::BuildParams;
    use crate::light::{Light, unshadowed};
    use crate::receiver::{Lambert, Phong};
    use crate::testing;
    use crate::tree::LightTree;

    /// Rounding of cosines, as a share of what the cluster could do face to face. A lobe of exponent 40 multiplies it.
    const ROUNDING: f32 = 1e-4;

    fn lights_below(tree: &LightTree, index: usize) -> Vec<usize> {
        let node = &tree.nodes[index];
        if node.is_leaf() {
            return vec![node.representative as usize];
        }
        let first = node.children();
        [lights_below(tree, first), lights_below(tree, first + 1)].concat()
    }

    /// The estimate, the truth and their difference stay below the bound, for every cluster of the tree.
    fn check<R: Receiver>(
        tree: &LightTree,
        receiver: &R,
        strongest: Vec3,
        shadow_seed: u64,
    ) -> Result<(), TestCaseError> {
        let position = Vec3A::from(receiver.position());
        let visible = |k: usize| testing::visible(shadow_seed, k);
        let reflected = |light: &Light, k: usize| {
            if visible(k) { unshadowed(receiver, light, tree.softening2) } else { Vec3::ZERO }
        };
        for (index, node) in tree.nodes.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
            let bound = error_bound(receiver, position, node, tree.softening2);
            let representative = node.representative as usize;
            let estimate = luminance(reflected(&tree.lights[representative], representative) * node.intensity);
            let below = lights_below(tree, index);
            let truth: f32 =
                below.iter().map(|&k| luminance(reflected(&tree.lights[k], k) * tree.lights[k].intensity)).sum();
            let region = Region::new(Vec3A::from(node.low) - position, Vec3A::from(node.high) - position);
            let face_to_face = luminance(strongest * node.intensity) / (region.nearest_distance2() + tree.softening2);
            let limit = bound + ROUNDING * face_to_face;
            prop_assert!(bound >= 0.0 && bound.is_finite(), "bound {} of node {:?}", bound, node);
            prop_assert!(estimate <= limit, "estimate {} above bound {} of node {:?}", estimate, bound, node);
            prop_assert!(truth <= limit, "truth {} above bound {} of node {:?}", truth, bound, node);
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn no_cluster_is_wrong_by_more_than_its_bound(scene in testing::scene(1..40), shadow_seed: u64) {
            let tree = LightTree::build(&scene.lights, BuildParams { softening2: scene.softening2, seed: scene.seed });
            let Lambert { position, normal, reflectance } = scene.receiver;
            check(&tree, &scene.receiver, reflectance / std::f32::consts::PI, shadow_seed)?;
            let mirror = scene.direction;
            let phong = Phong { position, normal, mirror, diffuse: reflectance, specular: Vec3::splat(0.3), exponent: 40.0 };
            check(&tree, &phong, phong.reflect_bound(&Region::new(Vec3A::NEG_ONE, Vec3A::ONE)), shadow_seed)?;
        }
    }
}
