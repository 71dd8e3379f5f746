//! How much is tried for few bits.

/// How much computation a picture is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Effort {
    /// Motion as it is given, the prediction that differs least, levels by rounding.
    Fast,
    /// Vectors around what is given, types of pictures by content, macroblock-tree, levels by shortest path.
    #[default]
    Balanced,
    /// Vectors by transformed differences, every prediction coded for comparison, and where quantisers may vary the cheapest one.
    Best,
}

impl Effort {
    /// All efforts, least computation first.
    pub const ALL: &[Self] = &[Self::Fast, Self::Balanced, Self::Best];

    /// Name in lower case, as in command lines and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Best => "best",
        }
    }
}

impl std::fmt::Display for Effort {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
