//! Frame rates of the standard.

use crate::ConfigError;
use mpeg2::FRAME_RATES;

/// A frame rate with a code in MPEG-2 (Table 6-4).
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

impl FrameRate {
    /// 25 frames per second.
    pub const FPS_25: Self = Self { code: 3 };
    /// 30 frames per second.
    pub const FPS_30: Self = Self { code: 5 };

    /// Returns the rate nearest to `fps`, if it differs by less than 0.01 frames per second.
    ///
    /// # Errors
    /// If no rate of the standard is that near.
    pub fn from_fps(fps: f64) -> Result<Self, ConfigError> {
        (1..=8)
            .map(|code| Self { code })
            .find(|rate| (rate.fps() - fps).abs() < 0.01)
            .ok_or(ConfigError::FrameRate { fps })
    }

    /// Returns the frame rate if every other picture of this rate has three fields; `None` unless the picture rate is 24 or
    /// 23.976.
    pub(crate) fn after_pulldown(self) -> Option<Self> {
        match self.code {
            1 => Some(Self { code: 4 }),
            2 => Some(Self { code: 5 }),
            _ => None,
        }
    }

    /// Returns the number of frames per second.
    pub fn fps(self) -> f64 {
        let (numerator, denominator) = self.fraction();
        f64::from(numerator) / f64::from(denominator)
    }

    /// Returns the number of frames per second as a fraction, for example (30000, 1001).
    pub fn fraction(self) -> (u32, u32) {
        FRAME_RATES[usize::from(self.code) - 1]
    }

    /// Returns frame_rate_code (6.3.3).
    pub fn code(self) -> u8 {
        self.code
    }
}
