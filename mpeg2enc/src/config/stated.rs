//! Level, bit rate and buffer that a stream states.

use super::Config;
use crate::{Level, level::Limits};

const LEVELS: [Level; 4] = [Level::Low, Level::Main, Level::High1440, Level::High];

impl Config {
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
        let lowest = Level::lowest(self.width, self.height, self.frame_rate.fps()).unwrap_or(Level::High);
        self.level
            .or(self.raised)
            .or_else(|| LEVELS.into_iter().find(|level| *level >= lowest && holds_rate(level)))
            .unwrap_or(Level::High)
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
            let rate = (self.width * self.height) as f64 * self.frame_rate.fps() / limits.luma_samples_per_second;
            let growth = rate.ceil().max(1.0) as u64;
            let bit_rate = (limits.bits_per_second * growth / 400).min((1 << 30) - 1);
            (bit_rate as u32, (limits.vbv_buffer_size * growth).min((1 << 18) - 1) as u32)
        })
    }
}
