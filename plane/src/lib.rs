//! Planes of samples, 8×8 blocks, and the one orthonormal 8×8 DCT that a masking model and an MPEG-2 encoder share.
//!
//! ```
//! use plane::Plane;
//! let ramp = Plane::from_fn(16, 16, |x, y| (x + y) as f32);
//! assert_eq!(ramp.get(3, 4), 7.0);
//! assert_eq!(ramp.block(1, 0)[0], 8.0);
//! ```
#![forbid(unsafe_code)]

mod plane;

pub use crate::plane::Plane;
