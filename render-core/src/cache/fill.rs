//! New records where a picture needs them, coarse to fine.

use super::doubt::{LEAST_SHARE, Tolerances, contradicted_pixels};
use super::group::weight_between;
use super::illumination::{Computed, Illumination, Site};
use super::picture::SurfacePicture;
use super::predict::predictions;
use super::record::{Record, RecordLight};
use super::spacing::{clamp_to_neighbors, least_radius};
use super::tile::Tiles;
use super::{IrradianceCache, openness};
use crate::ranks::{Turn, share};
use plane::Plane;
use rayon::prelude::*;
use std::ops::Range;

/// Steps of the lattices \[pixels\].
const STEPS: [usize; 5] = [16, 8, 4, 2, 1];
/// A pixel is covered when the weights of its records sum to at least this: one record reaches it at e = 0.67.
const COVERED: f32 = 0.3;
/// Pixels around a candidate in which another can cover it, at the least radius and seen face on.
const NEIGHBORHOOD: usize = 3;

/// Times that new records are held against their neighbors.
const DOUBTS: usize = 3;

impl<R: Send + Sync> IrradianceCache<R> {
    /// Adds records until every pixel of the picture is covered and none is contradicted; returns how many. Those listed at the
    /// places `carried` may fit in no longer.
    pub(super) fn fill<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &SurfacePicture,
        tiles: &mut Tiles,
        carried: Vec<usize>,
        illumination: &I,
    ) -> usize {
        // Records that came here with a moving thing meet new neighbors, which may contradict them.
        let (first, first_place) = (self.records.len(), tiles.listed.len());
        if !carried.is_empty() {
            self.doubt(picture, tiles, &carried);
            tiles.list_again(picture, &self.records, 0);
        }

        // New records cover what is bare. Held against each other, some give up a part of that, which is bare again.
        let mut bare = vec![true; tiles.all.len()];
        for doubts_left in (0..=DOUBTS).rev() {
            let place = tiles.listed.len();
            self.cover(picture, tiles, &bare, illumination);
            if doubts_left == 0 || tiles.listed.len() == place {
                break;
            }
            // The newest are not yet known to fit in.
            self.doubt(picture, tiles, &Vec::from_iter(place..tiles.listed.len()));
            bare = tiles.list_again(picture, &self.records, place);
        }

        // All is covered. Pixels whose records still predict different things get one of their own, for its close surroundings.
        let unsettled: Vec<usize> = carried.into_iter().chain(first_place..tiles.listed.len()).collect();
        if !unsettled.is_empty() {
            let contradicted = contradicted_pixels(picture, tiles, &self.records, &unsettled);
            let new = self.make(picture, contradicted, illumination);
            for record in &mut self.records[new.clone()] {
                record.share = LEAST_SHARE;
            }
            tiles.list(picture, &self.records, new);
            // What no pixel takes light from is not known in the next frame, where the same is to come out.
            tiles.keep_used(picture, &self.records, first_place);
        }
        self.records.len() - first
    }

    /// Holds the records listed at these `places` against their neighbors.
    pub(super) fn doubt(&mut self, picture: &SurfacePicture, tiles: &Tiles, places: &[usize]) {
        let tolerances = Tolerances::of(tiles, &self.records);
        let found = predictions(picture, tiles, &self.records, places);
        for (&place, predicted) in places.iter().zip(found) {
            let record = &mut self.records[tiles.listed[place] as usize];
            record.share = record.share.min(tolerances.share(record, predicted.difference));
        }
    }

    /// Adds records until every pixel of the `bare` tiles is covered.
    ///
    /// Each pass finds the pixels of its lattice that the records of the passes before leave bare, and gives them records of
    /// their own, but for those that a neighbor of the same pass is certain to cover. So the last pass leaves none.
    fn cover<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &SurfacePicture,
        tiles: &mut Tiles,
        bare: &[bool],
        illumination: &I,
    ) {
        for step in STEPS {
            let pixels = bare_pixels(picture, tiles, bare, step);
            let new = self.make(picture, pixels, illumination);
            tiles.list(picture, &self.records, new);
        }
    }

    /// Makes records at those of `pixels` that no other of them is certain to cover. Returns their indices.
    fn make<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &SurfacePicture,
        pixels: Vec<(usize, usize)>,
        illumination: &I,
    ) -> Range<usize> {
        // Numbers follow the order of the sites, whichever rank and thread takes them.
        let sites = picture.busy.measure(|| thinned(picture, pixels));
        let (ranks, before, made) = (picture.ranks(), self.records.len(), self.made);
        let number = |place: usize| made.wrapping_add(place as u32);
        let turns: Vec<Turn> = (0..sites.len()).map(|place| Turn::Golden(number(place))).collect();

        // Light goes to all ranks; its recipe stays where it was computed.
        let mut recipes = Vec::new();
        let lights = share(ranks, &turns, |own, meter| {
            let compute = |scratch: &mut I::Scratch, &place: &usize| {
                let mut laps = meter.laps();
                let computed = picture.busy.measure(|| illumination.compute(&sites[place], scratch));
                laps.note(turns[place]);
                computed
            };
            let computed: Vec<Computed<R>> =
                own.par_iter().with_min_len(4).map_init(I::Scratch::default, compute).collect();
            let mut lights = Vec::with_capacity(computed.len());
            for Computed { light: estimate, recipe } in computed {
                lights.push(RecordLight { estimate, note: illumination.note(&recipe), afresh: true });
                recipes.push(recipe);
            }
            lights
        });
        let mut recipes = recipes.into_iter();
        for (place, (site, light)) in sites.iter().zip(lights).enumerate() {
            let scale = openness::scale(site, picture.seen);
            let mut record = Record::new(*site, scale, light, number(place), self.frame);
            if turns[place].owner(ranks.count()) == ranks.rank() {
                record.recipe = recipes.next();
            }
            self.records.push(record);
        }

        // A surface near to one record is near to its neighbors, too: their radii are clamped.
        self.made = number(sites.len());
        let among = self.parts.around();
        clamp_to_neighbors(&mut self.records, before, among, picture.busy);
        before..self.records.len()
    }
}

