//! Which standard a stream follows.

use crate::{Config, ConfigError};

/// The standard that a stream follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Standard {
    /// ISO/IEC 11172-2: what small decoders in browsers play.
    ///
    /// The pictures are made in the same way. There are no extensions, so sizes go to 4095×2800, quantisers are the even ones
    /// up to 62 (twice what this standard counts), all coefficients use Table B.14, and intra DC has 8 bits. Levels go to
    /// ±255, with shorter escapes; restored coefficients are made odd one by one, instead of their sum.
    Mpeg1,
    /// ISO/IEC 13818-2 Main Profile.
    #[default]
    Mpeg2,
}

impl Standard {
    /// Largest level that a coefficient may have: of 12 bits without −2048 (7.2.2.3), or of 8 bits and a sign (11172-2,
    /// Annex B).
    pub(crate) fn level_max(self) -> i32 {
        match self {
            Self::Mpeg1 => 255,
            Self::Mpeg2 => 2047,
        }
    }

    /// Largest f_code, whatever the level allows: MPEG-1 has three bits for it.
    pub(crate) fn f_code_max(self) -> u32 {
        match self {
            Self::Mpeg1 => 7,
            Self::Mpeg2 => 9,
        }
    }

    /// Is all that is asked for in this standard?
    pub(crate) fn check(self, config: &Config) -> Result<(), ConfigError> {
        let missing = |what, remedy| Err(ConfigError::NotInMpeg1 { what, remedy });
        match self {
            Self::Mpeg2 => Ok(()),
            Self::Mpeg1 if config.width > 4095 || config.height > 2800 => {
                missing("pictures of this size", "width goes to 4095 and height to 2800")
            }
            Self::Mpeg1 if config.quantiser_scale > 62 || !config.quantiser_scale.is_multiple_of(2) => {
                missing("such a quantiser_scale", "use an even one from 2 to 62")
            }
            Self::Mpeg1 if config.intra_dc_precision != 8 => missing("such an intra DC precision", "use 8 bits"),
            Self::Mpeg1 if config.alternate_scan => missing("the alternate scan", "leave it out"),
            Self::Mpeg1 => Ok(()),
        }
    }
}
