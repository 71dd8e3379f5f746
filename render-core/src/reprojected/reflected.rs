//! Reprojection of the light that rough coats reflect.
//!
//! A coat reflects light from a lobe around the mirror direction, so its light depends on the viewer. Reflected surfaces
//! form a virtual image behind the coat, which slides over the coat as the viewer moves. Each pixel stores a sample: a
//! point of the coat, the mirror direction, and the mean radiance that arrives in the lobe. Two points of a coat show the
//! same part of the image if h is zero:
//!
//! ```text
//! h = (x_q − x) n + (m_q − m), across m         n  mean of 1/t over the reflection rays      t  distance to the first hit
//!   x  position of the coat      m  mirror direction      q  sample
//! ```
//!
//! The light of a pixel follows from the samples of the previous frame around h = 0, by the same fit as irradiance
//! follows from samples around a position ([`near`](super::near)). The error has one more term, for light that does not
//! move with the image, such as highlights of nearer lamps and shadow edges:
//!
//! ```text
//! ε = STALE |g| |x_q − x| (n + 1/d)          g  slope of the light along h      d  distance to the viewer
//! ```
//!
//! As for irradiance, samples are copied and never mixed, and audits determine which estimates are reliable.

use super::limit::{OpenPixel, choose};
use super::near::{NearLight, NearSamples};
use super::trust::{LARGEST, Trust};
use super::{Audit, AuditCounts, Reuse, judged};
use crate::gbuffer::MACROBLOCK;
use crate::sampling::frame;
use crate::{Timed, luminance};
use glam::{Vec2, Vec3, Vec3A};
use plane::{Correspondence, Plane};
use rayon::prelude::*;

/// Maximum parallax |x_q − x| n of a sample, in units of α. Hits at other distances than 1/n widen the lobe.
const PARALLAX: f32 = 1.5;
/// Maximum relative difference of α between a sample and a pixel.
const SAME_ALPHA: f32 = 0.3;
/// Maximum distance of a sample off the plane of a pixel's surface \[pixels\], and as a fraction of the distance along
/// the plane, for curved surfaces.
const OFF_PLANE: (f32, f32) = (0.1, 0.1);
/// Fraction of the light's slope that does not move with the image.
const STALE: f32 = 0.3;
/// Distance along h over which the light of a lobe is nearly linear, in units of α.
const LINEAR: f32 = 0.15;
/// Number of standard deviations that audits ignore: two traced values of the same light differ too.
const NOISE: f32 = 2.0;
/// Strides of the search for the image \[pixels\], and maximum number of steps of each.
const STRIDES: [usize; 3] = [4, 2, 1];
const STEPS: usize = 4;

/// Coat of a pixel, as seen by the viewer.
#[derive(Clone, Copy, Debug)]
pub struct CoatView {
    /// Position \[m\].
    pub position: Vec3A,
    /// Unit normal of the surface.
    pub normal: Vec3A,
    /// Unit vector in the mirror direction of the viewer.
    pub mirrored: Vec3A,
    /// Half-width α of the lobe \[rad\].
    pub alpha: f32,
    /// Distance to the viewer \[m\].
    pub depth: f32,
    /// Width of a pixel at the position, at right angles to the view \[m\].
    pub pixel_width: f32,
}

/// Light that arrives in the lobe of a coat \[W·m⁻²·sr⁻¹\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LobeLight {
    /// Mean radiance in the lobe, without the excess. It is negative where the base reflects less than matte surfaces.
    pub whole: [f32; 3],
    /// Portion of the mean radiance that reflection rays found.
    pub traced: [f32; 3],
    /// Excess of single rays, which is spread over nearby pixels.
    pub excess: [f32; 3],
    /// Standard deviation of the luminance, from the reflection rays.
    pub noise: f32,
    /// Mean of 1/t over the reflection rays \[1/m\].
    pub nearness: f32,
}

/// Light of a coat at the position and mirror direction for which it was computed.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct CoatSample {
    /// Position \[m\], or NaN without known light.
    position: [f32; 3],
    mirrored: [f32; 3],
    alpha: f32,
    light: LobeLight,
}

