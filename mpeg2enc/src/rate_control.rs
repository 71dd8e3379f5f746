//! The quantiser of the next picture, so that the stream keeps to a bit rate and the decoder's buffer holds it.
//!
//! Bits are predicted from what the lookahead measured:
//!
//! ```text
//! bits = headers + c·cost / quantiser_scale^a      cost  sum of differences that a picture leaves when predicted
//!                                                  c     learnt from the pictures of the same type
//!                                                  a     3/4 for I pictures, 1 for others
//! ```
//! All frames that wait are to be coded with one quantiser_scale, which is found by bisection: the bits must come out
//! right at the end, and the buffer must neither run dry nor overflow on the way. That is done anew for each picture.

use crate::{Config, PictureType, Rate, RestoreError, rate::starting_fullness, restore::ensure, vbv::Buffer};

/// A picture that will be coded, in the order of coding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Upcoming {
    pub picture_type: PictureType,
    pub cost: u64,
}

/// quantiser_scale in sixteenths: finest and coarsest.
const FINEST_X16: u32 = 16;
const COARSEST_X16: u32 = 112 * 16;
/// Bits of headers, types and vectors of a macroblock that take no part in quantisation: about half of what a picture
/// with few coefficients has.
const HEADER_BITS_PER_MACROBLOCK: i64 = 1;
/// c for I, P, B in 256ths before anything is learnt. These and the powers of quantiser_scale are middle values over the
/// clips of README.md at 0.5 to 8 Mbit/s.
const FIRST_GUESS: [i64; 3] = [970, 2000, 1000];
/// Part of the buffer that planning does not touch, in 16ths: predicted bits are never exact.
const RESERVE_SIXTEENTHS: i64 = 1;

/// More than c can be: 2³² bits at the coarsest quantiser, of the least cost.
const MODEL_MAX: i64 = 1 << 48;

/// Chooses quantisers, and keeps the buffer.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct RateControl {
    pub buffer: Buffer,
    rate: Rate,
    quantiser_x16: u32,
    start: i64,
    header_bits: i64,
    /// c for I, P, B in 256ths, and whether anything was learnt.
    models: [(i64, bool); 3],
}

impl RateControl {
    /// `None` where bits are not bounded.
    pub fn new(config: &Config, macroblocks: usize) -> Option<Self> {
        let (bit_rate, buffer_size) = config.rate.stated()?;
        let (bit_rate, size) = (400 * i64::from(bit_rate), 16_384 * i64::from(buffer_size));
        let pauses = matches!(config.rate, Rate::Capped { .. });
        let start = starting_fullness(config.rate, size);
        Some(Self {
            buffer: Buffer::new(bit_rate, size, config.frame_rate.fraction(), start, pauses),
            rate: config.rate,
            quantiser_x16: config.quantiser_x256() / 16,
            start,
            header_bits: HEADER_BITS_PER_MACROBLOCK * macroblocks as i64,
            models: FIRST_GUESS.map(|c| (c, false)),
        })
    }

    /// Uses the quantiser of changed settings.
    pub fn set_quantiser(&mut self, config: &Config) {
        self.quantiser_x16 = config.quantiser_x256() / 16;
    }

    /// Whether this follows from the one with which an encoder of the same settings begins.
    pub fn check(&self, fresh: &Self) -> Result<(), RestoreError> {
        let settings = |of: &Self| (of.rate, of.start, of.header_bits);
        ensure(settings(self) == settings(fresh) && self.buffer.is_like(&fresh.buffer), "rate control")?;
        ensure((FINEST_X16..=COARSEST_X16).contains(&self.quantiser_x16), "the quantiser of rate control")?;
        ensure(self.models.iter().all(|(c, _)| (1..=MODEL_MAX).contains(c)), "the models of rate control")
    }

    /// Bits that a picture will take.
    fn predicted_bits(&self, picture: Upcoming, quantiser_x16: u32) -> i64 {
        let (c, _) = self.models[picture.picture_type as usize - 1];
        self.header_bits + c * picture.cost as i64 / (16 * power_x16(picture.picture_type, quantiser_x16))
    }

