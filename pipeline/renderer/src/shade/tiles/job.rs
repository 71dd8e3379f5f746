//! A tile's light, as one rank finds it.

use super::cut::Tile;
use crate::shade::layer::{Lit, PartSample, Visible};
use crate::shade::layers::Layers;
use crate::shade::lit_frame::Sample;
use crate::shade::tolerance::Tolerance;
use glam::Vec3;
use plane::Plane;
use ranks::portable;

/// The work on a picture, or on some of its samples, that ranks take tile by tile.
pub(super) struct Job<'a> {
    /// By sample, its surfaces and the pixels that have it.
    pub samples: Vec<(Visible<'a>, Plane<bool>)>,
    pub tolerance: &'a Tolerance<'a>,
    pub tiles: Vec<Tile>,
}

/// The light of a tile.
#[derive(Debug, PartialEq)]
pub(super) struct TileLight {
    /// Which tile.
    pub tile: u32,
    /// CPU time \[s\].
    pub seconds: f64,
    /// Records that pixels took light from, and that were computed.
    pub records_in_use: u64,
    pub records_computed: u64,
    /// Direct and indirect light of the pixels that have each sample, in raster order, sample by sample.
    pub light: Vec<(Vec3, Vec3)>,
}

portable!(TileLight { tile, seconds, records_in_use, records_computed, light });

impl Job<'_> {
    /// Lights a tile with a rank's own `layers`; adds times and counts of direct and of indirect light to `counts`.
    pub fn light(&self, tile: u32, layers: &mut Layers, counts: &mut [Lit; 2]) -> TileLight {
        let area = &self.tiles[tile as usize];
        let mut result = TileLight { tile, seconds: 0.0, records_in_use: 0, records_computed: 0, light: Vec::new() };
        let mut part = PartSample::First;
        for (visible, wanted) in &self.samples {
            // Pixels of the tile that have the sample.
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

            let visible = Visible { part: Some(part), ..*visible };
            let (light, lit) = layers.sample(&visible, Some(&own), self.tolerance);
            part = PartSample::Further;
            for (x, y) in pixels {
                result.light.push((light.direct.get(x, y), light.indirect.get(x, y)));
            }
            for (sum, lit) in counts.iter_mut().zip(lit) {
                result.seconds += lit.seconds;
                result.records_in_use = result.records_in_use.max(lit.records.in_use);
                result.records_computed += lit.records.computed;
                sum.add_counts(lit);
            }
        }
        result
    }

    /// Puts the light of a tile into pictures of the job's samples.
    ///
    /// # Panics
    /// If it is not that of all pixels of the tile.
    pub fn put(&self, lit: &TileLight, pictures: &mut [Sample]) {
        let area = &self.tiles[lit.tile as usize];
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