impl Default for CoatSample {
    fn default() -> Self {
        Self { position: [f32::NAN; 3], mirrored: [0.0; 3], alpha: 0.0, light: LobeLight::default() }
    }
}

/// Light that the coats of a picture reflect, and the audit results so far.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReflectedLight {
    samples: Plane<CoatSample>,
    trust: Trust,
}

/// Coats of a picture to which light is reprojected.
#[derive(Clone, Copy, Debug)]
pub struct CoatsInView<'a> {
    /// Coat of each pixel; `None` without a coat.
    pub coats: &'a Plane<Option<CoatView>>,
    /// Positions of the pixels in the source picture, or `None` if no light can be reprojected.
    pub known: Option<&'a Correspondence>,
    /// Maximum mean square error of reprojected light, in squares of the tolerance.
    pub allowed: f32,
    /// Maximum number of pixels that are lit, or `None` for all missing ones; see [`Destination::most`].
    ///
    /// [`Destination::most`]: super::Destination::most
    pub most: Option<usize>,
}

/// Light of a picture's coats after reprojection, with the pixels that remain to be lit.
#[derive(Clone, Debug)]
pub struct ReprojectedCoats {
    /// Reprojected light; `None` where `missing` and without a coat.
    pub light: Plane<Option<LobeLight>>,
    /// Mask of the pixels that must be lit. Pixels without a coat are not missing.
    pub missing: Plane<bool>,
    /// Number of pixels that should be lit, but are not missing. Pixels whose light cannot be reused are not counted.
    pub open: usize,
    /// Open pixels without light, in raster order.
    pub bare: Vec<u32>,
    audits: Vec<Audit>,
    /// Whether the number of missing pixels was limited. There are no audits then.
    is_limited: bool,
}

impl ReprojectedCoats {
    /// Stores the light of missing pixels from `lit` as samples of `light`, and learns from the audits. `None` is the
    /// light of a coat that cannot be reprojected.
    ///
    /// # Panics
    /// If the pictures differ in size.
    pub fn complete(
        self,
        lit: &Plane<Option<LobeLight>>,
        coats: &Plane<Option<CoatView>>,
        light: &mut ReflectedLight,
    ) -> AuditCounts {
        let samples = light.samples.samples_mut();
        for (k, &is_missing) in self.missing.samples().iter().enumerate() {
            if is_missing && let (Some(coat), Some(light)) = (coats.samples()[k], lit.samples()[k]) {
                let (position, mirrored) = (coat.position.to_array(), coat.mirrored.to_array());
                samples[k] = CoatSample { position, mirrored, alpha: coat.alpha, light };
            }
        }
        // Count only differences beyond the noise of both values.
        let difference = |audit: &Audit| {
            let lit = lit.samples()[audit.pixel as usize]?;
            let difference = luminance(lit.whole.into()) - audit.luminance;
            let noise2 = lit.noise * lit.noise + audit.noise * audit.noise;
            Some((difference * difference - NOISE * NOISE * noise2).max(0.0).sqrt())
        };
        match self.is_limited {
            true => AuditCounts::default(),
            false => judged(self.audits, difference, &mut light.trust),
        }
    }
}

/// Reprojected light of a coat with its sample and its estimated error.
struct CoatEstimate {
    sample: CoatSample,
    light: LobeLight,
    /// Estimated error of the luminance \[W·m⁻²·sr⁻¹\].
    error: f32,
}

