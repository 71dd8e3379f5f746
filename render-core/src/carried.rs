//! Light of one picture on the surfaces of the next.
//!
//! The irradiance of a matte surface at rest does not depend on the viewer. Each pixel holds a sample of it: the point where it
//! was computed, and its value there. The next picture takes the light of a pixel from the samples around the place where its
//! surface point was seen before:
//!
//! ```text
//! E(x) ≈ E₀ + g · (x − x₀)      (x₀, E₀)  the nearest sample      g  slope of the plane fitted to the 3×3 samples around
//! ```
//!
//! Samples are handed on and never mixed, so that light is not blurred however long it is carried \[Nehab07\], \[Walter99\].
//! The residual of the plane estimates the error. What lies outside of the samples' convex hull, beside another surface, is
//! estimated by its distance from the hull: light may change there. Audits tell which estimates hold ([`trust`]).
//! A pixel whose error exceeds what they allow, as in penumbras, is lit anew, and so is a pixel whose surface was not visible before.

mod sample;
mod trust;

use crate::gbuffer::{GBuffer, MACROBLOCK, PixelSurface};
use crate::sampling::frame;
use crate::{Timed, luminance};
use glam::{Mat2, Vec2, Vec3, Vec3A};
use plane::{Correspondence, Plane};
use rayon::prelude::*;
use sample::Sample;
use trust::Trust;

/// Distance of a sample, along the surface and off it, up to which it says something about a pixel \[pixels\]. In `nave` rows of
/// benches lie a third of a pixel before others.
const REACH: f32 = 3.0;
const OFF_PLANE: f32 = 0.1;
/// Cosine of the angle up to which the normals of a sample and a pixel may differ: 18°.
const ALIKE_COSINE: f32 = 0.95;
/// Distance of the nearest sample at most \[pixels, seen face on\].
const NEAREST: f32 = 1.0;
/// Samples that a plane is fitted to at least.
const LEAST_FITTED: usize = 5;
/// Difference that is assumed of a sample that no other one can be compared with, as a share of its light.
const UNKNOWN_CONTRAST: f32 = 0.25;
/// Difference of light that the samples do not show, as a share of the brightest around them. Beside benches of `nave` irradiance
/// falls to a third within half a pixel.
const UNSEEN_CONTRAST: f32 = 0.5;
/// Share of the mean square distance of the samples that is added to the fit: nearly collinear samples give no steep slopes.
const STIFFNESS: f32 = 0.01;
/// Cosine of the angle of view below which slanted surfaces are treated alike.
const LEAST_COSINE: f32 = 0.05;

/// Irradiance of the surfaces of a picture: a sample for each pixel, 20 bytes, and what audits found so far.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CarriedLight {
    samples: Plane<Sample>,
    trust: Trust,
}

/// Whether a pixel may take the light of the picture before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reuse {
    /// Its light is what it was.
    Allowed,
    /// It is, but the pixel is lit anew, for comparison.
    Audited,
    /// Its light may have changed.
    Forbidden,
}

/// Irradiance of a picture, as far as it could be carried over.
#[derive(Clone, Debug)]
pub struct Carried {
    /// \[W·m⁻²\], linear RGB; zero where `missing`.
    pub irradiance: Plane<[f32; 3]>,
    /// Pixels that have to be lit. Pixels that show nothing are not missing.
    pub missing: Plane<bool>,
    /// Light that audited pixels would have taken.
    audits: Vec<Audit>,
}

/// Light that was not carried, though it could have been.
#[derive(Clone, Copy, Debug)]
struct Audit {
    /// Raster index.
    pixel: u32,
    luminance: f32,
    /// Estimated error.
    error: f32,
    tolerance: f32,
    /// Whether the light would have been carried, by what is known of estimates.
    is_trusted: bool,
}

/// Irradiance of a whole picture, and what its audits found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Completed {
    /// \[W·m⁻²\], linear RGB.
    pub irradiance: Plane<[f32; 3]>,
    /// Audited pixels.
    pub audits: AuditCounts,
}

/// Numbers of audited pixels whose light would have been carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AuditCounts {
    /// Those that carrying would have made wrong by no more than their tolerance.
    pub within: usize,
    /// All of them.
    pub all: usize,
}

