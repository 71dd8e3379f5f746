//! Errors of light fields. Each message is one line with the location and a remedy.

use crate::tiles::{Slot, TILE_SIDE, TILE_SLOTS};

/// Maximum number of directions per texel. A tile with this number takes 6 MiB.
pub(crate) const MOST_DIRECTIONS: usize = 4096;
/// Maximum number of tiles, so that slots fit in 32 bits.
pub(crate) const MOST_TILES: usize = 1 << 24;
/// Largest allowed δ \[codes\]. For logarithmic codes, 4095 codes are a factor of 2¹⁶.
pub(crate) const LARGEST_DELTA: u16 = 4095;

/// Error for invalid samples or invalid bytes of a stored field.
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
        /// Actual number of samples.
        found: usize,
        /// Expected number of samples.
        expected: usize,
    },
    /// A sample is negative, infinite or NaN.
    #[error("light of tile {}, texel ({}, {}), direction {direction} is {value}: expected a finite number of at least 0",
        slot.0 / TILE_SLOTS, slot.0 % TILE_SIDE, slot.0 % TILE_SLOTS / TILE_SIDE)]
    Light {
        /// Slot of the texel: 256 × tile + 16 y + x.
        slot: Slot,
        /// Index of the direction.
        direction: usize,
        /// Value of the sample.
        value: f32,
    },
    /// The unit of logarithmic codes is not a positive normal number.
    #[error("light of {0} as unit of logarithmic codes: expected a positive normal number")]
    Unit(f32),
    /// The requested δ is too large.
    #[error("an error of {0} codes: expected at most {LARGEST_DELTA}")]
    Delta(u16),
    /// The bytes do not start like a stored field.
    #[error("these bytes are not a stored light field")]
    NotAField,
    /// The bytes have an unsupported version.
    #[error("stored light field of version {0}, expected {expected}: store it again", expected = crate::error::VERSION)]
    Version(u32),
    /// The header is truncated, changed or inconsistent.
    #[error("the head of the stored light field is damaged: store it again")]
    Head,
    /// The bytes of a tile are changed, or their length differs from the length in the header.
    #[error("tile {0} of the stored light field is damaged: store it again")]
    Tile(usize),
    /// The number of bytes differs from the number implied by the header.
    #[error("the stored light field has {found} bytes, its head says {expected}: store it again")]
    Size {
        /// Actual number of bytes.
        found: usize,
        /// Number of bytes implied by the header.
        expected: u64,
    },
}

/// Version of the file format.
pub(crate) const VERSION: u32 = 1;
