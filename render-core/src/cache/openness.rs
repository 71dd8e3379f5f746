//! Openness of the surroundings of each pixel, which distinguishes a groove from the wall around it.
//!
//! A record measures its own surroundings, not an adjacent groove one pixel wide. Position and normal are too similar
//! to separate the two, so a pixel in the groove would use the record. A few rays distinguish the groove:
//!
//! ```text
//! o(x) = mean of d / (d + D) over cosine-distributed rays of length d      D  SCALE pixels
//! ```
//!
//! The value varies smoothly from 0 in a crack to 1 in the open. Records are not used at points of different openness:
//! see `OPENNESS_TOLERANCE` in `tolerance.rs`. If no visible surface around a pixel rises above the pixel's surface,
//! the pixel counts as open without rays.

use super::illumination::{Illumination, Site};
use super::record::Record;
use super::request::{OPEN, Request};
use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::{Ranks, in_order, share_each};
use crate::scene::View;
use crate::{Busy, MACROBLOCK};
use glam::Vec3A;
use plane::Plane;
use ranks::portable;
use rayon::prelude::*;

/// Distance D of a surface that halves the contribution of a direction \[pixels\]. From 8 to 32, the simulated error of
/// `nave` varies by at most 3 %.
const SCALE: f32 = 16.0;
/// Offsets in all directions at which surfaces are tested for rising above a pixel's surface \[pixels\]. On `nave`,
/// {3, 1} leaves 1 % more error with 6 % more records. With {16, 6, 3, 1}, the error is equal, with 1 % fewer records
/// and 7 % more rays.
const LOOKED_AT: [usize; 3] = [10, 4, 1];
/// Sine of the minimum elevation angle of a rising surface.
const RISES: f32 = 0.05;
/// Maximum distance of a rising surface, in units of D. Farther surfaces occlude little. A value of 2 leaves 1 % more
/// error on `nave`.
const NEAR: f32 = 8.0;
/// Maximum ratio of two values of D for which one measurement is valid.
const OTHER_SCALE: f32 = 1.25;

/// Openness of an emissive surface, which prevents it from sharing records with other surfaces. Its emission outshines
/// its reflected light, and surfaces very close to it may light it.
const GLOWING: f32 = 2.0;

/// Maximum distance at which an earlier measurement is reused \[pixels\]. Openness varies over distances of [`SCALE`]
/// pixels.
const STILL_HOLDS: f32 = 1.0;
/// Maximum distance off the plane of the surface at which an earlier measurement is reused \[pixels\].
const STILL_HOLDS_OFF_PLANE: f32 = 0.25;

/// Openness of every pixel of a picture.
#[derive(Clone, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Openness {
    pixels: Plane<Felt>,
    /// View of the picture, or `None` before the first picture.
    view: Option<View>,
}

/// Openness of one point, measured by rays.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Felt {
    /// Position of the measurement, possibly in an earlier picture. NaN if no rays were traced.
    position: [f32; 3],
    openness: f32,
    /// Distance D at the point \[m\].
    scale: f32,
}

portable!(Felt { position, openness, scale });

impl Default for Felt {
    fn default() -> Self {
        Self { position: [f32::NAN; 3], openness: OPEN, scale: 0.0 }
    }
}

impl Felt {
    /// Returns whether the measurement is valid for `site` with D = `scale`.
    fn holds_at(&self, site: &Site, scale: f32) -> bool {
        let (way, pixel) = (Vec3A::from(self.position) - site.position, scale / SCALE);
        // Comparisons with NaN are false, so a measurement without rays is never valid.
        way.length_squared() <= (STILL_HOLDS * pixel).powi(2)
            && way.dot(site.geometric_normal).abs() <= STILL_HOLDS_OFF_PLANE * pixel
            && is_alike(scale / self.scale)
    }
}

impl Openness {
    /// Measures the openness of the wanted pixels of a picture. Reuses values of `before` at distances below a pixel if
    /// `illumination` reports the surroundings as undisturbed.
    pub fn new<I: Illumination>(request: &Request, before: &Self, illumination: &I, busy: &Busy) -> Self {
        let seen = request.seen;
        let (width, height) = (seen.pixels.width(), seen.pixels.height());
        let known = |x: usize, y: usize| {
            let Some(site) = request.bare_site(x, y) else { return Some(Felt::default()) };
            if seen.pixels.get(x, y).emission != [0.0; 3] {
                return Some(Felt { openness: GLOWING, ..Felt::default() });
            }

            // Skip rays for pixels without a surface above them, as for most pixels.
            let scale = || scale(&site, seen);
            if !is_below_something(seen, x, y, scale) {
                return Some(Felt::default());
            }

            // Reuse the value of the previous frame unless geometry has moved.
            let scale = scale();
            let known = before.at(site.position).filter(|felt| felt.holds_at(&site, scale));
            known.filter(|_| illumination.is_undisturbed(&site, scale))
        };

        // Process rows of macroblocks in parallel; collect the pixels that need rays.
        let mut pixels = Plane::filled(width, height, Felt::default());
        let strips = pixels.samples_mut().par_chunks_mut((MACROBLOCK * width).max(1)).enumerate();
        let look = |(strip, samples): (usize, &mut [Felt])| {
            busy.measure(|| {
                let mut unknown = Vec::new();
                for (k, sample) in samples.iter_mut().enumerate() {
                    let (x, y) = (k % width, strip * MACROBLOCK + k / width);
                    match known(x, y) {
                        Some(felt) => *sample = felt,
                        None => unknown.push((x, y)),
                    }
                }
                unknown
            })
        };
        let unknown = strips.map(look).collect::<Vec<_>>().concat();

        // Trace the rays of this rank's pixels.
        let feel = |(): &mut (), place: usize| {
            let (x, y) = unknown[place];
            let site = request.bare_site(x, y).expect("rays are for places that reflect");
            let scale = scale(&site, seen);
            Felt { position: site.position.into(), openness: illumination.openness(&site, scale), scale }
        };
        let turns = in_order(unknown.len());
        let felt = busy.take(share_each(request.ranks, &turns, super::CHUNK, || (), feel));
        for (&(x, y), felt) in unknown.iter().zip(felt) {
            pixels.row_mut(y)[x] = felt;
        }
        Self { pixels, view: Some(seen.view) }
    }

