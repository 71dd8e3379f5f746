//! New records where a picture needs them, coarse to fine.

use super::record::{Illumination, Record, Site};
use super::spacing::{clamp_to_neighbours, least_radius};
use super::tile::{Tiles, weight_between};
use super::{IrradianceCache, Picture, openness};
use crate::Busy;
use rayon::prelude::*;

/// Steps of the lattices \[pixels\].
const STEPS: [usize; 5] = [16, 8, 4, 2, 1];
/// A pixel is covered when the weights of its records sum to at least this: one record reaches it at e = 0.67.
const COVERED: f32 = 0.3;
/// Pixels around a candidate in which another can cover it, at the least radius and seen face on.
const NEIGHBOURHOOD: usize = 3;

impl<R: Send + Sync> IrradianceCache<R> {
    /// Adds records until every pixel of the picture is covered; returns how many.
    ///
    /// Each pass asks which pixels of its lattice the records of the passes before leave bare, and gives them records of
    /// their own, but for those that a neighbour of the same pass is certain to cover. So the last pass leaves none.
    pub(super) fn fill<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &Picture,
        tiles: &mut Tiles,
        illumination: &I,
        busy: &Busy,
    ) -> usize {
        let first = self.records.len();
        for step in STEPS {
            let bare = bare_pixels(picture, tiles, step, busy);
            let sites = busy.measure(|| thinned(picture, bare));
            let before = self.records.len();
            let (frame, made) = (self.frame, self.made);
            let new: Vec<Record<R>> = sites
                .par_iter()
                .zip(made..made.wrapping_add(sites.len() as u32))
                .with_min_len(4)
                .map_init(I::Scratch::default, |scratch, (site, number)| {
                    let scale = openness::scale(site, picture.seen);
                    busy.measure(|| Record::new(*site, scale, illumination.compute(site, scratch), number, frame))
                })
                .collect();
            self.made = made.wrapping_add(new.len() as u32);
            self.records.extend(new);
            busy.measure(|| clamp_to_neighbours(&mut self.records, before));
            let added: Vec<usize> = (before..self.records.len()).collect();
            tiles.list(picture, &self.records, &added, busy);
        }
        self.records.len() - first
    }
}

/// Pixels of the lattice of this step that no record covers, in raster order of tiles and within them.
fn bare_pixels(picture: &Picture, tiles: &Tiles, step: usize, busy: &Busy) -> Vec<(usize, usize)> {
    let in_tile = |index: usize| {
        let (columns, rows) = picture.tile_area(index);
        let on_lattice = |v: &usize| v % step == step / 2;
        let mut bare = Vec::new();
        for y in rows.filter(on_lattice) {
            for x in columns.clone().filter(on_lattice) {
                let Some(site) = picture.site(x, y) else { continue };
                if !tiles.all[index].is_covered(tiles.lanes, &site, COVERED) {
                    bare.push((x, y));
                }
            }
        }
        bare
    };
    let bare: Vec<Vec<(usize, usize)>> =
        (0..tiles.all.len()).into_par_iter().map(|index| busy.measure(|| in_tile(index))).collect();
    bare.concat()
}

/// The sites of `pixels`, without those that an earlier one covers whatever its radius turns out to be.
fn thinned(picture: &Picture, pixels: Vec<(usize, usize)>) -> Vec<Site> {
    let (width, height) = picture.size();
    let mut taken = vec![false; width * height];
    let mut sites = Vec::new();
    for (x, y) in pixels {
        let Some(site) = picture.site(x, y) else { continue };
        let around = |v: usize, end: usize| v.saturating_sub(NEIGHBOURHOOD)..(v + NEIGHBOURHOOD + 1).min(end);
        let covered = around(y, height).any(|v| {
            around(x, width).filter(|&u| taken[v * width + u]).any(|u| {
                let other = picture.site(u, v).expect("it was taken for having one");
                weight_between(&other, least_radius(&other, &picture.seen.view), &site) >= COVERED
            })
        });
        if !covered {
            taken[y * width + x] = true;
            sites.push(site);
        }
    }
    sites
}
