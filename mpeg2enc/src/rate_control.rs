//! Chooses the quantiser of the next picture, so that the stream meets a bit rate and fits the decoder's buffer.
//!
//! Bits are predicted from costs measured by the look-ahead:
//!
//! ```text
//! bits = f + c·cost / (q^a·e(u))        f     floor: headers, types, vectors, DC coefficients
//! u    = κ·q·n / cost                   c     learned from pictures of the same type
//! e(u) = 1 + u + u²/2 + u³/6            cost  sum of absolute differences of the predicted picture
//!                                       q, n  quantiser_scale, number of macroblocks
//!                                       a     3/4 for I pictures, 1 for others
//! ```
//! e(u) approximates e^u: if q is large compared with the mean difference cost/n, nearly all levels are zero.
//!
//! All waiting frames use one quantiser_scale, found by bisection. It is the finest one that prevents underflow and meets the
//! total number of bits at the end. After the buffer is full, later pictures no longer depend on earlier ones. The search is
//! repeated for each picture.

use crate::{
    CoefficientTable, Config, PictureStatistics, PictureType, Rate, RestoreError, rate::starting_fullness,
    restore::ensure, vbv::Buffer,
};

/// A picture to be coded, in the order of coding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Upcoming {
    pub picture_type: PictureType,
    pub cost: u64,
}

/// Finest quantiser_scale, in sixteenths.
const FINEST_X16: u32 = 16;
/// Coarsest quantiser_scale, in sixteenths.
const COARSEST_X16: u32 = 112 * 16;
/// Initial f of I, P and B pictures, in bits per macroblock. Like c and κ, these are medium values over the clips of the rate
/// table of README.md, at quantiser_scale 1 to 48 and every effort.
const FIRST_FLOOR: [i64; 3] = [45, 8, 8];
/// Initial c of I, P and B pictures, in 256ths.
const FIRST_C: [i64; 3] = [750, 2500, 2000];
/// Factor κ of I, P and B pictures.
const KAPPA: [i64; 3] = [0, 2, 6];
/// Maximum of u, in 256ths; at this value no levels remain.
const MOST_U: i64 = 32 << 8;
/// Maximum ratio of c to its initial value, and of the initial value to c. Noise in a static scene predicts little about the next
/// scene. With a ratio of 16, the next scene lost up to 1.1 dB (a title, then action, at most 300 kbit/s).
const C_RANGE: i64 = 4;
/// Minimum mean cost of a macroblock from which c is learned. Lower costs are noise that even the finest quantiser removes.
const LEAST_COST: u64 = 2;
/// Inverse of a fraction of the floor. c is learned only if levels take, or are predicted to take, more than this fraction. The
/// value was chosen, not tuned.
const LEVELS_OF_FLOOR: i64 = 8;
/// Minimum ratio of a quantiser to the previous one, in thirds, at a constant rate. Compared with no limit, 2 gains 0.8 dB on a
/// clip of slow waves after dark static frames (effort fast, 70 kbit/s). The clips of the rate table gain 0.04 dB on average at
/// 300 kbit/s.
const LEAST_OF_LAST_THIRDS: u32 = 2;
/// Fraction of the buffer that planning reserves, in 16ths, because predicted bits are never exact.
const RESERVE_SIXTEENTHS: i64 = 1;
/// Upper bound on the bits of any picture.
const MOST_BITS: i64 = 1 << 40;

/// Bits of a coded picture, split into floor and levels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taken {
    /// Number of bits that hardly depend on the quantiser.
    pub floor: i64,
    /// Number of bits of the quantised levels.
    pub levels: i64,
}

impl Taken {
    pub fn bits(self) -> i64 {
        self.floor + self.levels
    }
}

/// Model of the bits of one picture type.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Model {
    /// Floor f, in bits.
    floor: i64,
    /// Factor c, in 256ths.
    c: i64,
    /// Whether the model has learned from a picture.
    is_learnt: bool,
}

