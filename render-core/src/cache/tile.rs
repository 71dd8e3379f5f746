//! Lists of the records that may light the pixels of each macroblock.

use super::group::{InUse, NearRecords, ROUNDING, RecordGroup, SumUpTo, Weigh};
use super::illumination::Site;
use super::picture::{ShownSurface, SurfacePicture};
use super::record::Record;
use super::spacing::radius_in_view;
use super::{LARGE_CHUNK, Vec3A};
use crate::MACROBLOCK;
use crate::ranks::{in_order, share_each};
use lanes::{Choice, LANES};
use rayon::prelude::*;

/// Minimum sum of record weights at a point where records count as dense. At this density, another record would
/// not resolve a contradiction.
///
/// While the camera moves, every frame contradicts some records. Without this bound, each contradiction adds another
/// record. The table shows 25 frames of `conference` at 160×160. The error is the relative MSE of indirect light
/// against one lightcut per pixel. Records in use and indirect time are from the last frame.
///
/// | bound | error | records in use | indirect time |
/// |---|---|---|---|
/// | none | 1.02e-2 | 34 600 | 9.3 s |
/// | 2 | 1.11e-2 | 13 400 | 1.6 s |
/// | 1 | 1.21e-2 | 9 000 | 1.0 s |
pub(super) const DENSE: f32 = 2.0;
/// Minimum sum of weights at which a record is dropped, because a receding camera moves records closer together on
/// screen. In a picture without previous frames, 1 % of the records exceed 2.3. With 4, `conference` at 160×160 has
/// 19 900 records after 150 frames. With 2.5, it has 18 500 records, and a frame takes four fifths of the time.
const CROWDED: f32 = 2.5;

/// Macroblock of the picture, with its candidate records.
#[derive(Default)]
pub(super) struct Tile {
    /// Minimum corner of the box around the macroblock's surfaces. The box is empty without surfaces.
    low: Vec3A,
    high: Vec3A,
    /// Groups of candidates. Unused lanes of the last group are infinitely far away.
    groups: Vec<RecordGroup>,
    /// Position of each candidate in [`Tiles::listed`], ascending.
    pub candidates: Vec<u32>,
}

impl Tile {
    /// Sets `weights` to the candidates with a weight above zero at a pixel, in the order of candidates.
    #[inline]
    pub fn weights(&self, lanes: Choice, shown: &ShownSurface, weights: &mut Vec<(usize, f32)>) {
        weights.clear();
        lanes.run(Weigh { groups: &self.groups, shown, weights });
    }

    /// Returns whether the weights at a pixel sum to at least `enough`.
    #[inline]
    pub fn is_covered(&self, lanes: Choice, shown: &ShownSurface, enough: f32) -> bool {
        lanes.run(SumUpTo { groups: &self.groups, shown, enough })
    }

    /// Sets `near` to the candidates less than `reach` meters from `position`. A few may be slightly farther away.
    #[inline]
    pub fn candidates_near(&self, lanes: Choice, position: Vec3A, reach: f32, near: &mut Vec<u32>) {
        near.clear();
        let Self { groups, candidates, .. } = self;
        lanes.run(NearRecords { groups, candidates, position, reach2: reach * reach * ROUNDING, near });
    }

    fn add(&mut self, place: usize, site: &Site, radius: f32) {
        let lane = self.candidates.len() % LANES;
        if lane == 0 {
            self.groups.push(RecordGroup::NOWHERE);
        }
        self.groups.last_mut().expect("just made").set(lane, site, radius);
        self.candidates.push(place as u32);
    }

    /// Removes the candidates at list positions from `place` on. Returns whether any candidate was removed.
    fn forget_from(&mut self, place: usize) -> bool {
        // Remove the last candidates, which have the highest positions, and clear their lanes in the remaining group.
        let (before, kept) = (self.candidates.len(), self.candidates.partition_point(|&c| (c as usize) < place));
        self.candidates.truncate(kept);
        self.groups.truncate(kept.div_ceil(LANES));
        if let Some(last) = self.groups.last_mut() {
            for lane in kept.wrapping_sub(1) % LANES + 1..LANES {
                last.clear(lane);
            }
        }
        kept < before
    }

    /// Returns the candidates with a weight above zero at any of these pixels.
    fn candidates_in_use(&self, lanes: Choice, shown: &[ShownSurface]) -> Vec<u32> {
        let mut used = Vec::new();
        for (group, candidates) in self.groups.iter().zip(self.candidates.chunks(LANES)) {
            // Exclude empty lanes by the mask.
            let bits = lanes.run(InUse { group, shown, all: (1 << candidates.len()) - 1 });
            for (lane, &candidate) in candidates.iter().enumerate() {
                if bits >> lane & 1 == 1 {
                    used.push(candidate);
                }
            }
        }
        used
    }