impl ReflectedLight {
    /// Reprojects the light to the next picture where `reuse(x, y, nearness)` allows it; `nearness` is the mean of 1/t over
    /// the reflection rays \[1/m\]. `tolerance(x, y, luminance)` is the tolerable error of the luminance of the light in a
    /// lobe \[W·m⁻²·sr⁻¹\].
    ///
    /// Afterwards, the samples belong to `to`. [`ReprojectedCoats::complete`] adds the samples of missing pixels.
    pub fn carry(
        &mut self,
        to: CoatsInView,
        reuse: impl Fn(usize, usize, f32) -> Reuse + Sync,
        tolerance: impl Fn(usize, usize, f32) -> f32 + Sync,
    ) -> Timed<ReprojectedCoats> {
        // Create the next picture without light.
        let (width, height) = (to.coats.width(), to.coats.height());
        let mut light = Plane::filled(width, height, None);
        let mut missing = Plane::filled(width, height, false);
        let mut samples = Plane::filled(width, height, CoatSample::default());

        // Process rows of macroblocks in parallel. Each row reads samples anywhere in the previous frame, and writes
        // its own pixels only.
        let (before, limit) = (&*self, self.trust.limit(to.allowed));
        let strip = (MACROBLOCK * width).max(1);
        let strips = samples
            .samples_mut()
            .par_chunks_mut(strip)
            .zip(light.samples_mut().par_chunks_mut(strip))
            .zip(missing.samples_mut().par_chunks_mut(strip))
            .enumerate();
        let is_limited = to.most.is_some();
        let found: Timed<Vec<(Vec<Audit>, Vec<OpenPixel>)>> = Timed::of(|busy| {
            let carry = |(row, ((samples, light), missing)): (usize, ((&mut [_], &mut [_]), &mut [bool]))| {
                busy.measure(|| {
                    let (mut audits, mut open) = (Vec::new(), Vec::new());
                    for k in 0..samples.len() {
                        let pixel = row * strip + k;
                        let (x, y) = (pixel % width, pixel / width);
                        let Some(coat) = to.coats.get(x, y) else { continue };
                        missing[k] = true;
                        let from = to.known.and_then(|known| known.match_of(x, y));
                        let Some(found) = from.and_then(|from| before.light_at(&coat, from as usize)) else {
                            if is_limited {
                                let is_kept = reuse(x, y, 0.0) != Reuse::Forbidden;
                                open.push(OpenPixel { is_kept, ..OpenPixel::bare(x, y, width) });
                            }
                            continue;
                        };

                        // Audit estimates above the limit too: otherwise the limit could never rise again.
                        let reuse = reuse(x, y, found.light.nearness);
                        let (luminance, error) = (luminance(found.light.whole.into()), found.error);
                        let tolerance = tolerance(x, y, luminance);
                        let is_trusted = error <= limit * tolerance;
                        if is_limited {
                            // Reproject light despite its error. Pixels that are lit get light and sample later.
                            match reuse {
                                Reuse::Forbidden => {
                                    open.push(OpenPixel { is_kept: false, ..OpenPixel::bare(x, y, width) });
                                }
                                _ if is_trusted => missing[k] = false,
                                _ => open.push(OpenPixel::coarse(pixel as u32, error / tolerance)),
                            }
                            if reuse != Reuse::Forbidden {
                                (samples[k], light[k]) = (found.sample, Some(found.light));
                            }
                        } else if reuse == Reuse::Audited && error <= LARGEST * tolerance {
                            let noise = found.light.noise;
                            audits.push(Audit { pixel: pixel as u32, luminance, error, noise, tolerance, is_trusted });
                        } else if reuse == Reuse::Allowed && is_trusted {
                            missing[k] = false;
                            samples[k] = found.sample;
                            light[k] = Some(found.light);
                        }
                    }
                    (audits, open)
                })
            };
            strips.map(carry).collect()
        });
        self.samples = samples;
        found.map(|found| {
            let (audits, pixels): (Vec<_>, Vec<_>) = found.into_iter().unzip();
            let (open, bare) = choose(pixels.concat(), to.most.unwrap_or(usize::MAX), &mut missing);
            // Pixels that are lit have no reprojected light.
            for (light, _) in light.samples_mut().iter_mut().zip(missing.samples()).filter(|(_, missing)| **missing) {
                *light = None;
            }
            ReprojectedCoats { light, missing, open, bare, audits: audits.concat(), is_limited }
        })
    }

