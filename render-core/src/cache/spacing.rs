//! Radius of a record in a picture and near other records.

use super::illumination::Site;
use super::picture::SurfacePicture;
use super::radius::{BY_HARMONIC_MEAN, BY_NEAREST};
use super::record::Record;
use crate::Busy;
use crate::scene::View;
use glam::Vec3A;
use rayon::prelude::*;

/// Minimum and maximum radius on screen \[pixels\] \[Tabellion04\].
const ON_SCREEN: (f32, f32) = (8.0, 40.0);
/// Minimum radius of a record near a wall, and distance that counts as near \[pixels\]. Small radii prevent light from
/// leaking through thin walls.
const BESIDE_WALLS: f32 = 4.0;
/// Minimum radius of a contradicted record \[pixels\].
const DOUBTED: f32 = 2.2;

/// Returns the expected maximum radius on screen of a record at `site` \[pixels\], from the site's surroundings. The
/// record will light the region of the picture within this radius.
#[must_use]
pub fn footprint(site: &Site, harmonic_mean: f32, nearest: f32, view: &View) -> f32 {
    let radius = (BY_HARMONIC_MEAN * harmonic_mean).min(BY_NEAREST * nearest);
    (radius / site.pixel_width(view)).clamp(BESIDE_WALLS, ON_SCREEN.1)
}

/// Returns the minimum radius of a record at `site` in this view \[m\].
pub(super) fn least_radius(site: &Site, view: &View) -> f32 {
    BESIDE_WALLS * site.pixel_width(view)
}

/// Returns the radius of `record` in this picture \[m\].
///
/// The picture raises the radius if it shows the surroundings of the record. If another surface is visible at the
/// record's position, for example after geometry has moved in front of it, the record keeps its own radius.
pub(super) fn radius_in_view<R>(record: &Record<R>, picture: &SurfacePicture) -> f32 {
    // Allow a smaller minimum on screen near a wall. Elsewhere, a small record would cover too few pixels.
    let pixel = record.site.pixel_width(&picture.seen.view);
    let beside_wall = record.estimate.nearest < BESIDE_WALLS * pixel;
    let least = pixel * if beside_wall { BESIDE_WALLS } else { ON_SCREEN.0 };

    // Limit the radius by the picture where the record is visible. A hidden record, or one outside the picture, may be
    // in another room. Its rays detect a wall only if the wall is close.
    let shown = picture.shows(&record.site, least);
    let on_picture = shown && picture.pixel_of(&record.site).is_some();
    let most = if on_picture { ON_SCREEN.1 * pixel } else { least };
    let kept_up = record.radius >= least || shown;
    let radius = if kept_up { record.radius.clamp(least, most) } else { record.radius };

    // Keep a fraction of the radius of a contradicted record, but cover at least a few pixels.
    (radius * record.share).max(radius.min(DOUBTED * pixel))
}

/// Clamps the radii of `new` records to their neighbors, and inserts them into the spheres of `older` records. A surface
/// near one record is also near the next record, even if the rays of that record missed it \[Krivanek08, section
/// 4.3.2\]. New records are compared with each other and with older records:
///
/// ```text
/// R_x ← min(R_x, min_y (|x − y| + R_y))
/// ```
pub(super) fn clamp_to_neighbors<R: Send + Sync>(new: &mut [Record<R>], older: &mut Spheres, busy: &Busy) {
    // Collect the radii before any clamping, so that the result does not depend on the order.
    let unclamped = busy.measure(|| Spheres::of(new.iter()));

    // Clamp each new record. Older records keep their radii.
    new.par_chunks_mut(CHUNK).for_each(|records| {
        busy.measure(|| {
            for record in records {
                let (position, radius) = (record.site.position, record.radius);
                record.radius_by_neighbors = older.reach(position, radius).min(unclamped.reach(position, radius));
                record.radius = record.radius.min(record.radius_by_neighbors);
            }
        });
    });
    busy.measure(|| older.insert(new.iter().map(sphere)));
}

/// Number of records per thread task.
const CHUNK: usize = 64;
/// Number of spheres that are compared at a time.
const TOGETHER: usize = 8;

/// Positions and radii of records, in ascending order of radius.
#[derive(Clone, Default)]
pub(super) struct Spheres {
    radii: Vec<f32>,
    /// x, y and z of the centers \[m\].
    centers: [Vec<f32>; 3],
}

