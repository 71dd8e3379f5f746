//! Means of what a display shows: several surfaces in one pixel.

use super::ToneMap;

/// A part of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelPart {
    /// Its share of the pixel's area; those of a pixel sum to 1.
    pub share: f32,
    /// Linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: [f32; 3],
}

impl ToneMap {
    /// Radiance that a display shows as the mean of what it shows of the `parts`, as a finer display is seen from afar:
    ///
    /// ```text
    /// L = C⁻¹(Σ s C(Lₛ))      C  display light of radiance, before the transfer curve      s  share
    /// ```
    ///
    /// No part adds more than display white. A mean of radiance would let a light far above white cover what is thin before it.
    #[must_use]
    pub fn mean_shown(&self, parts: impl IntoIterator<Item = PixelPart>) -> [f32; 3] {
        let (curve, exposure) = (self.curve(), self.exposure());
        let mut sum = [0.0f64; 3];
        for PixelPart { share, radiance } in parts {
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

    /// Display light of a display value, by IEC 61966-2-1.
    fn light(value: f32) -> f32 {
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    }

    /// Half of a pixel is dark, half far above white: the display gives the mean of both lights, whatever the curve.
    #[test]
    fn the_mean_is_that_of_the_display() {
        for operator in Operator::ALL {
            if operator == Operator::Gamma {
                continue;
            }
            let tone_map = ToneMap { operator, display: Display::Srgb, ..ToneMap::default() }.with_exposure(2.0);
            for (dark, bright) in [(0.02, 1.0), (0.0, 1e6), (0.1, 0.12), (0.3, f32::INFINITY)] {
                let half = |radiance: f32| PixelPart { share: 0.5, radiance: [radiance, 0.5 * radiance, 0.0] };
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

    /// The blend of equal parts is the part itself, up to white.
    #[test]
    fn equal_parts_stay() {
        let part = |share| PixelPart { share, radiance: [0.01, 0.4, 2.0] };
        let mean = ToneMap::default().mean_shown([part(0.25), part(0.75)]);
        assert!(mean.iter().zip([0.01, 0.4, 2.0]).all(|(a, b)| (a - b).abs() < 1e-5 * b), "{mean:?}");
    }
}
