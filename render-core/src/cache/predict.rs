//! Predictions of irradiance around records.
//!
//! A record's analytic derivatives ignore changes of visibility. Near occluders, irradiance changes mostly because the
//! visible fraction of the surroundings changes. Neighboring records measure this change, so the derivatives are fitted
//! to the neighbors:
//!
//! ```text
//! E(x) = Eᵢ + (∂E/∂n)ᵢ (n − nᵢ) + b · (x − xᵢ) + c (o − oᵢ)          o  openness
//!   b, c minimize  Σⱼ wⱼ |E(xⱼ) − Eⱼ|² + ρ |(b − bᵢ) R|² + σ |c t|²      bᵢ  the record's own derivative    R  its radius
//! ```
//!
//! Each record has one ridge regression along the surface. wⱼ is the weight of neighbor j for record i at a radius
//! larger than the record's own radius. The residual limits the radius of the record: see `doubt.rs`.

use super::group::weight;
use super::illumination::Site;
use super::known::{Before, Taught};
use super::picture::{ShownSurface, SurfacePicture};
use super::radius::trust;
use super::record::Record;
use super::spacing::radius_in_view;
use super::tile::{Tile, Tiles};
use super::tolerance::{ACROSS, NORMAL_TOLERANCE, OPENNESS_TOLERANCE};
use crate::ranks::{Assignment, Portable, share_each};
use crate::sampling::frame;
use crate::scene::View;
use crate::{MACROBLOCK, luminance};
use glam::{Mat3A, Vec3, Vec3A};
use ranks::portable;
use std::sync::Mutex;

/// Maximum distance of neighbors \[pixels\]. [`BY_RADIUS`] clamps it to a range of multiples of the record's radius. In
/// a simulation of `nave`, a minimum of 2 instead of 1.25 leaves 4 % less error and needs 4 % more records. On
/// `cornell`, a minimum of 2 leaves 1.5 times the error.
const ON_SCREEN: f32 = 12.0;
/// Minimum and maximum of the maximum distance of neighbors, in radii of the record.
const BY_RADIUS: (f32, f32) = (1.25, 2.0);
/// ρ, the stiffness of slopes. Three times this value leaves 1 % less error on the simulated `nave`, with 4 % more
/// records.
const STIFFNESS: f32 = 0.1;
/// σ, the stiffness of the slope by openness.
const STIFFNESS_BY_OPENNESS: f32 = 0.5;
/// Residual of a neighbor at which its weight in the fit becomes zero, as a fraction of the record's luminance. A
/// neighbor with this residual is across a border; smaller residuals reduce the weight smoothly.
const OTHER_LIGHT: f32 = 0.7;
/// Difference at which half of the fitted correction is applied, in tolerances. Below this difference, the record's own
/// derivatives are more accurate than the chords to its neighbors.
const SETTLED: f32 = 0.5;
/// Maximum change of luminance over the radius, as a fraction of the luminance. In a simulation of `cornell`, 0.4
/// left a quarter less error than no limit.
const MOST_CHANGE: f32 = 0.5;

/// Model of the irradiance around a record.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prediction {
    position: Vec3A,
    normal: Vec3A,
    irradiance: Vec3A,
    by_position: Mat3A,
    by_normal: Mat3A,
    by_openness: Vec3A,
    openness: f32,
}

impl Prediction {
    /// Placeholder for records without a prediction.
    pub const NOTHING: Self = Self {
        position: Vec3A::ZERO,
        normal: Vec3A::ZERO,
        irradiance: Vec3A::ZERO,
        by_position: Mat3A::ZERO,
        by_normal: Mat3A::ZERO,
        by_openness: Vec3A::ZERO,
        openness: 0.0,
    };

    /// Returns the prediction from the record's own derivatives, limited over this `radius`.
    fn alone<R>(record: &Record<R>, radius: f32) -> Self {
        let Record { site, estimate, .. } = record;
        let trust = trust(estimate, record.radius, radius);
        Self {
            position: site.position,
            normal: site.normal,
            irradiance: estimate.irradiance.into(),
            by_position: estimate.by_position * trust,
            by_normal: estimate.by_normal * trust,
            by_openness: Vec3A::ZERO,
            openness: site.openness,
        }
    }

