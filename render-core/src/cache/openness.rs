//! How open each pixel's place is: what tells a groove from the wall beside it.
//!
//! A record knows what is around it, and nothing of a groove a pixel wide beside it, which would take its light all the same.
//! Position and normal cannot tell them apart, a few rays can:
//!
//! ```text
//! o(x) = mean of d / (d + D) over cosine-distributed rays, d long each      D  SCALE pixels
//! ```
//!
//! runs from 0 in a crack to 1 in the open, smoothly. Places of different openness are no neighbors: see
//! `OPENNESS_TOLERANCE` in `tolerance.rs`. Where the picture shows nothing around a pixel that rises above its surface, it is
//! taken as open, without a ray.

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

/// Distance of what halves the light of a direction \[pixels\]. From 8 to 32 the simulated error on `nave` is the same to 3 %.
const SCALE: f32 = 16.0;
/// Pixels so far to all sides are looked at for what rises above the surface of the one between them. On `nave` 3 and 1 leave 1 %
/// more error with 6 % more records, and 16, 6, 3 and 1 the same with 1 % fewer, for 7 % more rays.
const LOOKED_AT: [usize; 3] = [10, 4, 1];
/// Sine of the angle above the surface from which on it rises.
const RISES: f32 = 0.05;
/// Distance up to which it does, in distances D: beyond, it hides the less. With 2 it is 1 % more error on `nave`.
const NEAR: f32 = 8.0;
/// Ratio of distances D at which what was found for one is not taken for the other.
const OTHER_SCALE: f32 = 1.25;

/// Openness of a glowing surface, which shares no records with others: it outshines what it reflects, and may be lit by what
/// is a hair's breadth from it.
const GLOWING: f32 = 2.0;

/// How far from a pixel's place, along its surface and off it, what was felt in an earlier picture holds \[pixels\]. Openness
/// changes over [`SCALE`] of them.
const STILL_HOLDS: f32 = 1.0;
const STILL_HOLDS_OFF_PLANE: f32 = 0.25;

/// The openness of every pixel.
#[derive(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Openness {
    pixels: Plane<Felt>,
    /// How they were seen; none before the first picture.
    view: Option<View>,
}

/// Openness of one place, as rays found it.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Felt {
    /// Where, though perhaps for an earlier picture; NaN where nothing was looked for.
    position: [f32; 3],
    openness: f32,
    /// D \[m\].
    scale: f32,
}

portable!(Felt { position, openness, scale });

impl Default for Felt {
    fn default() -> Self {
        Self { position: [f32::NAN; 3], openness: OPEN, scale: 0.0 }
    }
}

impl Felt {
    /// Whether it tells how open `site` is, with D = `scale`.
    fn holds_at(&self, site: &Site, scale: f32) -> bool {
        let (way, pixel) = (Vec3A::from(self.position) - site.position, scale / SCALE);
        // False for NaN.
        way.length_squared() <= (STILL_HOLDS * pixel).powi(2)
            && way.dot(site.geometric_normal).abs() <= STILL_HOLDS_OFF_PLANE * pixel
            && is_alike(scale / self.scale)
    }
}

