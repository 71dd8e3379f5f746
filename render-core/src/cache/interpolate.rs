//! Light between records.

use super::Picture;
use super::record::Record;
use super::tile::Tiles;
use crate::Busy;
use glam::Vec3A;
use plane::Plane;
use rayon::prelude::*;

/// Irradiance of every pixel, and the records it came from, ascending.
pub(super) fn picture<R: Send + Sync>(
    picture: &Picture,
    tiles: &Tiles,
    records: &[Record<R>],
    busy: &Busy,
) -> (Plane<[f32; 3]>, Vec<usize>) {
    let (width, height) = picture.size();
    let lit: Vec<(Vec<[f32; 3]>, Vec<usize>)> = (0..tiles.all.len())
        .into_par_iter()
        .map(|index| busy.measure(|| tile(picture, tiles, index, records)))
        .collect();
    let mut plane = Plane::filled(width, height, [0.0; 3]);
    let mut used = Vec::new();
    for (index, (light, of_tile)) in lit.into_iter().enumerate() {
        let (columns, rows) = picture.tile_area(index);
        for (y, row) in rows.zip(light.chunks_exact(columns.len())) {
            plane.row_mut(y)[columns.clone()].copy_from_slice(row);
        }
        used.extend(of_tile);
    }
    used.sort_unstable();
    used.dedup();
    (plane, used)
}

fn tile<R>(picture: &Picture, tiles: &Tiles, index: usize, records: &[Record<R>]) -> (Vec<[f32; 3]>, Vec<usize>) {
    let tile = &tiles.all[index];
    let (columns, rows) = picture.tile_area(index);
    let mut used = vec![false; tile.records.len()];
    let mut light = Vec::with_capacity(columns.len() * rows.len());
    let mut weights = Vec::new();
    for y in rows {
        for x in columns.clone() {
            let Some(site) = picture.site(x, y) else {
                light.push([0.0; 3]);
                continue;
            };
            tile.weights(tiles.lanes, &site, &mut weights);
            let (mut sum, mut whole) = (Vec3A::ZERO, 0.0);
            for &(k, weight) in &weights {
                used[k] = true;
                let (record, trust) = tile.records[k];
                sum += records[record as usize].extrapolate(site.position, site.normal, trust) * weight;
                whole += weight;
            }
            light.push((sum / whole.max(f32::MIN_POSITIVE)).to_array());
        }
    }
    let used = tile.records.iter().zip(used).filter(|(_, used)| *used).map(|(&(record, _), _)| record as usize);
    (light, used.collect())
}