/// Pixels of the lattice of this step that no record covers, in raster order of the tiles that may be `bare` and within them.
fn bare_pixels(picture: &SurfacePicture, tiles: &Tiles, bare: &[bool], step: usize) -> Vec<(usize, usize)> {
    let in_tile = |index: usize| {
        let mut pixels = Vec::new();
        if !bare[index] {
            return pixels;
        }
        let on_lattice = |(x, y): (usize, usize)| x % step == step / 2 && y % step == step / 2;
        for (pixel, shown) in picture.pixels(index).zip(picture.shown(index)) {
            let counts = on_lattice(pixel) && shown.is_something();
            if counts && !tiles.all[index].is_covered(tiles.lanes, shown, COVERED) {
                pixels.push(pixel);
            }
        }
        pixels
    };
    let wanted = picture.wanted_tiles.par_iter();
    let pixels: Vec<Vec<(usize, usize)>> = wanted.map(|&index| picture.busy.measure(|| in_tile(index))).collect();
    pixels.concat()
}

/// The sites of `pixels`, without those that an earlier one covers whatever its radius turns out to be.
fn thinned(picture: &SurfacePicture, pixels: Vec<(usize, usize)>) -> Vec<Site> {
    // A record is made at the first pixel of each place, and marks it.
    let (width, height) = picture.size();
    let mut taken = Plane::filled(width, height, false);
    let mut sites = Vec::new();
    for (x, y) in pixels {
        let Some(site) = picture.site(x, y) else { continue };
        if !is_covered_by_taken(picture, &taken, x, y, &site) {
            taken.row_mut(y)[x] = true;
            sites.push(site);
        }
    }
    sites
}

/// Whether a record at one of the `taken` pixels around (x, y) is certain to cover the `site` there, even with the least radius.
fn is_covered_by_taken(picture: &SurfacePicture, taken: &Plane<bool>, x: usize, y: usize, site: &Site) -> bool {
    let (width, height) = picture.size();
    let around = |v: usize, end: usize| v.saturating_sub(NEIGHBORHOOD)..(v + NEIGHBORHOOD + 1).min(end);
    for v in around(y, height) {
        for u in around(x, width) {
            if taken.get(u, v) {
                let other = picture.site(u, v).expect("it was taken for having one");
                if weight_between(&other, least_radius(&other, &picture.seen.view), site) >= COVERED {
                    return true;
                }
            }
        }
    }
    false
}
