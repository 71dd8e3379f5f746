//! Validation of settings.

use super::Config;
use crate::{
    ColorDescription, ConfigError, Level, Rate, Standard,
    limits::{B_PICTURES_MAX, GROUP_MAX, LOOKAHEAD_MAX, SIZE_MAX},
    quantiser_scale::quantiser_scale_code,
};

impl Config {
    /// Checks all settings.
    ///
    /// # Errors
    /// If the standard or this encoder does not support a setting. The error contains the first unsupported setting and its
    /// allowed range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let (width, height, fps) = (self.width, self.height, self.frame_rate.fps());
        let stated = self.stated_frame_rate().fps();
        // Check ranges of single settings first, then combinations.
        if !(1..=SIZE_MAX).contains(&width) || !(1..=SIZE_MAX).contains(&height) {
            return Err(ConfigError::Size { width, height });
        }
        if !(1..=GROUP_MAX).contains(&self.gop) {
            return Err(ConfigError::GroupOfPictures { pictures: self.gop });
        }
        quantiser_scale_code(self.quantiser_scale)?;
        check_standard(self)?;
        if self.pulldown && self.frame_rate.after_pulldown().is_none() {
            return Err(ConfigError::Pulldown { fps });
        }
        if !(8..=11).contains(&self.intra_dc_precision) {
            return Err(ConfigError::IntraDcPrecision { bits: self.intra_dc_precision });
        }
        // An explicit level must allow size and rate.
        if let Some(level) = self.level.filter(|level| !level.limits().hold(width, height, stated)) {
            let lowest = Level::lowest(width, height, stated);
            return Err(ConfigError::Level { level, width, height, fps: stated, lowest });
        }
        if self.b_pictures > B_PICTURES_MAX {
            return Err(ConfigError::BPictures { pictures: self.b_pictures });
        }
        if self.lookahead > LOOKAHEAD_MAX {
            return Err(ConfigError::Lookahead { frames: self.lookahead });
        }
        // Rate control and mean quantisers plan over at least one waiting frame.
        let plans = self.rate != Rate::ConstantQuantiser || self.mean_quantiser_x256.is_some();
        let least = self.b_pictures.max(plans.into());
        if self.lookahead < least {
            return Err(ConfigError::NeedsLookahead { frames: self.lookahead, least });
        }
        check_rate(self)?;
        // The intra DC has a fixed weight of 8 (6.3.11).
        for (matrix, first) in [(&self.intra_matrix, Some(8)), (&self.non_intra_matrix, None)] {
            let wrong = |&(place, &value): &(usize, &u8)| value == 0 || place == 0 && first.is_some_and(|f| f != value);
            if let Some((place, &value)) = matrix.iter().enumerate().find(wrong) {
                return Err(ConfigError::Matrix { place, value });
            }
        }
        Ok(())
    }
}

/// Checks that the standard allows these settings.
fn check_standard(config: &Config) -> Result<(), ConfigError> {
    let missing = |what, remedy| Err(ConfigError::NotInMpeg1 { what, remedy });
    match config.standard {
        Standard::Mpeg2 => Ok(()),
        Standard::Mpeg1 if config.width > 4095 || config.height > 2800 => {
            missing("pictures of this size", "use a width of at most 4095 and a height of at most 2800")
        }
        Standard::Mpeg1 if config.quantiser_scale > 62 || !config.quantiser_scale.is_multiple_of(2) => {
            missing("this quantiser_scale", "use an even value from 2 to 62")
        }
        Standard::Mpeg1 if config.intra_dc_precision != 8 => missing("this intra DC precision", "use 8 bits"),
        Standard::Mpeg1 if config.pulldown => missing("pulldown", "omit it or use MPEG-2"),
        Standard::Mpeg1 if config.alternate_scan => missing("the alternate scan", "omit it"),
        Standard::Mpeg1 if config.color != ColorDescription::default() => {
            missing("a color description", "omit it or use MPEG-2")
        }
        Standard::Mpeg1 if config.aspect.code(config.standard, config.width, config.height).is_none() => missing(
            "this sample aspect ratio",
            "scale the pictures to a sample aspect ratio of 0.8 to 1.5, or use MPEG-2",
        ),
        Standard::Mpeg1 => Ok(()),
    }
}

/// Returns the minimum bits of a picture: its headers, and a slice of one macroblock per row.
fn least_bits(config: &Config) -> u64 {
    // picture_header() of a P picture and picture_coding_extension() take 66 bits each, and both are padded to whole bytes.
    let headers = match config.standard {
        Standard::Mpeg1 => 72,
        Standard::Mpeg2 => 144,
    };
    // slice() takes 38 bits without macroblocks, and a macroblock without coefficients takes 6; both are padded to whole bytes.
    headers + 48 * config.height.div_ceil(16) as u64
}

/// Checks that the level allows bit rate and buffer size, and that both suffice for the smallest pictures.
fn check_rate(config: &Config) -> Result<(), ConfigError> {
    if let Rate::Constant { bits_per_second, buffer_bits } | Rate::Capped { bits_per_second, buffer_bits } = config.rate
    {
        let limits = config.level().limits();
        let (rate_max, buffer_max) = (limits.bits_per_second, 16_384 * limits.vbv_buffer_size);
        let (rate, buffer) = config.rate.stated().expect("a bounded rate");
        // Rate and buffer must not round to zero, and the level limits both.
        if rate == 0 || buffer == 0 || 400 * u64::from(rate) > rate_max || u64::from(buffer_bits) > buffer_max {
            let level = config.level();
            return Err(ConfigError::Rate { bits_per_second, buffer_bits, rate_max, buffer_max, level });
        }

        // Even a picture equal to the previous one takes bits.
        let picture_bits = least_bits(config);
        let rate_least = (picture_bits as f64 * config.frame_rate.fps()).ceil() as u64;
        if 400 * u64::from(rate) < rate_least || 16_384 * u64::from(buffer) < picture_bits {
            let buffer_least = picture_bits.next_multiple_of(16_384);
            return Err(ConfigError::TooFewBits {
                bits_per_second,
                buffer_bits,
                picture_bits,
                rate_least,
                buffer_least,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameRate;

    #[test]
    fn errors_name_value_and_range() {
        let config = || Config::new(64, 48, FrameRate::FPS_25);
        let message = |config: Config| config.validate().expect_err("an error").to_string();
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
