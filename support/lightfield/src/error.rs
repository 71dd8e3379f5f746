//! Failures: each is one line that names the place and a remedy.

use crate::tiles::{TILE_SIDE, TILE_SLOTS};

/// Directions of a texel at most: a tile of them takes 6 MiB.
pub(crate) const MOST_DIRECTIONS: usize = 4096;
/// Tiles at most, so that slots are counted in 32 bits.
pub(crate) const MOST_TILES: usize = 1 << 24;
/// Largest error that can be asked for, in codes: of logarithmic codes a factor of 2¹⁶.
pub(crate) const LARGEST_DELTA: u16 = 4095;

/// Reason why samples are no field, or bytes no stored field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// The number of directions is 0 or too large.
    #[error("{0} directions a texel: expected 1 to {MOST_DIRECTIONS}")]
    Directions(usize),
    /// There are too many tiles.
    #[error("{0} tiles: expected at most {MOST_TILES}")]
    Tiles(usize),
    /// The number of samples is not texels × directions × 3.
    #[error("{found} samples: expected {expected}, three for each texel and direction")]
    Length {
        /// Samples that are there.
        found: usize,
        /// Samples that belong there.
        expected: usize,
    },
    /// A sample is negative, infinite, or no number.
    #[error("light of tile {}, texel ({}, {}), direction {direction} is {value}: expected a finite number of at least 0",
        slot / TILE_SLOTS, slot % TILE_SIDE, slot % TILE_SLOTS / TILE_SIDE)]
    Light {
        /// The texel, as 256 × tile + 16 y + x.
        slot: usize,
        /// The direction's number.
        direction: usize,
        /// The sample.
        value: f32,
    },
    /// The unit of logarithmic codes cannot be one.
    #[error("light of {0} as unit of logarithmic codes: expected a positive normal number")]
    Unit(f32),
    /// The largest error asked for is too large.
    #[error("an error of {0} codes: expected at most {LARGEST_DELTA}")]
    Delta(u16),
    /// The bytes do not begin like a stored field.
    #[error("these bytes are not a stored light field")]
    NotAField,
    /// The bytes are of another version.
    #[error("stored light field of version {0}, expected {expected}: store it again", expected = crate::error::VERSION)]
    Version(u32),
    /// The bytes before the tiles are cut short, changed, or do not fit together.
    #[error("the head of the stored light field is damaged: store it again")]
    Head,
    /// The bytes of a tile are changed, or not as many as the head says.
    #[error("tile {0} of the stored light field is damaged: store it again")]
    Tile(usize),
    /// Fewer or more bytes than the head says.
    #[error("the stored light field has {found} bytes, its head says {expected}: store it again")]
    Size {
        /// Bytes that are there.
        found: usize,
        /// Bytes by the head.
        expected: u64,
    },
}

/// Version of stored fields.
pub(crate) const VERSION: u32 = 1;
