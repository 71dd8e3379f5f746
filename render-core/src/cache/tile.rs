//! Records that a macroblock's pixels may take light from, laid out for a loop over them.

use super::Vec3A;
use super::illumination::Site;
use super::picture::{Picture, Shown};
use super::record::Record;
use super::spacing::radius_in_view;
use super::tolerance::{ACROSS, NORMAL_TOLERANCE, OPENNESS_TOLERANCE};
use crate::MACROBLOCK;
use lanes::{Choice, Kernel, LANES, Lanes};
use rayon::prelude::*;

/// Sum of the weights of records at a place from which on they are dense there: another record would settle nothing.
///
/// While the camera moves, every frame contradicts some records anew, and without this bound each contradiction adds another.
/// On 25 frames of `conference` at 160×160 (relative MSE of indirect light against cuts for each pixel, records in use and
/// indirect time at the end): no bound 1.02e-2, 34 600, 9.3 s; 2 gives 1.11e-2, 13 400, 1.6 s; 1 gives 1.21e-2, 9 000, 1.0 s.
pub(super) const DENSE: f32 = 2.0;
/// The same sum from which on a record is dropped: a camera that goes away from a surface brings its records together. Pictures
/// that nothing went before have one record in a hundred where it is more than 2.3. With 4, `conference` at 160×160 has 19 900
/// records after 150 frames; with 2.5 it has 18 500, and a frame takes four fifths of the time.
const CROWDED: f32 = 2.5;

/// A macroblock of the picture.
#[derive(Default)]
pub(super) struct Tile {
    /// Box around its surfaces; empty if there are none.
    low: Vec3A,
    high: Vec3A,
    /// Groups of candidates; the last is filled up with records that are nowhere.
    groups: Vec<Group>,
    /// Place of each candidate in [`Tiles::listed`], ascending.
    pub candidates: Vec<u32>,
}

/// Terms of the error measure for [`LANES`] records.
struct Group {
    position: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    inverse_radius2: [f32; LANES],
    carrier: [u32; LANES],
    openness: [f32; LANES],
}