/// Chooses quantisers and tracks the decoder's buffer.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct RateControl {
    pub buffer: Buffer,
    rate: Rate,
    quantiser_x16: u32,
    /// quantiser_scale of the last picture, in sixteenths.
    last_x16: u32,
    start: i64,
    macroblocks: i64,
    /// Number of bits of an intra macroblock with only zeros, without its type.
    empty_intra_bits: i64,
    /// Models of I, P and B pictures.
    models: [Model; 3],
}

impl RateControl {
    /// Returns the initial control; `None` if bits are not bounded.
    pub fn new(config: &Config, macroblocks: usize) -> Option<Self> {
        let (bit_rate, buffer_size) = config.rate.stated()?;
        let (bit_rate, size) = (400 * i64::from(bit_rate), 16_384 * i64::from(buffer_size));
        let pauses = matches!(config.rate, Rate::Capped { .. });
        let start = starting_fullness(config.rate, size);
        let macroblocks = macroblocks as i64;
        let first = |t: usize| Model { floor: FIRST_FLOOR[t] * macroblocks, c: FIRST_C[t], is_learnt: false };
        Some(Self {
            buffer: Buffer::new(bit_rate, size, config.buffer_rate(), start, pauses).with_pulldown(config.pulldown),
            rate: config.rate,
            quantiser_x16: config.quantiser_x256() / 16,
            last_x16: FINEST_X16,
            start,
            macroblocks,
            // A dct_dc_size of zero has 3 bits in a luma block and 2 bits in a chroma block; End of block has 2 or 4 bits.
            empty_intra_bits: 4 * 3 + 2 * 2 + 6 * if config.intra_table == CoefficientTable::Zero { 2 } else { 4 },
            models: std::array::from_fn(first),
        })
    }

    /// Adopts the quantiser of changed settings.
    pub fn set_quantiser(&mut self, config: &Config) {
        self.quantiser_x16 = config.quantiser_x256() / 16;
    }

    /// Checks that this state can follow from `fresh`, the initial state of the same settings.
    pub fn check(&self, fresh: &Self) -> Result<(), RestoreError> {
        let settings = |of: &Self| (of.rate, of.start, of.macroblocks, of.empty_intra_bits);
        ensure(settings(self) == settings(fresh) && self.buffer.is_like(&fresh.buffer), "rate control")?;
        let is_quantiser = |x16: u32| (FINEST_X16..=COARSEST_X16).contains(&x16);
        ensure(is_quantiser(self.quantiser_x16) && is_quantiser(self.last_x16), "quantiser of rate control")?;
        let is_possible = |(model, first): (&Model, i64)| {
            (0..=MOST_BITS).contains(&model.floor) && bounded_c(model.c, first) == model.c
        };
        ensure(self.models.iter().zip(FIRST_C).all(is_possible), "models of rate control")
    }

    /// Returns q^a·e(u) / cost, the divisor of c: numerator in 4096ths, and denominator.
    fn divisor(&self, picture: Upcoming, quantiser_x16: u32) -> (i64, i64) {
        let kappa = KAPPA[picture.picture_type as usize - 1];
        let cost = (picture.cost as i64).max(1);
        let u = (16 * kappa * i64::from(quantiser_x16) * self.macroblocks / cost).min(MOST_U);
        let e = 256 + u + u * u / (2 << 8) + u * u * u / (6 << 16);
        (power_x16(picture.picture_type, quantiser_x16) * e, cost)
    }

    /// Predicts the bits of a picture.
    pub fn predicted(&self, picture: Upcoming, quantiser_x16: u32) -> Taken {
        let Model { floor, c, .. } = self.models[picture.picture_type as usize - 1];
        let (divisor, cost) = self.divisor(picture, quantiser_x16);
        Taken { floor, levels: 16 * c * cost / divisor }
    }

