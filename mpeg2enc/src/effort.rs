//! Computation per picture.

/// Amount of computation per picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Effort {
    /// Uses given motion, the prediction with the least difference, and rounded levels.
    Fast,
    /// Adds vectors near the given ones, picture types by content, the macroblock tree, and levels by shortest path.
    #[default]
    Balanced,
    /// Adds vector searches by transformed differences, full coding of every prediction, and the cheapest quantiser where
    /// quantisers may vary.
    Best,
}

impl Effort {
    /// All efforts, in order of computation.
    pub const ALL: &[Self] = &[Self::Fast, Self::Balanced, Self::Best];

    /// Returns the name in lower case, as in command lines and files.
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
