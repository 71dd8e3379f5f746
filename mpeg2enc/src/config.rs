//! What to encode: plain values, checked once.

use crate::{CoefficientTable, Effort, Level, Rate, Standard};
use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};
use std::hash::{Hash, Hasher};

/// The largest distance of I pictures: no macroblock is predicted more than 131 times before it is coded intra again,
/// so that the differences of inverse transforms, which the standard allows, do not add up without end.
pub(crate) const GROUP_MAX: u32 = 132;
/// The largest width and height that horizontal_size and vertical_size can say (6.3.3, 14 bits).
const SIZE_MAX: usize = 16383;

/// Something in a [`Config`] that cannot be encoded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// Width or height out of range.
    #[error("a picture of {width}x{height} cannot be encoded; width and height go from 1 to {SIZE_MAX}")]
    Size {
        /// The width asked for.
        width: usize,
        /// The height asked for.
        height: usize,
    },
    /// No frame_rate_code says this rate.
    #[error("{fps} frames a second have no code in MPEG-2; use one of 23.976, 24, 25, 29.97, 30, 50, 59.94, 60")]
    FrameRate {
        /// The rate asked for.
        fps: f64,
    },
    /// Distance of I pictures out of range.
    #[error("a group of {pictures} pictures is not allowed; the distance of I pictures goes from 1 to {GROUP_MAX}")]
    GroupOfPictures {
        /// The distance asked for.
        pictures: u32,
    },
    /// More B pictures in a row than are allowed.
    #[error("{pictures} B pictures in a row are not allowed; use 0 to {B_PICTURES_MAX}")]
    BPictures {
        /// The number asked for.
        pictures: u32,
    },
    /// Look-ahead out of range.
    #[error("a look-ahead of {frames} frames is not allowed; use 0 to {LOOKAHEAD_MAX}")]
    Lookahead {
        /// The number in the settings.
        frames: u32,
    },
    /// B pictures wait for later ones, and so do bit rates and means of quantisers.
    #[error(
        "B pictures, bit rates and mean quantisers need a look-ahead: Config::with_lookahead of {least} frames at least, not {frames}"
    )]
    NeedsLookahead {
        /// The look-ahead in the settings.
        frames: u32,
        /// The least that is enough.
        least: u32,
    },
    /// No stream can state this rate and buffer.
    #[error(
        "{bits_per_second} bits a second with a buffer of {buffer_bits} bits are not possible; at most {rate_max} and {buffer_max} are at {level:?} Level, and the buffer holds 16384 bits or more"
    )]
    Rate {
        /// Bits a second asked for.
        bits_per_second: u32,
        /// The buffer asked for.
        buffer_bits: u32,
        /// The most that the level allows.
        rate_max: u64,
        /// The largest buffer of the level.
        buffer_max: u64,
        /// The level.
        level: Level,
    },
    /// A weight that a matrix may not have.
    #[error(
        "a weight of {value} at place {place} of a matrix is not allowed; weights are 1 to 255, the first intra weight is 8"
    )]
    Matrix {
        /// Place in raster order.
        place: usize,
        /// The weight.
        value: u8,
    },
    /// Neither table of quantiser_scale_code has the value.
    #[error("quantiser_scale {value} does not exist; nearest are {nearest} and {second}")]
    QuantiserScale {
        /// The value asked for.
        value: u32,
        /// The nearest that exists.
        nearest: u32,
        /// The nearest but one.
        second: u32,
    },
    /// No profile has such a precision.
    #[error("an intra DC precision of {bits} bits does not exist; use 8 to 11")]
    IntraDcPrecision {
        /// The precision asked for.
        bits: u32,
    },
    /// MPEG-1 does not have what was asked for.
    #[error("MPEG-1 does not have {what}: {remedy}")]
    NotInMpeg1 {
        /// What it does not have.
        what: &'static str,
        /// What to do instead.
        remedy: &'static str,
    },
    /// The level that was asked for is too low.
    #[error(
        "{width}x{height} at {fps:.3} frames a second is beyond {level:?} Level; {}",
        match .lowest { Some(lowest) => format!("{lowest:?} Level or above holds it"), None => "no level holds it: leave the level out".into() }
    )]
    Level {
        /// The level asked for.
        level: Level,
        /// The width asked for.
        width: usize,
        /// The height asked for.
        height: usize,
        /// The rate asked for.
        fps: f64,
        /// The lowest level that is enough.
        lowest: Option<Level>,
    },
}