    /// Returns the irradiance at a nearby pixel \[W·m⁻²\].
    #[inline]
    pub fn at(&self, shown: &ShownSurface) -> Vec3A {
        let light = self.irradiance
            + self.by_normal * (shown.normal() - self.normal)
            + self.by_position * (shown.position() - self.position)
            + self.by_openness * (shown.openness - self.openness);
        light.max(Vec3A::ZERO)
    }
}

portable!(Prediction { position, normal, irradiance, by_position, by_normal, by_openness, openness });

/// Prediction of a record for a picture, fitted to its neighbors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Predicted {
    pub prediction: Prediction,
    /// Root mean square difference between the neighbors and the prediction, in luminance \[W·m⁻²\].
    pub difference: f32,
    /// Regression sums over the record's neighbors.
    pub taught: Taught,
}

/// Predicts the irradiance around the records listed at these `places`. Returns the predictions and the regression sums
/// of this rank's records; other ranks' sums are left empty, because no prediction on this rank will need them.
pub(super) fn predictions<R: Send + Sync>(
    picture: &SurfacePicture,
    tiles: &Tiles,
    records: &[Record<R>],
    places: &[usize],
) -> (Vec<Prediction>, Vec<Taught>) {
    // Collect the sums in any order: they are not sent to other ranks.
    let sums = Mutex::new(Vec::new());
    let keep = |item: usize, found: Predicted| {
        sums.lock().expect("no thread panics").push((item, found.taught));
        found.prediction
    };
    let predicted = predict_each(picture, tiles, (records, places), keep);
    let mut taught = vec![Taught::nothing(f32::NAN); places.len()];
    for (item, sums) in sums.into_inner().expect("no thread panics") {
        taught[item] = sums;
    }
    (predicted, taught)
}

/// Predicts the irradiance around the `records` listed at these `places`. Returns the result of `of` for the index and
/// the prediction of each place. If an earlier picture of the frame has found the neighbors of a record, searches only
/// for neighbors made since.
pub(super) fn predict_each<R: Send + Sync, T: Portable + Send>(
    picture: &SurfacePicture,
    tiles: &Tiles,
    (records, places): (&[Record<R>], &[usize]),
    of: impl Fn(usize, Predicted) -> T + Sync,
) -> Vec<T> {
    // Start from the sums of an earlier picture, if they exist; otherwise, search for all neighbors.
    let known = picture.known;
    let fresh = known.fresh(&tiles.listed, records);
    let no_neighbors = || Neighbors { picture, tiles, met_by: vec![u32::MAX; tiles.listed.len()], near: Vec::new() };
    let predict = |neighbors: &mut Neighbors, item: usize| {
        let place = places[item];
        let record = &records[tiles.listed[place] as usize];
        let radius = radius_in_view(record, picture);
        let mut fit = Fit::new(record, radius, &picture.seen.view);
        match known.of(record, radius, &fresh) {
            Some(before) => fit.go_on(&before, records),
            None => neighbors.teach(&mut fit, place, records),
        }
        of(item, fit.solve())
    };

    // Divide the records among ranks by number, so that each rank finds the sums of its records in later pictures. Each
    // thread has its own working memory.
    let number = |&place: &usize| records[tiles.listed[place] as usize].number;
    let turns: Vec<Assignment> = places.iter().map(|place| Assignment::Golden(number(place))).collect();
    picture.busy.take(share_each(picture.ranks(), &turns, CHUNK, no_neighbors, predict))
}

/// Search for neighbors of records, with the working memory of a thread.
struct Neighbors<'a> {
    picture: &'a SurfacePicture<'a>,
    tiles: &'a Tiles,
    /// For each position in the list, the position of the last record for which it was found as a neighbor.
    met_by: Vec<u32>,
    /// Candidates of a tile near a record.
    near: Vec<u32>,
}

