//! Coding types of pictures.

/// Coding type of a picture (ISO/IEC 13818-2, Table 6-12).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum PictureType {
    /// Intra picture: coded without a reference picture.
    I = 1,
    /// Predicted picture: its reference is the previous I or P picture.
    P = 2,
    /// Bidirectionally predicted picture: its references are the previous and the next I or P picture. B pictures are
    /// never references.
    B = 3,
}
