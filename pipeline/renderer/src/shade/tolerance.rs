//! Permitted error of each pixel's light. No other module derives it from thresholds.
//!
//! ```text
//! ΔY(x, y)         luminance threshold of a pixel, reprojected from the previous frame
//! e = ΔY / g       permitted error of radiance if the threshold is known    g  gain, 1 by default
//! e = s Y / g      otherwise                                             Y  luminance   s  2 %, or the user's fraction
//! e_E = e π / ρ    permitted error of irradiance                         ρ  luminance of the albedo, at least 0.05
//! λ e              with calibrated stopping                              λ  by class of e / Y
//! ```
//!
//! The gain comes from the importance map: at a gain of 2, a pixel is twice as accurate as the encoder requires.

use crate::settings::{Size, Thresholds};
use glam::Vec3;
use lighttree::{Calibration, Stop};
use perceptual::{RELATIVE_FLOOR, ThresholdMap};
use pipeline::stage::LastThresholds;
use plane::Plane;
use render_core::{GBuffer, NOTHING, luminance};
use std::f32::consts::PI;

/// Minimum reflectance in conversions to irradiance: darker pixels need no more accurate irradiance.
const LEAST_REFLECTANCE: f32 = 0.05;
/// Minimum luminance of pixels in the mean relative threshold, as a fraction of the frame's mean. The ratio of darker
/// pixels is meaningless.
const DARK: f64 = 1e-4;

/// Permitted errors of a frame's pixels.
#[derive(Clone, Debug)]
pub struct Tolerance<'a> {
    /// Thresholds ΔY of the pixels that have one \[W·m⁻²·sr⁻¹\].
    thresholds: ThresholdMap,
    /// Fraction s of luminance, for all other pixels.
    share: f32,
    /// Luminance of the pixels' surfaces in the previous frame, if visible; `None` without calibrated stopping.
    luminance_before: Option<ThresholdMap>,
    /// Calibration with the calibration factors λ; `None` without calibrated stopping.
    calibration: Option<&'a Calibration>,
    /// Gain g of each pixel; `None` if all gains are 1.
    gain: Option<&'a Plane<f32>>,
}

/// Pixel lit by an irradiance record.
#[derive(Clone, Copy, Debug)]
pub struct FootprintPixel {
    /// Column and row of the pixel.
    pub place: (usize, usize),
    /// Weight of the pixel's threshold in the mean of the footprint.
    pub weight: f32,
    /// Diffuse reflectance.
    pub albedo: Vec3,
    /// Radiance of the pixel known before the record's lightcut \[W·m⁻²·sr⁻¹\].
    pub radiance: Vec3,
}

impl<'a> Tolerance<'a> {
    /// Creates tolerances for a frame of `size`. `policy` is the source of the thresholds; `thresholds` come from the
    /// previous frame. `calibration` enables calibrated stopping.
    #[must_use]
    pub fn new(
        thresholds: LastThresholds<'_>,
        policy: Thresholds,
        size: Size,
        calibration: Option<&'a Calibration>,
    ) -> Self {
        let Size { width, height } = size;
        // Ignore the previous frame's thresholds if the user has fixed the fraction.
        let map = match policy {
            Thresholds::Fixed(_) => ThresholdMap::relative(width, height),
            _ => thresholds.map(width, height),
        };
        let share = policy.share_elsewhere();
        let luminance_before = calibration.and_then(|_| thresholds.luminance());
        Self { thresholds: map, share, luminance_before, calibration, gain: None }
    }

    /// Creates absolute tolerances of radiance \[W·m⁻²·sr⁻¹\]. A threshold of 0 becomes 2 % of the pixel's luminance.
    #[must_use]
    pub fn of_thresholds(thresholds: &Plane<f32>) -> Self {
        let thresholds = ThresholdMap::from_plane(thresholds);
        Self { thresholds, share: RELATIVE_FLOOR, luminance_before: None, calibration: None, gain: None }
    }

    /// Creates tolerances equal to `share` times each pixel's luminance.
    #[must_use]
    pub fn of_shares(width: usize, height: usize, share: f32) -> Self {
        let thresholds = ThresholdMap::relative(width, height);
        Self { thresholds, share, luminance_before: None, calibration: None, gain: None }
    }

    /// Sets the fraction s of luminance for pixels without a threshold.
    #[must_use]
    pub fn with_share_elsewhere(self, share: f32) -> Self {
        Self { share, ..self }
    }

    /// Divides all permitted errors by a positive gain per pixel.
    ///
    /// # Panics
    /// If the size of the gain map differs from the frame's.
    #[must_use]
    pub fn divided_by(self, gain: &'a Plane<f32>) -> Self {
        let size = (self.thresholds.width(), self.thresholds.height());
        assert_eq!(size, (gain.width(), gain.height()), "a gain for each pixel");
        Self { gain: Some(gain), ..self }
    }

