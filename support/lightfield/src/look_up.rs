//! Common interface for reading light fields.

/// Light that can be read by texel and direction.
pub trait LookUp {
    /// Returns the three codes of the texel in a slot of [`TexelTiles`](crate::TexelTiles), in a direction.
    ///
    /// Codes of this crate's fields are integers. Returns `None` if the texel or the direction does not exist.
    fn codes(&self, slot: usize, direction: usize) -> Option<[f32; 3]>;
}
