//! Estimation of the light at a point from the samples around it, and of its error.

use super::sample::Sample;
use crate::luminance;
use glam::{Mat2, Vec2, Vec3};

/// Maximum distance of the nearest sample \[pixels, seen head-on\].
const NEAREST: f32 = 1.0;
/// Minimum number of samples for fitting a plane.
const LEAST_FITTED: usize = 5;
/// Assumed contrast around a single sample, as a fraction of its light.
const UNKNOWN_CONTRAST: f32 = 0.25;
/// Assumed contrast of light between or beyond the samples, as a fraction of the brightest light around them. Next to
/// benches in `nave`, irradiance falls to a third within half a pixel.
const UNSEEN_CONTRAST: f32 = 0.5;
/// Stabilization of the fit, as a fraction of the samples' mean square distance: nearly collinear samples get no steep
/// slopes.
const STIFFNESS: f32 = 0.01;

/// Estimated light at a point.
pub(super) struct Estimate {
    /// The nearest sample.
    pub sample: Sample,
    pub irradiance: Vec3,
    /// Estimated error of the luminance \[W·m⁻²\].
    pub error: f32,
}

/// The samples near a point, with positions relative to it.
#[derive(Default)]
pub(super) struct NearSamples {
    count: usize,
    /// Maximum luminance of light outside of the samples.
    pub brightest: f32,
    /// Whether light may end between samples.
    has_borders: bool,
    places: [Vec2; 9],
    light: [Vec3; 9],
    samples: [Sample; 9],
}

/// Variation of the light between samples.
struct Variation {
    /// Distance over which light varies by the contrast \[m\].
    spread: f32,
    /// Slopes by channel \[W·m⁻³\].
    slopes: [Vec2; 3],
    /// Luminance not explained by the slopes \[W·m⁻²\].
    contrast: f32,
}

impl NearSamples {
    /// Returns an empty set. If light may end between samples, the light outside has at least the luminance `usual`.
    pub fn new(usual: Option<f32>) -> Self {
        Self { brightest: usual.unwrap_or(0.0), has_borders: usual.is_some(), ..Self::default() }
    }

    pub fn add(&mut self, sample: Sample, place: Vec2) {
        let k = self.count;
        (self.places[k], self.light[k], self.samples[k]) = (place, sample.irradiance(), sample);
        self.count += 1;
    }

    /// Estimates the light at the origin; returns `None` if no sample is within [`NEAREST`] of it, in units of the
    /// samples' `spacing`. Where the samples are insufficient, the light may differ by [`UNSEEN_CONTRAST`].
    pub fn at_origin(&self, spacing: f32) -> Option<Estimate> {
        // The nearest sample, x₀, is reused. If it is more than a pixel away, the light here is unknown.
        let (places, nearest) = (&self.places[..self.count], NEAREST * spacing);
        let distance2 = |k: usize| places[k].length_squared();
        let first = (0..self.count).min_by(|&a, &b| distance2(a).total_cmp(&distance2(b)))?;
        if distance2(first) > nearest * nearest {
            return None;
        }

        // The farther x₀ is from the origin, the more of the observed variation can lie between them.
        let Variation { spread, slopes, contrast } = self.variation(spacing);
        let share = (distance2(first).sqrt() / spread).min(1.0);

        // Light can also change where no sample lies: beyond all of them, or anywhere if they are few.
        let unseen = if self.count < LEAST_FITTED { share } else { (self.beyond() / spacing).min(1.0) };
        // A border of light is present or not. With its probability p, the root mean square error is proportional to
        // √p.
        let unseen = if self.has_borders { unseen.sqrt() } else { unseen };
        let error = contrast * share + UNSEEN_CONTRAST * unseen * self.brightest;

        // E(0) = E₀ − g · x₀ by channel. An extrapolated slope must not make light negative.
        let change = Vec3::from_array(slopes.map(|g| -g.dot(places[first])));
        let irradiance = (self.light[first] + change).max(Vec3::ZERO);
        Some(Estimate { sample: self.samples[first], irradiance, error })
    }