/// A frame rate that MPEG-2 has a code for (Table 6-4).
///
/// ```
/// use mpeg2enc::FrameRate;
/// assert_eq!(FrameRate::from_fps(25.0)?.fps(), 25.0);
/// assert_eq!(FrameRate::from_fps(29.97)?.fps(), 30000.0 / 1001.0);
/// assert!(FrameRate::from_fps(26.0).is_err());
/// # Ok::<(), mpeg2enc::ConfigError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FrameRate {
    code: u8,
}

/// Table 6-4, as (numerator, denominator) for frame_rate_code 1, 2, 3, …
const FRAME_RATES: [(u32, u32); 8] =
    [(24000, 1001), (24, 1), (25, 1), (30000, 1001), (30, 1), (50, 1), (60000, 1001), (60, 1)];

impl FrameRate {
    /// 25 frames a second.
    pub const FPS_25: Self = Self { code: 3 };
    /// 30 frames a second.
    pub const FPS_30: Self = Self { code: 5 };

    /// The rate nearest to `fps`, if it is less than 0.01 frames a second away.
    pub fn from_fps(fps: f64) -> Result<Self, ConfigError> {
        (1..=8)
            .map(|code| Self { code })
            .find(|rate| (rate.fps() - fps).abs() < 0.01)
            .ok_or(ConfigError::FrameRate { fps })
    }

    /// Frames a second.
    pub fn fps(self) -> f64 {
        let (numerator, denominator) = self.fraction();
        f64::from(numerator) / f64::from(denominator)
    }

    /// Frames a second as a fraction, such as (30000, 1001).
    pub fn fraction(self) -> (u32, u32) {
        FRAME_RATES[usize::from(self.code) - 1]
    }

    /// frame_rate_code (6.3.3).
    pub fn code(self) -> u8 {
        self.code
    }
}

/// quantiser_scale for quantiser_scale_code 1 to 31 with q_scale_type 1 (Table 7-6).
#[rustfmt::skip]
const NON_LINEAR: [u32; 31] = [
    1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20, 22, 24, 28, 32, 36, 40, 44, 48, 52, 56, 64, 72, 80, 88, 96, 104, 112,
];

/// How a quantiser_scale is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuantiserScaleCode {
    /// False for the linear table (2, 4, … 62), true for the other (1 … 112).
    pub q_scale_type: bool,
    /// quantiser_scale_code, 1 to 31.
    pub code: u8,
}

/// quantiser_scale of a code (Table 7-6).
pub(crate) fn quantiser_scale_of(code: QuantiserScaleCode) -> u32 {
    if code.q_scale_type { NON_LINEAR[usize::from(code.code) - 1] } else { 2 * u32::from(code.code) }
}

/// The quantiser_scale_code whose scale is nearest to one in sixteenths.
pub(crate) fn nearest_code(q_scale_type: bool, scale_x16: u32) -> u8 {
    let distance =
        |&code: &u8| (16 * quantiser_scale_of(QuantiserScaleCode { q_scale_type, code })).abs_diff(scale_x16);
    (1..=31).min_by_key(distance).expect("31 codes")
}

/// One of the two scales around `scale_x16`, also in sixteenths, such that over many rows their mean is that.
pub(crate) fn spread_over_rows(q_scale_type: bool, scale_x16: u32, row: usize) -> u32 {
    let scales = (1..=31).map(|code| 16 * quantiser_scale_of(QuantiserScaleCode { q_scale_type, code }));
    let below = scales.clone().filter(|&scale| scale <= scale_x16).max();
    let above = scales.filter(|&scale| scale >= scale_x16).min();
    let (Some(below), Some(above)) = (below, above) else { return scale_x16 };
    // Neighbours are far apart in this order: 0, 128, 64, 192, …
    let order = u32::from((row as u8).reverse_bits());
    if 256 * (scale_x16 - below) > order * (above - below) { above } else { below }
}

