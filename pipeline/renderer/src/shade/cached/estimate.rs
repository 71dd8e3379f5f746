//! Irradiance of a record, and its derivatives, from the clusters of its cut.

use super::recipe::Recipe;
use super::tree_light::{FINENESS, TreeLight};
use glam::{Mat3A, Vec3, Vec3A};
use lighttree::{Cluster, Emission, IrradianceTerm, Light, irradiance_term};
use render_core::cache::LocalIrradiance;
use render_core::{Anchor, Gathered, PACKET, ShadingPoint, luminance};

/// An anchor on a moving thing that would add less than this share gets no shadow ray and counts as visible: two dozen
/// of them together stay below half a per cent.
const UNTRACED_SHARE: f32 = 2e-4;

/// Lights below this cosine are at the horizon, and stand for those behind it.
const HORIZON_COSINE: f32 = 0.4;

/// Σ I t over lights of intensity I, t being the geometric term, and its derivatives.
///
/// A term's derivative by the normal holds the horizon fixed: of even light L from all around, a normal turned by α would have
/// π L cos α. What rises over the horizon makes up for that, and is taken to be as bright as what is just above it:
///
/// ```text
/// ∂E/∂n = Σ I ∂t/∂n − min(π Lₕ, E) nᵀ          Lₕ = Σ I t / cos θ over θ near the horizon / (2π h)          h  its cosine
/// ```
struct GradientSum {
    irradiance: Vec3,
    by_normal: Mat3A,
    by_position: Mat3A,
    /// π Lₕ \[W·m⁻²\].
    horizon: Vec3,
}

impl GradientSum {
    /// Of no light. (A matrix is the identity by default.)
    const ZERO: Self =
        Self { irradiance: Vec3::ZERO, by_normal: Mat3A::ZERO, by_position: Mat3A::ZERO, horizon: Vec3::ZERO };

    fn add(&mut self, intensity: Vec3, term: &IrradianceTerm) {
        self.irradiance += intensity * term.value;
        self.by_normal += outer(intensity, term.by_normal);
        self.by_position += outer(intensity, term.by_position);
        // t / cos θ is the length of ∂t/∂n.
        let facing = term.by_normal.length();
        if term.value < HORIZON_COSINE * facing {
            self.horizon += intensity * (facing / (2.0 * HORIZON_COSINE));
        }
    }
}

impl TreeLight<'_> {
    /// The sum over the visible clusters with the intensities that they have now, and what softening took from it.
    pub fn estimate(&self, receiver: &ShadingPoint, recipe: &Recipe) -> LocalIrradiance {
        let frame = self.visible.frame;
        let (position, normal): (Vec3, Vec3) = (receiver.position.into(), receiver.normal.into());
        let mut sum = GradientSum::ZERO;
        for cluster in recipe.seen_clusters() {
            let light = &frame.tree.lights()[cluster.light as usize];
            let term = irradiance_term(position, normal, light, frame.tree.geometry_term_bound());
            sum.add(frame.tree.cluster_intensity(cluster), &term);
        }
        self.add_moving_anchors(receiver, &mut sum);
        sum.by_normal -= outer(sum.horizon.min(sum.irradiance), normal);

        // Light from close by, which softening takes, is that of the final gather.
        let Gathered { harmonic_mean, nearest, .. } = recipe.surroundings;
        if self.compensates {
            let missing = frame.gather.compensation(&recipe.surroundings);
            sum.irradiance += missing.irradiance;
            sum.by_position += missing.by_position;
        }
        let GradientSum { irradiance, by_normal, by_position, .. } = sum;
        // A record's threshold is a share of that of its pixels.
        let tolerance = recipe.threshold / FINENESS;
        LocalIrradiance { irradiance, by_normal, by_position, harmonic_mean, nearest, tolerance }
    }

    /// Adds the light of the anchors on moving things, which are not in the tree.
    fn add_moving_anchors(&self, receiver: &ShadingPoint, sum: &mut GradientSum) {
        let dynamic = self.visible.frame.direct.dynamic();
        let (position, normal) = (receiver.position.into(), receiver.normal.into());
        // Anchors that would add next to nothing count as seen, without a ray.
        let untraced = UNTRACED_SHARE * luminance(sum.irradiance);
        let mut rays = 0;
        for anchors in dynamic.anchors.chunks(PACKET) {
            let mut terms = [IrradianceTerm::default(); PACKET];
            let (mut active, mut gives) = (0, 0);
            for (i, (anchor, intensity)) in anchors.iter().enumerate() {
                let emission = Emission::Cosine(anchor.normal.into());
                let lamp = Light { position: anchor.position.into(), emission, intensity: *intensity };
                terms[i] = irradiance_term(position, normal, &lamp, dynamic.geometry_term_bound);
                gives |= u64::from(terms[i].value > 0.0) << i;
                active |= u64::from(luminance(*intensity * terms[i].value) > untraced) << i;
            }

            // The shadow rays of a packet are cast together.
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

    /// The part of [`TreeLight::estimate`] that comes by the cut alone.
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

/// `a · bᵀ`.
fn outer(a: Vec3, b: Vec3) -> Mat3A {
    let a = Vec3A::from(a);
    Mat3A::from_cols(a * b.x, a * b.y, a * b.z)
}
