//! Placement of new records in a picture, coarse to fine.

use super::doubt::{LEAST_SHARE, Tolerances, contradicted_pixels};
use super::group::weight_between;
use super::illumination::{Computed, Illumination, Site};
use super::picture::SurfacePicture;
use super::predict::predict_each;
use super::record::{Record, RecordLight};
use super::spacing::{Spheres, clamp_to_neighbors, least_radius};
use super::tile::Tiles;
use super::{IrradianceCache, openness};
use crate::ranks::{Assignment, share};
use plane::Plane;
use rayon::prelude::*;
use std::ops::Range;

/// Steps of the pixel lattices, coarse to fine \[pixels\].
const STEPS: [usize; 5] = [16, 8, 4, 2, 1];
/// Minimum sum of weights at a covered pixel. A single record reaches it at e = 0.67.
const COVERED: f32 = 0.3;
/// Maximum distance at which a candidate with the least radius can cover another one, seen head-on \[pixels\].
const NEIGHBORHOOD: usize = 3;

/// Number of comparisons of new records with their neighbors.
const DOUBTS: usize = 3;

impl<R: Send + Sync> IrradianceCache<R> {
    /// Adds records until every pixel of the picture is covered and no pixel is contradicted. Returns the number of new
    /// records. The records listed at the positions `moved` have moved and may contradict their neighbors.
    pub(super) fn fill<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &SurfacePicture,
        tiles: &mut Tiles,
        moved: Vec<usize>,
        illumination: &I,
    ) -> usize {
        // Compare records attached to moving geometry with their new neighbors.
        let (first, first_place) = (self.records.len(), tiles.listed.len());
        if !moved.is_empty() {
            self.doubt(picture, tiles, &moved);
            tiles.list_again(picture, &self.records, 0);
        }

        // Add records in uncovered areas. Comparisons shrink some records, which uncovers area again.
        let mut bare = vec![true; tiles.all.len()];
        for doubts_left in (0..=DOUBTS).rev() {
            let place = tiles.listed.len();
            self.cover(picture, tiles, &bare, illumination);
            if illumination.is_discarded() {
                return self.records.len() - first;
            }
            if doubts_left == 0 || tiles.listed.len() == place {
                break;
            }
            // Compare the newest records with their neighbors.
            self.doubt(picture, tiles, &Vec::from_iter(place..tiles.listed.len()));
            bare = tiles.list_again(picture, &self.records, place);
        }

        // Add a small record at each pixel with contradictory predictions. All pixels are covered now.
        let unsettled: Vec<usize> = moved.into_iter().chain(first_place..tiles.listed.len()).collect();
        if !unsettled.is_empty() {
            let contradicted = contradicted_pixels(picture, tiles, &self.records, &unsettled);
            let new = self.make(picture, contradicted, illumination);
            for record in &mut self.records[new.clone()] {
                record.share = LEAST_SHARE;
            }
            tiles.list(picture, &self.records, new);
            // Drop records without weight at any pixel. The next frame ignores these records and must have an identical
            // result.
            tiles.keep_used(picture, &self.records, first_place);
        }
        self.spheres = None;
        self.records.len() - first
    }

    /// Compares the records listed at these `places` with their neighbors, and shrinks contradicted records.
    pub(super) fn doubt(&mut self, picture: &SurfacePicture, tiles: &Tiles, places: &[usize]) {
        let tolerances = Tolerances::of(tiles, &self.records);
        let differences = predict_each(picture, tiles, (&self.records, places), |_, found| found.difference);
        for (&place, difference) in places.iter().zip(differences) {
            let record = &mut self.records[tiles.listed[place] as usize];
            record.share = record.share.min(tolerances.share(record, difference));
        }
    }

    /// Adds records until every pixel of the `bare` tiles is covered.
    ///
    /// Each pass adds records at the uncovered pixels of its lattice. It skips pixels that a neighbor from this pass is
    /// certain to cover. After the last pass, all pixels are covered.
    fn cover<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &SurfacePicture,
        tiles: &mut Tiles,
        bare: &[bool],
        illumination: &I,
    ) {
        for step in STEPS {
            if illumination.is_discarded() {
                return;
            }
            let pixels = bare_pixels(picture, tiles, bare, step);
            let new = self.make(picture, pixels, illumination);
            tiles.list(picture, &self.records, new);
        }
    }

    /// Creates records at `pixels`, except at pixels that another new record is certain to cover. Returns the indices
    /// of the records.
    fn make<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &SurfacePicture,
        pixels: Vec<(usize, usize)>,
        illumination: &I,
    ) -> Range<usize> {
        // Number the records in the order of the sites, independently of ranks and threads.
        let sites = picture.busy.measure(|| thinned(picture, pixels));
        let (ranks, before, made) = (picture.ranks(), self.records.len(), self.made);
        let number = |place: usize| made.wrapping_add(place as u32);
        let assignments: Vec<Assignment> = (0..sites.len()).map(|place| Assignment::Golden(number(place))).collect();

        // Send the light to all ranks, but keep the recipe on the rank that computed it.
        let mut recipes = Vec::new();
        let lights = share(ranks, &assignments, |own, meter| {
            let compute = |scratch: &mut I::Scratch, &place: &usize| {
                let mut laps = meter.laps();
                let computed = picture.busy.measure(|| illumination.compute(&sites[place], scratch));
                laps.note(assignments[place]);
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

        // Create the records in order. Recipes follow the order of this rank's records.
        let mut recipes = recipes.into_iter();
        for (place, (site, light)) in sites.iter().zip(lights).enumerate() {
            let scale = openness::scale(site, picture.seen);
            let mut record = Record::new(*site, scale, light, number(place), self.frame);
            if assignments[place].owner(ranks.count()) == ranks.rank() {
                record.recipe = recipes.next();
            }
            self.records.push(record);
        }

        // Clamp the radii of neighbors, because a surface close to one record is close to its neighbors too.
        self.made = number(sites.len());
        let (older, new) = self.records.split_at_mut(before);
        if !new.is_empty() {
            let of_older = || match self.regions.around() {
                Some(around) => Spheres::of(around.iter().map(|&index| &older[index])),
                None => Spheres::of(older.iter()),
            };
            let spheres = self.spheres.get_or_insert_with(|| picture.busy.measure(of_older));
            clamp_to_neighbors(new, spheres, picture.busy);
        }
        before..self.records.len()
    }
}

/// Returns the uncovered pixels of the lattice with this `step`, in the tiles that may be `bare`. Tiles, and pixels
/// within a tile, are in raster order.
fn bare_pixels(picture: &SurfacePicture, tiles: &Tiles, bare: &[bool], step: usize) -> Vec<(usize, usize)> {
    let in_tile = |index: usize| {
        let mut pixels = Vec::new();
        let on_lattice = |(x, y): (usize, usize)| x % step == step / 2 && y % step == step / 2;
        for (pixel, shown) in picture.pixels(index).zip(picture.shown(index)) {
            let counts = on_lattice(pixel) && shown.is_something();
            if counts && !tiles.all[index].is_covered(tiles.lanes, shown, COVERED) {
                pixels.push(pixel);
            }
        }
        pixels
    };

    // Search tiles in parallel, and concatenate their pixels in raster order of tiles.
    let mut searched = picture.wanted_tiles.clone();
    searched.retain(|&index| bare[index]);
    picture.share_tiles(&searched, in_tile).concat()
}

/// Returns the sites of `pixels`, except sites that an earlier site is certain to cover.
fn thinned(picture: &SurfacePicture, pixels: Vec<(usize, usize)>) -> Vec<Site> {
    // Mark the first pixel at each position, which receives a record.
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

/// Returns whether a record at one of the `taken` pixels around (x, y) is certain to cover the `site` at (x, y). The
/// record is assumed to have the least radius.
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