/// The code of a quantiser_scale (7.4.2.2, Table 7-6): even values to 62 by the linear table, others by the non-linear.
///
/// ```
/// use mpeg2enc::quantiser_scale_code;
/// assert_eq!(quantiser_scale_code(16)?.code, 8);
/// assert!(quantiser_scale_code(7)?.q_scale_type);
/// let message = quantiser_scale_code(113).unwrap_err().to_string();
/// assert_eq!(message, "quantiser_scale 113 does not exist; nearest are 112 and 104");
/// # Ok::<(), mpeg2enc::ConfigError>(())
/// ```
pub fn quantiser_scale_code(quantiser_scale: u32) -> Result<QuantiserScaleCode, ConfigError> {
    if (2..=62).contains(&quantiser_scale) && quantiser_scale.is_multiple_of(2) {
        return Ok(QuantiserScaleCode { q_scale_type: false, code: (quantiser_scale / 2) as u8 });
    }
    if let Some(index) = NON_LINEAR.iter().position(|&scale| scale == quantiser_scale) {
        return Ok(QuantiserScaleCode { q_scale_type: true, code: index as u8 + 1 });
    }
    let mut scales: Vec<u32> = NON_LINEAR.into_iter().chain((1..=31).map(|code| 2 * code)).collect();
    scales.sort_unstable();
    scales.dedup();
    scales.sort_by_key(|scale| scale.abs_diff(quantiser_scale));
    Err(ConfigError::QuantiserScale { value: quantiser_scale, nearest: scales[0], second: scales[1] })
}

/// Settings of an [`Encoder`](crate::Encoder); [`Config::validate`] checks them.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Config {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) frame_rate: FrameRate,
    pub(crate) standard: Standard,
    pub(crate) gop: u32,
    pub(crate) quantiser_scale: u32,
    /// In 256ths, in the place of `quantiser_scale`.
    mean_quantiser_x256: Option<u32>,
    pub(crate) intra_dc_precision: u32,
    pub(crate) level: Option<Level>,
    pub(crate) effort: Effort,
    pub(crate) lookahead: u32,
    pub(crate) b_pictures: u32,
    pub(crate) closed_gop: bool,
    pub(crate) scene_cuts: bool,
    pub(crate) uniform_quantiser: bool,
    pub(crate) adaptive_quantisation: bool,
    pub(crate) alternate_scan: bool,
    pub(crate) intra_table: CoefficientTable,
    pub(crate) intra_matrix: [u8; 64],
    pub(crate) non_intra_matrix: [u8; 64],
    pub(crate) rate: Rate,
}

/// The most B pictures in a row: vectors would reach too far.
pub(crate) const B_PICTURES_MAX: u32 = 7;
/// The longest look-ahead: beyond a few dozen frames, what is inherited no longer changes.
const LOOKAHEAD_MAX: u32 = 30;

impl Config {
    /// The most frames of [`Config::with_lookahead`].
    pub const LOOKAHEAD_MAX: u32 = LOOKAHEAD_MAX;

    /// Pictures of this size, in luma samples: an I picture every 15, quantiser_scale 8, intra DC of 8 bits, no look-ahead.
    ///
    /// Width and height go from 1 to 16383. A multiple of 4096 cannot be written as horizontal_size or vertical_size
    /// (6.3.3): it is coded as one sample more, which decoders that do not look at the display size will show.
    pub fn new(width: usize, height: usize, frame_rate: FrameRate) -> Self {
        Self {
            width,
            height,
            frame_rate,
            standard: Standard::default(),
            gop: 15,
            quantiser_scale: 8,
            mean_quantiser_x256: None,
            intra_dc_precision: 8,
            level: None,
            effort: Effort::default(),
            lookahead: 0,
            b_pictures: 0,
            closed_gop: false,
            scene_cuts: true,
            uniform_quantiser: false,
            adaptive_quantisation: false,
            alternate_scan: false,
            intra_table: CoefficientTable::One,
            intra_matrix: DEFAULT_INTRA_MATRIX,
            non_intra_matrix: DEFAULT_NON_INTRA_MATRIX,
            rate: Rate::default(),
        }
    }

    /// The standard that the stream follows: MPEG-2 unless another is asked for.
    pub fn with_standard(self, standard: Standard) -> Self {
        Self { standard, ..self }
    }

    /// Distance between I pictures, 1 to 132.
    pub fn with_gop(self, pictures: u32) -> Self {
        Self { gop: pictures, ..self }
    }

    /// Distance between I pictures.
    #[must_use]
    pub fn gop(&self) -> u32 {
        self.gop
    }

    /// Quantiser of every macroblock: 1 to 8, even values to 62, 64, multiples of 8 to 112.
    pub fn with_quantiser_scale(self, quantiser_scale: u32) -> Self {
        Self { quantiser_scale, mean_quantiser_x256: None, ..self }
    }