impl Carried {
    /// The whole picture's irradiance: `lit` has that of missing pixels, which `light` keeps.
    ///
    /// # Panics
    /// If the pictures differ in size.
    pub fn complete(self, lit: &Plane<[f32; 3]>, seen: &GBuffer, light: &mut CarriedLight) -> Completed {
        let Self { mut irradiance, missing, audits } = self;
        let pixels = missing.samples().iter().zip(lit.samples()).zip(irradiance.samples_mut());
        let kept = seen.pixels.samples().iter().zip(light.samples.samples_mut());
        for (((_, &lit), irradiance), (pixel, sample)) in pixels.zip(kept).filter(|(((missing, _), _), _)| **missing) {
            *irradiance = lit;
            *sample = Sample::new(pixel.position, pixel.shading_normal.into(), lit.into());
        }
        let mut counts = AuditCounts::default();
        light.trust.forget();
        for Audit { pixel, luminance: carried, error, tolerance, is_trusted } in audits {
            let difference = (luminance(lit.samples()[pixel as usize].into()) - carried).abs();
            light.trust.note(error / tolerance, difference / tolerance);
            counts.all += usize::from(is_trusted);
            counts.within += usize::from(is_trusted && difference <= tolerance);
        }
        Completed { irradiance, audits: counts }
    }
}

/// The picture that light is carried to.
#[derive(Clone, Copy, Debug)]
pub struct Destination<'a> {
    /// Its surfaces.
    pub seen: &'a GBuffer,
    /// Where its pixels were in the picture that the light comes from; none if nothing can be carried.
    pub known: Option<&'a Correspondence>,
    /// Contrast of the light that the samples around a pixel may miss.
    pub unseen: Unseen,
    /// Mean square of the errors that carried light may have, in squares of the tolerance: audits steer by it.
    pub allowed: f32,
}

/// Contrast that may be beyond the outermost samples around a pixel, and between fewer than five.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unseen {
    /// That of the light around the pixel.
    Smooth,
    /// That of the whole picture: light may begin and end anywhere.
    Shadows,
}

impl CarriedLight {
    /// Carries the light to the next picture, where `reuse(x, y)` allows it. `tolerance(x, y, E)` is the error that the luminance
    /// of an irradiance of luminance E may have \[W·m⁻²\].
    ///
    /// From now on the samples are those of `to`; those of missing pixels follow by [`Carried::complete`].
    pub fn carry(
        &mut self,
        to: Destination,
        reuse: impl Fn(usize, usize) -> Reuse + Sync,
        tolerance: impl Fn(usize, usize, f32) -> f32 + Sync,
    ) -> Timed<Carried> {
        let Destination { seen, known, unseen, allowed } = to;
        let (width, height) = (seen.pixels.width(), seen.pixels.height());
        let mut irradiance = Plane::filled(width, height, [0.0; 3]);
        let mut missing = Plane::filled(width, height, false);
        let mut samples = Plane::filled(width, height, Sample::NONE);
        let limit = self.trust.limit(allowed);
        let usual = (unseen == Unseen::Shadows).then(|| self.usual_luminance());
        let strip = (MACROBLOCK * width).max(1);
        let strips = samples
            .samples_mut()
            .par_chunks_mut(strip)
            .zip(irradiance.samples_mut().par_chunks_mut(strip))
            .zip(missing.samples_mut().par_chunks_mut(strip));
        let carry_strip = |row: usize, samples: &mut [Sample], irradiance: &mut [[f32; 3]], missing: &mut [bool]| {
            let mut audits = Vec::new();
            for k in 0..samples.len() {
                let (x, y) = (k % width, row * MACROBLOCK + k / width);
                let pixel = seen.pixels.get(x, y);
                if !pixel.reflects() {
                    continue;
                }
                missing[k] = true;
                let Some(from) = known.and_then(|known| known.match_of(x, y)) else { continue };
                let reuse = reuse(x, y);
                if reuse == Reuse::Forbidden {
                    continue;
                }
                let Some(found) = self.light_at(&pixel, (seen, usual), from as usize) else { continue };
                let tolerance = tolerance(x, y, luminance(found.irradiance));
                if found.error > trust::LARGEST * tolerance {
                    continue;
                }
                let is_trusted = found.error <= limit * tolerance;
                if reuse == Reuse::Audited {
                    let (pixel, luminance) = ((y * width + x) as u32, luminance(found.irradiance));
                    audits.push(Audit { pixel, luminance, error: found.error, tolerance, is_trusted });
                    continue;
                }
                if !is_trusted {
                    continue;
                }
                missing[k] = false;
                samples[k] = found.sample;
                irradiance[k] = found.irradiance.to_array();
            }
            audits
        };
        let audits: Timed<Vec<Vec<Audit>>> = Timed::of(|busy| {
            let strips = strips.enumerate().map(|(row, ((samples, irradiance), missing))| {
                busy.measure(|| carry_strip(row, samples, irradiance, missing))
            });
            strips.collect()
        });
        self.samples = samples;
        audits.map(|audits| Carried { irradiance, missing, audits: audits.concat() })
    }

