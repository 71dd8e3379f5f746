//! The level, bit rate and buffer size in the headers of a stream.

use super::Config;
use crate::{FrameRate, Level, level::Limits};

const LEVELS: [Level; 4] = [Level::Low, Level::Main, Level::High1440, Level::High];

impl Config {
    /// Returns the frame rate in the sequence header; with pulldown it exceeds the picture rate.
    pub(crate) fn stated_frame_rate(&self) -> FrameRate {
        if self.pulldown { self.frame_rate.after_pulldown().unwrap_or(self.frame_rate) } else { self.frame_rate }
    }

    /// Returns the number of periods per second of the decoder's buffer, as a fraction. A period is a frame, or a field with
    /// pulldown.
    pub(crate) fn buffer_rate(&self) -> (u32, u32) {
        let (numerator, denominator) = self.stated_frame_rate().fraction();
        if self.pulldown { (2 * numerator, denominator) } else { (numerator, denominator) }
    }

    /// Returns the delay in pictures between decoding and display: 1 if B pictures are allowed, otherwise 0 (low_delay, 6.3.5).
    pub(crate) fn reorder(&self) -> u64 {
        u64::from(self.b_pictures > 0)
    }

    /// Returns the level of the stream; pictures beyond High Level are coded as High Level.
    ///
    /// At a constant quantiser the encoder chooses a higher level if the first picture is too large for this one.
    pub fn level(&self) -> Level {
        let (rate, buffer) = self.rate.stated().unwrap_or_default();
        let holds_rate = |level: &Level| {
            let limits = level.limits();
            400 * u64::from(rate) <= limits.bits_per_second && u64::from(buffer) <= limits.vbv_buffer_size
        };
        let lowest = Level::lowest(self.width, self.height, self.stated_frame_rate().fps()).unwrap_or(Level::High);
        self.level
            .or(self.raised)
            .or_else(|| LEVELS.into_iter().find(|level| *level >= lowest && holds_rate(level)))
            .unwrap_or(Level::High)
    }

    /// Sets the level that allows pictures of `bits` bits each, unless a level is requested. The first picture then has no
    /// influence. Use this function for chunks of a stream that are coded separately and must have the same level.
    pub fn with_level_for(mut self, bits: u64) -> Self {
        let has_level = Level::lowest(self.width, self.height, self.stated_frame_rate().fps()).is_some();
        if self.level.is_none() && has_level {
            self.hold(bits);
            (self.level, self.raised) = (Some(self.level()), None);
        }
        self
    }

    /// Raises the level to the lowest that allows pictures of `bits` bits each, unless a level is requested.
    pub(crate) fn hold(&mut self, bits: u64) {
        let holds = |level: &Level| {
            let Limits { bits_per_second, vbv_buffer_size, .. } = level.limits();
            bits <= 16_384 * vbv_buffer_size && bits as f64 * self.frame_rate.fps() <= *bits_per_second as f64
        };
        let lowest = self.level();
        let mut above = LEVELS.into_iter().filter(|level| *level > lowest);
        if self.level.is_none() && !holds(&lowest) {
            // If no level suffices, use the highest one.
            self.raised = above.clone().find(holds).or(above.next_back());
        }
    }

    /// Returns bit_rate in units of 400 bits per second and vbv_buffer_size in units of 16 384 bits, as coded in the headers.
    /// Without a bit rate, these are the limits of the level.
    pub(crate) fn stated_rate(&self) -> (u32, u32) {
        self.rate.stated().unwrap_or_else(|| {
            let limits = self.level().limits();
            // Beyond High Level the limits grow with the sample rate.
            let rate =
                (self.width * self.height) as f64 * self.stated_frame_rate().fps() / limits.luma_samples_per_second;
            let growth = rate.ceil().max(1.0) as u64;
            let bit_rate = (limits.bits_per_second * growth / 400).min((1 << 30) - 1);
            (bit_rate as u32, (limits.vbv_buffer_size * growth).min((1 << 18) - 1) as u32)
        })
    }
}