    /// Returns the state of a picture before any measurement.
    pub fn of_nothing(seen: &GBuffer) -> Self {
        Self {
            pixels: Plane::filled(seen.pixels.width(), seen.pixels.height(), Felt::default()),
            view: Some(seen.view),
        }
    }

    /// Copies the openness of the wanted pixels from another state of this picture.
    pub fn take_wanted(&mut self, request: &Request, other: &Self) {
        for (index, felt) in other.pixels.samples().iter().enumerate() {
            if request.wanted.is_none_or(|wanted| wanted.samples()[index]) {
                self.pixels.samples_mut()[index] = *felt;
            }
        }
    }

    /// Returns the measurement at the pixel to which `point` projects.
    fn at(&self, point: Vec3A) -> Option<Felt> {
        let place = self.view.as_ref()?.project(point)?.pixel;
        let inside = place.x >= 0.0
            && place.y >= 0.0
            && place.x < self.pixels.width() as f32
            && place.y < self.pixels.height() as f32;
        inside.then(|| self.pixels.get(place.x as usize, place.y as usize))
    }

    /// Returns the openness of a pixel, 0…1, or [`GLOWING`] for emissive surfaces.
    pub fn get(&self, x: usize, y: usize) -> f32 {
        self.pixels.get(x, y).openness
    }
}

/// Updates the openness of records for this picture. A record is measured again if its viewing distance has changed, or
/// if geometry near it has moved.
pub(super) fn renew<R: Send + Sync, I: Illumination>(
    records: &mut [Record<R>],
    seen: &GBuffer,
    illumination: &I,
    ranks: &dyn Ranks,
    busy: &Busy,
) {
    // Return D for measuring the record again, or `None` if its value is still valid.
    let new_scale = |record: &Record<R>| {
        if record.site.openness >= OPEN {
            return None;
        }

        // Measure again if the rays would have a different length on screen, or may hit different surfaces.
        let scale = scale(&record.site, seen);
        // Keep the values of records outside the view.
        let is_known =
            || is_alike(scale / record.scale) && !record.moved && illumination.is_undisturbed(&record.site, scale);
        (scale > 0.0 && !is_known()).then_some(scale)
    };
    let look = |(chunk, records): (usize, &[Record<R>])| {
        let mut due = Vec::new();
        for (k, record) in records.iter().enumerate() {
            due.extend(new_scale(record).map(|scale| (chunk * super::CHUNK + k, scale)));
        }
        due
    };
    let chunks = records.par_chunks(super::CHUNK).enumerate();
    let due = chunks.map(|chunk| busy.measure(|| look(chunk))).collect::<Vec<_>>().concat();

    // Trace the rays of this rank's records.
    let feel = |(): &mut (), place: usize| {
        let (index, scale) = due[place];
        illumination.openness(&records[index].site, scale)
    };
    let openness = busy.take(share_each(ranks, &in_order(due.len()), super::CHUNK, || (), feel));
    for (&(index, scale), openness) in due.iter().zip(openness) {
        records[index].site.openness = openness;
        records[index].scale = scale;
    }
}

/// Returns whether openness is about equal for two values of D with this `ratio`.
fn is_alike(ratio: f32) -> bool {
    (OTHER_SCALE.recip()..OTHER_SCALE).contains(&ratio)
}

/// Returns the distance D at a site \[m\].
pub(super) fn scale(site: &Site, seen: &GBuffer) -> f32 {
    SCALE * site.pixel_width(&seen.view)
}

/// Returns whether a visible surface around a pixel rises above the pixel's surface. `scale` returns D at the pixel.
fn is_below_something(seen: &GBuffer, x: usize, y: usize, scale: impl Fn() -> f32) -> bool {
    let (width, height) = (seen.pixels.width(), seen.pixels.height());
    let samples = seen.pixels.samples();
    // A surface rises if it is above the tangent plane at a noticeable angle, and near.
    let pixel = &samples[y * width + x];
    let (position, normal) = (Vec3A::from(pixel.position), Vec3A::from(pixel.geometric_normal));
    let rises = |u: usize, v: usize| {
        let other = &samples[v * width + u];
        let way = Vec3A::from(other.position) - position;
        let (above, far2) = (way.dot(normal), way.length_squared());
        // Compare the squares of sin α = above / |way| and RISES. Compute D last, because it costs most.
        above > 0.0
            && above * above > RISES * RISES * far2
            && other.instance != NOTHING
            && far2 < (NEAR * scale()).powi(2)
    };

    // Test eight pixels at each offset. Coordinates left of or above the picture wrap to huge values.
    for r in LOOKED_AT {
        for v in [y.wrapping_sub(r), y, y + r] {
            for u in [x.wrapping_sub(r), x, x + r] {
                if u < width && v < height && rises(u, v) {
                    return true;
                }
            }
        }
    }
    false
}