    /// Estimates the light of `coat` from the samples around index `from` (raster order), the pixel that showed the same
    /// point in the previous picture.
    fn light_at(&self, coat: &CoatView, from: usize) -> Option<CoatEstimate> {
        let (width, height) = (self.samples.width(), self.samples.height());
        if from >= width * height {
            return None;
        }

        // Return the own sample without error if neither the camera nor the surface moved.
        let same = self.samples.samples()[from];
        let is_alike = |sample: &CoatSample| (sample.alpha - coat.alpha).abs() <= SAME_ALPHA * coat.alpha;
        if same.position == coat.position.to_array() && same.mirrored == coat.mirrored.to_array() && is_alike(&same) {
            return Some(CoatEstimate { sample: same, light: same.light, error: 0.0 });
        }
        // Comparisons with NaN (no sample) are false.
        if !(same.light.nearness >= 0.0 && same.position[0].is_finite()) {
            return None;
        }

        // Follow the image: step to the neighbor with the least h until no neighbor has less. Begin with long strides,
        // because adjacent pixels may have copies of one sample.
        let nearness = same.light.nearness;
        let axes = <[Vec3; 2]>::from(frame(coat.mirrored.into())).map(Vec3A::from);
        let offset = |sample: &CoatSample| {
            let way = Vec3A::from(sample.position) - coat.position;
            let h = way * nearness + (Vec3A::from(sample.mirrored) - coat.mirrored);
            (way, Vec2::new(h.dot(axes[0]), h.dot(axes[1])))
        };
        let around = |(column, row): (usize, usize), stride: usize| {
            let rows = (row.saturating_sub(stride)..(row + stride + 1).min(height)).step_by(stride);
            let columns = move || (column.saturating_sub(stride)..(column + stride + 1).min(width)).step_by(stride);
            rows.flat_map(move |y| columns().map(move |x| (x, y)))
        };
        let mut center = (from % width, from / width);
        let mut least = offset(&same).1.length_squared();
        for stride in STRIDES {
            for _ in 0..STEPS {
                let mut next = center;
                for (x, y) in around(center, stride) {
                    let h = offset(&self.samples.get(x, y)).1.length_squared();
                    if h < least {
                        (least, next) = (h, (x, y));
                    }
                }
                if next == center {
                    break;
                }
                center = next;
            }
        }

        // Select the 3×3 samples of the same coat.
        let off_plane = OFF_PLANE.0 * coat.pixel_width;
        let (mut noise, mut low, mut high) = (0f32, Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (mut near, mut samples) = (NearSamples::new(None), [CoatSample::default(); 9]);
        for (x, y) in around(center, 1) {
            let sample = self.samples.get(x, y);
            let (way, h) = offset(&sample);
            let (length, parallax) = (way.length(), PARALLAX * coat.alpha);
            near.brightest = near.brightest.max(luminance(sample.light.whole.into()));
            if length * nearness <= parallax
                && way.dot(coat.normal).abs() <= off_plane + OFF_PLANE.1 * length
                && is_alike(&sample)
            {
                samples[near.count()] = sample;
                noise = noise.max(sample.light.noise);
                (low, high) = (low.min(sample.light.whole.into()), high.max(sample.light.whole.into()));
                near.add(sample.light.whole.into(), h);
            }
        }
        let per_meter = nearness + coat.depth.max(f32::MIN_POSITIVE).recip();
        let spacing = (coat.pixel_width * per_meter).max(LINEAR * coat.alpha);
        let NearLight { nearest, light, error, slope } = near.at_origin(spacing)?;
        // Reject estimates from samples that coincide, and limit extrapolation.
        if !(error.is_finite() && slope.is_finite() && light.is_finite()) {
            return None;
        }
        let (sample, margin) = (samples[nearest], 0.5 * (high - low));
        let moved = (Vec3A::from(sample.position) - coat.position).length();
        let light = LobeLight { whole: light.clamp(low - margin, high + margin).to_array(), ..sample.light };
        // Omit the noise of the samples: if noise led to new samples, bright samples would be replaced more often than
        // dark ones, and the light would become darker.
        let error = (error + STALE * slope * moved * per_meter - NOISE * noise).max(0.0);
        Some(CoatEstimate { sample, light, error })
    }
}

#[cfg(test)]
mod tests;