    /// quantiser_scale in sixteenths for the first of `upcoming`.
    pub fn quantiser_x16(&self, upcoming: &[Upcoming]) -> u32 {
        match self.rate {
            Rate::ConstantQuantiser => self.quantiser_x16,
            Rate::Capped { .. } => least(self.quantiser_x16, |q| self.stays_above(upcoming, q)),
            Rate::Constant { .. } => {
                let planned = least(FINEST_X16, |q| {
                    let bits: i64 = upcoming.iter().map(|&picture| self.predicted_bits(picture, q)).sum();
                    self.buffer.bits() + upcoming.len() as i64 * self.buffer.bits_per_picture() - bits >= self.start
                });
                // Coarser if the buffer would run dry on the way; finer if it would overflow.
                let safe = least(planned, |q| self.stays_above(upcoming, q));
                if safe > planned { safe } else { self.finer_until_below(upcoming, planned) }
            }
        }
    }

    /// Does the buffer never run dry with this quantiser?
    fn stays_above(&self, upcoming: &[Upcoming], quantiser_x16: u32) -> bool {
        let mut buffer = self.buffer;
        let reserve = buffer.size * RESERVE_SIXTEENTHS / 16;
        upcoming.iter().all(|&picture| {
            let bits = self.predicted_bits(picture, quantiser_x16);
            let enough = buffer.bits() - bits >= reserve;
            buffer.take(bits);
            enough
        })
    }

    /// The coarsest quantiser up to this one with which the buffer does not overflow.
    fn finer_until_below(&self, upcoming: &[Upcoming], quantiser_x16: u32) -> u32 {
        let overflows = |q: u32| {
            let mut buffer = self.buffer;
            upcoming.iter().any(|&picture| {
                let bits = self.predicted_bits(picture, q);
                let too_few = bits < buffer.least();
                buffer.take(bits);
                too_few
            })
        };
        let (mut low, mut high) = (FINEST_X16, quantiser_x16);
        if !overflows(high) || overflows(low) {
            return high;
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            if overflows(middle) { high = middle } else { low = middle }
        }
        // Never finer than what leaves the next pictures enough.
        if self.stays_above(upcoming, low) { low } else { quantiser_x16 }
    }

    /// Learns from a picture that took `bits`.
    pub fn learn(&mut self, picture: Upcoming, quantiser_x16: u32, bits: i64) {
        if picture.cost == 0 {
            return;
        }
        let c = ((bits - self.header_bits).max(bits / 4) * 16 * power_x16(picture.picture_type, quantiser_x16)
            / picture.cost as i64)
            .max(1);
        let index = picture.picture_type as usize - 1;
        let (before, learnt) = self.models[index];
        self.models[index] = (if learnt { (before + c) / 2 } else { c }, true);
        if !learnt && index == 0 {
            // The others are likely off by as much.
            for (other, guess) in self.models.iter_mut().zip(FIRST_GUESS) {
                if !other.1 {
                    other.0 = (guess * c / FIRST_GUESS[0]).max(1);
                }
            }
        }
    }

    /// Was anything learnt of this type?
    pub fn knows(&self, picture_type: PictureType) -> bool {
        self.models[picture_type as usize - 1].1
    }

    /// A coarser quantiser after a picture of `bits` did not fit; `None` if there is none.
    pub fn coarser_after(&self, quantiser_x16: u32, bits: i64) -> Option<u32> {
        let room = (self.buffer.bits() * 15 / 16).max(1);
        (bits > self.buffer.bits() && quantiser_x16 < COARSEST_X16).then(|| {
            let scaled = i64::from(quantiser_x16) * bits / room;
            scaled.clamp(i64::from(quantiser_x16) + 16, i64::from(COARSEST_X16)) as u32
        })
    }
}

/// quantiser_scale to the power that bits follow, in sixteenths.
fn power_x16(picture_type: PictureType, quantiser_x16: u32) -> i64 {
    match picture_type {
        // 16·q^(3/4) = (16^4·q³)^(1/4) = (16·(16·q)³)^(1/4); eight more bits each time keep the fraction.
        PictureType::I => ((16 * u64::from(quantiser_x16).pow(3)) << 16).isqrt().isqrt() as i64 >> 4,
        _ => i64::from(quantiser_x16),
    }
}

/// The finest quantiser from `finest` on for which `fits` holds; the coarsest if none does.
fn least(finest: u32, fits: impl Fn(u32) -> bool) -> u32 {
    if fits(finest) {
        return finest;
    }
    let (mut low, mut high) = (finest, COARSEST_X16.max(finest));
    while high - low > 1 {
        let middle = (low + high) / 2;
        if fits(middle) { high = middle } else { low = middle }
    }
    high
}
