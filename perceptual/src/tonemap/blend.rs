//! Blending of several surfaces in one pixel, in display light.

use super::ToneMap;

/// Region of a pixel that shows one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelFragment {
    /// Fraction of the pixel's area. The fractions of a pixel sum to 1.
    pub share: f32,
    /// Linear RGB radiance \[W·m⁻²·sr⁻¹\].
    pub radiance: [f32; 3],
}

impl ToneMap {
    /// Returns the radiance that is displayed as the mean of the displayed `parts`. A finer display, seen from a
    /// distance, has the same effect:
    ///
    /// ```text
    /// L = C⁻¹(Σ s C(Lₛ))      C  display light of radiance, before the transfer curve      s  area fraction
    /// ```
    ///
    /// Lₛ is the radiance of the region with the fraction s. No region contributes more than display white. With a mean of
    /// radiance, a light far above white would hide thin objects in front of it.
    #[must_use]
    pub fn mean_shown(&self, parts: impl IntoIterator<Item = PixelFragment>) -> [f32; 3] {
        let (curve, exposure) = (self.curve(), self.exposure());
        let mut sum = [0.0f64; 3];
        for PixelFragment { share, radiance } in parts {
            for (sum, channel) in sum.iter_mut().zip(radiance) {
                // `max` turns NaN into 0.
                *sum += f64::from(share) * curve.forward(exposure * f64::from(channel.max(0.0)));
            }
        }
        sum.map(|light| (curve.inverse(light.min(1.0)) / exposure).min(f64::from(f32::MAX)) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Display, Operator};

    /// Returns the display light of a display value, according to IEC 61966-2-1.
    fn light(value: f32) -> f32 {
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    }

    /// If half of a pixel is dark and half is far above white, the result displays the mean of the two displayed
    /// lights. This holds for any curve.
    #[test]
    fn the_mean_is_that_of_the_display() {
        for operator in Operator::ALL {
            if operator == Operator::Gamma {
                continue;
            }
            let tone_map = ToneMap { operator, display: Display::Srgb, ..ToneMap::default() }.with_exposure(2.0);
            for (dark, bright) in [(0.02, 1.0), (0.0, 1e6), (0.1, 0.12), (0.3, f32::INFINITY)] {
                let half = |radiance: f32| PixelFragment { share: 0.5, radiance: [radiance, 0.5 * radiance, 0.0] };
                let mean = tone_map.mean_shown([half(dark), half(bright)]);
                assert!(mean.iter().all(|channel| channel.is_finite()));
                for (c, factor) in [(0, 1.0), (1, 0.5)] {
                    let wanted = [dark, bright].map(|radiance| light(tone_map.encode(factor * radiance)));
                    let shown = light(tone_map.encode(mean[c]));
                    assert!((shown - 0.5 * (wanted[0] + wanted[1])).abs() < 1e-4, "{operator}: {shown} of {wanted:?}");
                }
            }
        }
    }

    /// The blend of equal regions is the radiance of one of them, up to white.
    #[test]
    fn equal_parts_stay() {
        let part = |share| PixelFragment { share, radiance: [0.01, 0.4, 2.0] };
        let mean = ToneMap::default().mean_shown([part(0.25), part(0.75)]);
        assert!(mean.iter().zip([0.01, 0.4, 2.0]).all(|(a, b)| (a - b).abs() < 1e-5 * b), "{mean:?}");
    }
}
