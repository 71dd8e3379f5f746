//! Errors that the light of each pixel may have: the one place where a threshold becomes an error.
//!
//! ```text
//! ΔY(x, y)         threshold of the luminance of a pixel, carried along its motion from the frame before
//! e = ΔY / g       error that the radiance of a pixel may have where its threshold is known        g  gain, 1 where none is given
//! e = s Y / g      where it is not                                 Y  luminance   s  2 %, or the share that the user fixed
//! e_E = e π / ρ    the same for irradiance                         ρ  luminance of the albedo, at least 0.05
//! κ e              where cuts end by measured errors               κ  by class of e / Y
//! ```
//!
//! The gain is what another map makes of thresholds: 2 where a pixel is to be twice as exact as the encoder needs.

use crate::settings::{Size, Thresholds};
use glam::Vec3;
use lighttree::{Calibration, Stop};
use perceptual::{RELATIVE_FLOOR, ThresholdMap};
use pipeline::parts::LastThresholds;
use plane::Plane;
use render_core::{GBuffer, NOTHING, luminance};
use std::f32::consts::PI;

/// Reflectance below which a pixel needs no finer irradiance: its own light hardly matters.
const LEAST_REFLECTANCE: f32 = 0.05;
/// Pixels darker than this share of the picture's mean do not count in the mean relative threshold: 0/0 says nothing.
const DARK: f64 = 1e-4;

/// Errors that the light of the pixels of a frame may have.
#[derive(Clone, Debug)]
pub struct Tolerance<'a> {
    /// ΔY of the pixels that have one \[W·m⁻²·sr⁻¹\].
    thresholds: ThresholdMap,
    /// s, for all other pixels.
    share: f32,
    /// Luminance that the pixels had in the frame before, where they were seen there; none where no cut ends by it.
    luminance_before: Option<ThresholdMap>,
    /// κ, if cuts are to end by measured errors.
    calibration: Option<&'a Calibration>,
    /// g, if any is given.
    gain: Option<&'a Plane<f32>>,
}

/// A pixel that a record of irradiance answers for.
#[derive(Clone, Copy, Debug)]
pub struct FootprintPixel {
    /// Column and row.
    pub place: (usize, usize),
    /// Weight of its threshold among the others.
    pub weight: f32,
    /// Diffuse reflectance.
    pub albedo: Vec3,
    /// Radiance known before its cut \[W·m⁻²·sr⁻¹\].
    pub radiance: Vec3,
}

impl<'a> Tolerance<'a> {
    /// For a picture of `size` by the `thresholds` of the frame before, where `policy` says that they come from. With a
    /// `calibration` cuts end by measured errors.
    #[must_use]
    pub fn new(
        thresholds: LastThresholds<'_>,
        policy: Thresholds,
        size: Size,
        calibration: Option<&'a Calibration>,
    ) -> Self {
        let Size { width, height } = size;
        let map = match policy {
            Thresholds::Fixed(_) => ThresholdMap::relative(width, height),
            _ => thresholds.map(width, height),
        };
        let share = policy.share_elsewhere();
        let luminance_before = calibration.and_then(|_| thresholds.luminance());
        Self { thresholds: map, share, luminance_before, calibration, gain: None }
    }

    /// Absolute errors of radiance for each pixel \[W·m⁻²·sr⁻¹\]; 2 % of its luminance where they are 0.
    #[must_use]
    pub fn of_thresholds(thresholds: &Plane<f32>) -> Self {
        let thresholds = ThresholdMap::from_plane(thresholds);
        Self { thresholds, share: RELATIVE_FLOOR, luminance_before: None, calibration: None, gain: None }
    }

    /// This share of its luminance for each pixel of a picture.
    #[must_use]
    pub fn of_shares(width: usize, height: usize, share: f32) -> Self {
        let thresholds = ThresholdMap::relative(width, height);
        Self { thresholds, share, luminance_before: None, calibration: None, gain: None }
    }

