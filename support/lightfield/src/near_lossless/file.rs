//! File format of a stored field.
//!
//! ```text
//! "R2LF"  version (u32)  directions (u32)  kind: 0 bytes, 1 logarithmic (u16)  δ (u16)  L₀ (f32, 0 for bytes)
//! tiles (u32)  for each tile: mask (32 bytes), length (u32), CRC-32 (u32) of its bytes
//! CRC-32 (u32) of all bytes before it; then the bytes of the tiles, each a Zstandard frame   all little-endian
//! ```

use crate::error::{FieldError, LARGEST_DELTA, MOST_DIRECTIONS, MOST_TILES, VERSION};
use crate::scale::LogScale;
use crate::tiles::{Mask, TexelTiles};

const MAGIC: [u8; 4] = *b"R2LF";
/// Number of bytes before the list of tiles.
const START: usize = 24;
/// Number of bytes per tile in the list.
const ENTRY: usize = 40;

/// File header: everything before the tile data.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Head {
    pub directions: usize,
    /// Scale of logarithmic codes, or `None` for 8-bit codes.
    pub scale: Option<LogScale>,
    pub delta: u16,
    pub tiles: TexelTiles,
    /// Start of each tile's bytes, then the end of the last tile \[bytes\].
    pub places: Vec<usize>,
}

/// Reader that removes little-endian fields from the front of its bytes.
struct NumberReader<'a>(&'a [u8]);

impl NumberReader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], FieldError> {
        let (first, rest) = self.0.split_first_chunk().ok_or(FieldError::Head)?;
        self.0 = rest;
        Ok(*first)
    }

    fn u32(&mut self) -> Result<u32, FieldError> {
        self.take().map(u32::from_le_bytes)
    }

    fn u16(&mut self) -> Result<u16, FieldError> {
        self.take().map(u16::from_le_bytes)
    }

    fn mask(&mut self) -> Result<Mask, FieldError> {
        let mut mask = [0; 4];
        for word in &mut mask {
            *word = u64::from_le_bytes(self.take()?);
        }
        Ok(mask)
    }
}

/// Assembles the whole file from the header and the bytes of the tiles. Ignores `head.places`.
pub(crate) fn write(head: &Head, tiles: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((head.directions as u32).to_le_bytes());
    bytes.extend(u16::from(head.scale.is_some()).to_le_bytes());
    bytes.extend(head.delta.to_le_bytes());
    bytes.extend(head.scale.map_or(0.0, LogScale::unit).to_le_bytes());
    bytes.extend((tiles.len() as u32).to_le_bytes());
    // List all tiles before their bytes, so that a reader checks all sizes first.
    for (mask, tile) in head.tiles.masks().iter().zip(tiles) {
        mask.iter().for_each(|word| bytes.extend(word.to_le_bytes()));
        bytes.extend((tile.len() as u32).to_le_bytes());
        bytes.extend(crc32fast::hash(tile).to_le_bytes());
    }
    // Append the checksum of header and list, then the tiles.
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes.reserve_exact(tiles.iter().map(Vec::len).sum());
    tiles.iter().for_each(|tile| bytes.extend(tile));
    bytes
}

/// Reads the header and compares it with all bytes of the file. Allocates no more memory than the size of the file.
pub(crate) fn read(bytes: &[u8]) -> Result<Head, FieldError> {
    // Reject other file types and versions before the checksum.
    let mut reader = NumberReader(bytes);
    if reader.take() != Ok(MAGIC) {
        return Err(FieldError::NotAField);
    }
    let version = reader.u32()?;
    if version != VERSION {
        return Err(FieldError::Version(version));
    }
    let (directions, kind, delta) = (reader.u32()? as usize, reader.u16()?, reader.u16()?);
    let (unit, tiles) = (f32::from_le_bytes(reader.take()?), reader.u32()? as usize);

    // Check the length and the checksum of the list.
    let list = reader.0.get(..tiles.min(MOST_TILES + 1) * ENTRY).ok_or(FieldError::Head)?;
    let end = START + list.len();
    let mut sum = NumberReader(&bytes[end..]);
    let scale = if kind == 0 { None } else { Some(LogScale::new(unit).map_err(|_| FieldError::Head)?) };
    let fits = (1..=MOST_DIRECTIONS).contains(&directions) && kind <= 1 && delta <= LARGEST_DELTA;
    if sum.u32()? != crc32fast::hash(&bytes[..end]) || !fits || tiles > MOST_TILES {
        return Err(FieldError::Head);
    }

    // Check that the tiles fill the remaining bytes.
    let (mut masks, mut lengths, mut sums) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..tiles {
        masks.push(reader.mask()?);
        lengths.push(reader.u32()? as usize);
        sums.push(reader.u32()?);
    }
    let expected = lengths.iter().fold(end as u64 + 4, |sum, &length| sum + length as u64);
    if expected != bytes.len() as u64 {
        return Err(FieldError::Size { found: bytes.len(), expected });
    }
    // Check each tile and record its position.
    let mut places = vec![end + 4];
    for (tile, (&length, &sum)) in lengths.iter().zip(&sums).enumerate() {
        let (from, to) = (places[tile], places[tile] + length);
        if crc32fast::hash(&bytes[from..to]) != sum {
            return Err(FieldError::Tile(tile));
        }
        places.push(to);
    }
    Ok(Head { directions, scale, delta, tiles: TexelTiles::new(masks), places })
}
