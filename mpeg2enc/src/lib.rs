//! An MPEG-2 video encoder that takes the motion it is given.
//!
//! It writes ISO/IEC 13818-2:2000 Main Profile, or ISO/IEC 11172-2:1993 ([`Standard`]): progressive 4:2:0 pictures of 8 bits,
//! I, P and B, at a constant quantiser or within a bit rate. A [`Multiplexer`] wraps them into program and transport streams.
//! Make an [`Encoder`] by a [`Config`], give it each [`Picture`], and where pixels were before if that is known
//! ([`Correspondence`]); each frame gives a [`Packet`], whose reconstruction is what a decoder will show.
//! With a look-ahead ([`Config::with_lookahead`]) it waits for later frames first: it has B pictures, quality that follows
//! what later pictures inherit, and [`Rate`]s.
//!
//! ```
//! use mpeg2enc::{Config, Correspondence, FrameRate, KnownMotion, Picture, Plane};
//!
//! let mut encoder = Config::new(64, 48, FrameRate::FPS_25).with_gop(12).with_quantiser_scale(6).encoder()?;
//! let mut stream = Vec::new();
//! for time in 0..10 {
//!     // A pattern that moves one pixel to the left in each frame: it was one pixel farther right before.
//!     let luma = Plane::from_fn(64, 48, |x, y| (128.0 + 90.0 * ((x + time) as f32 * 0.4 + y as f32 * 0.1).sin()) as u8);
//!     let frame = Picture::new(luma, Plane::filled(32, 24, 110), Plane::filled(32, 24, 140))?;
//!     let motion = Correspondence::from_motion(Plane::filled(64, 48, [1.0, 0.0]));
//!     for packet in encoder.push(&frame, KnownMotion::from(&motion)) {
//!         assert!(packet.psnr_y > 35.0);
//!         stream.extend(packet.data);
//!     }
//! }
//! stream.extend(encoder.finish().end);
//! assert_eq!(stream[..4], [0, 0, 1, 0xb3]); // sequence_header_code: the stream plays as an .m2v file
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! All that reaches the stream is integer arithmetic over fixed slices: the same frames give the same bits on every
//! processor and with any number of threads (those of the `rayon` pool that `push` is called in).
//! Numbers of clauses and tables in this crate are those of the edition of 2000.
#![forbid(unsafe_code)]

#[macro_use]
mod kernel; // innermost loops, twice: plain and with vector instructions

mod aspect; // shape of samples
mod color; // meaning of samples
mod config; // what to encode
mod effort; // how hard to try
mod error; // what cannot be encoded
mod frame; // copies of pictures and their errors
mod frame_rate;
mod limits; // the largest values of settings
mod pool; // memory of pictures
mod quantiser_scale;

mod pulldown; // 24 pictures a second in 30 frames
mod standard; // MPEG-1 or MPEG-2

mod level; // limits of Main Profile

mod encoder; // the way of a picture: at once, or after a look ahead
mod restore; // and on from a state

mod lookahead; // what waiting frames tell: types of pictures, quantisers

mod container; // streams with times
mod elementary; // streams that were written before

mod bounds; // the level that holds a stream
mod coder; // one picture
mod rate; // bounds of bits
mod rate_control; // the quantiser that keeps to them
mod vbv; // the buffer of a decoder
mod verifier; // which follows a stream

mod motion;
mod vector; // vectors: given, predicted, searched

mod picture; // slices

mod decide; // intra, inter, skipped
mod predict; // motion compensation

mod block;
mod dct;
mod quant; // levels and back
mod trellis; // which levels cost least

mod header; // syntax above the macroblock
mod macroblock; // syntax of a macroblock
mod scan;
mod vlc; // code words

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
    motion::KnownMotion,
    picture::{MacroblockKind, PictureStatistics},
    quantiser_scale::{QuantiserScaleCode, quantiser_scale_code},
    rate::{Passes, Rate},
    restore::RestoreError,
    standard::Standard,
    verifier::BufferVerifier,
    vlc::CoefficientTable,
};

/// Input: pictures, which also come back, their planes, and where their pixels were.
pub use plane::{Correspondence, NO_MATCH, Picture, PictureType, Plane};

pub use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
