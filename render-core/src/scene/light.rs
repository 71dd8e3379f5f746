//! Lights without area, as `KHR_lights_punctual` describes them.

use glam::Vec3;

/// Strongest that any light may be \[W·sr⁻¹ or W·m⁻²·sr⁻¹\]: ten thousand million times the sun's surface. Sums over pixels, lights
/// and photons, and their squares over what falls off with distance, stay inside of the range of `f32`.
pub(super) const STRONGEST: f32 = 1e18;

/// Shape of the light that leaves a point, or comes from a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PunctualKind {
    /// Parallel light along the node's −z; `color` is the irradiance \[W·m⁻²\] of a surface that faces it.
    Directional,
    /// `color` is the intensity \[W·sr⁻¹\] in every direction.
    Point,
    /// `color` is the intensity \[W·sr⁻¹\] inside of the inner cone; the angles are from the axis, in radians.
    Spot {
        /// Where the fall-off begins.
        inner: f32,
        /// Where nothing is left.
        outer: f32,
    },
}

/// A punctual light on a node.
///
/// glTF gives candela and lux; here one candela counts as one W·sr⁻¹ and one lux as one W·m⁻², and a
/// nit of emission as one W·m⁻²·sr⁻¹: a common factor of all lights, which the exposure takes up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PunctualLight {
    /// Index into the scene's nodes: place and direction (−z).
    pub node: usize,
    /// Linear RGB intensity or irradiance, see [`PunctualKind`].
    pub color: Vec3,
    /// The shape.
    pub kind: PunctualKind,
}

impl PunctualKind {
    /// Share of the intensity in a direction whose angle to the axis has this cosine.
    #[must_use]
    pub fn falloff(&self, cos_axis: f32) -> f32 {
        match *self {
            PunctualKind::Directional | PunctualKind::Point => 1.0,
            PunctualKind::Spot { inner, outer } => {
                // KHR_lights_punctual, "Inner and Outer Cone Angles".
                let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-3);
                let t = ((cos_axis - outer.cos()) * scale).clamp(0.0, 1.0);
                t * t
            }
        }
    }
}
