//! The system clock, and when pictures are due.

use crate::pulldown::fields;

/// Units of the system clock in a second (2.4.2.1).
pub(super) const CLOCK: u64 = 27_000_000;

/// When a picture is decoded and shown, in units of 1/27 000 000 s.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Times {
    pub decoding: u64,
    pub presentation: u64,
}

/// When pictures are decoded and shown.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Clock {
    /// Numerator and denominator of the frame rate.
    pub frame_rate: (u64, u64),
    /// From the first byte to the first picture that is decoded, in units of 1/27 000 000 s.
    pub start: u64,
    /// Pictures decoded so far.
    pub count: u64,
    /// Frame periods by which pictures are shown later than they were decoded if none are in front of them: 1 where there
    /// may be B pictures (low_delay, 13818-2 6.3.5).
    pub reorder: u64,
    /// Whether every other picture has three fields; `frame_rate` is that of the frames then.
    pub pulldown: bool,
}

impl Clock {
    pub fn next(&mut self, display_index: u64) -> Times {
        let (numerator, denominator) = self.frame_rate;
        let at = |pictures: u64| match self.pulldown {
            true => self.start + fields(pictures) * CLOCK * denominator / (2 * numerator),
            false => self.start + pictures * CLOCK * denominator / numerator,
        };
        let times = Times { decoding: at(self.count), presentation: at(display_index + self.reorder) };
        self.count += 1;
        times
    }
}
