//! An MPEG-2 video encoder that uses motion supplied by its caller.
//!
//! It writes ISO/IEC 13818-2:2000 Main Profile, or ISO/IEC 11172-2:1993 ([`Standard`]). Pictures are progressive
//! 4:2:0 with 8 bits per sample, of type I, P or B. The quantiser is constant or follows a bit rate.
//! A [`Multiplexer`] wraps the coded pictures in a [`Container`].
//!
//! A [`Config`] makes an [`Encoder`], which accepts each [`Picture`] and, if known, the earlier positions of its pixels
//! ([`Correspondence`]). Each frame yields a [`Packet`], with the reconstruction that a decoder will show.
//!
//! With a look-ahead ([`Config::with_lookahead`]) the encoder waits for later frames before it codes one. This allows B
//! pictures, bit rates ([`Rate`]), and finer quantisers in areas from which later pictures are predicted.
//!
//! ```
//! use mpeg2enc::{Config, Correspondence, FrameRate, SuppliedMotion, Picture, Plane};
//!
//! let mut encoder = Config::new(64, 48, FrameRate::FPS_25).with_gop(12).with_quantiser_scale(6).encoder()?;
//! let mut stream = Vec::new();
//! for time in 0..10 {
//!     // A pattern that moves one pixel to the left per frame: its previous position is one pixel to the right.
//!     let luma = Plane::from_fn(64, 48, |x, y| (128.0 + 90.0 * ((x + time) as f32 * 0.4 + y as f32 * 0.1).sin()) as u8);
//!     let frame = Picture::new(luma, Plane::filled(32, 24, 110), Plane::filled(32, 24, 140))?;
//!     let motion = Correspondence::from_motion(Plane::filled(64, 48, [1.0, 0.0]));
//!     for packet in encoder.push(&frame, SuppliedMotion::from(&motion)) {
//!         assert!(packet.psnr_y > 35.0);
//!         stream.extend(packet.data);
//!     }
//! }
//! stream.extend(encoder.finish().end);
//! assert_eq!(stream[..4], [0, 0, 1, 0xb3]); // sequence_header_code: the stream is a valid .m2v file
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Only integer arithmetic over fixed slices determines the stream. The same frames therefore produce the same bits on every
//! processor and with any number of threads. The threads belong to the `rayon` pool in which `push` is called. Without the
//! feature `parallel`, the calling thread codes all slices. Clause and table numbers in this crate refer to the 2000 edition.
#![forbid(unsafe_code)]

#[macro_use]
mod kernel; // innermost loops: scalar and SIMD versions

mod aspect; // sample aspect ratio
mod color; // color description
mod config; // settings
mod effort; // computation per picture
mod error; // errors of settings
mod frame; // picture copies and their errors
mod frame_rate;
mod limits; // maximum values of settings
mod pool; // reusable picture memory
mod quantiser_scale;

mod pulldown; // 24 pictures/s shown as 30 frames/s

mod level; // limits of the Main Profile levels

mod encoder; // codes pictures immediately or after a look-ahead
mod restore; // errors of restored states

mod lookahead; // picture types and quantisers from waiting frames

mod container; // containers with timestamps
mod elementary; // parser of elementary streams

mod bounds; // level limits at a constant quantiser
mod coder; // codes one picture
mod rate; // bit rates
mod rate_control; // chooses quantisers for a bit rate
mod vbv; // decoder buffer
mod verifier; // checks buffer fullness over a stream

mod motion;
mod vector; // motion vectors

mod picture; // slices of a picture

mod decide; // mode decision: intra, inter or skipped
mod predict; // motion compensation

mod block;
mod dct;
mod quant; // quantisation and its inverse
mod trellis; // rate-distortion optimal levels

mod header; // syntax above the macroblock
mod macroblock; // syntax of a macroblock
mod vlc; // variable-length codes

mod bits;

pub use crate::{
    aspect::AspectRatio,
    coder::Packet,
    color::{ColorDescription, ColorPrimaries, MatrixCoefficients, TransferCharacteristics},
    config::Config,
    container::{AccessUnit, Container, Multiplexer},
    effort::Effort,
    elementary::{ElementaryStream, StreamError},
    encoder::{Encoder, EncoderState, Finish},
    error::ConfigError,
    frame::psnr,
    frame_rate::FrameRate,
    level::Level,
    motion::SuppliedMotion,
    picture::{MacroblockKind, PictureStatistics},
    quantiser_scale::{QuantiserScaleCode, quantiser_scale_code},
    rate::{Passes, Rate},
    restore::RestoreError,
    verifier::BufferVerifier,
    vlc::CoefficientTable,
};

/// Input types: pictures, planes and motion fields.
pub use plane::{Correspondence, NO_MATCH, Picture, PictureType, Plane};

pub use mpeg2::Standard;

pub use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
