//! Levels of Main Profile and their limits (clause 8).

/// A level of Main Profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Level {
    /// Low Level: up to 352×288 at 30 pictures per second.
    Low,
    /// Main Level: up to 720×576, 10 368 000 luma samples per second.
    Main,
    /// High-1440 Level: up to 1440×1152, 47 001 600 luma samples per second.
    High1440,
    /// High Level: up to 1920×1152, 62 668 800 luma samples per second.
    High,
}

/// Limits of a level (tables of clause 8).
pub(crate) struct Limits {
    pub level: Level,
    /// The four bits of the level in profile_and_level_indication.
    pub level_indication: u32,
    pub width: usize,
    pub height: usize,
    pub pictures_per_second: f64,
    pub luma_samples_per_second: f64,
    pub bits_per_second: u64,
    /// Maximum vbv_buffer_size, in units of 16 384 bits.
    pub vbv_buffer_size: u64,
    pub f_code_horizontal: u32,
    pub f_code_vertical: u32,
}

#[rustfmt::skip]
const LIMITS: [Limits; 4] = [
    Limits {
        level: Level::Low, level_indication: 0b1010, width: 352, height: 288, pictures_per_second: 30.0,
        luma_samples_per_second: 3_041_280.0, bits_per_second: 4_000_000, vbv_buffer_size: 29,
        f_code_horizontal: 7, f_code_vertical: 4,
    },
    Limits {
        level: Level::Main, level_indication: 0b1000, width: 720, height: 576, pictures_per_second: 30.0,
        luma_samples_per_second: 10_368_000.0, bits_per_second: 15_000_000, vbv_buffer_size: 112,
        f_code_horizontal: 8, f_code_vertical: 5,
    },
    Limits {
        level: Level::High1440, level_indication: 0b0110, width: 1440, height: 1152, pictures_per_second: 60.0,
        luma_samples_per_second: 47_001_600.0, bits_per_second: 60_000_000, vbv_buffer_size: 448,
        f_code_horizontal: 9, f_code_vertical: 5,
    },
    Limits {
        level: Level::High, level_indication: 0b0100, width: 1920, height: 1152, pictures_per_second: 60.0,
        luma_samples_per_second: 62_668_800.0, bits_per_second: 80_000_000, vbv_buffer_size: 597,
        f_code_horizontal: 9, f_code_vertical: 5,
    },
];

impl Level {
    /// Returns the lowest level that allows pictures of this size at this rate; `None` beyond High Level.
    pub fn lowest(width: usize, height: usize, fps: f64) -> Option<Self> {
        LIMITS.iter().find(|limits| limits.hold(width, height, fps)).map(|limits| limits.level)
    }

    /// Returns the bit rate of the level that has this vbv_buffer_size, in units of 400 bits per second.
    pub(crate) fn rate_of_buffer(vbv_buffer_size: u32) -> Option<u32> {
        let limits = LIMITS.iter().find(|limits| limits.vbv_buffer_size == u64::from(vbv_buffer_size))?;
        Some((limits.bits_per_second / 400) as u32)
    }

    pub(crate) fn limits(self) -> &'static Limits {
        &LIMITS[self as usize]
    }
}

impl Limits {
    /// Returns whether the level allows pictures of this size at this rate.
    pub fn hold(&self, width: usize, height: usize, fps: f64) -> bool {
        width <= self.width
            && height <= self.height
            && fps <= self.pictures_per_second
            && (width * height) as f64 * fps <= self.luma_samples_per_second
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_of_known_formats() {
        for (level, indication) in LIMITS.iter().zip([10, 8, 6, 4]) {
            assert_eq!(level.level_indication, indication);
            assert_eq!(level.level.limits().level, level.level);
        }
        assert_eq!(Level::lowest(352, 288, 30.0), Some(Level::Low));
        assert_eq!(Level::lowest(720, 576, 25.0), Some(Level::Main));
        assert_eq!(Level::lowest(704, 576, 30.0), Some(Level::High1440), "above the sample rate of Main Level");
        assert_eq!(Level::lowest(1920, 1080, 25.0), Some(Level::High));
        assert_eq!(Level::lowest(1920, 1080, 60.0), None);
    }
}
