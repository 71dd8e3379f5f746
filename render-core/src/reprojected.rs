//! Reprojection of irradiance from one picture to the next.
//!
//! The irradiance of a static matte surface does not depend on the viewer. Each pixel stores a sample: a point and its
//! irradiance. The surface point of a pixel in the next picture is reprojected to the previous frame. The irradiance
//! at this point follows from the samples around it:
//!
//! ```text
//! E(x) ≈ E₀ + g · (x − x₀)      (x₀, E₀)  the nearest sample      g  slope of the plane fitted to the 3×3 samples around
//! ```
//!
//! Samples are copied and never mixed, so light is not blurred over any number of frames \[Nehab07\], \[Walter99\]. The
//! residual of the plane estimates the error. Next to another surface, a point may be outside the samples' convex hull,
//! where light may change. The error at such a point is estimated from the distance to the hull. Audits determine which
//! estimates are reliable ([`trust`]). A pixel is lit again if its estimated error exceeds the limit set by audits, as
//! in penumbras. A pixel is also lit if its surface was not visible before.

mod limit;
mod near;
mod reflected;
mod sample;
mod trust;

use crate::gbuffer::{GBuffer, MACROBLOCK, PixelSurface};
use crate::sampling::frame;
use crate::{Timed, luminance};
use glam::{Vec2, Vec3, Vec3A};
pub use limit::spread;
use limit::{OpenPixel, choose};
use near::{NearLight, NearSamples};
use plane::{Correspondence, Plane};
use rayon::prelude::*;
pub use reflected::{CoatView, CoatsInView, LobeLight, ReflectedLight, ReprojectedCoats};
use sample::{PackedNormal, Sample};
use trust::Trust;

/// Maximum distance along the surface at which a sample is used \[pixels\].
const REACH: f32 = 3.0;
/// Maximum distance off the surface at which a sample is used \[pixels\]. In `nave`, rows of benches lie a third of a
/// pixel in front of other rows.
const OFF_PLANE: f32 = 0.1;
/// Minimum cosine of the angle between the normals of a sample and a pixel: 18°.
const ALIKE_COSINE: f32 = 0.95;
/// Minimum cosine of the viewing angle. More oblique surfaces count as being at this angle.
const LEAST_COSINE: f32 = 0.05;

/// Irradiance of the surfaces in a picture, and the audit results so far. Each pixel has a sample of 20 bytes.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReprojectedLight {
    samples: Plane<Sample>,
    trust: Trust,
}

/// Permission for a pixel to reuse the light of the previous frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reuse {
    /// The pixel's light is unchanged and is reused.
    Allowed,
    /// The pixel's light is unchanged, but the pixel is lit again for comparison.
    Audited,
    /// The pixel's light may have changed.
    Forbidden,
}

/// Irradiance of a picture after reprojection, with the pixels that remain to be lit.
#[derive(Clone, Debug)]
pub struct Reprojected {
    /// Irradiance \[W·m⁻²\], linear RGB. It is zero where `missing`.
    pub irradiance: Plane<[f32; 3]>,
    /// Mask of the pixels that must be lit. Pixels without a surface are not missing.
    pub missing: Plane<bool>,
    /// Audits, with the reprojected light of the audited pixels.
    audits: Vec<Audit>,
    /// Whether the number of missing pixels was limited. There are no audits then.
    is_limited: bool,
    /// Number of pixels that should be lit, but are not missing.
    open: usize,
    /// Open pixels without light, in raster order.
    bare: Vec<u32>,
}

/// Light that is reprojected for comparison only.
#[derive(Clone, Copy, Debug)]
struct Audit {
    /// Index of the pixel in raster order.
    pixel: u32,
    luminance: f32,
    /// Estimated error of the reprojected light's luminance \[W·m⁻²\].
    error: f32,
    /// Standard deviation of the reprojected light's luminance; 0 for light without noise.
    noise: f32,
    tolerance: f32,
    /// Whether the light would have been reused under the current limit.
    is_trusted: bool,
}

/// Irradiance of a whole picture, with the results of its audits.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Completed {
    /// Irradiance \[W·m⁻²\], linear RGB.
    pub irradiance: Plane<[f32; 3]>,
    /// Counts of audited pixels.
    pub audits: AuditCounts,
    /// Number of pixels with an error above their tolerance, because [`Destination::most`] left them unlit.
    pub open: usize,
}

/// Counts of audited pixels that would have been reused without the audit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AuditCounts {
    /// Number of counted pixels with reprojection errors within their tolerance.
    pub within: usize,
    /// Number of counted pixels.
    pub all: usize,
}