    /// Returns quantiser_scale in sixteenths for the first of `upcoming`. `tried` contains quantiser and bits of its previous
    /// attempt, if any.
    pub fn quantiser_x16(&self, upcoming: &[Upcoming], tried: Option<(u32, Taken)>) -> u32 {
        let (finest, left) = match self.rate {
            Rate::ConstantQuantiser => return self.quantiser_x16,
            Rate::Capped { .. } => (self.quantiser_x16, i64::MIN),
            // If all levels were zero, the number of levels with a far finer quantiser is unknown.
            Rate::Constant { .. } => ((self.last_x16 * LEAST_OF_LAST_THIRDS / 3).max(FINEST_X16), self.start),
        };
        least(finest, |q| {
            let first = tried.map(|(tried_x16, taken)| self.rescaled(upcoming[0], tried_x16, taken, q));
            let later = upcoming[usize::from(first.is_some())..].iter().map(|&picture| self.predicted(picture, q));
            self.fits(first.into_iter().chain(later), left)
        })
    }

    /// Predicts the bits of a picture with another quantiser from the bits with an already tried one.
    fn rescaled(&self, picture: Upcoming, tried_x16: u32, taken: Taken, quantiser_x16: u32) -> Taken {
        let [(tried, _), (wanted, _)] = [tried_x16, quantiser_x16].map(|q| self.divisor(picture, q));
        // Zero levels may become many with a finer quantiser.
        let levels = taken.levels.max(taken.floor / LEVELS_OF_FLOOR);
        Taken { levels: (i128::from(levels) * i128::from(tried) / i128::from(wanted)) as i64, ..taken }
    }

    /// Returns whether the buffer becomes full before these pictures empty it. If neither happens, returns whether at least
    /// `left` bits remain at the end.
    fn fits(&self, pictures: impl Iterator<Item = Taken>, left: i64) -> bool {
        let mut buffer = self.buffer;
        let reserve = buffer.size * RESERVE_SIXTEENTHS / 16;
        let (mut floors, mut all_levels) = (0, 0);
        for picture in pictures {
            let bits = picture.bits();
            (floors, all_levels) = (floors + picture.floor, all_levels + picture.levels);
            // If levels are few, a coarser quantiser saves no bits.
            if buffer.bits() - bits < reserve && all_levels > floors / LEVELS_OF_FLOOR {
                return false;
            }
            if buffer.is_full_after(bits) {
                return true;
            }
            buffer.take(bits);
        }
        buffer.bits() >= left || all_levels <= floors / LEVELS_OF_FLOOR
    }

    /// Returns the model that predicts the actual bits of a picture with this quantiser.
    fn measured(&self, picture: Upcoming, quantiser_x16: u32, taken: Taken) -> Model {
        let index = picture.picture_type as usize - 1;
        let Taken { floor, levels } = taken;
        // Levels that are few compared with the floor, as predicted, contain no information about c.
        let is_quiet = picture.cost < LEAST_COST * self.macroblocks as u64;
        if is_quiet || levels.max(self.predicted(picture, quantiser_x16).levels) < floor / LEVELS_OF_FLOOR {
            return Model { floor, ..self.models[index] };
        }
        let (divisor, cost) = self.divisor(picture, quantiser_x16);
        let c = (i128::from(levels) * i128::from(divisor) / (16 * i128::from(cost))).min(1 << 40) as i64;
        Model { floor, c: bounded_c(c, FIRST_C[index]), is_learnt: true }
    }

    /// Updates the model with a picture coded with this quantiser.
    pub fn learn(&mut self, picture: Upcoming, quantiser_x16: u32, taken: Taken) {
        let measured = self.measured(picture, quantiser_x16, taken);
        let model = &mut self.models[picture.picture_type as usize - 1];
        if !model.is_learnt {
            *model = measured;
            return;
        }
        // c changes by a factor of at least 3/4 and at most 5/2.
        model.floor = (model.floor + measured.floor) / 2;
        model.c = (model.c + measured.c.clamp(model.c / 2, model.c * 4)) / 2;
    }

    /// Splits the bits of a picture into levels and floor.
    pub fn taken(&self, bits: i64, statistics: &PictureStatistics) -> Taken {
        let empty = self.empty_intra_bits * i64::from(statistics.intra);
        let levels = (statistics.coefficient_bits as i64 - empty).clamp(0, bits);
        Taken { floor: bits - levels, levels }
    }

