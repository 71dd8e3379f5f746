//! What is clustered: one point light, its geometric term and its unshadowed share of the light reflected at a receiver.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::receiver::Receiver;

/// Weights of linear RGB (Rec. 709 primaries) in luminance; they sum to one, so luminance keeps the unit of its argument.
pub const LUMINANCE_WEIGHTS: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Luminance of a linear RGB quantity, in the quantity's own unit.
#[inline]
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(LUMINANCE_WEIGHTS)
}

/// Largest coordinate of a light \[m\] and largest intensity \[W·sr⁻¹\]; beyond, sums and squares may leave the range of `f32`.
const LARGEST_COORDINATE: f32 = 1e15;
const LARGEST_INTENSITY: f32 = 1e25;

/// Squared distance \[m²\] below which a direction to the light no longer exists in `f32`.
pub(crate) const SMALLEST_DISTANCE2: f32 = 1e-30;

/// How the intensity of a light depends on the direction it leaves in.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, PartialEq)]
pub enum Emission {
    /// The same in all directions.
    Omni,
    /// `max(0, cos θ)` of the axis' intensity, θ being the angle to this unit axis: a virtual light on a surface.
    Cosine(Vec3),
}

/// A point light.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, PartialEq)]
pub struct Light {
    /// Where it is, in world space \[m\].
    pub position: Vec3,
    /// Where it shines.
    pub emission: Emission,
    /// Radiant intensity, linear RGB \[W·sr⁻¹\], not negative; along the axis for [`Emission::Cosine`].
    pub intensity: Vec3,
}

impl Light {
    /// The light as it enters a tree: axis of unit length, and no intensity if any field is unusable.
    pub(crate) fn accepted(mut self) -> (Self, Fitness) {
        let mut placed = self.position.is_finite() && self.position.abs().max_element() <= LARGEST_COORDINATE;
        if !placed {
            self.position = Vec3::ZERO;
        }
        if let Emission::Cosine(axis) = self.emission {
            let unit = axis.try_normalize();
            self.emission = Emission::Cosine(unit.unwrap_or(Vec3::Z));
            placed &= unit.is_some();
        }
        let (intensity, lit) = accepted_intensity(self.intensity);
        self.intensity = if placed { intensity } else { Vec3::ZERO };
        let fitness = match (placed, lit) {
            (false, _) => Fitness::Misplaced,
            (true, false) => Fitness::Darkened,
            (true, true) => Fitness::Good,
        };
        (self, fitness)
    }
}

/// What had to be done to a light before it could enter a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fitness {
    Good,
    /// Its intensity was unusable and is now zero.
    Darkened,
    /// Its position or axis was unusable: the intensity has to stay zero.
    Misplaced,
}

/// The intensity itself, or zero where it is not finite, negative or too large for sums; and whether it was usable.
pub(crate) fn accepted_intensity(intensity: Vec3) -> (Vec3, bool) {
    // Comparisons with NaN are false, so this covers all of it.
    let usable =
        intensity.min_element() >= 0.0 && intensity.max_element() <= LARGEST_INTENSITY && intensity.is_finite();
    (if usable { intensity } else { Vec3::ZERO }, usable)
}

/// M·G of one light: radiance at the receiver per unit of the light's intensity, visibility left out \[m⁻²·sr⁻¹·sr\].
///
/// ```text
/// L = M · G · V · I                        \[Walter05\], eq. 1
///   M  material term, the receiver's cosine included
///   G  cos θ_light / (r² + s²)             Cosine
///      1 / (r² + s²)                       Omni
///   V  visibility, 0 or 1
///   I  intensity
/// ```
/// `s²` (`softening2`) is ours: it keeps G finite close to a light that stands for a disc.
/// A receiver exactly on the light gets nothing from it, as no direction exists.
#[inline]
pub(crate) fn unshadowed<R: Receiver>(receiver: &R, light: &Light, softening2: f32) -> Vec3 {
    let to_light = light.position - receiver.position();
    let r2 = to_light.length_squared();
    if r2 < SMALLEST_DISTANCE2 {
        return Vec3::ZERO;
    }
    let direction = to_light * (1.0 / r2.sqrt());
    let emitted = match light.emission {
        Emission::Omni => 1.0,
        Emission::Cosine(axis) => -axis.dot(direction),
    };
    if emitted <= 0.0 {
        return Vec3::ZERO;
    }
    receiver.reflect(direction) * (emitted / (r2 + softening2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::receiver::Lambert;

    #[test]
    fn unusable_lights_are_darkened() {
        let good = Light { position: Vec3::ONE, emission: Emission::Cosine(Vec3::Y * 3.0), intensity: Vec3::ONE };
        assert_eq!(good.accepted(), (Light { emission: Emission::Cosine(Vec3::Y), ..good }, Fitness::Good));
        use Fitness::{Darkened, Misplaced};
        for (bad, expected) in [
            (Light { position: Vec3::new(f32::NAN, 0.0, 0.0), ..good }, Misplaced),
            (Light { position: Vec3::splat(1e20), ..good }, Misplaced),
            (Light { emission: Emission::Cosine(Vec3::ZERO), ..good }, Misplaced),
            (Light { emission: Emission::Cosine(Vec3::splat(f32::INFINITY)), ..good }, Misplaced),
            (Light { intensity: Vec3::new(1.0, f32::NAN, 1.0), ..good }, Darkened),
            (Light { intensity: Vec3::new(1.0, f32::INFINITY, 1.0), ..good }, Darkened),
            (Light { intensity: Vec3::new(1.0, -1.0, 1.0), ..good }, Darkened),
        ] {
            let (light, fitness) = bad.accepted();
            assert_eq!(fitness, expected, "{bad:?}");
            assert!(light.position.is_finite() && light.intensity == Vec3::ZERO, "{light:?}");
        }
    }

    /// A lamp of 1 W/sr two metres above a white diffuse floor: L = ρ/π · I/r² = 1/(4π); it shines down, or sideways.
    #[test]
    fn closed_form_below_a_lamp() {
        let receiver = Lambert { position: Vec3::ZERO, normal: Vec3::Z, reflectance: Vec3::ONE };
        let position = Vec3::new(0.0, 0.0, 2.0);
        let value = |emission| unshadowed(&receiver, &Light { position, emission, intensity: Vec3::ONE }, 0.0).x;
        let expected = 0.25 / std::f32::consts::PI;
        assert!((value(Emission::Omni) - expected).abs() < 1e-7);
        assert!((value(Emission::Cosine(-Vec3::Z)) - expected).abs() < 1e-7);
        assert_eq!(value(Emission::Cosine(Vec3::X)), 0.0);
        assert_eq!(value(Emission::Cosine(Vec3::Z)), 0.0);
    }
}