impl Neighbors<'_> {
    /// Adds the neighbors of the record at position `place` in the list to a `fit`.
    fn teach<R>(&mut self, fit: &mut Fit<R>, place: usize, records: &[Record<R>]) {
        let (tiles, site) = (self.tiles, &fit.record.site);
        for tile in tiles_around(self.picture, tiles, site) {
            tile.candidates_near(tiles.lanes, site.position, fit.reach(), &mut self.near);
            for &candidate in &self.near {
                // Add each neighbor once, because most neighbors are listed by several tiles.
                if std::mem::replace(&mut self.met_by[candidate as usize], place as u32) != place as u32 {
                    fit.add(&records[tiles.listed[candidate as usize] as usize]);
                }
            }
        }
    }
}

/// Minimum number of records per thread task.
const CHUNK: usize = 128;

/// Returns the macroblock of a site and the macroblocks around it, or none for a site outside the picture.
fn tiles_around<'a>(picture: &SurfacePicture, tiles: &'a Tiles, site: &Site) -> impl Iterator<Item = &'a Tile> {
    let (width, height) = picture.size();
    let (across, down) = (width.div_ceil(MACROBLOCK), height.div_ceil(MACROBLOCK));
    let seen_at = picture.pixel_of(site);
    let beside = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
    seen_at.into_iter().flat_map(move |(x, y)| {
        let columns = beside(x / MACROBLOCK, across);
        beside(y / MACROBLOCK, down).flat_map(move |row| tiles.all[row * across..][columns.clone()].iter())
    })
}

/// Regression of a record over its neighbors.
pub(super) struct Fit<'a, R> {
    record: &'a Record<R>,
    alone: Prediction,
    radius: f32,
    /// Maximum distance of neighbors, in radii of the record.
    widened: f32,
    /// Unit axes along the surface.
    axes: [Vec3A; 2],
    /// Change of irradiance over the radius along both axes, from the record's own derivatives.
    own: [Vec3A; 2],
    taught: Taught,
}

impl<'a, R> Fit<'a, R> {
    pub fn new(record: &'a Record<R>, radius: f32, view: &View) -> Self {
        let alone = Prediction::alone(record, radius);
        let axes: [Vec3A; 2] = <[Vec3; 2]>::from(frame(record.site.normal.into())).map(Vec3A::from);
        let (least, most) = BY_RADIUS;
        Self {
            record,
            alone,
            radius,
            widened: (ON_SCREEN * record.site.pixel_width(view) / radius).clamp(least, most),
            axes,
            own: axes.map(|axis| alone.by_position * axis * radius),
            taught: Taught::nothing(radius),
        }
    }

    /// Returns the maximum distance of neighbors \[m\].
    fn reach(&self) -> f32 {
        self.radius * self.widened
    }

    /// Adds the sums of an earlier picture.
    fn go_on(&mut self, before: &Before, records: &[Record<R>]) {
        self.taught = *before.taught;
        let (reach, position) = (self.reach(), self.record.site.position);
        for fresh in before.since {
            if fresh.is_within(reach, position) {
                self.add(&records[fresh.index]);
            }
        }
    }

