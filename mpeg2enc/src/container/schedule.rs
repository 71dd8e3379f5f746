//! When bytes arrive at a decoder.

use super::clock::CLOCK;
use crate::{Config, Rate, rate::starting_fullness};
use std::collections::VecDeque;

/// Bytes are sent this much earlier than the buffer requires, in units of 1/27 000 000 s, so that headers of packs and
/// packets, which take time as well, make nothing late.
pub(super) const SLACK: u64 = CLOCK / 100;
/// No byte waits longer than this in the buffer (2.4.2.6), or than the buffer takes to fill.
const LONGEST_WAIT: u64 = CLOCK;

/// A buffer that fills at a rate as long as there is room.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Schedule {
    pub bytes_per_second: u64,
    /// Bytes that the buffer holds.
    pub buffer: u64,
    /// See [`start`](Self::start).
    start: u64,
    /// Bytes in the buffer.
    fullness: u64,
    /// Pictures that have bytes in it: when they are decoded, and how many bytes.
    pictures: VecDeque<(u64, u64)>,
    /// When the next byte may arrive, in units of 1/27 000 000 s, times the rate.
    next: u128,
}

impl Schedule {
    pub fn new(config: &Config) -> Self {
        let (bit_rate, buffer_size) = config.stated_rate();
        match config.rate {
            Rate::ConstantQuantiser => Self::of_stated(bit_rate, buffer_size),
            rate => {
                let (bytes_per_second, buffer) = in_bytes(bit_rate, buffer_size);
                // The buffer is as full as rate control believes.
                Self::filled(bytes_per_second, buffer, starting_fullness(rate, 8 * buffer as i64) as u64 / 8)
            }
        }
    }

    /// For a variable rate of which a stream states the bounds: bit_rate and vbv_buffer_size.
    pub fn of_stated(bit_rate: u32, buffer_size: u32) -> Self {
        let (bytes_per_second, buffer) = in_bytes(bit_rate, buffer_size);
        Self::filled(bytes_per_second, buffer, buffer.min(bytes_per_second / 2))
    }

    /// With a buffer of which `full` bytes are filled when the first picture is decoded.
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

    /// When the first picture is decoded: the buffer was filled then.
    pub fn start(&self) -> u64 {
        self.start
    }

    /// Lets no more than this many bytes wait.
    pub fn bound(&mut self, most: u64) {
        self.buffer = self.buffer.min(most);
    }

    /// A picture begins, which will be decoded at this time.
    pub fn begin(&mut self, decoding: u64) {
        self.pictures.push_back((decoding, 0));
        self.not_before(decoding.saturating_sub(LONGEST_WAIT.max(self.start)));
    }

    /// The time at which the first of `bytes` of the current picture arrives. They wait for room, if others can make any.
    pub fn arrive(&mut self, bytes: u64) -> u64 {
        let now = self.wait(bytes);
        self.take(bytes);
        now
    }

    /// The time at which there is room for `bytes`.
    pub fn wait(&mut self, bytes: u64) -> u64 {
        while self.pictures.len() > 1 && (self.fullness + bytes > self.buffer || self.pictures[0].0 <= self.now()) {
            let (decoding, gone) = self.pictures.pop_front().expect("more than one");
            self.fullness -= gone;
            self.not_before(decoding);
        }
        self.now()
    }

    /// Puts in bytes of the current picture.
    pub fn take(&mut self, bytes: u64) {
        self.fullness += bytes;
        self.pictures.back_mut().expect("a picture has begun").1 += bytes;
        self.next += u128::from(bytes) * u128::from(CLOCK);
    }

    /// Nothing more arrives before this time.
    fn not_before(&mut self, time: u64) {
        self.next = self.next.max(u128::from(time) * u128::from(self.bytes_per_second));
    }

    /// When the next byte may arrive.
    pub fn now(&self) -> u64 {
        (self.next / u128::from(self.bytes_per_second)) as u64
    }
}

/// Bytes a second and in the buffer, of bit_rate and vbv_buffer_size.
fn in_bytes(bit_rate: u32, buffer_size: u32) -> (u64, u64) {
    // A rate of 0 is refused by the encoder, but may come here before.
    (50 * u64::from(bit_rate.max(1)), 2048 * u64::from(buffer_size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameRate;

    /// 1 Mbit/s with half a megabit of buffer, 25 frames a second.
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
            // The third has to wait for the first, the fourth for the second.
            if picture >= 2 {
                assert_eq!(arrives, start + 100 * CLOCK + (picture - 2) * period);
            } else {
                assert!(arrives >= start + 99 * CLOCK + picture * period && arrives < start + 100 * CLOCK);
            }
        }
    }
}
