//! Interpolation of light between records.

use super::picture::SurfacePicture;
use super::predict::Prediction;
use super::tile::Tiles;
use glam::Vec3A;
use plane::Plane;

/// Interpolates the irradiance of every pixel from the predictions of the listed records. Returns the irradiance and
/// the indices of the records used, ascending.
pub(super) fn picture(
    picture: &SurfacePicture,
    tiles: &Tiles,
    predicted: &[Prediction],
) -> (Plane<[f32; 3]>, Vec<usize>) {
    let (width, height) = picture.size();
    let light = |index| tile(picture, tiles, index, predicted);
    let lit: Vec<(Vec<[f32; 3]>, Vec<u32>)> = picture.share_tiles(&picture.wanted_tiles, light);

    // Copy the pixels of each tile into the picture, row by row.
    let mut plane = Plane::filled(width, height, [0.0; 3]);
    let mut used = Vec::new();
    for (&index, (light, of_tile)) in picture.wanted_tiles.iter().zip(lit) {
        let (columns, rows) = picture.tile_area(index);
        for (y, row) in rows.zip(light.chunks_exact(columns.len())) {
            plane.row_mut(y)[columns.clone()].copy_from_slice(row);
        }
        used.extend(of_tile);
    }
    (plane, tiles.records(used))
}

fn tile(picture: &SurfacePicture, tiles: &Tiles, index: usize, predicted: &[Prediction]) -> (Vec<[f32; 3]>, Vec<u32>) {
    // Mark the candidates that light any pixel.
    let tile = &tiles.all[index];
    let shown = picture.shown(index);
    let mut is_used = vec![false; tile.candidates.len()];
    let mut light = Vec::with_capacity(shown.len());
    let mut weights = Vec::new();
    for shown in shown {
        if !shown.is_something() {
            light.push([0.0; 3]);
            continue;
        }
        tile.weights(tiles.lanes, shown, &mut weights);

        // Compute E = Σ w E_i / Σ w over the records i.
        let (mut sum, mut whole) = (Vec3A::ZERO, 0.0);
        for &(k, weight) in &weights {
            is_used[k] = true;
            sum += predicted[tile.candidates[k] as usize].at(shown) * weight;
            whole += weight;
        }
        light.push((sum / whole.max(f32::MIN_POSITIVE)).to_array());
    }

    // Return the used candidates in their order in the tile.
    let mut candidates = Vec::new();
    for (&candidate, is_used) in tile.candidates.iter().zip(is_used) {
        if is_used {
            candidates.push(candidate);
        }
    }
    (light, candidates)
}
