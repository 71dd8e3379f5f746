//! Outgoing light of surfaces per texel and direction: representation, and storage in a fraction of the raw bytes.
//!
//! A [`Field`] contains raw samples: texels in tiles of 16×16 ([`TexelTiles`]), directions by index, three channels.
//! [`NearLossless`] stores them with a bounded error. Both implement [`LookUp`]. [`OctahedralMap`] maps directions to
//! indices. [`Harmonics`] represents the light around a point for the irradiance of any normal. [`CompactFit`] fits the
//! light of a texel in a form of fixed size for GPUs.
//!
//! ```
//! use lightfield::{Field, LookUp, NearLossless, Samples, Slot, TexelTiles};
//! let tiles = TexelTiles::of_picture(20, 10);
//! let field = Field::new(tiles, 2, Samples::Bytes((0..20 * 10 * 2 * 3).map(|k| (k / 6) as u8).collect()))?;
//! let stored = NearLossless::encode(&field, 2)?;
//! let (exact, found) = (field.codes(Slot(17), 1).unwrap(), stored.codes(Slot(17), 1).unwrap());
//! assert!((0..3).all(|c| (exact[c] - found[c]).abs() <= 2.0));
//! # Ok::<(), lightfield::FieldError>(())
//! ```
#![forbid(unsafe_code)]

mod compact;
mod error;
mod field;
mod harmonics;
mod look_up;
mod near_lossless;
mod octahedral;
mod packed;
mod scale;
mod tiles;

pub use crate::compact::{CompactFit, CompactKind, CompactMap, CompactPages, CompactPlace};
pub use crate::error::FieldError;
pub use crate::field::{Field, Samples};
pub use crate::harmonics::{Harmonics, basis};
pub use crate::look_up::LookUp;
pub use crate::near_lossless::NearLossless;
pub use crate::octahedral::{DirectionCells, OctahedralMap, map_side};
pub use crate::packed::{from_shared_exponent, shared_exponent};
pub use crate::scale::LogScale;
pub use crate::tiles::{Rank, Slot, TILE_SIDE, TILE_SLOTS, TexelTiles};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
