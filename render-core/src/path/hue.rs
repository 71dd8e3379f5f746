//! Color of a path in dispersive glass.

use crate::bsdf::GlassLobe;
use glam::{Vec2, Vec3};

/// Color of a path in dispersive glass: a place in the spectrum.
///
/// ```text
/// n(x) = n + 0.025 D (n − 1) x        x in −2…2: red around −1, green around 0, blue around 1
/// ```
/// The channels' responses are hat functions. Their indices are the ones of `KHR_materials_dispersion`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hue(f32);

impl Hue {
    /// Draws a color from a number in 0…1.
    pub(super) fn new(u: Vec2) -> Self {
        Self(4.0 * u.x - 2.0)
    }

    /// Returns the linear RGB weight of the color. The mean over all colors is 1.
    pub(super) fn weight(self) -> Vec3 {
        let hat = |center: f32| 4.0 * (1.0 - (self.0 - center).abs()).max(0.0);
        Vec3::new(hat(-1.0), hat(0.0), hat(1.0))
    }

    /// Returns the index of refraction for the color.
    pub(super) fn ior(self, glass: &GlassLobe) -> f32 {
        (glass.ior + 0.025 * glass.dispersion * (glass.ior - 1.0) * self.0).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_are_white_on_average() {
        let hue = |i: usize| Hue::new(Vec2::splat((i as f32 + 0.5) / 4000.0));
        let mean = (0..4000).map(|i| hue(i).weight()).sum::<Vec3>() / 4000.0;
        assert!((mean - 1.0).abs().max_element() < 1e-3, "{mean}");
        // The index of green is the nominal one; red and blue differ by 0.025 · 2 · 0.5 each.
        let iors = [0.25, 0.5, 0.75]
            .map(|u| Hue::new(Vec2::splat(u)).ior(&GlassLobe { dispersion: 2.0, ..GlassLobe::of_ior(1.5) }));
        assert_eq!(iors, [1.475, 1.5, 1.525]);
    }
}
