//! Punctual lights: lights without area, as defined by `KHR_lights_punctual`.

use super::{Channel, Scene, Transform};
use glam::Vec3;
use std::collections::HashMap;
use std::f32::consts::FRAC_PI_2;

/// Maximum strength of a light \[W·sr⁻¹ or W·m⁻²·sr⁻¹\], 10¹⁰ times the radiance of the sun's surface. Sums over
/// pixels, lights and photons, and their squares divided by distances, then stay within the range of `f32`.
pub(super) const STRONGEST: f32 = 1e18;

/// Shape of a punctual light's emission.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PunctualKind {
    /// Parallel light along the node's −z. `color` is the irradiance of a surface that faces the light \[W·m⁻²\].
    Directional,
    /// Light in all directions. `color` is the intensity in every direction \[W·sr⁻¹\].
    Point,
    /// Light in a cone. `color` is the intensity inside the inner cone \[W·sr⁻¹\]. Both angles are measured from the
    /// axis.
    Spot {
        /// Angle at which the falloff begins \[rad\].
        inner: f32,
        /// Angle at which the intensity reaches 0 \[rad\].
        outer: f32,
    },
}

/// Punctual light on a node.
///
/// glTF uses candela and lux. In this crate, one candela counts as one W·sr⁻¹, one lux as one W·m⁻², and one nit of
/// emission as one W·m⁻²·sr⁻¹. The exposure absorbs this common factor of all lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PunctualLight {
    /// Index into the scene's nodes. The node sets position and direction (−z).
    pub node: usize,
    /// Linear RGB intensity or irradiance; see [`PunctualKind`].
    pub color: Vec3,
    /// Shape of the emission.
    pub kind: PunctualKind,
}

/// Animated property of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LightProperty {
    /// Linear RGB color of the light.
    Color,
    /// Factor on the color \[cd or lx\].
    Intensity,
    /// Angle at which the falloff of a spot light begins \[rad\].
    InnerCone,
    /// Angle at which the intensity of a spot light reaches 0 \[rad\].
    OuterCone,
    /// Visibility, 0 or 1, of the light's node or of one of its ancestors.
    Visibility,
}

/// Animation of a punctual light.
#[derive(Clone, Debug)]
pub struct LightChannel {
    /// Index into the scene's punctual lights.
    pub light: usize,
    /// Property of the light that the keys animate.
    pub property: LightProperty,
    /// Linear RGB color and intensity in the file, and the factor on their product.
    pub rest: (Vec3, f32, f32),
    /// Keys of the property: translations for colors, weights for numbers.
    pub keys: Channel,
}

impl Scene {
    /// Returns the punctual lights at `time` seconds, or an empty list if no light is animated. Values that are out of
    /// range are clamped.
    pub(super) fn lights_at(&self, time: f32) -> Vec<PunctualLight> {
        if self.light_channels.is_empty() {
            return Vec::new();
        }
        // Start from the lights and factors of the file.
        let mut lights = self.punctual_lights.clone();
        let mut parts: HashMap<usize, (Vec3, f32, f32)> = HashMap::new();
        for LightChannel { light, property, rest, keys } in &self.light_channels {
            // Evaluate the keys: colors are translations, numbers are weights.
            let (mut vector, mut number) = (Transform::IDENTITY, [0.0]);
            keys.apply(time, &mut vector);
            keys.apply_weights(time, &mut number);
            let (part, light) = (parts.entry(*light).or_insert(*rest), &mut lights[*light]);
            match (property, &mut light.kind) {
                (LightProperty::Color, _) => part.0 = vector.translation,
                (LightProperty::Intensity, _) => part.1 = number[0],
                (LightProperty::InnerCone, PunctualKind::Spot { inner, .. }) => {
                    *inner = number[0].clamp(0.0, FRAC_PI_2)
                }
                (LightProperty::OuterCone, PunctualKind::Spot { outer, .. }) => {
                    *outer = number[0].clamp(0.0, FRAC_PI_2)
                }
                (LightProperty::Visibility, _) if number[0] == 0.0 => part.2 = 0.0,
                _ => {}
            }
            // Recompute the product, because channels animate its factors separately.
            let (color, intensity, factor) = *part;
            light.color = (color * intensity * factor).clamp(Vec3::ZERO, Vec3::splat(STRONGEST));
        }
        lights
    }
}

impl PunctualKind {
    /// Returns the fraction of the intensity in a direction, given the cosine between direction and axis.
    #[must_use]
    pub fn falloff(&self, cos_axis: f32) -> f32 {
        match *self {
            PunctualKind::Directional | PunctualKind::Point => 1.0,
            PunctualKind::Spot { inner, outer } => {
                // The falloff follows KHR_lights_punctual, "Inner and Outer Cone Angles".
                let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-3);
                let t = ((cos_axis - outer.cos()) * scale).clamp(0.0, 1.0);
                t * t
            }
        }
    }
}
