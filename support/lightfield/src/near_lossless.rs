//! Fields stored with an error that never exceeds a limit: prediction and quantization, then Zstandard, tile by tile.

mod file;
mod residuals;

use crate::error::{FieldError, LARGEST_DELTA};
use crate::field::{Field, Samples};
use crate::look_up::LookUp;
use crate::near_lossless::file::Head;
use crate::near_lossless::residuals::Code;
use crate::scale::LogScale;
use crate::tiles::{TILE_SLOTS, TexelTiles, count, rank_in};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Level of Zstandard: the highest below those that ask decoders for larger windows.
const LEVEL: i32 = 19;

/// A field whose codes are wrong by at most δ, stored by tiles of 16×16 texels.
///
/// A tile is decoded when one of its texels is looked up first, and kept. Any number of threads may look up at once.
#[derive(Clone, Debug)]
pub struct NearLossless {
    bytes: Vec<u8>,
    head: Head,
    decoded: Vec<OnceLock<Samples>>,
}

impl NearLossless {
    /// Stores a field with errors of at most `delta` codes; 0 loses nothing. The bytes do not depend on the number of
    /// threads.
    ///
    /// # Errors
    ///
    /// [`FieldError::Delta`] where `delta` is above 4095.
    pub fn encode(field: &Field, delta: u16) -> Result<Self, FieldError> {
        if delta > LARGEST_DELTA {
            return Err(FieldError::Delta(delta));
        }
        let stored: Vec<Vec<u8>> =
            (0..field.tiles().len()).into_par_iter().map(|tile| compressed(field, tile, delta)).collect();
        let head = Head {
            directions: field.directions(),
            scale: field.samples().scale(),
            delta,
            tiles: field.tiles().clone(),
            places: Vec::new(),
        };
        Self::from_bytes(file::write(&head, &stored))
    }

    /// Reads what [`NearLossless::as_bytes`] gave. Everything is checked: look-ups cannot fail later.
    ///
    /// # Errors
    ///
    /// Each kind of damage is told in one line. That of a tile names the tile.
    pub fn from_bytes(bytes: Vec<u8>) -> Result<Self, FieldError> {
        let head = file::read(&bytes)?;
        let decoded = (0..head.tiles.len()).map(|_| OnceLock::new()).collect();
        let field = Self { bytes, head, decoded };
        // Sums are right, but whoever forges a file makes them so: each tile must decompress to its length.
        let unfit = (0..field.head.tiles.len()).into_par_iter().find_first(|&tile| field.residuals(tile).is_none());
        unfit.map_or(Ok(field), |tile| Err(FieldError::Tile(tile)))
    }

    /// The stored bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The texels.
    #[must_use]
    pub fn tiles(&self) -> &TexelTiles {
        &self.head.tiles
    }

    /// Directions of each texel.
    #[must_use]
    pub fn directions(&self) -> usize {
        self.head.directions
    }

    /// The scale of logarithmic codes; `None` of 8-bit ones.
    #[must_use]
    pub fn scale(&self) -> Option<LogScale> {
        self.head.scale
    }

    /// The largest error of a code.
    #[must_use]
    pub fn delta(&self) -> u16 {
        self.head.delta
    }

    /// Gives back the memory of all tiles that were decoded.
    pub fn forget_decoded(&mut self) {
        self.decoded.iter_mut().for_each(|tile| drop(tile.take()));
    }

    /// The decompressed bytes of a tile; `None` unless they are as many as its texels take.
    fn residuals(&self, tile: usize) -> Option<Vec<u8>> {
        let bytes_of_code = if self.head.scale.is_some() { u16::BYTES } else { u8::BYTES };
        let length = count(&self.head.tiles.masks()[tile]) * self.head.directions * 3 * bytes_of_code;
        let stored = &self.bytes[self.head.places[tile]..self.head.places[tile + 1]];
        let residuals = zstd::bulk::decompress(stored, length).ok()?;
        (residuals.len() == length).then_some(residuals)
    }

    /// The codes of a tile.
    fn decode(&self, tile: usize) -> Samples {
        let Head { directions, scale, delta, ref tiles, .. } = self.head;
        let residuals = self.residuals(tile).expect("tiles are checked when they are read");
        let mask = &tiles.masks()[tile];
        match scale {
            None => Samples::Bytes(residuals::decode(&residuals, mask, directions, delta)),
            Some(scale) => {
                let codes = residuals::decode(&residuals, mask, directions, delta);
                Samples::Logarithmic { scale, codes }
            }
        }
    }
}

impl LookUp for NearLossless {
    #[inline]
    fn codes(&self, slot: usize, direction: usize) -> Option<[f32; 3]> {
        let Head { directions, ref tiles, .. } = self.head;
        let tile = slot / TILE_SLOTS;
        let rank = rank_in(tiles.masks().get(tile)?, slot % TILE_SLOTS).filter(|_| direction < directions)?;
        let samples = self.decoded[tile].get_or_init(|| self.decode(tile));
        Some(samples.three((rank * directions + direction) * 3))
    }
}

/// The stored bytes of one tile.
fn compressed(field: &Field, tile: usize, delta: u16) -> Vec<u8> {
    let (tiles, directions) = (field.tiles(), field.directions());
    let (ranks, mask) = (tiles.ranks(tile), &tiles.masks()[tile]);
    let own = ranks.start * directions * 3..ranks.end * directions * 3;
    let residuals = match field.samples() {
        Samples::Bytes(codes) => residuals::encode(&codes[own], mask, directions, delta),
        Samples::Logarithmic { codes, .. } => residuals::encode(&codes[own], mask, directions, delta),
    };
    zstd::bulk::compress(&residuals, LEVEL).expect("memory for a tile of residuals")
}