    /// Mean luminance of the samples that have light.
    fn usual_luminance(&self) -> f32 {
        let (mut sum, mut count) = (0.0, 0u32);
        for sample in self.samples.samples() {
            let luminance = luminance(sample.irradiance());
            if luminance > 0.0 {
                (sum, count) = (sum + f64::from(luminance), count + 1);
            }
        }
        (sum / f64::from(count.max(1))) as f32
    }

    /// Light at the surface point of `pixel` by the samples around the place `from`, in raster order. Where it
    /// may begin anywhere, it is as bright as `usual`.
    fn light_at(&self, pixel: &PixelSurface, (seen, usual): (&GBuffer, Option<f32>), from: usize) -> Option<Found> {
        let (width, height) = (self.samples.width(), self.samples.height());
        if from >= width * height {
            return None;
        }
        let (column, row) = (from % width, from / width);
        let position = Vec3A::from(pixel.position);
        let same = self.samples.get(column, row);
        if same.position == pixel.position && same.normal().dot(pixel.shading_normal.into()) >= ALIKE_COSINE {
            return Some(Found { sample: same, irradiance: same.irradiance(), error: 0.0 });
        }
        let normal = Vec3::from(pixel.geometric_normal);
        let axes = <[Vec3; 2]>::from(frame(normal)).map(Vec3A::from);
        let (normal, shading_normal) = (Vec3A::from(normal), Vec3A::from(pixel.shading_normal));
        let width_facing = seen.view.pixel_width(pixel.depth);
        let to_viewer = (seen.view.position() - position).normalize_or_zero();
        let slant = to_viewer.dot(normal).abs().max(LEAST_COSINE).recip();
        let (reach, off_plane) = (REACH * width_facing * slant, OFF_PLANE * width_facing);
        let mut near = Near { brightest: usual.unwrap_or(0.0), has_borders: usual.is_some(), ..Near::default() };
        for y in row.saturating_sub(1)..(row + 2).min(height) {
            for x in column.saturating_sub(1)..(column + 2).min(width) {
                let sample = self.samples.get(x, y);
                near.brightest = near.brightest.max(luminance(sample.irradiance()));
                let way = Vec3A::from(sample.position) - position;
                // False for NaN, where there is no sample.
                if way.length_squared() <= reach * reach
                    && way.dot(normal).abs() <= off_plane
                    && sample.normal().dot(shading_normal) >= ALIKE_COSINE
                {
                    near.add(sample, Vec2::new(way.dot(axes[0]), way.dot(axes[1])));
                }
            }
        }
        near.at_origin(width_facing * slant)
    }
}

/// Light at a point.
struct Found {
    /// The nearest sample.
    sample: Sample,
    irradiance: Vec3,
    /// By which its luminance may be wrong.
    error: f32,
}

/// The samples near a point.
#[derive(Default)]
struct Near {
    count: usize,
    /// Luminance of what is not seen, at most.
    brightest: f32,
    /// Whether light may end between samples.
    has_borders: bool,
    places: [Vec2; 9],
    light: [Vec3; 9],
    samples: [Sample; 9],
}

impl Near {
    fn add(&mut self, sample: Sample, place: Vec2) {
        let k = self.count;
        (self.places[k], self.light[k], self.samples[k]) = (place, sample.irradiance(), sample);
        self.count += 1;
    }

