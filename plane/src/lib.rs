//! Planes of samples, 8×8 blocks, and the one orthonormal 8×8 DCT that a masking model and an MPEG-2 encoder share.
//!
//! ```
//! use plane::Plane;
//! let ramp = Plane::from_fn(16, 16, |x, y| (x + y) as f32);
//! assert_eq!(ramp.get(3, 4), 7.0);
//! let block = ramp.block(1, 0);
//! assert_eq!(block[0], 8.0);
//! let coefficients = plane::dct(&block);
//! assert!((coefficients[0] - 8.0 * 15.0).abs() < 1e-3, "the first coefficient is 8 × the mean");
//! ```
#![forbid(unsafe_code)]

mod dct;
mod plane;

pub use crate::dct::{dct, dct_definition, idct, idct_definition};
pub use crate::plane::Plane;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
