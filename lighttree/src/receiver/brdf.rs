//! A surface whose BRDF is a function: the simplest way to a material of one's own.

use glam::Vec3;

use super::Receiver;
use crate::bounds::Region;
use crate::lanes::{Real, Vector3};

/// A surface with a BRDF given as a function, seen from its front: M = brdf(direction) · max(0, cos θ).
///
/// The error bound of a cut rests on `largest`: no value of the BRDF exceeds it. Values beyond are cut off there, and
/// negative values and NaN count as 0. For a material with a narrow lobe this bound is wide, so cuts are large; implement
/// [`Receiver`] to bound such a lobe by direction.
///
/// ```
/// use glam::Vec3;
/// use lighttree::{BrdfReceiver, BuildParams, Emission, Light, LightTree, Scratch, Stop, luminance};
///
/// let lamps: Vec<Light> = (0..100)
///     .map(|k| Light {
///         position: Vec3::new((k % 10) as f32, (k / 10) as f32, 3.0),
///         emission: Emission::Omni,
///         intensity: Vec3::splat(0.1),
///     })
///     .collect();
/// let tree = LightTree::build(&lamps, BuildParams::bounded_by(0.01));
///
/// // A cloth that is brightest at grazing angles.
/// let (position, normal) = (Vec3::new(5.0, 5.0, 0.0), Vec3::Z);
/// let cloth = BrdfReceiver::new(position, normal, Vec3::splat(0.3), |direction| {
///     Vec3::splat(0.1 + 0.2 * (1.0 - normal.dot(direction)).powi(2))
/// });
/// let stop = Stop::Relative { fraction: 0.02, known_luminance: 0.0 };
/// let cut = tree.lightcut(&cloth, stop, |_light, _index| true, &mut Scratch::default());
/// let truth = tree.exhaustive(&cloth, |_, _| true);
/// assert!((luminance(cut.radiance) - luminance(truth)).abs() <= cut.total_bound);
/// ```
#[derive(Clone, Copy)]
pub struct BrdfReceiver<B> {
    position: Vec3,
    normal: Vec3,
    largest: Vec3,
    brdf: B,
}

impl<B: Fn(Vec3) -> Vec3> BrdfReceiver<B> {
    /// A surface at `position` \[m\] with this unit normal. `brdf` gets the unit direction to the light and returns linear
    /// RGB \[sr⁻¹\], at most `largest` in each channel.
    #[must_use]
    pub fn new(position: Vec3, normal: Vec3, largest: Vec3, brdf: B) -> Self {
        Self { position, normal, largest, brdf }
    }
}

/// Without the function.
impl<B> std::fmt::Debug for BrdfReceiver<B> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { position, normal, largest, brdf: _ } = self;
        f.debug_struct("BrdfReceiver")
            .field("position", position)
            .field("normal", normal)
            .field("largest", largest)
            .finish_non_exhaustive()
    }
}

impl<B: Fn(Vec3) -> Vec3> Receiver for BrdfReceiver<B> {
    fn position(&self) -> Vec3 {
        self.position
    }

    fn reflect<F: Real>(&self, direction: Vector3<F>) -> Vector3<F> {
        F::map3(direction, |direction| {
            let cosine = self.normal.dot(direction).max(0.0);
            // NaN fails the comparison and becomes 0.
            let value = (self.brdf)(direction).to_array().map(|value| if value > 0.0 { value } else { 0.0 });
            Vec3::from(value).min(self.largest) * cosine
        })
    }

    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F> {
        Vector3::splat(self.largest) * region.max_cosine_in_front(Vector3::splat(self.normal))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{BuildParams, Lambert, LightTree, Scratch, Stop, luminance, testing};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// A constant BRDF is [`Lambert`]; one that breaks its promise is cut off, so the bound of the cut holds.
        #[test]
        fn cuts_keep_their_bound(scene in testing::scene(1..60), excess in 0.5..4.0f32) {
            let params = BuildParams::bounded_by(scene.geometry_term_bound).with_seed(scene.seed);
            let tree = LightTree::build(&scene.lights, params);
            let Lambert { position, normal, reflectance } = scene.receiver;
            let constant = reflectance * std::f32::consts::FRAC_1_PI;
            let same = BrdfReceiver::new(position, normal, constant, |_| constant);
            let (truth, lambert) = (tree.exhaustive(&same, |_, _| true), tree.exhaustive(&scene.receiver, |_, _| true));
            prop_assert!((truth - lambert).abs().cmple(1e-5 * lambert).all(), "{truth} {lambert}");

            let wild = BrdfReceiver::new(position, normal, constant, |direction| {
                if direction.x > direction.y { constant * excess } else { Vec3::new(f32::NAN, -1.0, f32::INFINITY) }
            });
            let truth = luminance(tree.exhaustive(&wild, |_, _| true));
            let cut = tree.lightcut(&wild, Stop::Absolute(0.05 * truth), |_, _| true, &mut Scratch::default());
            let error = (luminance(cut.radiance) - truth).abs();
            prop_assert!(error <= cut.total_bound * 1.0001 + 1e-3 * truth, "{error} of {truth}: {cut:?}");
        }
    }
}
