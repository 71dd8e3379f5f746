//! How open each pixel's place is: what tells a groove from the wall beside it.
//!
//! A record knows what is around it, and nothing of a groove a pixel wide beside it, which would take its light all the same.
//! Position and normal cannot tell them apart, a few rays can:
//!
//! ```text
//! o(x) = mean of d / (d + D) over cosine-distributed rays, d long each      D  SCALE pixels
//! ```
//!
//! runs from 0 in a crack to 1 in the open, smoothly. Places of different openness are no neighbours: see
//! [`OPENNESS_TOLERANCE`](super::tile). Where the surface goes on evenly around a pixel as far as the picture shows, it is
//! taken as open, without a ray.

use super::record::{Illumination, Record, Site};
use super::spacing::pixel_width;
use crate::gbuffer::{GBuffer, NOTHING};
use crate::{Busy, MACROBLOCK};
use glam::Vec3A;
use plane::Plane;
use rayon::prelude::*;

/// Distance of what halves the light of a direction \[pixels\]. From 8 to 32 the simulated error on `nave` is the same to 3 %.
const SCALE: f32 = 16.0;
/// Pixels whose surfaces have to continue that of the pixel between them, for it to count as open: so far to all sides.
const LOOKED_AT: [isize; 2] = [1, 3];
/// Sine of the angle by which they may lie off its plane, and cosine between the normals of both.
const OFF_PLANE: f32 = 0.05;
const ALIKE_COSINE: f32 = 0.98;
/// Ratio of distances D at which what was found for one is not taken for the other.
const OTHER_SCALE: f32 = 1.25;

/// What is open all around.
pub(super) const OPEN: f32 = 1.0;

/// The openness of every pixel, and the places it is of.
pub(super) struct Openness(Plane<(Vec3A, f32)>);

const NOWHERE: (Vec3A, f32) = (Vec3A::NAN, OPEN);

impl Default for Openness {
    fn default() -> Self {
        Self(Plane::filled(0, 0, NOWHERE))
    }
}

impl Openness {
    /// Of the picture `seen`, whose sites are `site(x, y)`. What is known from `before` is taken from there, for pixels that
    /// see the same point, where `illumination` finds their surroundings undisturbed.
    pub fn new<I: Illumination>(
        seen: &GBuffer,
        site: impl Fn(usize, usize) -> Option<Site> + Sync,
        before: &Self,
        illumination: &I,
        busy: &Busy,
    ) -> Self {
        let (width, height) = (seen.pixels.width(), seen.pixels.height());
        let comparable = (before.0.width(), before.0.height()) == (width, height);
        let openness = |x: usize, y: usize| {
            // What glows outshines what it reflects.
            let site = site(x, y).filter(|_| seen.pixels.get(x, y).emission == [0.0; 3]);
            let Some(site) = site else { return NOWHERE };
            if goes_on_evenly(seen, x, y) {
                return (site.position, OPEN);
            }
            let scale = scale(&site, seen);
            if comparable {
                let (position, known) = before.0.get(x, y);
                if position == site.position && known != OPEN && illumination.is_undisturbed(&site, scale) {
                    return (position, known);
                }
            }
            (site.position, illumination.openness(&site, scale))
        };
        let mut plane = Plane::filled(width, height, NOWHERE);
        plane.samples_mut().par_chunks_mut((MACROBLOCK * width).max(1)).enumerate().for_each(|(strip, samples)| {
            busy.measure(|| {
                for (k, sample) in samples.iter_mut().enumerate() {
                    *sample = openness(k % width, strip * MACROBLOCK + k / width);
                }
            });
        });
        Self(plane)
    }

    /// At a pixel, 0…1.
    pub fn get(&self, x: usize, y: usize) -> f32 {
        self.0.get(x, y).1
    }
}

/// Brings the openness of records to this picture, where it is seen from nearer or farther than when they were made, and where
/// something has moved.
pub(super) fn renew<R: Send + Sync, I: Illumination>(
    records: &mut [Record<R>],
    seen: &GBuffer,
    illumination: &I,
    busy: &Busy,
) {
    let renew = |record: &mut Record<R>| {
        if record.site.openness == OPEN {
            return;
        }
        let scale = scale(&record.site, seen);
        let ratio = scale / record.scale;
        let alike = (OTHER_SCALE.recip()..OTHER_SCALE).contains(&ratio);
        // Out of sight it may stay what it was.
        if scale > 0.0 && !(alike && !record.carried && illumination.is_undisturbed(&record.site, scale)) {
            record.site.openness = illumination.openness(&record.site, scale);
            record.scale = scale;
        }
    };
    records.par_chunks_mut(super::CHUNK).for_each(|records| busy.measure(|| records.iter_mut().for_each(renew)));
}

/// D at a site \[m\].
pub(super) fn scale(site: &Site, seen: &GBuffer) -> f32 {
    SCALE * pixel_width(site, &seen.view)
}

/// Whether the surface of a pixel goes on evenly around it, as far as the picture shows.
fn goes_on_evenly(seen: &GBuffer, x: usize, y: usize) -> bool {
    let pixel = seen.pixels.get(x, y);
    let (position, normal) = (Vec3A::from(pixel.position), Vec3A::from(pixel.geometric_normal));
    let goes_on = |dx: isize, dy: isize| {
        let (Some(u), Some(v)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { return true };
        if u >= seen.pixels.width() || v >= seen.pixels.height() {
            return true;
        }
        let other = seen.pixels.get(u, v);
        let way = Vec3A::from(other.position) - position;
        other.instance != NOTHING
            && normal.dot(other.geometric_normal.into()) > ALIKE_COSINE
            && way.dot(normal).abs() <= OFF_PLANE * way.length()
    };
    LOOKED_AT.iter().all(|&r| [-r, 0, r].iter().all(|&dy| [-r, 0, r].iter().all(|&dx| goes_on(dx, dy))))
}
