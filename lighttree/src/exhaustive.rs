//! Exhaustive sum over all lights: the reference for lightcuts.

use glam::{DVec3, Vec3};

use crate::light::{Light, unshadowed_by};
use crate::receiver::Receiver;
use crate::tree::LightTree;

/// Returns the sum over all lights with the estimator of [`LightTree::lightcut`] \[W·m⁻²·sr⁻¹\], summed in `f64`.
///
/// `visible` is called with a light and its index, for each light that contributes if visible.
pub fn exhaustive<R: Receiver>(
    lights: &[Light],
    geometry_term_bound: f32,
    receiver: &R,
    mut visible: impl FnMut(&Light, usize) -> bool,
) -> Vec3 {
    let mut radiance = DVec3::ZERO;
    for (index, light) in lights.iter().enumerate() {
        let contribution = unshadowed_by(receiver, light, geometry_term_bound) * light.intensity;
        if contribution != Vec3::ZERO && visible(light, index) {
            radiance += contribution.as_dvec3();
        }
    }
    radiance.as_vec3()
}

impl LightTree {
    /// Returns the sum of [`exhaustive`] over the lights of this tree.
    pub fn exhaustive<R: Receiver>(&self, receiver: &R, visible: impl FnMut(&Light, usize) -> bool) -> Vec3 {
        exhaustive(&self.lights, self.geometry_term_bound, receiver, visible)
    }
}
