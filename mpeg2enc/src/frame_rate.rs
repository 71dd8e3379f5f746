//! Frame rates of the standard.

use crate::ConfigError;

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

    /// The rate nearest to `fps`, less than 0.01 frames a second away.
    ///
    /// # Errors
    /// No rate of the standard is so near.
    pub fn from_fps(fps: f64) -> Result<Self, ConfigError> {
        (1..=8)
            .map(|code| Self { code })
            .find(|rate| (rate.fps() - fps).abs() < 0.01)
            .ok_or(ConfigError::FrameRate { fps })
    }

    /// The rate of frames in which every other picture of this rate has three fields; none of rates other than 24.
    pub(crate) fn after_pulldown(self) -> Option<Self> {
        match self.code {
            1 => Some(Self { code: 4 }),
            2 => Some(Self { code: 5 }),
            _ => None,
        }
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
