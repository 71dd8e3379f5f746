//! Arrival times of bytes at a decoder.

use super::clock::CLOCK;
use crate::{Config, Rate, rate::starting_fullness};
use std::collections::VecDeque;

/// Margin by which bytes are sent before the buffer requires them, in units of 1/27 000 000 s. It covers the time of pack and
/// packet headers.
pub(super) const SLACK: u64 = CLOCK / 100;
/// Maximum time that a byte waits in the buffer (2.4.2.6), unless filling the buffer takes longer.
const LONGEST_WAIT: u64 = CLOCK;

/// A buffer that fills at a given rate while it has room.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Schedule {
    pub bytes_per_second: u64,
    /// Size of the buffer in bytes.
    pub buffer: u64,
    /// Decoding time of the first picture.
    start: u64,
    /// Bytes in the buffer.
    fullness: u64,
    /// Decoding time and number of bytes of each picture in the buffer.
    pictures: VecDeque<(u64, u64)>,
    /// Earliest arrival time of the next byte, in units of 1/27 000 000 s, multiplied by the rate.
    next: u128,
}

impl Schedule {
    pub fn new(config: &Config) -> Self {
        let (bit_rate, buffer_size) = config.stated_rate();
        match config.rate {
            Rate::ConstantQuantiser => Self::of_stated(bit_rate, buffer_size),
            rate => {
                let (bytes_per_second, buffer) = in_bytes(bit_rate, buffer_size);
                // Use the fullness that rate control assumes.
                Self::filled(bytes_per_second, buffer, starting_fullness(rate, 8 * buffer as i64) as u64 / 8)
            }
        }
    }

    /// Makes a schedule for a variable rate with this bit_rate and vbv_buffer_size.
    pub fn of_stated(bit_rate: u32, buffer_size: u32) -> Self {
        let (bytes_per_second, buffer) = in_bytes(bit_rate, buffer_size);
        Self::filled(bytes_per_second, buffer, buffer.min(bytes_per_second / 2))
    }

    /// Makes a buffer with `full` bytes when the first picture is decoded.
    fn filled(bytes_per_second: u64, buffer: u64, full: u64) -> Self {
        Self {
            bytes_per_second,
            buffer: buffer + (bytes_per_second * SLACK).div_ceil(CLOCK),
            start: (full * CLOCK).div_ceil(bytes_per_second) + SLACK,
            fullness: 0,
            pictures: VecDeque::new(),
            next: 0,
        }
    }

    /// Returns the decoding time of the first picture, after the initial buffer fill, in units of 1/27 000 000 s.
    pub fn start(&self) -> u64 {
        self.start
    }

    /// Limits the buffer to at most `most` bytes.
    pub fn bound(&mut self, most: u64) {
        self.buffer = self.buffer.min(most);
    }

    /// Begins a picture with this decoding time.
    pub fn begin(&mut self, decoding: u64) {
        self.pictures.push_back((decoding, 0));
        self.not_before(decoding.saturating_sub(LONGEST_WAIT.max(self.start)));
    }

    /// Adds `bytes` of the current picture and returns the arrival time of the first byte. The bytes wait for room if the removal
    /// of earlier pictures can free it.
    pub fn arrive(&mut self, bytes: u64) -> u64 {
        let now = self.wait(bytes);
        self.take(bytes);
        now
    }

    /// Returns the time at which `bytes` fit in the buffer.
    pub fn wait(&mut self, bytes: u64) -> u64 {
        // Remove decoded pictures, and wait for further removals until the bytes fit.
        while self.pictures.len() > 1 && (self.fullness + bytes > self.buffer || self.pictures[0].0 <= self.now()) {
            let (decoding, gone) = self.pictures.pop_front().expect("more than one");
            self.fullness -= gone;
            self.not_before(decoding);
        }
        self.now()
    }

    /// Adds bytes of the current picture.
    pub fn take(&mut self, bytes: u64) {
        self.fullness += bytes;
        self.pictures.back_mut().expect("a picture has begun").1 += bytes;
        self.next += u128::from(bytes) * u128::from(CLOCK);
    }

    /// Delays further arrivals to this time.
    fn not_before(&mut self, time: u64) {
        self.next = self.next.max(u128::from(time) * u128::from(self.bytes_per_second));
    }

    /// Returns the earliest arrival of the next byte.
    pub fn now(&self) -> u64 {
        (self.next / u128::from(self.bytes_per_second)) as u64
    }
}

/// Converts bit_rate and vbv_buffer_size to bytes per second and bytes.
fn in_bytes(bit_rate: u32, buffer_size: u32) -> (u64, u64) {
    // The encoder refuses a rate of 0, but a multiplexer may be made before that check.
    (50 * u64::from(bit_rate.max(1)), 2048 * u64::from(buffer_size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameRate;

    /// Returns a schedule of 1 Mbit/s with a buffer of half a megabit, at 25 frames per second.
    fn schedule() -> Schedule {
        let rate = Rate::Constant { bits_per_second: 1_000_000, buffer_bits: 500_000 };
        Schedule::new(&Config::new(64, 48, FrameRate::FPS_25).with_rate(rate))
    }

    #[test]
    fn bytes_follow_each_other_at_the_rate() {
        let mut schedule = schedule();
        let start = schedule.start();
        schedule.begin(start);
        assert_eq!(schedule.arrive(1000), 0);
        assert_eq!(schedule.arrive(1000), 8 * CLOCK / 1000);
        assert_eq!(schedule.arrive(1), 16 * CLOCK / 1000);
    }

    #[test]
    fn a_full_buffer_waits_for_the_next_picture_to_leave() {
        let mut schedule = schedule();
        let (start, period) = (schedule.start(), CLOCK / 2);
        let buffer = schedule.buffer;
        for picture in 0..4 {
            schedule.begin(start + 100 * CLOCK + picture * period);
            let arrives = schedule.arrive(buffer / 2 - 10);
            // The third picture waits for the first one to leave the buffer, and the fourth for the second.
            if picture >= 2 {
                assert_eq!(arrives, start + 100 * CLOCK + (picture - 2) * period);
            } else {
                assert!(arrives >= start + 99 * CLOCK + picture * period && arrives < start + 100 * CLOCK);
            }
        }
    }
}