    /// Light at the origin; none if no sample is within [`NEAREST`] of it, in units of the samples' `spacing`. Where the samples
    /// tell little, the light may differ by [`UNSEEN_CONTRAST`].
    fn at_origin(&self, spacing: f32) -> Option<Found> {
        let (count, nearest) = (self.count, NEAREST * spacing);
        let (places, light) = (&self.places[..count], &self.light[..count]);
        let far2 = |k: usize| places[k].length_squared();
        let first = (0..count).min_by(|&a, &b| far2(a).total_cmp(&far2(b)))?;
        if far2(first) > nearest * nearest {
            return None;
        }
        let mean = |sum: Vec2| sum / count as f32;
        let middle = mean(places.iter().sum());
        let spread2 = places.iter().map(|place| (place - middle).length_squared()).sum::<f32>() / count as f32;
        let (spread, slopes, contrast) = if count == 1 || spread2 == 0.0 {
            (spacing, [Vec2::ZERO; 3], UNKNOWN_CONTRAST * self.brightest)
        } else if count < LEAST_FITTED {
            let brightness = || light.iter().map(|&light| luminance(light));
            let range = brightness().fold(f32::NEG_INFINITY, f32::max) - brightness().fold(f32::INFINITY, f32::min);
            (spread2.sqrt(), [Vec2::ZERO; 3], range)
        } else {
            let (slopes, rest) = self.fitted(middle, spread2);
            (spread2.sqrt(), slopes, rest)
        };
        let share = (far2(first).sqrt() / spread).min(1.0);
        // Few samples say nothing of what is between them, either.
        let unseen = if count < LEAST_FITTED { share } else { (self.beyond() / spacing).min(1.0) };
        // A border is there or not: errors by chance, and their root mean square.
        let unseen = if self.has_borders { unseen.sqrt() } else { unseen };
        let error = contrast * share + UNSEEN_CONTRAST * unseen * self.brightest;
        let change = Vec3::from_array(slopes.map(|slope| -slope.dot(places[first])));
        let irradiance = (light[first] + change).max(Vec3::ZERO);
        Some(Found { sample: self.samples[first], irradiance, error })
    }

    /// Distance of the origin from the convex hull of the places.
    fn beyond(&self) -> f32 {
        let places = &self.places[..self.count];
        // Outside, all places are on one side of the line through the origin and one of them.
        let is_outside = places.iter().any(|a| places.iter().all(|&b| a.perp_dot(b) >= 0.0));
        if !is_outside {
            return 0.0;
        }
        let mut least = f32::INFINITY;
        for (k, &a) in places.iter().enumerate() {
            for &b in &places[..=k] {
                let way = b - a;
                let along = (-a.dot(way) / way.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
                least = least.min((a + way * along).length_squared());
            }
        }
        least.sqrt()
    }

    /// Slopes of the plane through the samples' light, by channel, and root mean square of the luminance that it leaves.
    fn fitted(&self, middle: Vec2, spread2: f32) -> ([Vec2; 3], f32) {
        let (places, light) = (&self.places[..self.count], &self.light[..self.count]);
        let count = self.count as f32;
        let mean = light.iter().sum::<Vec3>() / count;
        let (mut square, mut by) = (Mat2::from_diagonal(Vec2::splat(STIFFNESS * spread2 * count)), [Vec2::ZERO; 3]);
        for (place, light) in places.iter().zip(light) {
            let (way, more) = (place - middle, light - mean);
            square += Mat2::from_cols(way * way.x, way * way.y);
            by.iter_mut().zip(more.to_array()).for_each(|(by, more)| *by += way * more);
        }
        let inverse = square.inverse();
        let slopes = by.map(|by| inverse * by);
        let rest = |(place, light): (&Vec2, &Vec3)| {
            let plane = Vec3::from_array(slopes.map(|slope| slope.dot(place - middle)));
            luminance(light - mean - plane).powi(2)
        };
        let rest = places.iter().zip(light).map(rest).sum::<f32>() / (count - 3.0);
        (slopes, rest.sqrt())
    }
}

#[cfg(test)]
mod tests;
