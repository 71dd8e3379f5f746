//! Common interface for reading light fields.

use crate::scale::LogScale;
use crate::tiles::Slot;

/// A light field that can be read by texel and direction.
pub trait LookUp {
    /// Returns the three codes of a texel in a direction.
    ///
    /// The codes of this crate's fields are integers. Returns `None` if the texel or the direction does not exist.
    fn codes(&self, slot: Slot, direction: usize) -> Option<[f32; 3]>;

    /// Returns the scale of the codes, or `None` if the codes are not logarithmic.
    fn scale(&self) -> Option<LogScale>;

    /// Returns the light of a texel in a direction, linear RGB. Returns `None` if the texel or the direction does not
    /// exist, or if the codes are not logarithmic.
    fn light(&self, slot: Slot, direction: usize) -> Option<[f32; 3]> {
        let scale = self.scale()?;
        Some(self.codes(slot, direction)?.map(|code| scale.light(code)))
    }
}
