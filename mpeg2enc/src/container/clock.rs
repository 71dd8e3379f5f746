//! The system clock and the times of pictures.

use crate::pulldown::fields;

/// Frequency of the system clock in Hz (2.4.2.1).
pub(super) const CLOCK: u64 = 27_000_000;

/// Decoding and display time of a picture, in units of 1/27 000 000 s.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Times {
    pub decoding: u64,
    pub presentation: u64,
}

/// Computes decoding and display times of pictures.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Clock {
    /// Numerator and denominator of the frame rate.
    pub frame_rate: (u64, u64),
    /// Time from the first byte to the decoding of the first picture, in units of 1/27 000 000 s.
    pub start: u64,
    /// Number of pictures decoded so far.
    pub count: u64,
    /// Delay in frame periods between decoding and display of pictures without reordering: 1 if B pictures are allowed,
    /// otherwise 0 (low_delay, 13818-2 6.3.5).
    pub reorder: u64,
    /// Whether every other picture has three fields; `frame_rate` is then the rate of the frames.
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
