//! Common interface for reading light fields.

/// A light field that can be read by texel and direction.
pub trait LookUp {
    /// Returns the three codes of a texel in a direction. `slot` is a slot of [`TexelTiles`](crate::TexelTiles).
    ///
    /// The codes of this crate's fields are integers. Returns `None` if the texel or the direction does not exist.
    fn codes(&self, slot: usize, direction: usize) -> Option<[f32; 3]>;
}