    /// Removes a finished picture from the buffer and records its quantiser.
    pub fn take(&mut self, bits: i64, quantiser_x16: u32) {
        self.buffer.take(bits);
        self.last_x16 = quantiser_x16;
    }

    /// Returns whether the model of this type has learned from a picture.
    pub fn knows(&self, picture_type: PictureType) -> bool {
        self.models[picture_type as usize - 1].is_learnt
    }

    /// Returns a coarser quantiser if a picture of `bits` does not fit; `None` if it fits or no coarser one exists.
    pub fn coarser_after(&self, quantiser_x16: u32, bits: i64) -> Option<u32> {
        // Leave a sixteenth of the available bits as a margin.
        let room = (self.buffer.bits() * 15 / 16).max(1);
        (bits > self.buffer.bits() && quantiser_x16 < COARSEST_X16).then(|| {
            let scaled = i64::from(quantiser_x16) * bits / room;
            scaled.max(i64::from(quantiser_x16) + 16).min(i64::from(COARSEST_X16)) as u32
        })
    }
}

/// Clamps c to the allowed range around its initial value.
fn bounded_c(c: i64, first: i64) -> i64 {
    c.clamp(first / C_RANGE, first * C_RANGE)
}

/// Returns the power of quantiser_scale that bits depend on, in sixteenths.
fn power_x16(picture_type: PictureType, quantiser_x16: u32) -> i64 {
    match picture_type {
        // 16·q^(3/4) = (16^4·q³)^(1/4) = (16·(16·q)³)^(1/4); eight extra bits per root preserve the fraction.
        PictureType::I => ((16 * u64::from(quantiser_x16).pow(3)) << 16).isqrt().isqrt() as i64 >> 4,
        _ => i64::from(quantiser_x16),
    }
}

/// Returns the finest quantiser from `finest` on for which `fits` is true, or the coarsest if there is none.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameRate;

    /// Returns the rate control of 100 macroblocks at 1 Mbit/s.
    fn control() -> RateControl {
        let rate = Rate::Constant { bits_per_second: 1_000_000, buffer_bits: 500_000 };
        let config = Config::new(160, 160, FrameRate::FPS_25).with_lookahead(30).with_rate(rate);
        RateControl::new(&config, 100).expect("a bounded rate")
    }

    #[test]
    fn what_the_quantiser_does_not_govern_makes_none_coarser() {
        let mut control = control();
        for (cost, floor) in [(50, 20_000), (400, 30_000), (0, 39_000)] {
            let upcoming = [Upcoming { picture_type: PictureType::P, cost }; 30];
            for _ in 0..100 {
                let quantiser_x16 = control.quantiser_x16(&upcoming, None);
                control.learn(upcoming[0], quantiser_x16, Taken { floor, levels: 0 });
            }
            assert_eq!(control.quantiser_x16(&upcoming, None), FINEST_X16, "cost {cost}, floor {floor}");
        }
    }

    #[test]
    fn models_stay_possible() {
        let fresh = control();
        let mut control = fresh.clone();
        let picture = Upcoming { picture_type: PictureType::B, cost: 30_000 };
        for levels in [0, 1 << 40] {
            for _ in 0..100 {
                control.learn(picture, COARSEST_X16, Taken { floor: 0, levels });
            }
            assert!(control.check(&fresh).is_ok());
        }
        control.models[0].c *= C_RANGE + 1;
        assert!(control.check(&fresh).is_err());
    }

    #[test]
    fn the_coarsest_quantiser_follows_any_other() {
        let control = control();
        for quantiser_x16 in COARSEST_X16 - 20..COARSEST_X16 {
            assert_eq!(control.coarser_after(quantiser_x16, 1 << 30), Some(COARSEST_X16));
        }
        assert_eq!(control.coarser_after(COARSEST_X16, 1 << 30), None);
    }
}