    /// A quantiser between those that exist, from 1 to 112: each macroblock gets the nearest to what it would have, or, where they do
    /// not vary, each row of them one of the two around, so that their mean follows any fraction. Needs
    /// [`Config::with_lookahead`]; what is beyond 1 to 112 is brought there.
    pub fn with_mean_quantiser_scale(self, quantiser_scale: f64) -> Self {
        // What is no number counts as the finest.
        let within = if quantiser_scale > 1.0 { quantiser_scale.min(112.0) } else { 1.0 };
        let x256 = (256.0 * within).round() as u32;
        Self { mean_quantiser_x256: Some(x256), ..self }
    }

    /// What macroblocks' quantisers begin with, in 256ths.
    pub(crate) fn quantiser_x256(&self) -> u32 {
        self.mean_quantiser_x256.unwrap_or(256 * self.quantiser_scale)
    }

    /// Bits of the DC coefficient of intra blocks, 8 to 11 (intra_dc_precision, 6.3.10). 11 are in High Profile only, which the
    /// stream states then.
    pub fn with_intra_dc_precision(self, bits: u32) -> Self {
        Self { intra_dc_precision: bits, ..self }
    }

    /// States this level instead of the lowest that holds size and rate.
    pub fn with_level(self, level: Level) -> Self {
        Self { level: Some(level), ..self }
    }

    /// How much is tried for few bits.
    pub fn with_effort(self, effort: Effort) -> Self {
        Self { effort, ..self }
    }

    /// The most frames that wait for later ones before they are coded, 0 to 30.
    ///
    /// At 0 every frame is coded as it comes, as an I or P picture with one quantiser. A look-ahead allows B pictures, new
    /// groups at scene cuts, quantisers that follow what later pictures inherit, means of quantisers, and bit rates. 30 frames
    /// give the best quality. [`Effort::Fast`] at a constant quantiser waits only for as many as there are B pictures in a row.
    pub fn with_lookahead(self, frames: u32) -> Self {
        Self { lookahead: frames, ..self }
    }

    /// The most frames that wait for later ones before they are coded.
    #[must_use]
    pub fn lookahead(&self) -> u32 {
        self.lookahead
    }

    /// The most B pictures in a row, 0 to 7; they need a [look-ahead](Config::with_lookahead) of as many frames.
    pub fn with_b_pictures(self, pictures: u32) -> Self {
        Self { b_pictures: pictures, ..self }
    }

    /// Whether no group of pictures needs the group before: no B pictures in front of its I picture then.
    pub fn with_closed_gop(self, closed: bool) -> Self {
        Self { closed_gop: closed, ..self }
    }

    /// Whether an encoder that looks ahead begins a group of pictures where a new scene begins. On unless switched off.
    pub fn with_scene_cuts(self, scene_cuts: bool) -> Self {
        Self { scene_cuts, ..self }
    }

    /// Whether an encoder that looks ahead leaves the quantiser of I and P pictures the same everywhere; without a look-ahead
    /// it always is.
    pub fn with_uniform_quantiser(self, uniform: bool) -> Self {
        Self { uniform_quantiser: uniform, ..self }
    }

    /// Whether an encoder that looks ahead makes quantisers finer where the picture is smooth and coarser where it is busy,
    /// which eyes and SSIM prefer; PSNR falls. Off unless switched on.
    pub fn with_adaptive_quantisation(self, adaptive: bool) -> Self {
        Self { adaptive_quantisation: adaptive, ..self }
    }

    /// Whether coefficients are sent in the order of Figure 7-3, meant for interlace, instead of zig-zag.
    pub fn with_alternate_scan(self, alternate: bool) -> Self {
        Self { alternate_scan: alternate, ..self }
    }

    /// The table that coefficients of intra blocks are coded with (intra_vlc_format, 6.3.10): Table B.15 unless another is
    /// asked for, which takes 1 to 3 % fewer bits over the clips of README.md.
    pub fn with_intra_table(self, table: CoefficientTable) -> Self {
        Self { intra_table: table, ..self }
    }

    /// Weighting matrices in raster order (6.3.11): weights of 1 to 255, the first of the intra matrix 8.
    pub fn with_matrices(self, intra: [u8; 64], non_intra: [u8; 64]) -> Self {
        Self { intra_matrix: intra, non_intra_matrix: non_intra, ..self }
    }

