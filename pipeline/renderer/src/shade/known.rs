//! Light that is known before a frame is lit, such as baked light.

use super::gradient_sum::GradientSum;
use super::layer::Visible;
use glam::Vec3;
use plane::Plane;
use render_core::{Hit, ShadingPoint, Surface, Timed};
use std::fmt::Debug;

/// Irradiance of all surfaces, known before a frame is lit. It replaces photons and virtual lights.
pub(crate) trait KnownLight: Debug + Sync {
    /// Returns the irradiance at a ray's hit \[W·m⁻²\]. `surface` is the surface at the hit.
    fn irradiance(&self, hit: &Hit, surface: &Surface) -> Vec3;

    /// Traces rays around `receiver`, and returns the light that surfaces reflect to it. `key` determines the rotation
    /// of the rays.
    fn gather(&self, receiver: &ShadingPoint, key: u64) -> GatheredLight;

    /// Returns the change of the irradiance of visible static surfaces by dynamic objects \[W·m⁻²\]; `None` without such
    /// objects. `still` contains the irradiance of these surfaces without dynamic objects, and `None` elsewhere.
    fn change(&self, visible: &Visible<'_>, still: &Plane<Option<[f32; 3]>>) -> Option<Timed<Plane<[f32; 3]>>>;
}

/// Light that surfaces reflect to a point, and the distances of these surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GatheredLight {
    /// Irradiance with its derivatives.
    pub light: GradientSum,
    /// Harmonic mean distance of the hits \[m\]; infinite without hits.
    pub harmonic_mean: f32,
    /// Distance to the nearest hit \[m\]; infinite without hits.
    pub nearest: f32,
}