impl Openness {
    /// The openness of the wanted pixels of a picture. Values of `before` hold for pixels whose place is less than a pixel from
    /// where they were found, and where `illumination` finds the surroundings undisturbed.
    pub fn new<I: Illumination>(request: &Request, before: &Self, illumination: &I, busy: &Busy) -> Self {
        let seen = request.seen;
        let (width, height) = (seen.pixels.width(), seen.pixels.height());
        let known = |x: usize, y: usize| {
            let Some(site) = request.bare_site(x, y) else { return Some(Felt::default()) };
            if seen.pixels.get(x, y).emission != [0.0; 3] {
                return Some(Felt { openness: GLOWING, ..Felt::default() });
            }

            // Most pixels have nothing above them, and need no rays.
            let scale = || scale(&site, seen);
            if !is_below_something(seen, x, y, scale) {
                return Some(Felt::default());
            }

            // Openness that rays felt here in the picture before still holds, unless something has moved.
            let scale = scale();
            let known = before.at(site.position).filter(|felt| felt.holds_at(&site, scale));
            known.filter(|_| illumination.is_undisturbed(&site, scale))
        };

        // Rows of macroblocks side by side; the places where rays have to be cast.
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

        // Each rank casts those of its own.
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

    /// Nothing known as yet of a picture.
    pub fn of_nothing(seen: &GBuffer) -> Self {
        Self {
            pixels: Plane::filled(seen.pixels.width(), seen.pixels.height(), Felt::default()),
            view: Some(seen.view),
        }
    }

    /// Takes over the wanted pixels of the same picture.
    pub fn take_wanted(&mut self, request: &Request, other: &Self) {
        for (index, felt) in other.pixels.samples().iter().enumerate() {
            if request.wanted.is_none_or(|wanted| wanted.samples()[index]) {
                self.pixels.samples_mut()[index] = *felt;
            }
        }
    }

    /// Openness of the pixel that a point falls on.
    fn at(&self, point: Vec3A) -> Option<Felt> {
        let place = self.view.as_ref()?.project(point)?.pixel;
        let inside = place.x >= 0.0
            && place.y >= 0.0
            && place.x < self.pixels.width() as f32
            && place.y < self.pixels.height() as f32;
        inside.then(|| self.pixels.get(place.x as usize, place.y as usize))
    }

    /// At a pixel, 0…1; [`GLOWING`] on what glows.
    pub fn get(&self, x: usize, y: usize) -> f32 {
        self.pixels.get(x, y).openness
    }
}

/// Brings the openness of records to this picture, where it is seen from nearer or farther than when they were made, and where
/// something has moved.
pub(super) fn renew<R: Send + Sync, I: Illumination>(
    records: &mut [Record<R>],
    seen: &GBuffer,
    illumination: &I,
    ranks: &dyn Ranks,
    busy: &Busy,
) {
    // The scale that a record's openness is felt with anew, where it is.
    let new_scale = |record: &Record<R>| {
        if record.site.openness >= OPEN {
            return None;
        }

        // Felt anew where the same rays would not be as long on the screen, or may meet something else.
        let scale = scale(&record.site, seen);
        // Out of sight it may stay what it was.
        let is_known =
            || is_alike(scale / record.scale) && !record.carried && illumination.is_undisturbed(&record.site, scale);
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

    // Each rank casts the rays of its own.
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

/// Whether openness for two distances D of this ratio is about the same.
fn is_alike(ratio: f32) -> bool {
    (OTHER_SCALE.recip()..OTHER_SCALE).contains(&ratio)
}

/// D at a site \[m\].
pub(super) fn scale(site: &Site, seen: &GBuffer) -> f32 {
    SCALE * site.pixel_width(&seen.view)
}

/// Whether something that the picture shows around a pixel rises above its surface; `scale` is D there.
fn is_below_something(seen: &GBuffer, x: usize, y: usize, scale: impl Fn() -> f32) -> bool {
    let (width, height) = (seen.pixels.width(), seen.pixels.height());
    let samples = seen.pixels.samples();
    let pixel = &samples[y * width + x];
    let (position, normal) = (Vec3A::from(pixel.position), Vec3A::from(pixel.geometric_normal));
    let rises = |u: usize, v: usize| {
        let other = &samples[v * width + u];
        let way = Vec3A::from(other.position) - position;
        let (above, far2) = (way.dot(normal), way.length_squared());
        // sin α = above / |way| > RISES, in squares. D takes longest to know.
        above > 0.0
            && above * above > RISES * RISES * far2
            && other.instance != NOTHING
            && far2 < (NEAR * scale()).powi(2)
    };

    // Eight pixels around it at each distance. What is left of or above the picture wraps to huge numbers.
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
