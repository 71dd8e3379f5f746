//! A streaming decoder of MPEG-1 and MPEG-2 video (ISO/IEC 11172-2:1993, 13818-2:2000) in safe Rust.
//!
//! [`Input`] accepts elementary, program and transport streams. [`Decoder`] accepts elementary streams, and [`Demuxer`] extracts
//! them from containers. Each one takes bytes in pieces of any size and passes pictures to a function as soon as they are
//! complete.
//!
//! ```
//! use mpeg2dec::{Input, SampleComponent};
//!
//! let mut input = Input::default();
//! let mut brightness = Vec::new();
//! let mut show = |picture: mpeg2dec::DecodedPicture| {
//!     let luma = picture.plane(SampleComponent::Y);
//!     let sum: u64 = luma.rows().flatten().map(|&sample| u64::from(sample)).sum();
//!     brightness.push(sum / (luma.width * luma.height) as u64);
//! };
//! input.push(include_bytes!("../tests/data/small.m2v"), &mut show);
//! input.flush(&mut show);
//! assert_eq!(brightness.len(), 6);
//! ```
//!
//! - Profiles: Main and 4:2:2 profile tools, and 4:4:4, without scalability. MPEG-1 with D pictures.
//! - Samples of steady streams are decoded without allocation. Memory is bounded for any input.
//! - Invalid data does not panic. Damaged slices are concealed by motion-compensated samples of a reference, and counted.
//! - The inverse transform equals that of `mpeg2enc` in all bits, on every processor.
//!
//! Clause and table numbers in this crate refer to ISO/IEC 13818-2:2000 unless they begin with another number.
#![forbid(unsafe_code)]

mod bits; // bit reader
mod lookup; // decoding tables

mod coefficients; // coefficients of a block
mod vectors; // motion vectors

mod captions; // closed captions
mod header; // picture headers
mod sequence; // sequence headers
mod units; // start codes

mod frame; // frame memory
mod kernel; // half-sample prediction
mod predict; // prediction of blocks
mod progress; // decoded macroblocks
mod residual; // inverse transform of blocks

mod coding; // parameters of a picture
mod compensate; // kinds of motion compensation
mod conceal; // missing macroblocks
mod slice; // slices and macroblocks

mod decoder; // elementary streams
mod picture; // decoded pictures

mod container; // program and transport streams
mod input; // streams of any kind

pub mod web; // files of the npm package

pub use crate::{
    captions::{CaptionPair, Captions},
    container::{DemuxedData, Demuxer, StreamFormat},
    decoder::{Decoder, DecoderCounts, DecoderOptions},
    input::Input,
    picture::{DecodedPicture, PictureDamage, PictureFlags, SampleComponent, SamplePlane},
    sequence::{ChromaFormat, ColorCodes, Sequence},
};

pub use mpeg2::Standard;
pub use plane::PictureType;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