impl Group {
    /// Infinitely far from everything.
    const NOWHERE: Self = Self {
        position: [[1e18; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        inverse_radius2: [1.0; LANES],
        carrier: [0; LANES],
        openness: [0.0; LANES],
    };

    /// e² of each record at a pixel:
    ///
    /// ```text
    /// e² = (|d|² + k² (d · n̄)²) / R² + (1 − n · nᵢ) / c + (o − oᵢ)² / t²
    ///   d  way from the record        n̄  mean of the two normals        k  ACROSS     c  NORMAL_TOLERANCE
    ///   o  openness                                                                   t  OPENNESS_TOLERANCE
    /// ```
    #[inline(always)]
    fn error2(&self, shown: &Shown) -> [f32; LANES] {
        let (p, n) = (shown.position().to_array(), shown.normal().to_array());
        let mut error2 = [0.0; LANES];
        for (k, error2) in error2.iter_mut().enumerate() {
            let (mut d2, mut along, mut cosine) = (0.0, 0.0, 0.0);
            for axis in 0..3 {
                let d = p[axis] - self.position[axis][k];
                d2 += d * d;
                along += d * (n[axis] + self.normal[axis][k]);
                cosine += n[axis] * self.normal[axis][k];
            }
            let other = if self.carrier[k] == shown.carrier { 0.0 } else { 2.0 };
            let opener = (shown.openness - self.openness[k]) * (1.0 / OPENNESS_TOLERANCE);
            *error2 = (d2 + ACROSS * ACROSS / 4.0 * along * along) * self.inverse_radius2[k]
                + (1.0 - cosine) * (1.0 / NORMAL_TOLERANCE)
                + opener * opener
                + other;
        }
        error2
    }
}

/// Weight of a record by its e².
#[inline(always)]
pub(super) fn weight(error2: f32) -> f32 {
    let rest = (1.0 - error2).max(0.0);
    rest * rest
}

/// Weight that a record at `from` with this radius has at `to`, on the same footing as [`Tile::weights`].
pub(super) fn weight_between(from: &Site, radius: f32, to: &Site) -> f32 {
    let mut group = Group::NOWHERE;
    group.set(0, from, radius);
    weight(group.error2(&to.into())[0])
}

impl Group {
    /// Square of each record's distance \[m²\].
    #[inline(always)]
    fn distance2(&self, position: [f32; 3]) -> [f32; LANES] {
        let mut distance2 = [0.0; LANES];
        for (axis, place) in self.position.iter().zip(position) {
            for (d2, at) in distance2.iter_mut().zip(axis) {
                let d = at - place;
                *d2 += d * d;
            }
        }
        distance2
    }

    fn set(&mut self, lane: usize, site: &Site, radius: f32) {
        for axis in 0..3 {
            self.position[axis][lane] = site.position[axis];
            self.normal[axis][lane] = site.normal[axis];
        }
        self.inverse_radius2[lane] = 1.0 / (radius * radius).max(f32::MIN_POSITIVE);
        self.carrier[lane] = site.carrier;
        self.openness[lane] = site.openness;
    }

    fn clear(&mut self, lane: usize) {
        for axis in 0..3 {
            self.position[axis][lane] = Self::NOWHERE.position[axis][lane];
        }
        self.inverse_radius2[lane] = Self::NOWHERE.inverse_radius2[lane];
    }
}

impl Tile {
    /// Puts the candidates whose weight at a pixel is above zero into `weights`, in their order.
    #[inline]
    pub fn weights(&self, lanes: Choice, shown: &Shown, weights: &mut Vec<(usize, f32)>) {
        weights.clear();
        lanes.run(Weigh { groups: &self.groups, shown, weights });
    }

    /// Whether the weights at a pixel sum to at least `enough`.
    #[inline]
    pub fn is_covered(&self, lanes: Choice, shown: &Shown, enough: f32) -> bool {
        lanes.run(SumUpTo { groups: &self.groups, shown, enough })
    }

    /// Puts the candidates less than `reach` meters from `position` into `near`; some may lie a little farther away.
    #[inline]
    pub fn candidates_near(&self, lanes: Choice, position: Vec3A, reach: f32, near: &mut Vec<u32>) {
        near.clear();
        let Self { groups, candidates, .. } = self;
        lanes.run(Near { groups, candidates, position, reach2: reach * reach * ROUNDING, near });
    }

    fn add(&mut self, place: usize, site: &Site, radius: f32) {
        let lane = self.candidates.len() % LANES;
        if lane == 0 {
            self.groups.push(Group::NOWHERE);
        }
        self.groups.last_mut().expect("just made").set(lane, site, radius);
        self.candidates.push(place as u32);
    }

    /// Forgets the candidates from `place` on; whether there were any.
    fn forget_from(&mut self, place: usize) -> bool {
        let (before, kept) = (self.candidates.len(), self.candidates.partition_point(|&c| (c as usize) < place));
        self.candidates.truncate(kept);
        self.groups.truncate(kept.div_ceil(LANES));
        if let Some(last) = self.groups.last_mut() {
            (kept.wrapping_sub(1) % LANES + 1..LANES).for_each(|lane| last.clear(lane));
        }
        kept < before
    }

    /// Candidates with a weight above zero at any of these pixels.
    fn candidates_in_use(&self, lanes: Choice, shown: &[Shown]) -> Vec<u32> {
        let mut used = Vec::new();
        for (group, candidates) in self.groups.iter().zip(self.candidates.chunks(LANES)) {
            let bits = lanes.run(InUse { group, shown, all: (1 << candidates.len()) - 1 });
            let candidates = candidates.iter().enumerate().filter(|(lane, _)| bits >> lane & 1 == 1);
            used.extend(candidates.map(|(_, &candidate)| candidate));
        }
        used
    }

    fn reached_by(&self, position: Vec3A, radius: f32) -> bool {
        let outside = (self.low - position).max(position - self.high).max(Vec3A::ZERO);
        outside.length_squared() < radius * radius
    }
}

// The loops over candidates are kernels, though they are written as for one lane after the other: compiled for the vector
// instructions that the processor has, they take half the time.

/// See [`Tile::weights`].
struct Weigh<'a> {
    groups: &'a [Group],
    shown: &'a Shown,
    weights: &'a mut Vec<(usize, f32)>,
}

impl Kernel for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        for (g, group) in self.groups.iter().enumerate() {
            let error2 = group.error2(self.shown);
            let mut bits = below(&error2, 1.0);
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize % LANES;
                bits &= bits - 1;
                self.weights.push((g * LANES + lane, weight(error2[lane])));
            }
        }
    }
}