impl Reprojected {
    /// Completes the irradiance with the missing pixels from `lit`, and stores their samples in `light`.
    ///
    /// # Panics
    /// If the pictures differ in size.
    pub fn complete(self, lit: &Plane<[f32; 3]>, seen: &GBuffer, light: &mut ReprojectedLight) -> Timed<Completed> {
        let Self { mut irradiance, missing, audits, is_limited, open, bare } = self;
        let lit = lit.samples();

        // Complete the picture with the new light of missing pixels, which becomes the samples for the next picture.
        let (surfaces, samples) = (seen.pixels.samples(), light.samples.samples_mut());
        let irradiances = irradiance.samples_mut();
        for (k, &is_missing) in missing.samples().iter().enumerate() {
            if is_missing {
                irradiances[k] = lit[k];
                samples[k] = Sample::new(surfaces[k].position, surfaces[k].shading_normal.into(), lit[k].into());
            }
        }

        let difference = |audit: &Audit| Some((luminance(lit[audit.pixel as usize].into()) - audit.luminance).abs());
        let audits = if is_limited { AuditCounts::default() } else { judged(audits, difference, &mut light.trust) };
        // Unlit pixels have no sample, so that the next picture lights them.
        let spread = spread(&mut irradiance, &bare, seen, |k| seen.pixels.samples()[k].reflects());
        spread.map(|()| Completed { irradiance, audits, open })
    }
}

/// Measures the errors of reprojected light at audited pixels, which were lit too. `difference` returns the error of a
/// pixel's luminance, if it has new light. All errors train the `trust` in estimates. The counts contain only pixels that
/// would have been reused without the audit.
fn judged(audits: Vec<Audit>, difference: impl Fn(&Audit) -> Option<f32>, trust: &mut Trust) -> AuditCounts {
    let mut counts = AuditCounts::default();
    trust.forget();
    for audit in audits {
        let Some(difference) = difference(&audit) else { continue };
        let Audit { error, tolerance, is_trusted, .. } = audit;
        trust.note(error / tolerance, difference / tolerance);
        counts.all += usize::from(is_trusted);
        counts.within += usize::from(is_trusted && difference <= tolerance);
    }
    counts
}

/// Picture to which light is reprojected.
#[derive(Clone, Copy, Debug)]
pub struct Destination<'a> {
    /// Surfaces of the picture.
    pub seen: &'a GBuffer,
    /// Positions of the picture's pixels in the source picture, or `None` if no light can be reprojected.
    pub known: Option<&'a Correspondence>,
    /// Contrast of light between and beyond the samples around a pixel.
    pub unseen: Unseen,
    /// Maximum mean square error of reprojected light, in squares of the tolerance. Audits adapt the reuse to this
    /// limit.
    pub allowed: f32,
    /// Maximum number of pixels that are lit, or `None` for all missing ones. The pixels with the largest errors are
    /// lit. All others have reprojected light despite its error, or the light of pixels around them.
    pub most: Option<usize>,
}

/// Contrast of light beyond the outermost samples around a pixel, or between fewer than five samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unseen {
    /// Use the contrast of the light around the pixel.
    Smooth,
    /// Use the contrast of the whole picture, because shadows may begin and end anywhere.
    Shadows,
}

impl ReprojectedLight {
    /// Reprojects the light to the next picture where `reuse(x, y)` allows it. `tolerance(x, y, E)` is the tolerable
    /// error of luminance \[W·m⁻²\] for an irradiance with luminance E \[W·m⁻²\].
    ///
    /// Afterwards, the samples belong to `to`. [`Reprojected::complete`] adds the samples of missing pixels.
    pub fn carry(
        &mut self,
        to: Destination,
        reuse: impl Fn(usize, usize) -> Reuse + Sync,
        tolerance: impl Fn(usize, usize, f32) -> f32 + Sync,
    ) -> Timed<Reprojected> {
        // Create the next picture without light.
        let (width, height) = (to.seen.pixels.width(), to.seen.pixels.height());
        let mut irradiance = Plane::filled(width, height, [0.0; 3]);
        let mut missing = Plane::filled(width, height, false);
        let mut samples = Plane::filled(width, height, Sample::NONE);

        // Compute the parameters common to all pixels.
        let (light, limit) = (&*self, self.trust.limit(to.allowed));
        let usual = (to.unseen == Unseen::Shadows).then(|| self.usual_luminance());
        let transfer = Transfer { light, to, reuse: &reuse, tolerance: &tolerance, limit, usual };

        // Process rows of macroblocks in parallel. Each row reads samples anywhere in the previous frame, and writes
        // its own pixels only.
        let strip = (MACROBLOCK * width).max(1);
        let strips = samples
            .samples_mut()
            .par_chunks_mut(strip)
            .zip(irradiance.samples_mut().par_chunks_mut(strip))
            .zip(missing.samples_mut().par_chunks_mut(strip))
            .enumerate();
        let found: Timed<Vec<FoundInStrip>> = Timed::of(|busy| {
            let carry = |(row, ((samples, irradiance), missing))| {
                busy.measure(|| transfer.carry_strip(row * MACROBLOCK, Strip { samples, irradiance, missing }))
            };
            strips.map(carry).collect()
        });
        self.samples = samples;
        found.map(|found| {
            let (mut audits, mut pixels) = (Vec::new(), Vec::new());
            for FoundInStrip { audits: own, open } in found {
                audits.extend(own);
                pixels.extend(open);
            }
            let (open, bare) = choose(pixels, to.most.unwrap_or(usize::MAX), &mut missing);
            Reprojected { irradiance, missing, audits, is_limited: to.most.is_some(), open, bare }
        })
    }

