//! The buffer of the video buffering verifier (Annex C): what a decoder must hold before a picture is due.

/// Fewer bits than any film makes of a buffer.
const FULLNESS_MIN: i64 = -(1 << 44);

/// Fills at the bit rate; each picture is taken out whole when it is decoded.
///
/// A frame period holds a whole number of bits only by chance, so all is counted in bits times the numerator of the
/// frame rate: no fraction is ever dropped.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Buffer {
    /// Bits a second, as the sequence header says.
    pub bit_rate: i64,
    /// Size in bits.
    pub size: i64,
    /// Numerator and denominator of the frame rate.
    frame_rate: (i64, i64),
    /// Bits just before the next picture is taken out, times the numerator.
    fullness: i64,
    /// Is a full buffer just not filled further (variable rate), or is that an error (constant rate)?
    pauses: bool,
    /// With pulldown, whether the next period has three fields, and not two; the rate is that of the fields then.
    is_long: Option<bool>,
}

impl Buffer {
    pub fn new(bit_rate: i64, size: i64, frame_rate: (u32, u32), fullness: i64, pauses: bool) -> Self {
        let frame_rate = (i64::from(frame_rate.0), i64::from(frame_rate.1));
        Self { bit_rate, size, frame_rate, fullness: fullness * frame_rate.0, pauses, is_long: None }
    }

    /// The buffer for periods of three and two fields, in turn, at a rate that is that of the fields.
    pub fn with_pulldown(self, pulldown: bool) -> Self {
        Self { is_long: pulldown.then_some(true), ..self }
    }

    /// Bits that come in until the picture after the next one is taken out, times the numerator.
    fn filling(&self) -> i64 {
        let periods = match self.is_long {
            None => 1,
            Some(false) => 2,
            Some(true) => 3,
        };
        self.bit_rate * self.frame_rate.1 * periods
    }

    /// Whether both are the same buffer, at any time of a film.
    pub fn is_like(&self, other: &Self) -> bool {
        let same = |of: &Self| (of.bit_rate, of.size, of.frame_rate, of.pauses, of.is_long.is_some());
        // Pictures that are too large even with the coarsest quantiser leave less than nothing.
        same(self) == same(other) && self.bits() <= self.size && self.bits() >= FULLNESS_MIN
    }

    /// Bits in the buffer just before the next picture is taken out.
    pub fn bits(&self) -> i64 {
        self.fullness / self.frame_rate.0
    }

    /// vbv_delay of the next picture, of which the headers up to its picture_start_code take `ahead` bits (6.3.9).
    pub fn delay(&self, ahead: i64) -> u32 {
        ((self.bits() - ahead).max(0) * 90_000 / self.bit_rate).min(0xfffe) as u32
    }

    /// The fewest bits that the next picture may have, so that the buffer does not overflow before the one after it.
    pub fn least(&self) -> i64 {
        if self.pauses {
            return 0;
        }
        let after = self.fullness + self.filling() - self.size * self.frame_rate.0;
        (after + self.frame_rate.0 - 1).div_euclid(self.frame_rate.0).max(0)
    }

    /// Is the buffer full before the picture after one of `bits`, so that bits are stuffed or reading pauses?
    pub fn is_full_after(&self, bits: i64) -> bool {
        let after = self.fullness + self.filling() - bits * self.frame_rate.0;
        after > self.size * self.frame_rate.0
    }

    /// Takes out a picture and fills for a frame period.
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
