//! How much is tried for few bits.

/// How much computation a picture is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// One trial for a macroblock, levels by rounding.
    Fast,
    /// Vectors by transformed differences, two trials for a macroblock, levels by shortest path.
    #[default]
    Balanced,
    /// Every prediction is coded for comparison, and where quantisers may vary the cheapest is kept.
    Best,
}
