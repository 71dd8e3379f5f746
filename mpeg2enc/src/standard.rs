//! The standard that a stream follows.

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
}
