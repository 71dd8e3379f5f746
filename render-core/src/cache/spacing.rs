//! How far around its place a record may be used.

use super::picture::Picture;
use super::record::{LocalIrradiance, Record, Site};
use super::tile::NORMAL_TOLERANCE;
use crate::luminance;
use crate::scene::View;
use glam::{Mat3A, Vec3A};

/// Radius by harmonic mean distance: Ward's a \[Ward88, eq. 2\]. Ours is larger than the usual 0.1…0.4, since the weights
/// fall off towards the border and reach zero there.
const BY_HARMONIC_MEAN: f32 = 0.6;
/// Radius by distance of the nearest surface: to either side of a thin wall its records end before it.
const BY_NEAREST: f32 = 1.0;
/// Change of irradiance over the radius that its gradient may predict, as a share of the irradiance \[Krivanek08\].
const BY_GRADIENT: f32 = 0.7;
/// The same where the picture keeps the radius up: what is near there changes more than a derivative tells. In a simulation
/// of `nave`, following it as far as elsewhere adds a tenth to the relative MSE.
const KEPT_UP_BY_GRADIENT: f32 = 0.25;
/// Length of the change of a normal that is tolerated: √(2 (1 − cos)).
const LARGEST_TURN: f32 = 0.632;
const _: () = assert!((LARGEST_TURN * LARGEST_TURN - 2.0 * NORMAL_TOLERANCE).abs() < 1e-3);
/// Radius on the screen at least and at most \[pixels\] \[Tabellion04\].
const ON_SCREEN: (f32, f32) = (8.0, 40.0);
/// The least radius of a record to which something is nearer than that \[pixels\]: light must not leak past thin walls.
const BESIDE_WALLS: f32 = 4.0;
/// What remains at least of a radius that is doubted \[pixels\].
const DOUBTED: f32 = 2.2;

/// Radius that the surroundings allow \[m\].
pub(super) fn radius(estimate: &LocalIrradiance) -> f32 {
    // NaN from 0/0 in the dark gives way to the other two.
    (BY_HARMONIC_MEAN * estimate.harmonic_mean)
        .min(BY_NEAREST * estimate.nearest)
        .min(BY_GRADIENT * luminance(estimate.irradiance) / slope(&estimate.by_position))
}

/// How far the derivatives of a record are followed, 0…1, when the picture makes its `own` radius `radius`: so far that they
/// change the irradiance by no more than they may. Where the picture keeps the radius up, they would promise light that is not
/// there.
pub(super) fn trust(estimate: &LocalIrradiance, own: f32, radius: f32) -> f32 {
    let share = if radius > own { KEPT_UP_BY_GRADIENT } else { BY_GRADIENT };
    let most = share * luminance(estimate.irradiance);
    let change = (slope(&estimate.by_position) * radius).max(slope(&estimate.by_normal) * LARGEST_TURN);
    if change > most { most / change } else { 1.0 }
}

/// Length of the luminance's derivative.
fn slope(gradient: &Mat3A) -> f32 {
    let Mat3A { x_axis, y_axis, z_axis } = *gradient;
    Vec3A::from_array([x_axis, y_axis, z_axis].map(|column| luminance(column.into()))).length()
}

/// Width of a pixel on the surface at `site` \[m\]: that of a square pixel of the same area where it is seen askew.
pub(super) fn pixel_width(site: &Site, view: &View) -> f32 {
    let Some((pixel, depth)) = view.project(site.position) else { return 0.0 };
    let cosine = view.ray(pixel).1.dot(site.geometric_normal).abs();
    view.pixel_width(depth) / cosine.max(0.04).sqrt()
}

/// Radius on the screen that a record at `site` is going to have at most \[pixels\], by what is around it: the part of the
/// picture that it answers for.
#[must_use]
pub fn footprint(site: &Site, harmonic_mean: f32, nearest: f32, view: &View) -> f32 {
    let radius = (BY_HARMONIC_MEAN * harmonic_mean).min(BY_NEAREST * nearest);
    (radius / pixel_width(site, view)).clamp(BESIDE_WALLS, ON_SCREEN.1)
}

/// Smallest radius that a record at `site` can come to have in this view \[m\].
pub(super) fn least_radius(site: &Site, view: &View) -> f32 {
    BESIDE_WALLS * pixel_width(site, view)
}

/// Radius of `record` in this picture \[m\].
///
/// That the picture keeps it up holds for what is seen of its surroundings. Where something else is seen in its place, as when
/// a thing has moved over it, it keeps its own.
pub(super) fn radius_in_view<R>(record: &Record<R>, picture: &Picture) -> f32 {
    let pixel = pixel_width(&record.site, &picture.seen.view);
    let beside_wall = record.estimate.nearest < BESIDE_WALLS * pixel;
    let least = pixel * if beside_wall { BESIDE_WALLS } else { ON_SCREEN.0 };
    let kept_up = record.radius >= least || picture.shows(&record.site, least);
    let radius = if kept_up { record.radius.clamp(least, ON_SCREEN.1 * pixel) } else { record.radius };
    (radius * record.share).max(radius.min(DOUBTED * pixel))
}

/// Neighbor clamping \[Krivanek08, section 4.3.2\]: what is near to one record is not much farther from the next, even if its
/// rays have missed it. Applied to the records from `first` on, against all.
pub(super) fn clamp_to_neighbors<R>(records: &mut [Record<R>], first: usize) {
    let places: Vec<(Vec3A, f32)> = records.iter().map(|r| (r.site.position, r.radius)).collect();
    for (index, record) in records.iter_mut().enumerate().skip(first) {
        let mut allowed = f32::INFINITY;
        for (other, &(position, other_radius)) in places.iter().enumerate() {
            // |x − y| + R_y ≥ R_x needs no root when R_y alone is enough.
            if other_radius < allowed.min(record.radius) && other != index {
                allowed = allowed.min(other_radius + position.distance(record.site.position));
            }
        }
        record.radius_by_neighbors = allowed;
        record.radius = record.radius.min(allowed);
    }
}
