//! Level, bit rate and buffer that a stream states.

use super::Config;
use crate::{FrameRate, Level, level::Limits};

const LEVELS: [Level; 4] = [Level::Low, Level::Main, Level::High1440, Level::High];

impl Config {
    /// The frame rate that the stream states: with pulldown that of the frames.
    pub(crate) fn stated_frame_rate(&self) -> FrameRate {
        if self.pulldown { self.frame_rate.after_pulldown().unwrap_or(self.frame_rate) } else { self.frame_rate }
    }

    /// The rate of the periods of a decoder's buffer: frames, or with pulldown fields.
    pub(crate) fn buffer_rate(&self) -> (u32, u32) {
        let (numerator, denominator) = self.stated_frame_rate().fraction();
        if self.pulldown { (2 * numerator, denominator) } else { (numerator, denominator) }
    }

    /// Pictures by which each is shown later than it is decoded, if none are in front of it: 1 where there may be B pictures
    /// (low_delay, 6.3.5).
    pub(crate) fn reorder(&self) -> u64 {
        u64::from(self.b_pictures > 0)
    }

    /// The level that the stream will state; beyond High Level, where none is right, it states High.
    ///
    /// At a constant quantiser a level above it may be stated, if the first picture is so large that the level does not hold it
    /// and others like it.
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

    /// States a level from now on, unless one is requested, whatever the first picture is: that which holds pictures of `bits` bits each.
    /// For parts of a stream that are coded apart, and state the same.
    pub fn with_level_for(mut self, bits: u64) -> Self {
        let has_level = Level::lowest(self.width, self.height, self.stated_frame_rate().fps()).is_some();
        if self.level.is_none() && has_level {
            self.hold(bits);
            (self.level, self.raised) = (Some(self.level()), None);
        }
        self
    }

    /// Raises the level to the lowest that holds pictures of `bits` each, where none is requested.
    pub(crate) fn hold(&mut self, bits: u64) {
        let holds = |level: &Level| {
            let Limits { bits_per_second, vbv_buffer_size, .. } = level.limits();
            bits <= 16_384 * vbv_buffer_size && bits as f64 * self.frame_rate.fps() <= *bits_per_second as f64
        };
        let lowest = self.level();
        let mut above = LEVELS.into_iter().filter(|level| *level > lowest);
        if self.level.is_none() && !holds(&lowest) {
            self.raised = above.clone().find(holds).or(above.next_back());
        }
    }

    /// bit_rate in units of 400 bits a second, and vbv_buffer_size in units of 16 384 bits, as the stream states them: the
    /// bounds of the level where there are no others.
    pub(crate) fn stated_rate(&self) -> (u32, u32) {
        self.rate.stated().unwrap_or_else(|| {
            let limits = self.level().limits();
            // Beyond the highest level the bounds grow with the sample rate.
            let rate =
                (self.width * self.height) as f64 * self.stated_frame_rate().fps() / limits.luma_samples_per_second;
            let growth = rate.ceil().max(1.0) as u64;
            let bit_rate = (limits.bits_per_second * growth / 400).min((1 << 30) - 1);
            (bit_rate as u32, (limits.vbv_buffer_size * growth).min((1 << 18) - 1) as u32)
        })
    }
}