fn sphere<R>(record: &Record<R>) -> (f32, Vec3A) {
    (record.radius, record.site.position)
}

impl Spheres {
    pub fn of<'a, R: 'a>(records: impl Iterator<Item = &'a Record<R>>) -> Self {
        let mut spheres = Self::default();
        spheres.insert(records.map(sphere));
        spheres
    }

    /// Inserts spheres, given as pairs of radius and center.
    fn insert(&mut self, spheres: impl Iterator<Item = (f32, Vec3A)>) {
        // Sort by radius, so that the spheres that can clamp a radius are a prefix of the list.
        let mut sorted: Vec<(f32, Vec3A)> = spheres.collect();
        sorted.sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));

        // Merge from the end, where the new places are free. The list is several times longer than its insertions.
        let mut from = self.radii.len();
        let mut to = from + sorted.len();
        self.radii.resize(to, 0.0);
        self.centers.iter_mut().for_each(|axis| axis.resize(to, 0.0));
        for (radius, center) in sorted.into_iter().rev() {
            let begin = self.radii[..from].partition_point(|&other| other <= radius);
            let moved = from - begin;
            to -= moved;
            self.radii.copy_within(begin..from, to);
            self.centers.iter_mut().for_each(|axis| axis.copy_within(begin..from, to));
            (from, to) = (begin, to - 1);
            self.radii[to] = radius;
            for (axis, &at) in self.centers.iter_mut().zip(center.as_ref()) {
                axis[to] = at;
            }
        }
    }

    /// Returns the minimum of |x − y| + R_y over the spheres with R_y below `radius`, or ∞ if no sphere is that small.
    fn reach(&self, place: Vec3A, radius: f32) -> f32 {
        // Exclude spheres with R_y ≥ R_x, which cannot reduce R_x.
        let smaller = self.radii.partition_point(|&other| other < radius);
        let reach = |r: f32, x: f32, y: f32, z: f32| {
            let (dx, dy, dz) = (x - place.x, y - place.y, z - place.z);
            r + (dx * dx + dy * dy + dz * dz).sqrt()
        };

        // Compare eight spheres at a time without branches, with one minimum per lane.
        let (radii, radii_left) = self.radii[..smaller].as_chunks::<TOGETHER>();
        let [(x, x_left), (y, y_left), (z, z_left)] =
            self.centers.each_ref().map(|axis| axis[..smaller].as_chunks::<TOGETHER>());
        let (x, y, z) = (&x[..radii.len()], &y[..radii.len()], &z[..radii.len()]);
        let mut least = [f32::INFINITY; TOGETHER];
        for group in 0..radii.len() {
            let (r, x, y, z) = (&radii[group], &x[group], &y[group], &z[group]);
            for k in 0..TOGETHER {
                let reach = reach(r[k], x[k], y[k], z[k]);
                least[k] = if reach < least[k] { reach } else { least[k] };
            }
        }

        // Combine the lanes with the remaining spheres.
        let mut whole = least.into_iter().fold(f32::INFINITY, f32::min);
        for k in 0..radii_left.len() {
            whole = whole.min(reach(radii_left[k], x_left[k], y_left[k], z_left[k]));
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{sobol_point, uniform_sphere};

    /// The sorted, vectorized search returns the minimum over all spheres.
    #[test]
    fn spheres_reach_as_far_as_one_by_one() {
        let place = |k: u64| Vec3A::from(uniform_sphere(sobol_point(k))) * (1.0 + (k % 7) as f32);
        let all: Vec<(f32, Vec3A)> = (0..203).map(|k| (0.01 * ((k * 37) % 101) as f32, place(k))).collect();
        let mut spheres = Spheres::default();
        for part in [&all[..90], &all[90..90], &all[90..91], &all[91..]] {
            spheres.insert(part.iter().copied());
        }
        assert!(spheres.radii.is_sorted() && spheres.radii.len() == all.len());
        for &(radius, center) in &all {
            let smaller = all.iter().filter(|&&(other, _)| other < radius);
            let expected = smaller.map(|&(r, y)| r + y.distance(center)).fold(f32::INFINITY, f32::min);
            let reach = spheres.reach(center, radius);
            assert!(reach == expected || (reach - expected).abs() <= 1e-6 * expected, "{reach} is not {expected}");
        }
    }
}
