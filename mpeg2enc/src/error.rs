//! Settings that cannot be encoded.

use crate::{
    Level,
    limits::{B_PICTURES_MAX, GROUP_MAX, LOOKAHEAD_MAX, SIZE_MAX},
};

/// Something in a [`Config`](crate::Config) that cannot be encoded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// Width or height out of range.
    #[error("a picture of {width}x{height} cannot be encoded; width and height go from 1 to {SIZE_MAX}")]
    Size {
        /// The requested width.
        width: usize,
        /// The requested height.
        height: usize,
    },
    /// No frame_rate_code says this rate.
    #[error("{fps} frames a second have no code in MPEG-2; use one of 23.976, 24, 25, 29.97, 30, 50, 59.94, 60")]
    FrameRate {
        /// The requested rate.
        fps: f64,
    },
    /// Only 24 pictures a second become 30 frames.
    #[error("{fps:.3} pictures a second have no pulldown; use it at 23.976 or 24, or leave it out")]
    Pulldown {
        /// The requested rate.
        fps: f64,
    },
    /// Distance of I pictures out of range.
    #[error("a group of {pictures} pictures is not allowed; the distance of I pictures goes from 1 to {GROUP_MAX}")]
    GroupOfPictures {
        /// The requested distance.
        pictures: u32,
    },
    /// More B pictures in a row than are allowed.
    #[error("{pictures} B pictures in a row are not allowed; use 0 to {B_PICTURES_MAX}")]
    BPictures {
        /// The requested number.
        pictures: u32,
    },
    /// Look-ahead out of range.
    #[error("a look-ahead of {frames} frames is not allowed; use 0 to {LOOKAHEAD_MAX}")]
    Lookahead {
        /// The number in the settings.
        frames: u32,
    },
    /// B pictures wait for later ones, and so do bit rates and means of quantisers.
    #[error(
        "B pictures, bit rates and mean quantisers need a look-ahead: Config::with_lookahead of {least} frames at least, not {frames}"
    )]
    NeedsLookahead {
        /// The look-ahead in the settings.
        frames: u32,
        /// The least that is enough.
        least: u32,
    },
    /// No stream can state this rate and buffer.
    #[error(
        "{bits_per_second} bits a second with a buffer of {buffer_bits} bits are not possible; at most {rate_max} and {buffer_max} are at {level:?} Level, and the buffer holds 16384 bits or more"
    )]
    Rate {
        /// Requested bits a second.
        bits_per_second: u32,
        /// The requested buffer.
        buffer_bits: u32,
        /// The most that the level allows.
        rate_max: u64,
        /// The largest buffer of the level.
        buffer_max: u64,
        /// The level.
        level: Level,
    },
    /// No picture is so small as this rate and buffer require.
    #[error(
        "{bits_per_second} bits a second with a buffer of {buffer_bits} bits hold no pictures of this size, which take {picture_bits} bits each at least; use {rate_least} bits a second and a buffer of {buffer_least} bits, or more"
    )]
    TooFewBits {
        /// Requested bits a second.
        bits_per_second: u32,
        /// The requested buffer.
        buffer_bits: u32,
        /// Bits of the smallest picture.
        picture_bits: u64,
        /// Bits a second of such pictures.
        rate_least: u64,
        /// The smallest buffer that holds one.
        buffer_least: u64,
    },
    /// A weight that a matrix may not have.
    #[error(
        "a weight of {value} at place {place} of a matrix is not allowed; weights are 1 to 255, the first intra weight is 8"
    )]
    Matrix {
        /// Place in raster order.
        place: usize,
        /// The weight.
        value: u8,
    },
    /// Neither table of quantiser_scale_code has the value.
    #[error("quantiser_scale {value} does not exist; nearest are {nearest} and {second}")]
    QuantiserScale {
        /// The requested value.
        value: u32,
        /// The nearest that exists.
        nearest: u32,
        /// The nearest but one.
        second: u32,
    },
    /// No profile has such a precision.
    #[error("an intra DC precision of {bits} bits does not exist; use 8 to 11")]
    IntraDcPrecision {
        /// The requested precision.
        bits: u32,
    },
    /// MPEG-1 does not have the requested feature.
    #[error("MPEG-1 does not have {what}: {remedy}")]
    NotInMpeg1 {
        /// The feature that it does not have.
        what: &'static str,
        /// The remedy.
        remedy: &'static str,
    },
    /// The requested level is too low.
    #[error(
        "{width}x{height} at {fps:.3} frames a second is beyond {level:?} Level; {}",
        match .lowest { Some(lowest) => format!("{lowest:?} Level or above holds it"), None => "no level holds it: leave the level out".into() }
    )]
    Level {
        /// The requested level.
        level: Level,
        /// The requested width.
        width: usize,
        /// The requested height.
        height: usize,
        /// The requested rate.
        fps: f64,
        /// The lowest level that is enough.
        lowest: Option<Level>,
    },
}
