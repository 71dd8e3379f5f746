//! Records to trust less and pixels that need one of their own: those where predictions are contradicted.
//!
//! A record that its neighbors differ from answers for less of what is around it, and what it gives up is given records anew.
//! At last, a pixel whose records predict different things for it gets one. So records crowd where irradiance changes as nobody
//! foresaw, and are spared where it is smooth. No pixel gets one where records are dense already.

use super::picture::{ShownSurface, SurfacePicture};
use super::predict::{Predicted, predictions};
use super::record::Record;
use super::tile::{DENSE, Tile, Tiles};
use crate::luminance;
use rayon::prelude::*;

/// Difference from its neighbors from which on a record is doubted, in tolerances.
const DOUBTED: f32 = 1.65;
/// Root mean square of the differences between a pixel's predictions from which on it gets a record, in tolerances. In a
/// simulation of `nave` the same number of records leaves 3 % more error without. On the scene itself, 1.55 and 2.0 for this and
/// the one before need 3 % more records than 1.75 and 2.1, and leave 3 % less error.
const CONTRADICTED: f32 = 2.0;
/// Least share of its radius that a contradicted record keeps.
pub(super) const LEAST_SHARE: f32 = 0.25;
/// In the dark, differences count as if it were so bright: as a share of the mean tolerance.
const IN_THE_DARK: f32 = 0.5;

/// Differences that matter at a record: luminance of irradiance \[W·m⁻²\].
pub(super) struct Tolerances {
    /// Addend for the dark.
    floor: f32,
}

impl Tolerances {
    /// Tolerances of a picture with the listed records.
    pub fn of<R>(tiles: &Tiles, records: &[Record<R>]) -> Self {
        let sum: f64 = tiles.listed.iter().map(|&index| f64::from(records[index as usize].estimate.tolerance)).sum();
        Self { floor: IN_THE_DARK * (sum / tiles.listed.len().max(1) as f64) as f32 }
    }

    fn at<R>(&self, record: &Record<R>) -> f32 {
        record.estimate.tolerance + self.floor
    }

    /// How much of its radius a record keeps when its neighbors differ by `difference` from what it predicts.
    pub fn share<R>(&self, record: &Record<R>, difference: f32) -> f32 {
        let allowed = DOUBTED * self.at(record);
        if difference > allowed { (allowed / difference).max(LEAST_SHARE) } else { 1.0 }
    }
}

/// Pixels for which records predict different things, in the tiles that one of the records listed at these `places` reaches.
pub(super) fn contradicted_pixels<R: Send + Sync>(
    picture: &SurfacePicture,
    tiles: &Tiles,
    records: &[Record<R>],
    places: &[usize],
) -> Vec<(usize, usize)> {
    // Tiles that none of these records reaches are passed over.
    let mut is_chosen = vec![false; tiles.listed.len()];
    for &place in places {
        is_chosen[place] = true;
    }
    let is_reached = |tile: &Tile| tile.candidates.iter().any(|&place| is_chosen[place as usize]);
    let wanted = picture.wanted_tiles.iter().copied();
    let chosen: Vec<usize> = wanted.filter(|&index| is_reached(&tiles.all[index])).collect();

    // Predictions of all the records that count there, each found once.
    let mut candidates = tiles.used_in(picture, &chosen);
    candidates.sort_unstable();
    candidates.dedup();
    let predicted =
        predictions(picture, tiles, records, &Vec::from_iter(candidates.iter().map(|&place| place as usize)));

    // They stand in the order of `candidates`; tiles look them up by place.
    let mut number = vec![0; tiles.listed.len()];
    for (k, &place) in candidates.iter().enumerate() {
        number[place as usize] = k;
    }
    let opinions = Opinions { tiles, records, tolerances: Tolerances::of(tiles, records), predicted, number };

    let in_tile = |&index: &usize| picture.busy.measure(|| opinions.contradicted_in(picture, index));
    let pixels: Vec<Vec<(usize, usize)>> = chosen.par_iter().map(in_tile).collect();
    pixels.concat()
}

/// Predictions of records for the pixels around them.
struct Opinions<'a, R> {
    tiles: &'a Tiles,
    records: &'a [Record<R>],
    tolerances: Tolerances,
    predicted: Vec<Predicted>,
    /// By the place of a record in the list, where its prediction is in `predicted`.
    number: Vec<usize>,
}

impl<R> Opinions<'_, R> {
    /// Pixels of a tile for which its records predict different things.
    fn contradicted_in(&self, picture: &SurfacePicture, index: usize) -> Vec<(usize, usize)> {
        let tile = &self.tiles.all[index];
        let (mut contradicted, mut weights) = (Vec::new(), Vec::new());
        for (pixel, shown) in picture.pixels(index).zip(picture.shown(index)) {
            if shown.is_something() {
                tile.weights(self.tiles.lanes, shown, &mut weights);
                if self.are_contradictory(tile, shown, &weights) {
                    contradicted.push(pixel);
                }
            }
        }
        contradicted
    }

    /// Whether the candidates of `tile` with these `weights` at a pixel predict different things for it.
    fn are_contradictory(&self, tile: &Tile, shown: &ShownSurface, weights: &[(usize, f32)]) -> bool {
        // Σ w, Σ w v, Σ w v² of the luminances v that are predicted, and Σ w t of the tolerances t.
        let (mut whole, mut sum, mut squares, mut tolerance) = (0.0, 0.0, 0.0, 0.0);
        for &(k, weight) in weights {
            let place = tile.candidates[k] as usize;
            let light = luminance(self.predicted[self.number[place]].prediction.at(shown).into());
            whole += weight;
            sum += weight * light;
            squares += weight * light * light;
            tolerance += weight * self.tolerances.at(&self.records[self.tiles.listed[place] as usize]);
        }

        // Where records are dense, more of them would not settle it.
        if whole >= DENSE {
            return false;
        }

        // σ² = (Σ w v² − (Σ w v)² / Σ w) / Σ w  >  (CONTRADICTED · mean of t)²
        let variance = (squares - sum * sum / whole) / whole;
        variance > (CONTRADICTED * tolerance / whole).powi(2)
    }
}