    pub fn add(&mut self, neighbor: &Record<R>) {
        // Skip the record itself, records on other instances, and records out of reach.
        let (site, other) = (&self.record.site, &neighbor.site);
        if std::ptr::eq(self.record, neighbor) || site.carrier != other.carrier {
            return;
        }
        let way = other.position - site.position;
        let reach = self.reach();
        let near2 = way.length_squared() / (reach * reach);
        if near2 >= 1.0 {
            return;
        }

        // w is the weight that the neighbor would have for this record if the record's radius were the reach.
        let across = ACROSS / 2.0 * way.dot(site.normal + other.normal) / reach;
        let opener = (other.openness - site.openness) / OPENNESS_TOLERANCE;
        let turn = (1.0 - site.normal.dot(other.normal)) / NORMAL_TOLERANCE;
        let w = weight(near2 + across * across + turn + (opener / self.widened).powi(2));
        if w == 0.0 {
            return;
        }

        // r = Eⱼ − Eᵢ − (∂E/∂n)ᵢ (nⱼ − nᵢ) − bᵢ · (xⱼ − xᵢ) is the residual of the record's own prediction.
        let f = Vec3A::new(way.dot(self.axes[0]) / self.radius, way.dot(self.axes[1]) / self.radius, opener);
        let r = Vec3A::from(neighbor.estimate.irradiance)
            - self.alone.irradiance
            - self.alone.by_normal * (other.normal - site.normal)
            - (self.own[0] * f.x + self.own[1] * f.y);

        // Reduce the weight of neighbors with very different light, which are across a border. The last sums include
        // all neighbors at full weight.
        let square = Mat3A::from_cols(f * f.x, f * f.y, f * f.z);
        let light = luminance(r.into());
        let border = OTHER_LIGHT * luminance(self.record.estimate.irradiance);
        let taught = w * (1.0 - (light / border).powi(2)).max(0.0).powi(2);
        let sums = &mut self.taught;
        sums.square += square * taught;
        sums.unexplained += Mat3A::from_cols(r * f.x, r * f.y, r * f.z) * taught;
        sums.weights += w;
        sums.variance += w * light * light;
        sums.all_square += square * w;
        sums.all_unexplained += f * (w * light);
    }

    /// Solves the regression. Returns the prediction and the remaining difference of the neighbors.
    pub fn solve(self) -> Predicted {
        let Self { alone, axes, own, taught, .. } = self;
        let Taught { square, unexplained, weights, variance, all_square, all_unexplained, .. } = taught;
        if weights == 0.0 {
            return Predicted { prediction: alone, difference: 0.0, taught };
        }

        // Solve (Σ w f fᵀ + ρ) s = Σ w f r, with separate ridge terms for slopes and for openness.
        let ridge = Vec3A::new(STIFFNESS, STIFFNESS, STIFFNESS_BY_OPENNESS);
        // Scale the correction down if the record's own derivatives agree with its neighbors.
        let mean_variance = variance / weights;
        let settled = (SETTLED * self.record.estimate.tolerance).powi(2);
        let open_to_learn = mean_variance / (mean_variance + settled).max(f32::MIN_POSITIVE);
        let learnt = unexplained * (square + Mat3A::from_diagonal(ridge.into())).inverse() * open_to_learn;

        // Limit the slopes along both axes to a fraction of the luminance over the radius.
        let along = [own[0] + learnt.x_axis, own[1] + learnt.y_axis];
        let light = |v: Vec3A| luminance(v.into());
        let (change, most) =
            (light(along[0]).hypot(light(along[1])), MOST_CHANGE * luminance(self.record.estimate.irradiance));
        let followed = if change > most { most / change } else { 1.0 };
        let along = along.map(|slope| slope * followed);

        // Compute the remaining difference of neighbors in luminance. The total correction of the record's own
        // prediction is s.
        // Σ w (r − s · f)² = Σ w r² − 2 s · Σ w f r + s · (Σ w f fᵀ) s
        let s = Vec3A::new(light(along[0] - own[0]), light(along[1] - own[1]), light(learnt.z_axis));
        let left = variance - 2.0 * s.dot(all_unexplained) + s.dot(all_square * s);

        // Convert changes over the radius along both axes to derivatives by x, y and z.
        let by_axis = |k: usize| (along[0] * axes[0][k] + along[1] * axes[1][k]) / self.radius;
        let prediction = Prediction {
            by_position: Mat3A::from_cols(by_axis(0), by_axis(1), by_axis(2)),
            by_openness: learnt.z_axis / OPENNESS_TOLERANCE,
            ..alone
        };
        Predicted { prediction, difference: (left.max(0.0) / weights).sqrt(), taught }
    }
}