    /// Weighting matrices of intra and of predicted blocks, in raster order.
    pub fn matrices(&self) -> ([u8; 64], [u8; 64]) {
        (self.intra_matrix, self.non_intra_matrix)
    }

    /// Bits of the DC coefficient of intra blocks; its step is 8, 4, 2, 1 for 8 to 11 (7.4.1).
    pub fn intra_dc_precision(&self) -> u32 {
        self.intra_dc_precision
    }

    /// How quantisers are chosen; all but [`Rate::ConstantQuantiser`] need a [look-ahead](Config::with_lookahead).
    pub fn with_rate(self, rate: Rate) -> Self {
        Self { rate, ..self }
    }

    /// May macroblocks have quantisers of their own?
    pub(crate) fn varies(&self) -> bool {
        self.lookahead > 0 && !self.uniform_quantiser
    }

    /// Is the quantiser a mean of those that macroblocks have?
    pub(crate) fn asks_for_a_mean(&self) -> bool {
        self.mean_quantiser_x256.is_some()
    }

    /// Does quality follow what later pictures take over?
    pub(crate) fn uses_tree(&self) -> bool {
        self.varies() && self.effort != Effort::Fast
    }

    /// Are B pictures placed by content?
    pub(crate) fn adapts_types(&self) -> bool {
        self.effort != Effort::Fast
    }

    /// Frames that wait before one is coded. Within a rate they tell how bits will be spent: with two or three of them alone,
    /// an I picture among these took all bits, and fast films at constant rates were 5 dB worse.
    pub(crate) fn delay(&self) -> usize {
        let needed = match self.effort {
            Effort::Fast if self.rate == Rate::ConstantQuantiser => self.b_pictures,
            _ => LOOKAHEAD_MAX,
        };
        needed.min(self.lookahead) as usize
    }

    /// A number for all settings but the quantiser: other settings have another one.
    pub(crate) fn fingerprint(&self) -> u64 {
        let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
        Self { quantiser_scale: 0, mean_quantiser_x256: None, ..self.clone() }.hash(&mut hash);
        hash.finish()
    }

    /// The level that the stream will state; beyond High Level, where none is right, it states High.
    pub fn level(&self) -> Level {
        let (rate, buffer) = self.rate.stated().unwrap_or_default();
        let holds_rate = |level: &Level| {
            let limits = level.limits();
            400 * u64::from(rate) <= limits.bits_per_second && u64::from(buffer) <= limits.vbv_buffer_size
        };
        let lowest = Level::lowest(self.width, self.height, self.frame_rate.fps()).unwrap_or(Level::High);
        let levels = [Level::Low, Level::Main, Level::High1440, Level::High];
        self.level
            .or_else(|| levels.into_iter().find(|level| *level >= lowest && holds_rate(level)))
            .unwrap_or(Level::High)
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

    /// Checks all settings.
    ///
    /// # Errors
    /// The first setting that the standard or the encoder does not have; the message says what is possible.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let (width, height, fps) = (self.width, self.height, self.frame_rate.fps());
        if !(1..=SIZE_MAX).contains(&width) || !(1..=SIZE_MAX).contains(&height) {
            return Err(ConfigError::Size { width, height });
        }
        if !(1..=GROUP_MAX).contains(&self.gop) {
            return Err(ConfigError::GroupOfPictures { pictures: self.gop });
        }
        quantiser_scale_code(self.quantiser_scale)?;
        self.standard.check(self)?;
        if !(8..=11).contains(&self.intra_dc_precision) {
            return Err(ConfigError::IntraDcPrecision { bits: self.intra_dc_precision });
        }
        if let Some(level) = self.level.filter(|level| !level.limits().hold(width, height, fps)) {
            let lowest = Level::lowest(width, height, fps);
            return Err(ConfigError::Level { level, width, height, fps, lowest });
        }
        if self.b_pictures > B_PICTURES_MAX {
            return Err(ConfigError::BPictures { pictures: self.b_pictures });
        }
        if self.lookahead > LOOKAHEAD_MAX {
            return Err(ConfigError::Lookahead { frames: self.lookahead });
        }
        let plans = self.rate != Rate::ConstantQuantiser || self.mean_quantiser_x256.is_some();
        let least = self.b_pictures.max(plans.into());
        if self.lookahead < least {
            return Err(ConfigError::NeedsLookahead { frames: self.lookahead, least });
        }
        if let Rate::Constant { bits_per_second, buffer_bits } | Rate::Capped { bits_per_second, buffer_bits } =
            self.rate
        {
            let limits = self.level().limits();
            let (rate_max, buffer_max) = (limits.bits_per_second, 16_384 * limits.vbv_buffer_size);
            let (rate, buffer) = self.rate.stated().expect("a bounded rate");
            if rate == 0 || buffer == 0 || 400 * u64::from(rate) > rate_max || u64::from(buffer_bits) > buffer_max {
                let level = self.level();
                return Err(ConfigError::Rate { bits_per_second, buffer_bits, rate_max, buffer_max, level });
            }
        }
        for (matrix, first) in [(&self.intra_matrix, Some(8)), (&self.non_intra_matrix, None)] {
            let wrong = |&(place, &value): &(usize, &u8)| value == 0 || place == 0 && first.is_some_and(|f| f != value);
            if let Some((place, &value)) = matrix.iter().enumerate().find(wrong) {
                return Err(ConfigError::Matrix { place, value });
            }
        }
        Ok(())
    }
}

