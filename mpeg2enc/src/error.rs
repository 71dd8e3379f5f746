//! Errors of settings.

use crate::{
    Level,
    limits::{B_PICTURES_MAX, GROUP_MAX, LOOKAHEAD_MAX, SIZE_MAX},
};

/// A setting in a [`Config`](crate::Config) that cannot be encoded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// Width or height is out of range.
    #[error("a picture of {width}x{height} cannot be encoded; width and height must be 1 to {SIZE_MAX}")]
    Size {
        /// Requested width in luma samples.
        width: usize,
        /// Requested height in luma samples.
        height: usize,
    },
    /// No frame_rate_code exists for this rate.
    #[error("MPEG-2 has no code for {fps} frames a second; use 23.976, 24, 25, 29.97, 30, 50, 59.94 or 60")]
    FrameRate {
        /// Requested frames per second.
        fps: f64,
    },
    /// Pulldown requires 23.976 or 24 pictures per second.
    #[error("pulldown needs 23.976 or 24 pictures a second, not {fps:.3}; change the rate or omit pulldown")]
    Pulldown {
        /// Requested pictures per second.
        fps: f64,
    },
    /// The distance between I pictures is out of range.
    #[error("a group of {pictures} pictures is not allowed; the distance between I pictures must be 1 to {GROUP_MAX}")]
    GroupOfPictures {
        /// Requested distance in pictures.
        pictures: u32,
    },
    /// Too many consecutive B pictures.
    #[error("{pictures} consecutive B pictures are not allowed; use 0 to {B_PICTURES_MAX}")]
    BPictures {
        /// Requested number of consecutive B pictures.
        pictures: u32,
    },
    /// The look-ahead is out of range.
    #[error("a look-ahead of {frames} frames is not allowed; use 0 to {LOOKAHEAD_MAX}")]
    Lookahead {
        /// Requested look-ahead in frames.
        frames: u32,
    },
    /// The look-ahead is too short for B pictures, a bit rate or a mean quantiser.
    #[error(
        "B pictures, bit rates and mean quantisers need a look-ahead of at least {least} frames, not {frames}; see with_lookahead"
    )]
    NeedsLookahead {
        /// Requested look-ahead in frames.
        frames: u32,
        /// Minimum look-ahead in frames.
        least: u32,
    },
    /// The level does not allow this rate and buffer size.
    #[error(
        "{bits_per_second} bits a second with a buffer of {buffer_bits} bits are not possible; {level:?} Level allows at most {rate_max} bits a second and a buffer of 16384 to {buffer_max} bits"
    )]
    Rate {
        /// Requested bits per second.
        bits_per_second: u32,
        /// Requested buffer size in bits.
        buffer_bits: u32,
        /// Maximum bits per second of the level.
        rate_max: u64,
        /// Maximum buffer size of the level, in bits.
        buffer_max: u64,
        /// Level of the stream.
        level: Level,
    },
    /// The rate or the buffer is too small for even the smallest pictures.
    #[error(
        "{bits_per_second} bits a second with a buffer of {buffer_bits} bits are too few for pictures of this size, which take at least {picture_bits} bits each; use {rate_least} bits a second and a buffer of {buffer_least} bits, or more"
    )]
    TooFewBits {
        /// Requested bits per second.
        bits_per_second: u32,
        /// Requested buffer size in bits.
        buffer_bits: u32,
        /// Minimum bits of a picture.
        picture_bits: u64,
        /// Minimum bits per second.
        rate_least: u64,
        /// Minimum buffer size in bits.
        buffer_least: u64,
    },
    /// A weight in a matrix is not allowed.
    #[error(
        "a weight of {value} at index {place} of a matrix is not allowed; use 1 to 255, and 8 for the first intra weight"
    )]
    Matrix {
        /// Index in raster order.
        place: usize,
        /// Requested weight.
        value: u8,
    },
    /// Neither table of quantiser_scale_code contains the value.
    #[error("quantiser_scale {value} does not exist; the nearest values are {nearest} and {second}")]
    QuantiserScale {
        /// Requested value.
        value: u32,
        /// Nearest existing value.
        nearest: u32,
        /// Second nearest existing value.
        second: u32,
    },
    /// No profile has this intra DC precision.
    #[error("an intra DC precision of {bits} bits does not exist; use 8 to 11")]
    IntraDcPrecision {
        /// Requested precision in bits.
        bits: u32,
    },
    /// MPEG-1 lacks a requested feature.
    #[error("MPEG-1 does not have {what}: {remedy}")]
    NotInMpeg1 {
        /// Name of the feature.
        what: &'static str,
        /// Suggested change of settings.
        remedy: &'static str,
    },
    /// The requested level is too low.
    #[error(
        "{width}x{height} at {fps:.3} frames a second exceeds {level:?} Level; {}",
        match .lowest { Some(lowest) => format!("use {lowest:?} Level or above"), None => "no level allows it, so omit the level".into() }
    )]
    Level {
        /// Requested level.
        level: Level,
        /// Requested width in luma samples.
        width: usize,
        /// Requested height in luma samples.
        height: usize,
        /// Requested frames per second.
        fps: f64,
        /// Lowest sufficient level; `None` if no level is.
        lowest: Option<Level>,
    },
}
