//! The quantiser of the next picture, so that the stream keeps to a bit rate and the decoder's buffer holds it.
//!
//! Bits are predicted from what the lookahead measured:
//!
//! ```text
//! bits = f + c·cost / (q^a·e(u))        f     floor: headers, types, vectors, DC coefficients
//! u    = κ·q·n / cost                   c     learnt from the pictures of the same type
//! e(u) = 1 + u + u²/2 + u³/6            cost  sum of differences that a picture leaves when predicted
//!                                       q, n  quantiser_scale, number of macroblocks
//!                                       a     3/4 for I pictures, 1 for others
//! ```
//! e(u) is near e^u: where q is large beside the mean difference cost/n, nearly all levels are zero.
//!
//! All frames that wait are to be coded with one quantiser_scale, which is found by bisection. It is the finest with which
//! the buffer does not run dry, and the bits come out right at the end. Once the buffer is full, what comes later no
//! longer depends on the pictures before. All that is done anew for each picture.

use crate::{
    CoefficientTable, Config, PictureStatistics, PictureType, Rate, RestoreError, rate::starting_fullness,
    restore::ensure, vbv::Buffer,
};

/// A picture that will be coded, in the order of coding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Upcoming {
    pub picture_type: PictureType,
    pub cost: u64,
}

/// quantiser_scale in sixteenths: finest and coarsest.
const FINEST_X16: u32 = 16;
const COARSEST_X16: u32 = 112 * 16;
/// f of I, P, B before anything is learnt, in bits a macroblock. These, and the numbers of c and κ, are middle values over
/// the clips of the rate table of README.md, at quantiser_scale 1 to 48 and every effort.
const FIRST_FLOOR: [i64; 3] = [45, 8, 8];
/// c of I, P, B before anything is learnt, in 256ths.
const FIRST_C: [i64; 3] = [750, 2500, 2000];
/// κ of I, P, B.
const KAPPA: [i64; 3] = [0, 2, 6];
/// The most that u can be, in 256ths: no level is left there.
const MOST_U: i64 = 32 << 8;
/// c is at most this many times as large or as small as before anything is learnt: noise at rest tells little of a scene that
/// follows. With 16 that scene lost up to 1.1 dB (a title, then action, at most 300 kbit/s).
const C_RANGE: i64 = 4;
/// The least cost of a macroblock, in the mean, of which c is learnt: less is noise that even the finest quantiser takes
/// away, or nothing at all.
const LEAST_COST: u64 = 2;
/// Levels tell c where they take more than this part of the floor, or were to take it. Chosen, not tuned.
const LEVELS_OF_FLOOR: i64 = 8;
/// Least ratio of a quantiser to the one before, in thirds, at a constant rate. With 2 instead of no limit, a clip of slow waves
/// after dark still frames gains 0.8 dB (effort fast, 70 kbit/s). The clips of the rate table gain 0.04 dB on average at 300 kbit/s.
const LEAST_OF_LAST_THIRDS: u32 = 2;
/// Part of the buffer that planning does not touch, in 16ths: predicted bits are never exact.
const RESERVE_SIXTEENTHS: i64 = 1;
/// More bits than any picture takes.
const MOST_BITS: i64 = 1 << 40;

/// Bits that a picture took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taken {
    /// Bits that the quantiser hardly governs.
    pub floor: i64,
    /// Bits of levels.
    pub levels: i64,
}

impl Taken {
    pub fn bits(self) -> i64 {
        self.floor + self.levels
    }
}

/// How many bits the pictures of a type take.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Model {
    /// f, in bits.
    floor: i64,
    /// c in 256ths.
    c: i64,
    /// Was anything learnt?
    is_learnt: bool,
}

/// Chooses quantisers, and keeps the buffer.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct RateControl {
    pub buffer: Buffer,
    rate: Rate,
    quantiser_x16: u32,
    /// The quantiser of the last picture, in sixteenths.
    last_x16: u32,
    start: i64,
    macroblocks: i64,
    /// Bits of an intra macroblock of zeros, without its type.
    empty_intra_bits: i64,
    /// For I, P, B.
    models: [Model; 3],
}

