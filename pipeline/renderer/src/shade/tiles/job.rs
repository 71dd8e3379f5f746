//! Light of a tile, computed by one rank.

use super::split::Tile;
use crate::shade::layer::{Lit, RegionSample, Visible};
use crate::shade::layers::Layers;
use crate::shade::sample::Sample;
use crate::shade::tolerance::Tolerance;
use glam::Vec3;
use plane::Plane;
use ranks::portable;

/// Work on some or all samples of a frame, which ranks perform tile by tile.
pub(super) struct Job<'a> {
    /// Surfaces of each sample, and the pixels that have the sample.
    pub samples: Vec<(Visible<'a>, Plane<bool>)>,
    pub tolerance: &'a Tolerance<'a>,
    pub tiles: Vec<Tile>,
}

/// Light of a tile, and the cost of computing it.
#[derive(Debug, PartialEq)]
pub(super) struct TileLight {
    /// Index of the tile.
    pub tile: u32,
    /// CPU time for the tile \[s\].
    pub seconds: f64,
    /// Number of records that the pixels use.
    pub records_in_use: u64,
    /// Number of records computed for the tile.
    pub records_computed: u64,
    /// Direct and indirect radiance of the tile's pixels \[W·m⁻²·sr⁻¹\], sample by sample, in raster order.
    pub light: Vec<(Vec3, Vec3)>,
}

portable!(TileLight { tile, seconds, records_in_use, records_computed, light });

impl Job<'_> {
    /// Lights a tile with a rank's own `layers`. Adds times and counts of direct and indirect light to `counts`.
    pub fn light(&self, tile: u32, layers: &mut Layers, counts: &mut [Lit; 2]) -> TileLight {
        let area = &self.tiles[tile as usize];
        let mut result = TileLight { tile, seconds: 0.0, records_in_use: 0, records_computed: 0, light: Vec::new() };
        let mut part = RegionSample::First;
        for (visible, wanted) in &self.samples {
            // Select the pixels of the tile that have the sample.
            let mut own = Plane::filled(wanted.width(), wanted.height(), false);
            let mut pixels = Vec::new();
            for (x, y) in area.places() {
                if wanted.get(x, y) {
                    own.row_mut(y)[x] = true;
                    pixels.push((x, y));
                }
            }
            if pixels.is_empty() {
                continue;
            }

            // Light the pixels of the sample; the first sample of a tile updates the cache.
            let visible = Visible { part: Some(part), ..*visible };
            let (light, lit) = layers.sample(&visible, Some(&own), self.tolerance);
            part = RegionSample::Further;
            for (x, y) in pixels {
                result.light.push((light.direct.get(x, y), light.indirect.get(x, y)));
            }
            // Keep the maximum number of records in use: samples of a pixel share records.
            for (sum, lit) in counts.iter_mut().zip(lit) {
                result.seconds += lit.seconds;
                result.records_in_use = result.records_in_use.max(lit.records.in_use);
                result.records_computed += lit.records.computed;
                sum.add_counts(lit);
            }
        }
        result
    }

    /// Copies the light of a tile into the frames of the job's samples.
    ///
    /// # Panics
    /// If `lit` contains light of too few pixels.
    pub fn put(&self, lit: &TileLight, pictures: &mut [Sample]) {
        let area = &self.tiles[lit.tile as usize];
        // Visit samples and pixels in the order in which `light` stored them.
        let mut light = lit.light.iter();
        for ((_, wanted), picture) in self.samples.iter().zip(pictures) {
            for (x, y) in area.places() {
                if wanted.get(x, y) {
                    let &(direct, indirect) = light.next().expect("a tile has light for each of its pixels");
                    picture.direct.row_mut(y)[x] = direct;
                    picture.indirect.row_mut(y)[x] = indirect;
                }
            }
        }
    }
}
