//! Radius of a record in a picture and among its neighbors.

use super::illumination::Site;
use super::picture::Picture;
use super::radius::{BY_HARMONIC_MEAN, BY_NEAREST};
use super::record::Record;
use crate::scene::View;
use glam::Vec3A;

/// Radius on the screen at least and at most \[pixels\] \[Tabellion04\].
const ON_SCREEN: (f32, f32) = (8.0, 40.0);
/// The least radius of a record to which something is nearer than that \[pixels\]: light must not leak past thin walls.
const BESIDE_WALLS: f32 = 4.0;
/// Least radius of a record that is contradicted \[pixels\].
const DOUBTED: f32 = 2.2;

/// Radius on the screen that a record at `site` is going to have at most \[pixels\], by what is around it: the part of the
/// picture that it answers for.
#[must_use]
pub fn footprint(site: &Site, harmonic_mean: f32, nearest: f32, view: &View) -> f32 {
    let radius = (BY_HARMONIC_MEAN * harmonic_mean).min(BY_NEAREST * nearest);
    (radius / site.pixel_width(view)).clamp(BESIDE_WALLS, ON_SCREEN.1)
}

/// Smallest radius that a record at `site` can come to have in this view \[m\].
pub(super) fn least_radius(site: &Site, view: &View) -> f32 {
    BESIDE_WALLS * site.pixel_width(view)
}

/// Radius of `record` in this picture \[m\].
///
/// The picture raises it where it shows the surroundings of the record. Where something else is seen in its place, as when a
/// thing has moved over it, it keeps its own.
pub(super) fn radius_in_view<R>(record: &Record<R>, picture: &Picture) -> f32 {
    let pixel = record.site.pixel_width(&picture.seen.view);
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