impl RateControl {
    /// `None` where bits are not bounded.
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
            // dct_dc_size of zero has 3 bits in a block of luma and 2 in one of chroma; End of block has 2 or 4.
            empty_intra_bits: 4 * 3 + 2 * 2 + 6 * if config.intra_table == CoefficientTable::Zero { 2 } else { 4 },
            models: std::array::from_fn(first),
        })
    }

    /// Uses the quantiser of changed settings.
    pub fn set_quantiser(&mut self, config: &Config) {
        self.quantiser_x16 = config.quantiser_x256() / 16;
    }

    /// Whether this follows from the one with which an encoder of the same settings begins.
    pub fn check(&self, fresh: &Self) -> Result<(), RestoreError> {
        let settings = |of: &Self| (of.rate, of.start, of.macroblocks, of.empty_intra_bits);
        ensure(settings(self) == settings(fresh) && self.buffer.is_like(&fresh.buffer), "rate control")?;
        let is_quantiser = |x16: u32| (FINEST_X16..=COARSEST_X16).contains(&x16);
        ensure(is_quantiser(self.quantiser_x16) && is_quantiser(self.last_x16), "the quantiser of rate control")?;
        let is_possible = |(model, first): (&Model, i64)| {
            (0..=MOST_BITS).contains(&model.floor) && bounded_c(model.c, first) == model.c
        };
        ensure(self.models.iter().zip(FIRST_C).all(is_possible), "the models of rate control")
    }

    /// q^a·e(u)/cost, of which c is divided to bits: as numerator, in 4096ths, and denominator.
    fn divisor(&self, picture: Upcoming, quantiser_x16: u32) -> (i64, i64) {
        let kappa = KAPPA[picture.picture_type as usize - 1];
        let cost = (picture.cost as i64).max(1);
        let u = (16 * kappa * i64::from(quantiser_x16) * self.macroblocks / cost).min(MOST_U);
        let e = 256 + u + u * u / (2 << 8) + u * u * u / (6 << 16);
        (power_x16(picture.picture_type, quantiser_x16) * e, cost)
    }

    /// Bits that a picture will take.
    pub fn predicted(&self, picture: Upcoming, quantiser_x16: u32) -> Taken {
        let Model { floor, c, .. } = self.models[picture.picture_type as usize - 1];
        let (divisor, cost) = self.divisor(picture, quantiser_x16);
        Taken { floor, levels: 16 * c * cost / divisor }
    }

    /// quantiser_scale in sixteenths for the first of `upcoming`; `tried` is what that picture took, if it was coded already.
    pub fn quantiser_x16(&self, upcoming: &[Upcoming], tried: Option<(u32, Taken)>) -> u32 {
        let (finest, left) = match self.rate {
            Rate::ConstantQuantiser => return self.quantiser_x16,
            Rate::Capped { .. } => (self.quantiser_x16, i64::MIN),
            // Where all levels were zero, nothing tells how many a far finer quantiser makes.
            Rate::Constant { .. } => ((self.last_x16 * LEAST_OF_LAST_THIRDS / 3).max(FINEST_X16), self.start),
        };
        least(finest, |q| {
            let first = tried.map(|(tried_x16, taken)| self.rescaled(upcoming[0], tried_x16, taken, q));
            let later = upcoming[usize::from(first.is_some())..].iter().map(|&picture| self.predicted(picture, q));
            self.fits(first.into_iter().chain(later), left)
        })
    }

    /// Bits of a picture with another quantiser than the one that was tried.
    fn rescaled(&self, picture: Upcoming, tried_x16: u32, taken: Taken, quantiser_x16: u32) -> Taken {
        let [(tried, _), (wanted, _)] = [tried_x16, quantiser_x16].map(|q| self.divisor(picture, q));
        // No levels at all may become many with a finer quantiser.
        let levels = taken.levels.max(taken.floor / LEVELS_OF_FLOOR);
        Taken { levels: (i128::from(levels) * i128::from(tried) / i128::from(wanted)) as i64, ..taken }
    }

    /// Does the buffer get full before these pictures run it dry? If neither happens, are `left` bits in it at the end?
    fn fits(&self, pictures: impl Iterator<Item = Taken>, left: i64) -> bool {
        let mut buffer = self.buffer;
        let reserve = buffer.size * RESERVE_SIXTEENTHS / 16;
        let (mut floors, mut all_levels) = (0, 0);
        for picture in pictures {
            let bits = picture.bits();
            (floors, all_levels) = (floors + picture.floor, all_levels + picture.levels);
            // Where few levels are left, none can be saved.
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

    /// Model of a picture by what it took with this quantiser.
    fn measured(&self, picture: Upcoming, quantiser_x16: u32, taken: Taken) -> Model {
        let index = picture.picture_type as usize - 1;
        let Taken { floor, levels } = taken;
        // Levels that are few beside the floor, and were to be few, tell nothing about others.
        let is_quiet = picture.cost < LEAST_COST * self.macroblocks as u64;
        if is_quiet || levels.max(self.predicted(picture, quantiser_x16).levels) < floor / LEVELS_OF_FLOOR {
            return Model { floor, ..self.models[index] };
        }
        let (divisor, cost) = self.divisor(picture, quantiser_x16);
        let c = (i128::from(levels) * i128::from(divisor) / (16 * i128::from(cost))).min(1 << 40) as i64;
        Model { floor, c: bounded_c(c, FIRST_C[index]), is_learnt: true }
    }

    /// Learns from a picture that took this with a quantiser.
    pub fn learn(&mut self, picture: Upcoming, quantiser_x16: u32, taken: Taken) {
        let measured = self.measured(picture, quantiser_x16, taken);
        let model = &mut self.models[picture.picture_type as usize - 1];
        if !model.is_learnt {
            *model = measured;
            return;
        }
        // c changes to three quarters at least, to five halves at most.
        model.floor = (model.floor + measured.floor) / 2;
        model.c = (model.c + measured.c.clamp(model.c / 2, model.c * 4)) / 2;
    }

    /// Bits of a picture, told apart: all but those of levels are the floor.
    pub fn taken(&self, bits: i64, statistics: &PictureStatistics) -> Taken {
        let empty = self.empty_intra_bits * i64::from(statistics.intra);
        let levels = (statistics.coefficient_bits as i64 - empty).clamp(0, bits);
        Taken { floor: bits - levels, levels }
    }

    /// Takes a picture out of the buffer that is finished with this quantiser.
    pub fn take(&mut self, bits: i64, quantiser_x16: u32) {
        self.buffer.take(bits);
        self.last_x16 = quantiser_x16;
    }

    /// Was anything learnt of this type?
    pub fn knows(&self, picture_type: PictureType) -> bool {
        self.models[picture_type as usize - 1].is_learnt
    }

    /// A coarser quantiser after a picture of `bits` did not fit; `None` if there is none.
    pub fn coarser_after(&self, quantiser_x16: u32, bits: i64) -> Option<u32> {
        let room = (self.buffer.bits() * 15 / 16).max(1);
        (bits > self.buffer.bits() && quantiser_x16 < COARSEST_X16).then(|| {
            let scaled = i64::from(quantiser_x16) * bits / room;
            scaled.max(i64::from(quantiser_x16) + 16).min(i64::from(COARSEST_X16)) as u32
        })
    }
}

/// c within the range about what it is first.
fn bounded_c(c: i64, first: i64) -> i64 {
    c.clamp(first / C_RANGE, first * C_RANGE)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameRate;

    /// 100 macroblocks at 1 Mbit/s.
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