    fn reached_by(&self, position: Vec3A, radius: f32) -> bool {
        // Compute the distance of the center from the box on each axis.
        let outside = (self.low - position).max(position - self.high).max(Vec3A::ZERO);
        outside.length_squared() < radius * radius
    }
}

/// Macroblocks of a picture, in raster order.
pub(super) struct Tiles {
    pub all: Vec<Tile>,
    pub lanes: Choice,
    /// Index of each listed record in the cache.
    pub listed: Vec<u32>,
}

impl Tiles {
    /// Returns tiles for all macroblocks, without records.
    pub fn new(picture: &SurfacePicture) -> Self {
        let empty = |tile| {
            let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
            for shown in picture.shown(tile) {
                if shown.is_something() {
                    (low, high) = (low.min(shown.position()), high.max(shown.position()));
                }
            }
            Tile { low, high, ..Tile::default() }
        };
        let all = (0..picture.tiles()).into_par_iter().map(|tile| picture.busy.measure(|| empty(tile))).collect();
        Self { all, lanes: Choice::best(), listed: Vec::new() }
    }

    /// Returns tiles that list records up to `margin` pixels around the wanted pixels. No record reaches tiles farther
    /// away.
    pub fn around(picture: &SurfacePicture, margin: usize) -> Self {
        let (columns, rows) = picture.wanted_area(margin);
        let reached = |&tile: &usize| {
            let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
            let (across, down) = picture.tile_area(tile);
            for y in down.start.max(rows.start)..down.end.min(rows.end) {
                for x in across.start.max(columns.start)..across.end.min(columns.end) {
                    if let Some(site) = picture.surface(x, y) {
                        (low, high) = (low.min(site.position), high.max(site.position));
                    }
                }
            }
            (low, high)
        };
        // Set the boxes of the tiles in the area. All other tiles keep an empty box, which no record reaches.
        let around = picture.tiles_around(margin);
        let boxes: Vec<(Vec3A, Vec3A)> = around.par_iter().map(|tile| picture.busy.measure(|| reached(tile))).collect();
        let nowhere = || Tile { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY, ..Tile::default() };
        let mut all: Vec<Tile> = (0..picture.tiles()).map(|_| nowhere()).collect();
        for (tile, (low, high)) in around.into_iter().zip(boxes) {
            (all[tile].low, all[tile].high) = (low, high);
        }
        Self { all, lanes: Choice::best(), listed: Vec::new() }
    }

    /// Returns the indices of the listed records that reach any tile, ascending.
    pub fn candidates(&self) -> Vec<usize> {
        let mut candidates = Vec::new();
        for tile in &self.all {
            candidates.extend_from_slice(&tile.candidates);
        }
        self.records(candidates)
    }

