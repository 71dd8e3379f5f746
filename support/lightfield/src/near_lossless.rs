//! Near-lossless coding of fields with a bounded error: prediction, quantization and Zstandard, separately for each
//! tile.

mod file;
mod residuals;

use crate::error::{FieldError, LARGEST_DELTA};
use crate::field::{Field, Samples};
use crate::look_up::LookUp;
use crate::near_lossless::file::Head;
use crate::near_lossless::residuals::Code;
use crate::scale::LogScale;
use crate::tiles::{Slot, TILE_SLOTS, TexelTiles, count, rank_in};
use std::sync::OnceLock;
use threads::prelude::*;

/// Zstandard level: the highest below the levels that require larger decoder windows.
const LEVEL: i32 = 19;

/// A field stored in tiles of 16×16 texels, with an error of at most δ per code.
///
/// A tile is decoded on first access and then cached. Any number of threads may read concurrently.
#[derive(Clone, Debug)]
pub struct NearLossless {
    bytes: Vec<u8>,
    head: Head,
    decoded: Vec<OnceLock<Samples>>,
}

impl NearLossless {
    /// Encodes a field with errors of at most `delta` codes. With 0, the coding is lossless. The bytes do not depend on
    /// the number of threads.
    ///
    /// # Errors
    ///
    /// [`FieldError::Delta`] if `delta` is above 4095.
    pub fn encode(field: &Field, delta: u16) -> Result<Self, FieldError> {
        if delta > LARGEST_DELTA {
            return Err(FieldError::Delta(delta));
        }
        // Compress the tiles in parallel, in the order of the file.
        let stored: Vec<Vec<u8>> =
            (0..field.tiles().len()).into_par_iter().map(|tile| compressed(field, tile, delta)).collect();
        let head = Head {
            directions: field.directions(),
            scale: field.samples().scale(),
            delta,
            tiles: field.tiles().clone(),
            places: Vec::new(),
        };
        // Read the file back, so that new and loaded fields pass the same checks.
        Self::from_bytes(file::write(&head, &stored))
    }

    /// Reads the bytes of [`NearLossless::as_bytes`]. Validates all of them, so that later reads cannot fail.
    ///
    /// # Errors
    ///
    /// If the bytes are damaged. The error describes the damage in one line and names a damaged tile.
    pub fn from_bytes(bytes: Vec<u8>) -> Result<Self, FieldError> {
        let head = file::read(&bytes)?;
        let decoded = (0..head.tiles.len()).map(|_| OnceLock::new()).collect();
        let field = Self { bytes, head, decoded };
        // A forger can compute correct checksums. Check that each tile also decompresses to its length.
        let unfit = (0..field.head.tiles.len()).into_par_iter().find_first(|&tile| field.residuals(tile).is_none());
        unfit.map_or(Ok(field), |tile| Err(FieldError::Tile(tile)))
    }

    /// Bytes of the stored field.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Texels of the field.
    #[must_use]
    pub fn tiles(&self) -> &TexelTiles {
        &self.head.tiles
    }

    /// Number of directions per texel.
    #[must_use]
    pub fn directions(&self) -> usize {
        self.head.directions
    }

    /// Largest allowed error δ \[codes\].
    #[must_use]
    pub fn delta(&self) -> u16 {
        self.head.delta
    }

    /// Frees the memory of all decoded tiles.
    pub fn forget_decoded(&mut self) {
        self.decoded.iter_mut().for_each(|tile| drop(tile.take()));
    }

    /// Decompresses a tile. Returns `None` if the length does not match its texels.
    fn residuals(&self, tile: usize) -> Option<Vec<u8>> {
        let bytes_of_code = if self.head.scale.is_some() { u16::BYTES } else { u8::BYTES };
        let length = count(&self.head.tiles.masks()[tile]) * self.head.directions * 3 * bytes_of_code;
        // Limit decompression to the expected length, because forged data may expand without bound.
        let stored = &self.bytes[self.head.places[tile]..self.head.places[tile + 1]];
        let residuals = zstd::bulk::decompress(stored, length).ok()?;
        (residuals.len() == length).then_some(residuals)
    }

    /// Decodes a tile.
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
    fn codes(&self, Slot(slot): Slot, direction: usize) -> Option<[f32; 3]> {
        let Head { directions, ref tiles, .. } = self.head;
        let tile = slot / TILE_SLOTS;
        let rank = rank_in(tiles.masks().get(tile)?, slot % TILE_SLOTS).filter(|_| direction < directions)?;
        // Decode the tile on first access.
        let samples = self.decoded[tile].get_or_init(|| self.decode(tile));
        Some(samples.three((rank * directions + direction) * 3))
    }

    fn scale(&self) -> Option<LogScale> {
        self.head.scale
    }
}

/// Compresses one tile.
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