/// See [`Tile::is_covered`].
struct SumUpTo<'a> {
    groups: &'a [Group],
    shown: &'a Shown,
    enough: f32,
}

impl Kernel for SumUpTo<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> bool {
        let mut sum = 0.0;
        for group in self.groups {
            let error2 = group.error2(self.shown);
            if below(&error2, 1.0) != 0 {
                for e in error2 {
                    sum += weight(e);
                }
                if sum >= self.enough {
                    return true;
                }
            }
        }
        false
    }
}

/// Margin in the comparison of squares of distances, which callers may round in another way.
const ROUNDING: f32 = 1.0001;

/// See [`Tile::candidates_near`].
struct Near<'a> {
    groups: &'a [Group],
    candidates: &'a [u32],
    position: Vec3A,
    reach2: f32,
    near: &'a mut Vec<u32>,
}

impl Kernel for Near<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let position = self.position.to_array();
        for (group, candidates) in self.groups.iter().zip(self.candidates.chunks(LANES)) {
            // Groups are filled up with records that are nowhere.
            let mut bits = below(&group.distance2(position), self.reach2);
            while bits != 0 {
                self.near.push(candidates[bits.trailing_zeros() as usize % LANES]);
                bits &= bits - 1;
            }
        }
    }
}

/// See [`Tile::candidates_in_use`]; bits of those of a group, of which `all` are records.
struct InUse<'a> {
    group: &'a Group,
    shown: &'a [Shown],
    all: u32,
}

impl Kernel for InUse<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> u32 {
        let mut used = 0;
        for shown in self.shown {
            used |= below(&self.group.error2(shown), 1.0);
            if used & self.all == self.all {
                break;
            }
        }
        used & self.all
    }
}

/// Bits of the lanes whose value is below `most`.
#[inline(always)]
fn below(values: &[f32; LANES], most: f32) -> u32 {
    let mut bits = 0;
    for (lane, &value) in values.iter().enumerate() {
        bits |= u32::from(value < most) << lane;
    }
    bits
}

/// All macroblocks of a picture, in raster order.
pub(super) struct Tiles {
    pub all: Vec<Tile>,
    pub lanes: Choice,
    /// Index of each record that is listed.
    pub listed: Vec<u32>,
}

impl Tiles {
    /// Tiles without records.
    pub fn new(picture: &Picture) -> Self {
        let empty = |tile| {
            let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
            for position in picture.shown(tile).iter().filter(|shown| shown.is_something()).map(Shown::position) {
                (low, high) = (low.min(position), high.max(position));
            }
            Tile { low, high, ..Tile::default() }
        };
        let all = (0..picture.tiles()).into_par_iter().map(|tile| picture.busy.measure(|| empty(tile))).collect();
        Self { all, lanes: Choice::best(), listed: Vec::new() }
    }

    /// Forgets all candidates.
    pub fn clear(&mut self) {
        self.listed.clear();
        for tile in &mut self.all {
            tile.groups.clear();
            tile.candidates.clear();
        }
    }