    /// Returns the threshold for the clusters of a pixel's lightcut. `radiance` is the pixel's radiance known before
    /// the lightcut.
    #[must_use]
    pub fn at_pixel(&self, x: usize, y: usize, radiance: Vec3) -> Stop {
        match self.absolute(x, y) {
            Some(error) => Stop::Absolute(error),
            None => Stop::Relative { fraction: self.share / self.gain(x, y), known_luminance: luminance(radiance) },
        }
    }

    /// Returns the threshold for the lightcut of an irradiance record: the weighted mean over the pixels of the
    /// record's footprint \[Herzog08, 4.3\]. Each pixel's reflectance converts its threshold to irradiance.
    #[must_use]
    pub fn over_footprint(&self, pixels: impl Iterator<Item = FootprintPixel>) -> Stop {
        // Convert thresholds to irradiance, and sum absolute and relative ones separately.
        let (mut error, mut weights) = (0.0, 0.0);
        let (mut known, mut gain, mut known_weights) = (0.0, 0.0, 0.0);
        for FootprintPixel { place: (x, y), weight, albedo, radiance } in pixels {
            let per_radiance = PI / luminance(albedo).max(LEAST_REFLECTANCE);
            match self.absolute(x, y) {
                Some(threshold) => {
                    error += weight * threshold * per_radiance;
                    weights += weight;
                }
                None => {
                    known += weight * luminance(radiance) * per_radiance;
                    gain += weight * self.gain(x, y);
                    known_weights += weight;
                }
            }
        }

        // Let the majority decide: absolute and relative thresholds have no common mean.
        if weights > known_weights {
            return Stop::Absolute(error / weights);
        }
        let mean = |sum: f32| sum / known_weights.max(f32::MIN_POSITIVE);
        let gain = if self.gain.is_some() && known_weights > 0.0 { mean(gain) } else { 1.0 };
        Stop::Relative { fraction: self.share / gain, known_luminance: mean(known) }
    }

    /// Returns the permitted error of the luminance of a pixel's irradiance \[W·m⁻²\], for the value `irradiance`.
    #[must_use]
    pub fn of_irradiance(&self, x: usize, y: usize, albedo: Vec3, irradiance: f32) -> f32 {
        let reflectance = luminance(albedo).max(LEAST_REFLECTANCE);
        match self.absolute(x, y) {
            Some(error) => error * PI / reflectance,
            None => self.share / self.gain(x, y) * irradiance,
        }
    }