    /// Returns the mean luminance of the samples that are not black.
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

    /// Estimates the light at the surface point of `pixel` from the samples around index `from` (raster order). `usual`
    /// is the luminance of light that may begin anywhere.
    fn light_at(&self, pixel: &PixelSurface, seen: &GBuffer, usual: Option<f32>, from: usize) -> Option<Estimate> {
        // Return early before the first reprojection: samples do not exist, even if the pictures have surfaces.
        let (width, height) = (self.samples.width(), self.samples.height());
        if from >= width * height {
            return None;
        }

        // Return the point's own sample without error if neither the camera nor the surface moved.
        let (column, row) = (from % width, from / width);
        let same = self.samples.get(column, row);
        let shading_normal = Vec3A::from(pixel.shading_normal);
        if same.position == pixel.position && same.normal().is_within(ALIKE_COSINE, shading_normal) {
            return Some(Estimate { sample: same, irradiance: same.irradiance(), error: 0.0 });
        }

        // Measure distances in pixel widths. On an oblique surface, a pixel is wider by 1 / cos.
        let position = Vec3A::from(pixel.position);
        let normal = Vec3A::from(pixel.geometric_normal);
        let width_facing = seen.view.pixel_width(pixel.depth);
        let to_viewer = (seen.view.position() - position).normalize_or_zero();
        let slant = to_viewer.dot(normal).abs().max(LEAST_COSINE).recip();
        let (reach, off_plane) = (REACH * width_facing * slant, OFF_PLANE * width_facing);

        // Select the 3×3 samples on the surface of `pixel`, by their positions along it. The other samples bound the
        // brightness of adjacent light.
        let axes = <[Vec3; 2]>::from(frame(normal.into())).map(Vec3A::from);
        let mut alike = None;
        let mut is_alike = |normal: PackedNormal| {
            // Neighbors mostly have the same normal.
            let is_known = alike == Some(normal);
            let is_alike = is_known || normal.is_within(ALIKE_COSINE, shading_normal);
            alike = if is_alike { Some(normal) } else { alike };
            is_alike
        };
        let (mut near, mut samples) = (NearSamples::new(usual), [Sample::NONE; 9]);
        for y in row.saturating_sub(1)..(row + 2).min(height) {
            for x in column.saturating_sub(1)..(column + 2).min(width) {
                let sample = self.samples.get(x, y);
                let irradiance = sample.irradiance();
                near.brightest = near.brightest.max(luminance(irradiance));
                let way = Vec3A::from(sample.position) - position;
                // Comparisons with NaN (no sample) are false.
                if way.length_squared() <= reach * reach
                    && way.dot(normal).abs() <= off_plane
                    && is_alike(sample.normal())
                {
                    samples[near.count()] = sample;
                    near.add(irradiance, Vec2::new(way.dot(axes[0]), way.dot(axes[1])));
                }
            }
        }
        // Irradiance is not negative, but its extrapolation may be.
        let NearLight { nearest, light, error, .. } = near.at_origin(width_facing * slant)?;
        Some(Estimate { sample: samples[nearest], irradiance: light.max(Vec3::ZERO), error })
    }
}

/// Estimated irradiance at a point, and its error.
struct Estimate {
    /// The nearest sample.
    sample: Sample,
    irradiance: Vec3,
    /// Estimated error of the luminance \[W·m⁻²\].
    error: f32,
}

