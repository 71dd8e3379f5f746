//! Planes of samples, 4:2:0 pictures, pixel correspondences and the orthonormal 8×8 DCT, shared by a renderer, a
//! masking model and an MPEG-2 encoder.
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

mod coded;
mod correspondence;
mod dct;
mod frame_header;
mod luminance;
pub mod matrices;
mod picture;
mod picture_type;
mod plane;
mod rgb;
mod size_error;

pub use crate::coded::Coded;
pub use crate::correspondence::{Correspondence, NO_MATCH};
pub use crate::dct::{dct, dct_definition, idct, idct_definition};
pub use crate::frame_header::{FrameCamera, FrameChannel, FrameHeader, FramePlace, HeaderText, SampleDepth};
pub use crate::luminance::{LUMINANCE_WEIGHTS, luminance};
pub use crate::picture::Picture;
pub use crate::picture_type::PictureType;
pub use crate::plane::Plane;
pub use crate::size_error::SizeError;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