    /// Returns the permitted error of the luminance of a coat's light, for `light` with that luminance and a pixel with
    /// the luminance `known` of all earlier light \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn of_coat(&self, x: usize, y: usize, known: f32, light: f32) -> f32 {
        self.absolute(x, y).unwrap_or_else(|| self.share / self.gain(x, y) * (known + light).max(0.0))
    }

    /// Returns the threshold ΔY of a pixel without gain \[W·m⁻²·sr⁻¹\]; `None` if it has no threshold.
    #[must_use]
    pub fn threshold(&self, x: usize, y: usize) -> Option<f32> {
        self.thresholds.get(x, y)
    }

    /// Returns the permitted error e of a pixel with a threshold; `None` for a pixel without one.
    fn absolute(&self, x: usize, y: usize) -> Option<f32> {
        Some(self.thresholds.get(x, y)? / self.gain(x, y))
    }

    fn gain(&self, x: usize, y: usize) -> f32 {
        self.gain.map_or(1.0, |gain| gain.get(x, y))
    }

    /// Returns the number of audited lightcuts per macroblock; `None` without calibrated stopping.
    pub(super) fn audits_per_macroblock(&self) -> Option<usize> {
        self.calibration.map(Calibration::audits_per_macroblock)
    }

    /// Returns the calibration class of a pixel.
    pub(super) fn class_at(&self, x: usize, y: usize) -> usize {
        let before = self.luminance_before.as_ref().and_then(|before| before.get(x, y));
        match (self.absolute(x, y), before) {
            (Some(error), Some(luminance)) => Calibration::class(error, luminance),
            (Some(_), None) => 0,
            (None, _) => Calibration::class(self.share / self.gain(x, y), 1.0),
        }
    }

    /// Returns the calibrated threshold for a lightcut of `class` with the target `stop`.
    pub(super) fn calibrated(&self, stop: Stop, class: usize) -> Stop {
        match self.calibration {
            Some(calibration) => stop.scaled(calibration.lambda(class)),
            None => stop,
        }
    }

    /// Returns the mean ratio of permitted error to luminance over the pixels that reflect light, for the report.
    pub(super) fn mean_relative(&self, seen: &GBuffer, radiance: &Plane<[f32; 3]>) -> f64 {
        // Collect error and luminance of each lit pixel.
        let mut lit: Vec<(f32, f32)> = Vec::new();
        for (index, pixel) in seen.pixels.samples().iter().enumerate() {
            if pixel.instance == NOTHING || pixel.albedo == [0.0; 3] {
                continue;
            }
            let (x, y) = (index % radiance.width(), index / radiance.width());
            let luminance = luminance(radiance.get(x, y).into());
            let error = self.absolute(x, y).unwrap_or(self.share / self.gain(x, y) * luminance);
            lit.push((error, luminance));
        }

        // Omit nearly black pixels: the mean would consist of their huge ratios.
        let mean = lit.iter().map(|&(_, y)| f64::from(y)).sum::<f64>() / lit.len().max(1) as f64;
        let (mut sum, mut count) = (0.0, 0usize);
        for (error, luminance) in lit {
            if f64::from(luminance) > DARK * mean {
                sum += f64::from(error) / f64::from(luminance);
                count += 1;
            }
        }
        sum / count.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::stage::LuminanceThresholds;
    use plane::Correspondence;
    use std::sync::Arc;

    const SIZE: Size = Size { width: 2, height: 1 };

    /// Returns the thresholds of two pixels: the left one has 0.5, the right one was not visible before.
    fn thresholds() -> (LuminanceThresholds, Correspondence) {
        let plane = |left| Arc::new(Plane::from_vec(2, 1, vec![left, 0.0]));
        let thresholds = LuminanceThresholds { of: 0, delta: plane(0.5), luminance: plane(4.0) };
        (thresholds, Correspondence::still(2, 1))
    }

    #[test]
    fn a_threshold_holds_where_it_is_known_and_a_share_of_luminance_elsewhere() {
        let (thresholds, known) = thresholds();
        let last = LastThresholds::new(1, Some(&thresholds), Some(&known));
        let tolerance = Tolerance::new(last, Thresholds::Codec, SIZE, None);
        assert_eq!(tolerance.at_pixel(0, 0, Vec3::ONE), Stop::Absolute(0.5));
        assert_eq!(tolerance.at_pixel(1, 0, Vec3::ONE), Stop::Relative { fraction: 0.02, known_luminance: 1.0 });
        // Expect E · 0.25 / π from a gray of 25 %.
        assert_eq!(tolerance.of_irradiance(0, 0, Vec3::splat(0.25), 1.0), 0.5 * PI / 0.25);
        assert_eq!(tolerance.of_irradiance(1, 0, Vec3::splat(0.25), 3.0), 0.06);
        let fixed = Tolerance::new(last, Thresholds::Fixed(0.1), SIZE, None);
        assert_eq!(fixed.at_pixel(0, 0, Vec3::ONE), Stop::Relative { fraction: 0.1, known_luminance: 1.0 });
    }

    #[test]
    fn over_a_footprint_the_kind_of_most_pixels_holds() {
        let (thresholds, known) = thresholds();
        let last = LastThresholds::new(1, Some(&thresholds), Some(&known));
        let tolerance = Tolerance::new(last, Thresholds::Codec, SIZE, None);
        let pixel = |x, weight| FootprintPixel { place: (x, 0), weight, albedo: Vec3::splat(0.5), radiance: Vec3::ONE };
        let of = |weights: [f32; 2]| tolerance.over_footprint((0..).zip(weights).map(|(x, weight)| pixel(x, weight)));
        assert_eq!(of([3.0, 1.0]), Stop::Absolute(0.5 * PI / 0.5));
        assert_eq!(of([1.0, 3.0]), Stop::Relative { fraction: 0.02, known_luminance: PI / 0.5 });
        let nothing = tolerance.over_footprint(std::iter::empty());
        assert_eq!(nothing, Stop::Relative { fraction: 0.02, known_luminance: 0.0 });
    }

    #[test]
    fn a_gain_divides_every_error() {
        let (thresholds, known) = thresholds();
        let last = LastThresholds::new(1, Some(&thresholds), Some(&known));
        let gain = Plane::from_vec(2, 1, vec![4.0, 2.0]);
        let plain = Tolerance::new(last, Thresholds::Codec, SIZE, None);
        let divided = plain.clone().divided_by(&gain);
        let albedo = Vec3::splat(0.5);
        for (x, gain) in [(0, 4.0), (1, 2.0)] {
            let pixel = || [FootprintPixel { place: (x, 0), weight: 0.7, albedo, radiance: Vec3::ONE }].into_iter();
            for radiance in [0.0, 2.0] {
                let of = |tolerance: &Tolerance| {
                    [
                        tolerance.at_pixel(x, 0, Vec3::ONE).threshold_at(radiance),
                        tolerance.over_footprint(pixel()).threshold_at(radiance),
                        tolerance.of_irradiance(x, 0, albedo, radiance),
                    ]
                };
                let expected = of(&plain).map(|error| error / gain);
                for (found, expected) in of(&divided).into_iter().zip(expected) {
                    assert!((found - expected).abs() <= 1e-6 * expected, "{found} is not {expected}");
                }
            }
        }
    }
}