    /// Removes all candidates.
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
        picture: &SurfacePicture,
        records: &[Record<R>],
        chosen: impl IntoIterator<Item = usize>,
    ) {
        // Compute the sphere in which each record may have a weight.
        let first = self.listed.len();
        self.listed.extend(chosen.into_iter().map(|index| index as u32));
        let sphere = |&index: &u32| {
            let record = &records[index as usize];
            (&record.site, radius_in_view(record, picture))
        };
        let spheres: Vec<(&Site, f32)> = picture.busy.measure(|| self.listed[first..].iter().map(sphere).collect());

        // Process tiles in runs of eight. The common box of a run excludes records that none of its tiles needs.
        let across = picture.size().0.div_ceil(MACROBLOCK).max(1);
        let add_to = |tiles: &mut [Tile]| picture.busy.measure(|| add_to_all(tiles, first, &spheres));
        self.all.par_chunks_mut(across.min(8)).for_each(add_to);
    }

    /// Lists the records from position `place` on again with new radii. Returns, for each tile, whether it contained
    /// any of these records.
    pub fn list_again<R: Sync + Send>(
        &mut self,
        picture: &SurfacePicture,
        records: &[Record<R>],
        place: usize,
    ) -> Vec<bool> {
        let had: Vec<bool> = self.all.iter_mut().map(|tile| tile.forget_from(place)).collect();
        let again = self.listed.split_off(place);
        self.list(picture, records, again.into_iter().map(|index| index as usize));
        had
    }

    /// Keeps only the used records among the records listed from position `place` on.
    pub fn keep_used<R: Sync + Send>(&mut self, picture: &SurfacePicture, records: &[Record<R>], place: usize) {
        // Find the late candidates that light any pixel of a tile. Skip tiles without late candidates.
        let is_late = |&candidate: &u32| candidate as usize >= place;
        let mut chosen = picture.wanted_tiles.clone();
        chosen.retain(|&index| self.all[index].candidates.last().is_some_and(is_late));
        let in_tile = |index: usize| {
            let mut used = self.all[index].candidates_in_use(self.lanes, picture.shown(index));
            used.retain(is_late);
            used
        };
        let used: Vec<Vec<u32>> = picture.share_tiles(&chosen, in_tile);

        // Remove all late records from the list, and add the used records again.
        let used = self.records(used.concat());
        for tile in &mut self.all {
            tile.forget_from(place);
        }
        self.listed.truncate(place);
        self.list(picture, records, used);
    }

    /// Returns the indices of the listed records that light any pixel, ascending.
    pub fn in_use(&self, picture: &SurfacePicture) -> Vec<usize> {
        self.records(self.candidates_in_use(picture))
    }

    /// Returns the list positions of the records that light any pixel, ascending.
    pub fn places_in_use(&self, picture: &SurfacePicture) -> Vec<usize> {
        let mut places: Vec<usize> = self.candidates_in_use(picture).into_iter().map(|place| place as usize).collect();
        places.sort_unstable();
        places.dedup();
        places
    }

    fn candidates_in_use(&self, picture: &SurfacePicture) -> Vec<u32> {
        self.used_in(picture, &picture.wanted_tiles)
    }

    /// Returns the candidates of the `chosen` tiles that light any of the tiles' pixels. Some candidates appear more
    /// than once.
    pub fn used_in(&self, picture: &SurfacePicture, chosen: &[usize]) -> Vec<u32> {
        // Skip macroblocks without surfaces, as most are if only a region is wanted.
        let in_tile = |index: usize| {
            let mut shown = picture.shown(index).to_vec();
            shown.retain(ShownSurface::is_something);
            if shown.is_empty() { Vec::new() } else { self.all[index].candidates_in_use(self.lanes, &shown) }
        };
        picture.share_tiles(chosen, in_tile).concat()
    }

    /// Returns the superfluous records among the `chosen` records. At their positions, the weights of earlier records
    /// sum to at least [`CROWDED`].
    ///
    /// A record outside the picture is never superfluous, because the density of records outside is unknown.
    pub fn superfluous<R: Send + Sync>(
        &self,
        picture: &SurfacePicture,
        records: &[Record<R>],
        chosen: &[usize],
    ) -> Vec<usize> {
        // Find the records at whose positions the weights of all listed records sum to that much. Few do.
        let across = picture.size().0.div_ceil(MACROBLOCK);
        let crowd = |weights: &mut Vec<(usize, f32)>, item: usize| {
            let site = &records[chosen[item]].site;
            let Some((x, y)) = picture.pixel_of(site) else { return Vec::new() };
            let tile = &self.all[y / MACROBLOCK * across + x / MACROBLOCK];
            tile.weights(self.lanes, &site.into(), weights);
            if weights.iter().fold(0.0, |sum, (_, weight)| sum + weight) < CROWDED {
                return Vec::new();
            }
            weights.iter().map(|&(k, weight)| (self.listed[tile.candidates[k] as usize], weight)).collect()
        };
        let turns = in_order(chosen.len());
        let shared = share_each(picture.ranks(), &turns, LARGE_CHUNK, Vec::new, crowd);
        let crowds: Vec<Vec<(u32, f32)>> = picture.busy.take(shared);

        // Sum only over kept records, so that two records close together do not exclude each other.
        let mut kept = vec![false; records.len()];
        let mut superfluous = Vec::new();
        for (&index, crowd) in chosen.iter().zip(crowds) {
            let mut covered = 0.0;
            for (other, weight) in crowd {
                if kept[other as usize] {
                    covered += weight;
                }
            }
            if covered >= CROWDED {
                superfluous.push(index);
            } else {
                kept[index] = true;
            }
        }
        superfluous
    }

    /// Returns the indices of the records at the list positions `candidates`, ascending and without duplicates.
    pub fn records(&self, candidates: Vec<u32>) -> Vec<usize> {
        let mut records: Vec<usize> =
            candidates.into_iter().map(|candidate| self.listed[candidate as usize] as usize).collect();
        records.sort_unstable();
        records.dedup();
        records
    }
}

/// Adds records to the tiles that they reach. `spheres` contains the sites and radii of the records listed from
/// position `first` on.
fn add_to_all(tiles: &mut [Tile], first: usize, spheres: &[(&Site, f32)]) {
    // Test the common box first. Few records reach any of the tiles.
    let low = tiles.iter().fold(Vec3A::INFINITY, |low, tile| low.min(tile.low));
    let high = tiles.iter().fold(Vec3A::NEG_INFINITY, |high, tile| high.max(tile.high));
    let together = Tile { low, high, ..Tile::default() };
    for (place, &(site, radius)) in (first..).zip(spheres) {
        if !together.reached_by(site.position, radius) {
            continue;
        }
        for tile in &mut *tiles {
            if tile.reached_by(site.position, radius) {
                tile.add(place, site, radius);
            }
        }
    }
}
