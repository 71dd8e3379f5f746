//! One way to ask every kind of stored field.

/// Stored light that can be looked up by texel and direction.
pub trait LookUp {
    /// The three codes of the texel in a slot, as [`TexelTiles`](crate::TexelTiles) counts them, in a direction.
    ///
    /// Codes of this crate's fields are whole numbers. `None` where there is no such texel or direction.
    fn codes(&self, slot: usize, direction: usize) -> Option<[f32; 3]>;
}
