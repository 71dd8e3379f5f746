//! Description of a container's video, for the headers of the container.

use super::{clock::CLOCK, pes::StreamPicture};
use crate::{ColorDescription, Config, Standard, header::GROUP_START_CODE};

/// Properties of a file's video, for its headers.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Description {
    /// Width in luma samples.
    pub width: u32,
    /// Height in lines.
    pub height: u32,
    /// Coded width and height, which may exceed the displayed size.
    pub coded: (u32, u32),
    /// Width and height of a sample, as a ratio.
    pub sample: (u32, u32),
    /// Color description; `None` for MPEG-1, which has none.
    pub color: Option<ColorDescription>,
    /// Standard that the stream follows.
    pub standard: Standard,
    /// Whether the stream needs a decoder of High Profile.
    pub is_high: bool,
    /// Numerator and denominator of the frame rate.
    pub frame_rate: (u64, u64),
    /// Size of the decoder's buffer, in bytes.
    pub buffer: u32,
    /// Bits per second, if the stream has a bounded rate.
    pub bit_rate: u32,
    /// Number of pictures, if known in advance.
    pub pictures: Option<u64>,
}

impl Description {
    /// Describes a stream with these settings.
    pub fn new(config: &Config) -> Self {
        let (bit_rate, buffer_size) = config.stated_rate();
        let (numerator, denominator) = config.frame_rate.fraction();
        Self {
            width: config.width as u32,
            height: config.height as u32,
            coded: config.coded_size(),
            sample: sample(config),
            color: (config.standard == Standard::Mpeg2).then_some(config.color),
            standard: config.standard,
            is_high: config.intra_dc_precision > 10,
            frame_rate: (numerator.into(), denominator.into()),
            buffer: buffer_size.saturating_mul(2048),
            bit_rate: config.rate.stated().map_or(0, |_| bit_rate.saturating_mul(400)),
            pictures: None,
        }
    }

    /// Returns the width of the picture in square samples, rounded.
    pub fn display_width(&self) -> u32 {
        let (width, height) = self.sample;
        (f64::from(self.width) * f64::from(width) / f64::from(height)).round() as u32
    }

    /// Returns the duration of a picture, in units of 1/27 000 000 s.
    pub fn period(&self) -> u64 {
        let (numerator, denominator) = self.frame_rate;
        CLOCK * denominator / numerator
    }
}

/// Returns the width and height of a sample, as a ratio.
fn sample(config: &Config) -> (u32, u32) {
    let Some((wide, high)) = config.aspect.of_display() else { return (1, 1) };
    // Divide the aspect ratio of the display by the ratio of the sample counts.
    let ratio = reduced((u64::from(wide) * config.height as u64, u64::from(high) * config.width as u64));
    (ratio.0 as u32, ratio.1 as u32)
}

/// A position where decoding can begin.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct SeekPoint {
    /// Display time of the I picture at this position, in the file's own units.
    pub time: u64,
    /// Byte offset of the fragment or cluster that contains the picture.
    pub place: u64,
}

/// Returns the sequence header and its extensions that precede an I picture (13818-2, 6.2.2.1).
pub(super) fn sequence_header(picture: &StreamPicture) -> &[u8] {
    let group = picture.data.windows(4).position(|bytes| bytes == [0, 0, 1, GROUP_START_CODE]);
    &picture.data[..group.unwrap_or(0)]
}

/// Reduces a ratio to lowest terms.
pub(super) fn reduced(ratio: (u64, u64)) -> (u64, u64) {
    let (mut divisor, mut rest) = ratio;
    // Find the greatest common divisor by Euclid's algorithm.
    while rest > 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    (ratio.0 / divisor.max(1), ratio.1 / divisor.max(1))
}
