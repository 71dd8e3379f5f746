//! Limits of a stream at a constant quantiser: the level, and the level's buffer, which must not underflow.
//!
//! Headers precede pictures, so the first picture determines the level. The encoder chooses the lowest level with enough buffer
//! for that picture and enough bit rate for equally large ones. Later pictures that do not fit are coded with a coarser
//! quantiser.

use crate::{Config, Level, Rate, RestoreError, Standard, restore::ensure, vbv::Buffer};

/// Maximum vbv_buffer_size of MPEG-1, in units of 16 384 bits: 10 bits (11172-2, 2.4.3.2).
const MPEG1_BUFFER_MAX: u32 = 0x3ff;
/// Coarsest quantiser_scale, in 256ths.
const COARSEST_X256: u64 = 112 * 256;

/// The level of the stream, and the fullness of the level's buffer.
#[derive(Clone, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Bounds {
    level: Option<Level>,
    /// Decoder's buffer; `None` before the first picture, and if a rate bounds the bits.
    buffer: Option<Buffer>,
}

impl Bounds {
    /// Chooses the level from the `bits` of the first picture and sets it in `config`.
    pub fn begin(&mut self, config: &mut Config, bits: u64) {
        if self.buffer.is_some() || config.rate != Rate::ConstantQuantiser {
            return;
        }
        config.hold(bits);
        self.level = config.raised;
        self.buffer = Some(buffer(config));
    }

    /// Sets the chosen level in `config` again.
    pub fn restate(&self, config: &mut Config) {
        config.raised = self.level;
    }

    /// Returns a coarser quantiser_scale in 256ths if a picture of `bits` bits does not fit; `None` if it fits or no coarser one
    /// exists.
    pub fn coarser(&self, scale_x256: u32, bits: u64) -> Option<u32> {
        let left = self.buffer.as_ref()?.bits().max(1) as u64;
        if bits <= left || u64::from(scale_x256) >= COARSEST_X256 {
            return None;
        }
        // Leave a sixteenth of the available bits as a margin.
        let scaled = u64::from(scale_x256) * bits / (left * 15 / 16).max(1);
        Some(scaled.clamp(u64::from(scale_x256) + 256, COARSEST_X256) as u32)
    }

    /// Removes a picture from the buffer.
    pub fn take(&mut self, bits: u64) {
        if let Some(buffer) = &mut self.buffer {
            buffer.take(bits as i64);
        }
    }

    /// Checks that these limits belong to a stream with these settings. `has_pictures` is true if pictures were coded.
    pub fn check(&self, config: &Config, has_pictures: bool) -> Result<(), RestoreError> {
        // Restore the level first, because the buffer depends on it.
        let mut stated = config.clone();
        self.restate(&mut stated);
        let is_bounded = has_pictures && config.rate == Rate::ConstantQuantiser;
        let is_possible = self.level.is_none_or(|level| config.level.is_none() && level >= config.level());
        ensure(is_possible && self.buffer.is_some() == is_bounded, "bounds of the stream")?;
        ensure(self.buffer.as_ref().is_none_or(|own| own.is_like(&buffer(&stated))), "buffer of the stream")
    }
}

/// Returns a full buffer of the size in the headers of a stream at a constant quantiser.
fn buffer(config: &Config) -> Buffer {
    let (bit_rate, size) = config.stated_rate();
    let size = match config.standard {
        Standard::Mpeg1 => size.min(MPEG1_BUFFER_MAX),
        Standard::Mpeg2 => size,
    };
    let size = 16_384 * i64::from(size);
    Buffer::new(400 * i64::from(bit_rate), size, config.buffer_rate(), size, true).with_pulldown(config.pulldown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameRate;

    /// Returns the level of a 352×288 stream with a first picture of `bits` bits.
    fn level_after(config: Config, bits: u64) -> Level {
        let mut config = config;
        Bounds::default().begin(&mut config, bits);
        config.level()
    }

    #[test]
    fn the_first_picture_chooses_the_level() {
        let config = || Config::new(352, 288, FrameRate::FPS_25);
        assert_eq!(level_after(config(), 160_000), Level::Low);
        assert_eq!(level_after(config(), 160_001), Level::Main, "4 Mbit/s");
        assert_eq!(level_after(config(), 600_001), Level::High1440, "15 Mbit/s");
        assert_eq!(level_after(config(), 2_400_001), Level::High, "60 Mbit/s");
        assert_eq!(level_after(config(), 1 << 40), Level::High);
        assert_eq!(level_after(config().with_level(Level::Low), 600_001), Level::Low, "as requested");
        let rate = Rate::Capped { bits_per_second: 1_000_000, buffer_bits: 400_000 };
        assert_eq!(level_after(config().with_rate(rate), 600_001), Level::Low);
    }

    #[test]
    fn pictures_beyond_the_buffer_are_coded_coarser() {
        let mut config = Config::new(352, 288, FrameRate::FPS_25).with_level(Level::Low);
        let mut bounds = Bounds::default();
        bounds.begin(&mut config, 475_136);
        assert_eq!(bounds.coarser(256, 475_136), None, "a picture as large as the buffer");
        bounds.take(475_136);
        // Since the first picture was removed, 160 000 bits have arrived.
        assert_eq!(bounds.coarser(256, 160_000), None);
        assert_eq!(bounds.coarser(256, 300_000), Some(512));
        assert_eq!(bounds.coarser(112 * 256, 300_000), None);
    }
}
