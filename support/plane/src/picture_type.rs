//! How a coded picture depends on others.

/// Coding type of a picture (13818-2, Table 6-12).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum PictureType {
    /// Intra: needs no other picture.
    I = 1,
    /// Predicted from the I or P picture before.
    P = 2,
    /// Predicted from the I or P pictures before and after; nothing is predicted from it.
    B = 3,
}
