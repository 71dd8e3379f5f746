//! How much is tried for few bits.

/// How much computation a picture is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
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