    /// Returns the variation of the light, by the best model for the number of samples; `spacing` is their usual
    /// distance \[m\].
    fn variation(&self, spacing: f32) -> Variation {
        // s² = Σ |x − x̄|² / n
        let (count, places) = (self.count, &self.places[..self.count]);
        let middle = places.iter().sum::<Vec2>() / count as f32;
        let spread2 = places.iter().map(|place| (place - middle).length_squared()).sum::<f32>() / count as f32;

        // A single position shows no variation, so some is assumed.
        if count == 1 || spread2 == 0.0 {
            return Variation { spread: spacing, slopes: [Vec2::ZERO; 3], contrast: UNKNOWN_CONTRAST * self.brightest };
        }
        // A plane fits a few samples nearly exactly, even if the light is irregular. Their range is the safer measure.
        if count < LEAST_FITTED {
            return Variation { spread: spread2.sqrt(), slopes: [Vec2::ZERO; 3], contrast: self.range() };
        }
        let (slopes, contrast) = self.fitted(middle, spread2);
        Variation { spread: spread2.sqrt(), slopes, contrast }
    }

    /// Returns the difference between the luminances of the brightest and the darkest sample.
    fn range(&self) -> f32 {
        let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
        for &light in &self.light[..self.count] {
            let luminance = luminance(light);
            (least, most) = (least.min(luminance), most.max(luminance));
        }
        most - least
    }

    /// Fits a plane to the samples' light. Returns its slopes g by channel, and the root mean square residual in
    /// luminance. The fit minimizes
    ///
    /// ```text
    /// Σ (E − Ē − g · d)² + ρ g²          d = x − x̄          ρ = STIFFNESS Σ d²
    /// ```
    ///
    /// `middle` is x̄ and `spread2` the mean of d².
    fn fitted(&self, middle: Vec2, spread2: f32) -> ([Vec2; 3], f32) {
        let (places, light) = (&self.places[..self.count], &self.light[..self.count]);
        let count = self.count as f32;
        let mean = light.iter().sum::<Vec3>() / count;

        // The normal equations A g = b:  A = Σ d dᵀ + ρ 1,  b = Σ d (E − Ē) for each channel. ρ keeps A invertible if
        // all samples are collinear.
        let (mut a, mut b) = (Mat2::from_diagonal(Vec2::splat(STIFFNESS * spread2 * count)), [Vec2::ZERO; 3]);
        for (place, light) in places.iter().zip(light) {
            let (d, e) = (place - middle, light - mean);
            a += Mat2::from_cols(d * d.x, d * d.y);
            for channel in 0..3 {
                b[channel] += d * e[channel];
            }
        }
        let inverse = a.inverse();
        let g = b.map(|b| inverse * b);

        // σ² = Σ (E − Ē − g · d)² / (n − 3), in luminance: the plane has three degrees of freedom.
        let mut squares = 0.0;
        for (place, light) in places.iter().zip(light) {
            let plane = Vec3::from_array(g.map(|g| g.dot(place - middle)));
            squares += luminance(light - mean - plane).powi(2);
        }
        (g, (squares / (count - 3.0)).sqrt())
    }

    /// Returns the distance of the origin from the convex hull of the positions.
    fn beyond(&self) -> f32 {
        // If the origin is outside, all positions are on one side of the line through it and one of them.
        let places = &self.places[..self.count];
        let is_outside = places.iter().any(|a| places.iter().all(|&b| a.perp_dot(b) >= 0.0));
        if !is_outside {
            return 0.0;
        }

        // The nearest point of the hull is on the line between two positions. Lines inside the hull are farther away
        // and harmless.
        let mut least = f32::INFINITY;
        for (k, &a) in places.iter().enumerate() {
            for &b in &places[..=k] {
                // The point a + t (b − a) nearest to the origin:  t = −a · (b − a) / |b − a|², in 0…1.
                let way = b - a;
                let t = (-a.dot(way) / way.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
                least = least.min((a + way * t).length_squared());
            }
        }
        least.sqrt()
    }
}
