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
//! A pixel whose error exceeds what they allow, as in penumbras, is lit anew. So is a pixel whose surface was not visible before.

mod near;
mod sample;
mod trust;

use crate::gbuffer::{GBuffer, MACROBLOCK, PixelSurface};
use crate::sampling::frame;
use crate::{Timed, luminance};
use glam::{Vec2, Vec3, Vec3A};
use near::{Estimate, NearSamples};
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
        let lit = lit.samples();

        // New light of missing pixels completes the picture, and becomes the sample that the next one takes.
        let (surfaces, samples) = (seen.pixels.samples(), light.samples.samples_mut());
        let irradiances = irradiance.samples_mut();
        for (k, &is_missing) in missing.samples().iter().enumerate() {
            if is_missing {
                irradiances[k] = lit[k];
                samples[k] = Sample::new(surfaces[k].position, surfaces[k].shading_normal.into(), lit[k].into());
            }
        }

        // Audited pixels were lit as well: how far off would the carried light have been? All of them say how far estimates can
        // be trusted. Counted are those that would not have been lit without the audit.
        let mut counts = AuditCounts::default();
        light.trust.forget();
        for Audit { pixel, luminance: carried, error, tolerance, is_trusted } in audits {
            let difference = (luminance(lit[pixel as usize].into()) - carried).abs();
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
        // The next picture, before anything is carried to it.
        let (width, height) = (to.seen.pixels.width(), to.seen.pixels.height());
        let mut irradiance = Plane::filled(width, height, [0.0; 3]);
        let mut missing = Plane::filled(width, height, false);
        let mut samples = Plane::filled(width, height, Sample::NONE);

        // What is the same for all pixels.
        let (light, limit) = (&*self, self.trust.limit(to.allowed));
        let usual = (to.unseen == Unseen::Shadows).then(|| self.usual_luminance());
        let transfer = Transfer { light, to, reuse: &reuse, tolerance: &tolerance, limit, usual };

        // Rows of macroblocks side by side. Each reads samples of the last picture anywhere, and writes to its own pixels.
        let strip = (MACROBLOCK * width).max(1);
        let strips = samples
            .samples_mut()
            .par_chunks_mut(strip)
            .zip(irradiance.samples_mut().par_chunks_mut(strip))
            .zip(missing.samples_mut().par_chunks_mut(strip))
            .enumerate();
        let audits: Timed<Vec<Vec<Audit>>> = Timed::of(|busy| {
            let carry = |(row, ((samples, irradiance), missing))| {
                busy.measure(|| transfer.carry_strip(row * MACROBLOCK, Strip { samples, irradiance, missing }))
            };
            strips.map(carry).collect()
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
    fn light_at(&self, pixel: &PixelSurface, seen: &GBuffer, usual: Option<f32>, from: usize) -> Option<Estimate> {
        // A light that has not been carried yet has no samples, whatever the pictures show.
        let (width, height) = (self.samples.width(), self.samples.height());
        if from >= width * height {
            return None;
        }

        // The very point has a sample where neither the camera nor the surface moved: nothing to estimate.
        let (column, row) = (from % width, from / width);
        let same = self.samples.get(column, row);
        let shading_normal = Vec3A::from(pixel.shading_normal);
        if same.position == pixel.position && same.normal().dot(shading_normal) >= ALIKE_COSINE {
            return Some(Estimate { sample: same, irradiance: same.irradiance(), error: 0.0 });
        }

        // Distances count in widths of a pixel. Along a surface seen askew a pixel is wider by 1 / cos.
        let position = Vec3A::from(pixel.position);
        let normal = Vec3A::from(pixel.geometric_normal);
        let width_facing = seen.view.pixel_width(pixel.depth);
        let to_viewer = (seen.view.position() - position).normalize_or_zero();
        let slant = to_viewer.dot(normal).abs().max(LEAST_COSINE).recip();
        let (reach, off_plane) = (REACH * width_facing * slant, OFF_PLANE * width_facing);

        // Of the 3×3 samples only those of the same surface count, by their places along it. The others still say how bright
        // the light beside it may be.
        let axes = <[Vec3; 2]>::from(frame(normal.into())).map(Vec3A::from);
        let mut near = NearSamples::new(usual);
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

/// All that decides what the pixels of a picture take from the one before.
struct Transfer<'a, R, T> {
    light: &'a CarriedLight,
    to: Destination<'a>,
    /// See [`CarriedLight::carry`].
    reuse: &'a R,
    tolerance: &'a T,
    /// Largest estimated error that is carried, in tolerances.
    limit: f32,
    /// Luminance of light that may begin anywhere; none if it does not.
    usual: Option<f32>,
}

/// A part of the next picture: some of its rows.
struct Strip<'a> {
    samples: &'a mut [Sample],
    irradiance: &'a mut [[f32; 3]],
    missing: &'a mut [bool],
}

/// What becomes of the light at a pixel.
enum Outcome {
    Carried(Estimate),
    /// The pixel is lit anew, and the carried light compared with that.
    Audited(Audit),
    /// The pixel is lit anew.
    Lost,
}

impl<R, T> Transfer<'_, R, T>
where
    R: Fn(usize, usize) -> Reuse,
    T: Fn(usize, usize, f32) -> f32,
{
    /// Carries light to a strip whose first row is `top`; returns the audits there.
    fn carry_strip(&self, top: usize, strip: Strip) -> Vec<Audit> {
        let pixels = &self.to.seen.pixels;
        let mut audits = Vec::new();
        for k in 0..strip.samples.len() {
            // The sky and the like reflect nothing: they need no light.
            let (x, y) = (k % pixels.width(), top + k / pixels.width());
            let pixel = pixels.get(x, y);
            if !pixel.reflects() {
                continue;
            }
            strip.missing[k] = true;
            match self.outcome(x, y, &pixel) {
                Outcome::Lost => (),
                Outcome::Audited(audit) => audits.push(audit),
                Outcome::Carried(estimate) => {
                    strip.missing[k] = false;
                    strip.samples[k] = estimate.sample;
                    strip.irradiance[k] = estimate.irradiance.to_array();
                }
            }
        }
        audits
    }

    /// What becomes of the light at pixel (x, y), which shows `pixel`.
    fn outcome(&self, x: usize, y: usize, pixel: &PixelSurface) -> Outcome {
        // A surface that was out of sight in the last picture, or whose light may be another now, has nothing to take.
        let Destination { seen, known, .. } = self.to;
        let Some(from) = known.and_then(|known| known.match_of(x, y)) else { return Outcome::Lost };
        let reuse = (self.reuse)(x, y);
        if reuse == Reuse::Forbidden {
            return Outcome::Lost;
        }

        // Beyond the largest estimate that audits are kept of, even an audit would say nothing.
        let Some(estimate) = self.light.light_at(pixel, seen, self.usual, from as usize) else {
            return Outcome::Lost;
        };
        let (luminance, error) = (luminance(estimate.irradiance), estimate.error);
        let tolerance = (self.tolerance)(x, y, luminance);
        if error > trust::LARGEST * tolerance {
            return Outcome::Lost;
        }

        // An audit also looks at light that is not trusted: else the limit could never rise again.
        let is_trusted = error <= self.limit * tolerance;
        if reuse == Reuse::Audited {
            let pixel = (y * seen.pixels.width() + x) as u32;
            return Outcome::Audited(Audit { pixel, luminance, error, tolerance, is_trusted });
        }
        if is_trusted { Outcome::Carried(estimate) } else { Outcome::Lost }
    }
}

#[cfg(test)]
mod tests;