/// Parameters of the reprojection to a picture.
struct Transfer<'a, R, T> {
    light: &'a ReprojectedLight,
    to: Destination<'a>,
    /// Callback `reuse` of [`ReprojectedLight::carry`].
    reuse: &'a R,
    tolerance: &'a T,
    /// Maximum estimated error that is accepted, in tolerances.
    limit: f32,
    /// Luminance of light that may begin anywhere, or `None` if light is smooth.
    usual: Option<f32>,
}

/// Consecutive rows of the next picture.
struct Strip<'a> {
    samples: &'a mut [Sample],
    irradiance: &'a mut [[f32; 3]],
    missing: &'a mut [bool],
}

/// Pixels of a strip that need more than reprojected light.
#[derive(Default)]
struct FoundInStrip {
    audits: Vec<Audit>,
    /// Missing pixels, if their number is limited.
    open: Vec<OpenPixel>,
}

/// Result of the reprojection at a pixel.
enum Outcome {
    Reprojected(Estimate),
    /// The pixel should be lit again. Its reprojected light has this error, in tolerances.
    Coarse(Estimate, f32),
    /// The pixel is lit again and compared with the reprojected light.
    Audited(Audit),
    /// The pixel is lit again.
    Lost,
}

impl<R, T> Transfer<'_, R, T>
where
    R: Fn(usize, usize) -> Reuse,
    T: Fn(usize, usize, f32) -> f32,
{
    /// Reprojects light to a strip with the first row `top`. Returns the audits and open pixels of the strip.
    fn carry_strip(&self, top: usize, strip: Strip) -> FoundInStrip {
        let pixels = &self.to.seen.pixels;
        let (mut found, is_limited) = (FoundInStrip::default(), self.to.most.is_some());
        for k in 0..strip.samples.len() {
            // Skip pixels without reflection, for example in the sky.
            let (x, y) = (k % pixels.width(), top + k / pixels.width());
            let pixel = pixels.get(x, y);
            if !pixel.reflects() {
                continue;
            }
            strip.missing[k] = true;
            match self.outcome(x, y, &pixel) {
                Outcome::Lost if is_limited => found.open.push(OpenPixel::bare(x, y, pixels.width())),
                Outcome::Lost => (),
                Outcome::Audited(audit) => found.audits.push(audit),
                Outcome::Coarse(estimate, error) => {
                    found.open.push(OpenPixel::coarse((y * pixels.width() + x) as u32, error));
                    strip.samples[k] = estimate.sample;
                    strip.irradiance[k] = estimate.irradiance.to_array();
                }
                Outcome::Reprojected(estimate) => {
                    strip.missing[k] = false;
                    strip.samples[k] = estimate.sample;
                    strip.irradiance[k] = estimate.irradiance.to_array();
                }
            }
        }
        found
    }

    /// Determines the result at pixel (x, y), which shows `pixel`.
    fn outcome(&self, x: usize, y: usize, pixel: &PixelSurface) -> Outcome {
        // Reject surfaces that were not visible in the previous frame, and surfaces with changed light.
        let Destination { seen, known, most, .. } = self.to;
        let Some(from) = known.and_then(|known| known.match_of(x, y)) else { return Outcome::Lost };
        let reuse = (self.reuse)(x, y);
        if reuse == Reuse::Forbidden {
            return Outcome::Lost;
        }

        // Reject estimates above the maximum of the audit statistics, for which even an audit would be useless.
        let Some(estimate) = self.light.light_at(pixel, seen, self.usual, from as usize) else {
            return Outcome::Lost;
        };
        let (luminance, error) = (luminance(estimate.irradiance), estimate.error);
        let tolerance = (self.tolerance)(x, y, luminance);
        let is_limited = most.is_some();
        if error > trust::LARGEST * tolerance && !is_limited {
            return Outcome::Lost;
        }

        // Audit estimates above the limit too: otherwise the limit could never rise again.
        let is_trusted = error <= self.limit * tolerance;
        if reuse == Reuse::Audited && !is_limited {
            let pixel = (y * seen.pixels.width() + x) as u32;
            return Outcome::Audited(Audit { pixel, luminance, error, noise: 0.0, tolerance, is_trusted });
        }
        match is_trusted {
            true => Outcome::Reprojected(estimate),
            // Large errors make extrapolation unreliable: next to shadows, it may even be black.
            false if is_limited => {
                let irradiance = estimate.sample.irradiance();
                Outcome::Coarse(Estimate { irradiance, ..estimate }, error / tolerance)
            }
            false => Outcome::Lost,
        }
    }
}

#[cfg(test)]
mod tests;