    /// The same errors divided by a gain above 0 for each pixel.
    ///
    /// # Panics
    /// If the gain is of another size than the picture.
    #[must_use]
    pub fn divided_by(self, gain: &'a Plane<f32>) -> Self {
        let size = (self.thresholds.width(), self.thresholds.height());
        assert_eq!(size, (gain.width(), gain.height()), "a gain for each pixel");
        Self { gain: Some(gain), ..self }
    }

    /// Error at which the cut of a pixel ends, if errors of clusters did not add up, given the radiance that is known before.
    #[must_use]
    pub fn at_pixel(&self, x: usize, y: usize, radiance: Vec3) -> Stop {
        match self.absolute(x, y) {
            Some(error) => Stop::Absolute(error),
            None => Stop::Relative { fraction: self.share / self.gain(x, y), known_luminance: luminance(radiance) },
        }
    }

    /// Error at which the cut of a record of irradiance ends: the weighted mean over the pixels of its footprint
    /// \[Herzog08, 4.3\], made one of irradiance by each pixel's reflectance.
    #[must_use]
    pub fn over_footprint(&self, pixels: impl Iterator<Item = FootprintPixel>) -> Stop {
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

        // The majority decides: the two kinds of thresholds have no mean.
        if weights > known_weights {
            return Stop::Absolute(error / weights);
        }
        let mean = |sum: f32| sum / known_weights.max(f32::MIN_POSITIVE);
        let gain = if self.gain.is_some() && known_weights > 0.0 { mean(gain) } else { 1.0 };
        Stop::Relative { fraction: self.share / gain, known_luminance: mean(known) }
    }

    /// Error that the luminance of a pixel's irradiance may have \[W·m⁻²\], given that it is `irradiance`.
    #[must_use]
    pub fn of_irradiance(&self, x: usize, y: usize, albedo: Vec3, irradiance: f32) -> f32 {
        let reflectance = luminance(albedo).max(LEAST_REFLECTANCE);
        match self.absolute(x, y) {
            Some(error) => error * PI / reflectance,
            None => self.share / self.gain(x, y) * irradiance,
        }
    }

    /// ΔY of a pixel, if it has one, whatever the gain \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn threshold(&self, x: usize, y: usize) -> Option<f32> {
        self.thresholds.get(x, y)
    }

    /// e of a pixel whose threshold is known.
    fn absolute(&self, x: usize, y: usize) -> Option<f32> {
        Some(self.thresholds.get(x, y)? / self.gain(x, y))
    }

    fn gain(&self, x: usize, y: usize) -> f32 {
        self.gain.map_or(1.0, |gain| gain.get(x, y))
    }

    /// How often cuts are audited in each macroblock; none where no cut is.
    pub(super) fn audits_per_macroblock(&self) -> Option<usize> {
        self.calibration.map(Calibration::audits_per_macroblock)
    }

    /// Where pixels with the threshold of this one belong in what is known of errors.
    pub(super) fn class_at(&self, x: usize, y: usize) -> usize {
        let before = self.luminance_before.as_ref().and_then(|before| before.get(x, y));
        match (self.absolute(x, y), before) {
            (Some(error), Some(luminance)) => Calibration::class(error, luminance),
            (Some(_), None) => 0,
            (None, _) => Calibration::class(self.share / self.gain(x, y), 1.0),
        }
    }

    /// When a cut of this class is let end, that was to be no more wrong than `stop` says.
    pub(super) fn calibrated(&self, stop: Stop, class: usize) -> Stop {
        match self.calibration {
            Some(calibration) => stop.scaled(calibration.kappa(class)),
            None => stop,
        }
    }

    /// Mean of error by luminance over the pixels of a picture that reflect light, for the report.
    pub(super) fn mean_relative(&self, seen: &GBuffer, radiance: &Plane<[f32; 3]>) -> f64 {
        // Error and luminance of each lit pixel.
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

        // Pixels next to black have huge ratios, which would decide the mean.
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
    use pipeline::parts::LuminanceThresholds;
    use plane::Correspondence;
    use std::sync::Arc;

    const SIZE: Size = Size { width: 2, height: 1 };

    /// Errors of two pixels: the left one has a threshold of 0.5, the right one was not seen before.
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
        // A gray of 25 % sends back E · 0.25 / π.
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
