//! Estimation of the light at a point from nearby samples, and of the error of this light.

use crate::luminance;
use glam::{Mat2, Vec2, Vec3};

/// Maximum distance of the nearest sample, seen head-on \[pixels\].
const NEAREST: f32 = 1.0;
/// Minimum number of samples for fitting a plane.
const LEAST_FITTED: usize = 5;
/// Assumed contrast around a single sample, as a fraction of the sample's light.
const UNKNOWN_CONTRAST: f32 = 0.25;
/// Assumed contrast of light between or beyond the samples, as a fraction of the brightest surrounding light. Next to
/// benches in `nave`, irradiance falls to a third within half a pixel.
const UNSEEN_CONTRAST: f32 = 0.5;
/// Stabilization of the fit, as a fraction of the samples' mean square distance. It prevents steep slopes from nearly
/// collinear samples.
const STIFFNESS: f32 = 0.01;

/// Light estimated from samples, and its error.
pub(super) struct NearLight {
    /// Index of the nearest sample, in the order of [`NearSamples::add`].
    pub nearest: usize,
    pub light: Vec3,
    /// Estimated error of the luminance, in units of the light.
    pub error: f32,
    /// Length of the luminance's slope, in units of the light per unit of the positions.
    pub slope: f32,
}

/// Samples near a point, with positions relative to the point.
#[derive(Default)]
pub(super) struct NearSamples {
    count: usize,
    /// Maximum luminance of light outside the samples \[W·m⁻²\].
    pub brightest: f32,
    /// Whether light may end between samples.
    has_borders: bool,
    places: [Vec2; 9],
    light: [Vec3; 9],
}

/// Variation of the light between samples.
struct Variation {
    /// Distance over which light varies by the contrast \[m\].
    spread: f32,
    /// Slopes of the light, by channel \[W·m⁻³\].
    slopes: [Vec2; 3],
    /// Contrast of luminance that the slopes do not explain \[W·m⁻²\].
    contrast: f32,
}

impl NearSamples {
    /// Returns an empty set. If light may end between samples, the light outside has at least the luminance `usual`.
    pub fn new(usual: Option<f32>) -> Self {
        Self { brightest: usual.unwrap_or(0.0), has_borders: usual.is_some(), ..Self::default() }
    }

    pub fn count(&self) -> usize {
        self.count
    }

    pub fn add(&mut self, light: Vec3, place: Vec2) {
        (self.places[self.count], self.light[self.count]) = (place, light);
        self.count += 1;
    }

    /// Estimates the light at the origin. Returns `None` if no sample is within [`NEAREST`] of the origin, in units of
    /// the samples' `spacing`. If the samples are insufficient, the light may differ by [`UNSEEN_CONTRAST`].
    pub fn at_origin(&self, spacing: f32) -> Option<NearLight> {
        // Reuse the nearest sample, x₀. If it is more than a pixel away, the light at the origin is unknown.
        let (places, nearest) = (&self.places[..self.count], NEAREST * spacing);
        let distance2 = |k: usize| places[k].length_squared();
        let first = (0..self.count).min_by(|&a, &b| distance2(a).total_cmp(&distance2(b)))?;
        if distance2(first) > nearest * nearest {
            return None;
        }

        // Scale the observed variation by the distance from x₀ to the origin, because more of the variation can lie
        // within a larger distance.
        let Variation { spread, slopes, contrast } = self.variation(spacing);
        let share = (distance2(first).sqrt() / spread).min(1.0);

        // Add the contrast of light without samples: beyond all samples, or anywhere if samples are few.
        let unseen = if self.count < LEAST_FITTED { share } else { (self.beyond() / spacing).min(1.0) };
        // Use √p for a border of light, which is present or absent: with probability p, the root mean square error is
        // proportional to √p.
        let unseen = if self.has_borders { unseen.sqrt() } else { unseen };
        let error = contrast * share + UNSEEN_CONTRAST * unseen * self.brightest;

        // Extrapolate E(0) = E₀ − g · x₀ by channel.
        let change = Vec3::from_array(slopes.map(|g| -g.dot(places[first])));
        let along = |axis: usize| luminance(Vec3::from_array(slopes.map(|g| g[axis])));
        let slope = Vec2::new(along(0), along(1)).length();
        Some(NearLight { nearest: first, light: self.light[first] + change, error, slope })
    }

    /// Returns the variation of the light, by the best model for the number of samples. `spacing` is the usual distance
    /// between samples \[m\].
    fn variation(&self, spacing: f32) -> Variation {
        // Compute the mean square distance s² = Σ |x − x̄|² / n.
        let (count, places) = (self.count, &self.places[..self.count]);
        let middle = places.iter().sum::<Vec2>() / count as f32;
        let spread2 = places.iter().map(|place| (place - middle).length_squared()).sum::<f32>() / count as f32;

        // Assume some variation, because a single position shows none.
        if count == 1 || spread2 == 0.0 {
            return Variation { spread: spacing, slopes: [Vec2::ZERO; 3], contrast: UNKNOWN_CONTRAST * self.brightest };
        }
        // Use the range of few samples: a plane fits few samples nearly exactly, even if the light is irregular.
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

    /// Fits a plane to the samples' light. Returns the slopes g of the plane by channel, and the root mean square
    /// residual of luminance. The fit minimizes
    ///
    /// ```text
    /// Σ (E − Ē − g · d)² + ρ g²          d = x − x̄          ρ = STIFFNESS Σ d²
    /// ```
    ///
    /// `middle` is x̄, and `spread2` is the mean of d².
    fn fitted(&self, middle: Vec2, spread2: f32) -> ([Vec2; 3], f32) {
        let (places, light) = (&self.places[..self.count], &self.light[..self.count]);
        let count = self.count as f32;
        let mean = light.iter().sum::<Vec3>() / count;

        // Build the normal equations A g = b: A = Σ d dᵀ + ρ 1, b = Σ d (E − Ē) for each channel. ρ keeps A invertible
        // if all samples are collinear.
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

        // Compute the residual of luminance σ² = Σ (E − Ē − g · d)² / (n − 3). The plane has three degrees of
        // freedom.
        let mut squares = 0.0;
        for (place, light) in places.iter().zip(light) {
            let plane = Vec3::from_array(g.map(|g| g.dot(place - middle)));
            squares += luminance(light - mean - plane).powi(2);
        }
        (g, (squares / (count - 3.0)).sqrt())
    }

    /// Returns the distance of the origin from the convex hull of the positions.
    fn beyond(&self) -> f32 {
        // Find a line through the origin and one position with all positions on one side. It exists if the origin is
        // outside.
        let places = &self.places[..self.count];
        let is_outside = places.iter().any(|a| places.iter().all(|&b| a.perp_dot(b) >= 0.0));
        if !is_outside {
            return 0.0;
        }

        // Find the nearest point of the hull on the lines between two positions. Lines inside the hull are farther away
        // and have no effect.
        let mut least = f32::INFINITY;
        for (k, &a) in places.iter().enumerate() {
            for &b in &places[..=k] {
                // The point a + t (b − a) nearest to the origin has t = −a · (b − a) / |b − a|², clamped to 0…1.
                let way = b - a;
                let t = (-a.dot(way) / way.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
                least = least.min((a + way * t).length_squared());
            }
        }
        least.sqrt()
    }
}
