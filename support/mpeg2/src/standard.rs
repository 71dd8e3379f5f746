//! Video standards.

/// Standard that a stream follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Standard {
    /// ISO/IEC 11172-2 (MPEG-1), for simple decoders such as those in browsers.
    ///
    /// Pictures are coded with the same tools, but without extensions. The size is at most 4095×2800, and quantiser_scale is an
    /// even value up to 62 (twice MPEG-1's own value). All coefficients use Table B.14, and intra DC has 8 bits. Levels are at
    /// most ±255, with shorter escapes. Mismatch control makes each restored coefficient odd, instead of the sum of all
    /// coefficients.
    Mpeg1,
    /// ISO/IEC 13818-2 Main Profile (MPEG-2).
    #[default]
    Mpeg2,
}

impl Standard {
    /// Returns the maximum level of a coefficient. It has 12 bits without −2048 (7.2.2.3), or 8 bits and a sign (11172-2, Annex
    /// B).
    #[must_use]
    pub fn level_max(self) -> i32 {
        match self {
            Self::Mpeg1 => 255,
            Self::Mpeg2 => 2047,
        }
    }

    /// Returns the maximum f_code at any level; MPEG-1 codes it in three bits.
    #[must_use]
    pub fn f_code_max(self) -> u32 {
        match self {
            Self::Mpeg1 => 7,
            Self::Mpeg2 => 9,
        }
    }
}