/// The hash of Fowler, Noll and Vo (FNV-1a), which is the same in every build.
struct Fnv(u64);

impl Hasher for Fnv {
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_brought_within_what_exists() {
        for (asked, x256) in [(f64::NAN, 256), (-3.0, 256), (2.5, 640), (1e9, 112 * 256), (f64::INFINITY, 112 * 256)] {
            let config = Config::new(16, 16, FrameRate::FPS_25);
            assert_eq!(config.with_mean_quantiser_scale(asked).quantiser_x256(), x256, "{asked}");
        }
    }

    #[test]
    fn rows_have_the_mean_that_was_asked_for() {
        for q_scale_type in [false, true] {
            for scale_x16 in 32..16 * 62 {
                let rows: Vec<u32> = (0..256).map(|row| spread_over_rows(q_scale_type, scale_x16, row)).collect();
                let mean = f64::from(rows.iter().sum::<u32>()) / 256.0;
                assert!((mean - f64::from(scale_x16)).abs() <= 0.5, "{mean} for {scale_x16}");
                // Each is a scale that exists, and no more than two are taken.
                assert!(rows.iter().all(|&x16| x16 % 16 == 0 && spread_over_rows(q_scale_type, x16, 1) == x16));
                assert!(rows.iter().max().unwrap() - rows.iter().min().unwrap() <= 16 * 8);
            }
        }
        assert_eq!(spread_over_rows(true, 16 * 120, 3), 16 * 120, "beyond the last");
    }

    #[test]
    fn every_code_gives_its_scale() {
        for scale in 0..200 {
            match quantiser_scale_code(scale) {
                Ok(QuantiserScaleCode { q_scale_type: false, code }) => assert_eq!(2 * u32::from(code), scale),
                Ok(QuantiserScaleCode { q_scale_type: true, code }) => {
                    assert_eq!(NON_LINEAR[usize::from(code) - 1], scale)
                }
                Err(error) => {
                    assert!(error.to_string().starts_with(&format!("quantiser_scale {scale} does not exist")))
                }
            }
        }
        let nearest = |scale| quantiser_scale_code(scale).unwrap_err().to_string();
        assert!(nearest(0).ends_with("nearest are 1 and 2"));
        assert!(nearest(63).ends_with("nearest are 62 and 64"));
    }

    #[test]
    fn errors_name_value_and_range() {
        let config = || Config::new(64, 48, FrameRate::FPS_25);
        let message = |config: Config| config.encoder().err().expect("an error").to_string();
        assert!(message(Config::new(0, 48, FrameRate::FPS_25)).contains("0x48"));
        assert!(message(Config::new(64, 16384, FrameRate::FPS_25)).contains("1 to 16383"));
        assert!(message(config().with_gop(0)).contains("1 to 132"));
        assert!(message(config().with_gop(133)).contains("133"));
        assert!(message(config().with_quantiser_scale(9)).contains("8 and 10"));
        assert!(message(config().with_intra_dc_precision(12)).contains("8 to 11"));
        let big = Config::new(1280, 720, FrameRate::FPS_25).with_level(Level::Main);
        assert!(message(big).contains("High1440 Level or above"));
        assert!(FrameRate::from_fps(12.5).unwrap_err().to_string().contains("23.976"));
        assert!(FrameRate::from_fps(f64::NAN).is_err());
    }
}