    /// Adds the `chosen` records, in their order, to the tiles that they reach.
    pub fn list<R: Sync + Send>(
        &mut self,
        picture: &Picture,
        records: &[Record<R>],
        chosen: impl IntoIterator<Item = usize>,
    ) {
        let first = self.listed.len();
        self.listed.extend(chosen.into_iter().map(|index| index as u32));
        let sphere = |&index: &u32| {
            let record = &records[index as usize];
            (&record.site, radius_in_view(record, picture))
        };
        let spheres: Vec<(&Site, f32)> = picture.busy.measure(|| self.listed[first..].iter().map(sphere).collect());
        // A row of tiles first rules out what none of them needs.
        let across = picture.size().0.div_ceil(MACROBLOCK).max(1);
        self.all.par_chunks_mut(across.min(8)).for_each(|tiles| {
            picture.busy.measure(|| {
                let low = tiles.iter().fold(Vec3A::INFINITY, |low, tile| low.min(tile.low));
                let high = tiles.iter().fold(Vec3A::NEG_INFINITY, |high, tile| high.max(tile.high));
                let together = Tile { low, high, ..Tile::default() };
                for (place, &(site, radius)) in (first..).zip(&spheres) {
                    if !together.reached_by(site.position, radius) {
                        continue;
                    }
                    for tile in tiles.iter_mut().filter(|tile| tile.reached_by(site.position, radius)) {
                        tile.add(place, site, radius);
                    }
                }
            });
        });
    }

    /// Lists the records from `place` on again, whose radii are others now. Returns for each tile whether it had any.
    pub fn list_again<R: Sync + Send>(&mut self, picture: &Picture, records: &[Record<R>], place: usize) -> Vec<bool> {
        let had: Vec<bool> = self.all.iter_mut().map(|tile| tile.forget_from(place)).collect();
        let again = self.listed.split_off(place);
        self.list(picture, records, again.into_iter().map(|index| index as usize));
        had
    }

    /// Keeps, among the records listed from `place` on, those that any pixel takes light from.
    pub fn keep_used<R: Sync + Send>(&mut self, picture: &Picture, records: &[Record<R>], place: usize) {
        let is_late = |&candidate: &u32| candidate as usize >= place;
        let in_tile = |index: usize| {
            let mut used = if self.all[index].candidates.last().is_some_and(is_late) {
                self.all[index].candidates_in_use(self.lanes, picture.shown(index))
            } else {
                Vec::new()
            };
            used.retain(is_late);
            used
        };
        let used: Vec<Vec<u32>> =
            (0..self.all.len()).into_par_iter().map(|index| picture.busy.measure(|| in_tile(index))).collect();
        let used = self.records(used.concat());
        self.all.iter_mut().for_each(|tile| _ = tile.forget_from(place));
        self.listed.truncate(place);
        self.list(picture, records, used);
    }

    /// Listed records, ascending, that any pixel takes light from.
    pub fn in_use(&self, picture: &Picture) -> Vec<usize> {
        let in_tile = |index: usize| self.all[index].candidates_in_use(self.lanes, picture.shown(index));
        let used: Vec<Vec<u32>> =
            (0..self.all.len()).into_par_iter().map(|index| picture.busy.measure(|| in_tile(index))).collect();
        self.records(used.concat())
    }

    /// The listed records of `chosen` at places where earlier ones of them sum to [`CROWDED`] already.
    ///
    /// A record beside the picture is none of them: the picture does not tell how dense the records are there.
    pub fn superfluous<R>(&self, picture: &Picture, records: &[Record<R>], chosen: &[usize]) -> Vec<usize> {
        let mut kept = vec![false; records.len()];
        let mut weights = Vec::new();
        let across = picture.size().0.div_ceil(MACROBLOCK);
        let mut is_superfluous = |index: usize| {
            let site = &records[index].site;
            let Some((x, y)) = picture.pixel_of(site) else { return false };
            let tile = &self.all[y / MACROBLOCK * across + x / MACROBLOCK];
            tile.weights(self.lanes, &site.into(), &mut weights);
            let earlier = weights.iter().filter(|(k, _)| kept[self.listed[tile.candidates[*k] as usize] as usize]);
            let covered = earlier.map(|&(_, weight)| weight).sum::<f32>() >= CROWDED;
            kept[index] = !covered;
            covered
        };
        chosen.iter().copied().filter(|&index| is_superfluous(index)).collect()
    }

    /// Indices of the records of `candidates`, ascending and each once.
    pub fn records(&self, candidates: Vec<u32>) -> Vec<usize> {
        let mut records: Vec<usize> =
            candidates.into_iter().map(|candidate| self.listed[candidate as usize] as usize).collect();
        records.sort_unstable();
        records.dedup();
        records
    }
}
