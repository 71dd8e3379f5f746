//! The buffer of the video buffering verifier (Annex C).

/// Lower bound on the fullness of a buffer.
const FULLNESS_MIN: i64 = -(1 << 44);

/// A buffer that fills at the bit rate. Each picture is removed as a whole when it is decoded.
///
/// A frame period seldom corresponds to a whole number of bits. Bits are therefore multiplied by the numerator of the frame
/// rate, and no fraction is lost.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Buffer {
    /// Bits per second, as coded in the sequence header.
    pub bit_rate: i64,
    /// Size in bits.
    pub size: i64,
    /// Numerator and denominator of the frame rate or, with pulldown, of the field rate.
    frame_rate: (i64, i64),
    /// Number of bits just before the next picture is removed, times the numerator.
    fullness: i64,
    /// Whether filling pauses when the buffer is full (variable rate). At a constant rate a full buffer is an error.
    pauses: bool,
    /// Whether the next period has three fields instead of two; `None` without pulldown.
    is_long: Option<bool>,
}

impl Buffer {
    pub fn new(bit_rate: i64, size: i64, frame_rate: (u32, u32), fullness: i64, pauses: bool) -> Self {
        let frame_rate = (i64::from(frame_rate.0), i64::from(frame_rate.1));
        Self { bit_rate, size, frame_rate, fullness: fullness * frame_rate.0, pauses, is_long: None }
    }

    /// Returns the buffer for alternating periods of three and two fields; its frame rate must be the field rate.
    pub fn with_pulldown(self, pulldown: bool) -> Self {
        Self { is_long: pulldown.then_some(true), ..self }
    }

    /// Returns the number of bits that arrive between the next picture and the following one, times the numerator.
    fn filling(&self) -> i64 {
        let periods = match self.is_long {
            None => 1,
            Some(false) => 2,
            Some(true) => 3,
        };
        self.bit_rate * self.frame_rate.1 * periods
    }

    /// Returns whether `other` is the same buffer, possibly at another time of the film, and the fullness of `self` is possible.
    pub fn is_like(&self, other: &Self) -> bool {
        let same = |of: &Self| (of.bit_rate, of.size, of.frame_rate, of.pauses, of.is_long.is_some());
        // Pictures that are too large even with the coarsest quantiser make the fullness negative.
        same(self) == same(other) && self.bits() <= self.size && self.bits() >= FULLNESS_MIN
    }

    /// Returns the number of bits in the buffer just before the next picture is removed.
    pub fn bits(&self) -> i64 {
        self.fullness / self.frame_rate.0
    }

    /// Returns vbv_delay of the next picture, if headers up to its picture_start_code take `ahead` bits (6.3.9).
    pub fn delay(&self, ahead: i64) -> u32 {
        // Stay below 0xffff, which codes a variable rate.
        ((self.bits() - ahead).max(0) * 90_000 / self.bit_rate).min(0xfffe) as u32
    }

    /// Returns the minimum bits of the next picture that prevent an overflow before the following picture is removed.
    pub fn least(&self) -> i64 {
        if self.pauses {
            return 0;
        }
        let after = self.fullness + self.filling() - self.size * self.frame_rate.0;
        // Round up to whole bits.
        (after + self.frame_rate.0 - 1).div_euclid(self.frame_rate.0).max(0)
    }

    /// Returns whether the buffer fills before the following picture is removed, so that stuffing is added or reading pauses.
    pub fn is_full_after(&self, bits: i64) -> bool {
        let after = self.fullness + self.filling() - bits * self.frame_rate.0;
        after > self.size * self.frame_rate.0
    }

    /// Removes a picture and fills the buffer for one period.
    pub fn take(&mut self, bits: i64) {
        self.fullness += self.filling() - bits * self.frame_rate.0;
        self.is_long = self.is_long.map(|is_long| !is_long);
        if self.pauses {
            self.fullness = self.fullness.min(self.size * self.frame_rate.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_lost_over_an_hour() {
        let mut buffer = Buffer::new(1_000_000, 2_000_000, (30000, 1001), 1_000_000, false);
        for _ in 0..30_000 {
            buffer.take(1_000_000 * 1001 / 30000); // rounded down: two thirds of a bit too few
        }
        assert_eq!(buffer.bits(), 1_000_000 + 20_000);
    }

    #[test]
    fn delays_and_limits() {
        let buffer = Buffer::new(900_000, 500_000, (30, 1), 450_000, false);
        assert_eq!(buffer.delay(0), 45_000);
        assert_eq!(buffer.delay(90_000), 36_000);
        assert_eq!(buffer.least(), 0);
        let full = Buffer::new(900_000, 500_000, (30, 1), 490_000, false);
        assert_eq!(full.least(), 20_000);
        assert_eq!(Buffer::new(900_000, 500_000, (30, 1), 490_000, true).least(), 0);
    }
}
