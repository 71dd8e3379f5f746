//! Decoded pictures.

use crate::{captions::Captions, frame::FrameMemory, sequence::Sequence};
use plane::PictureType;
use std::sync::Arc;

/// Component of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleComponent {
    /// Luma, Y′.
    Y = 0,
    /// Blue-difference chroma.
    Cb = 1,
    /// Red-difference chroma.
    Cr = 2,
}

impl SampleComponent {
    /// All components, in the order of the stream.
    pub const ALL: [Self; 3] = [Self::Y, Self::Cb, Self::Cr];
}

/// Samples of one component of a picture, in rows.
#[derive(Clone, Copy)]
pub struct SamplePlane<'a> {
    /// Samples of whole macroblocks, row by row.
    pub samples: &'a [u8],
    /// Number of visible columns.
    pub width: usize,
    /// Number of visible rows.
    pub height: usize,
    /// Distance between the starts of two rows; at least `width`.
    pub stride: usize,
}

impl<'a> SamplePlane<'a> {
    /// Visible rows from top to bottom.
    pub fn rows(&self) -> impl Iterator<Item = &'a [u8]> {
        let width = self.width;
        self.samples.chunks(self.stride).take(self.height).map(move |row| &row[..width])
    }
}

/// Coding and display flags of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PictureFlags {
    /// Coding type; the type of the first field of two field pictures.
    pub kind: PictureType,
    /// Whether this is a D picture of MPEG-1, whose blocks contain only their mean.
    pub is_dc_only: bool,
    /// temporal_reference: display order within the group of pictures.
    pub temporal_reference: u16,
    /// Whether the frame was coded as two field pictures.
    pub is_field_pair: bool,
    /// top_field_first: which field is displayed first.
    pub top_field_first: bool,
    /// repeat_first_field: a field or the whole frame is displayed again (3:2 pulldown).
    pub repeat_first_field: bool,
    /// progressive_frame: both fields belong to the same time.
    pub progressive_frame: bool,
}

/// Errors of a picture, which were concealed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PictureDamage {
    /// Number of slices that ended with an error.
    pub slices: u32,
    /// Number of macroblocks that were predicted from a reference because their data was missing or damaged.
    pub macroblocks: u32,
}

/// A decoded picture: a complete frame.
///
/// Its samples are shared with the decoder. They are reused after the last clone is dropped.
#[derive(Clone)]
pub struct DecodedPicture {
    pub(crate) frame: Arc<FrameMemory>,
    pub(crate) sequence: Sequence,
    pub(crate) flags: PictureFlags,
    pub(crate) time: Option<i64>,
    pub(crate) damage: PictureDamage,
}

impl DecodedPicture {
    /// Returns the samples of a component.
    #[must_use]
    pub fn plane(&self, component: SampleComponent) -> SamplePlane<'_> {
        let index = component as usize;
        let [x, y] = if index == 0 { [0, 0] } else { self.sequence.chroma.shifts() };
        SamplePlane {
            samples: &self.frame.planes[index],
            width: self.sequence.width.div_ceil(1 << x),
            height: self.sequence.height.div_ceil(1 << y),
            stride: self.frame.shape.plane(index)[0],
        }
    }

    /// Returns the properties of the sequence.
    #[must_use]
    pub fn sequence(&self) -> &Sequence {
        &self.sequence
    }

    /// Returns the coding type and the display flags.
    #[must_use]
    pub fn flags(&self) -> PictureFlags {
        self.flags
    }

    /// Returns the presentation time in units of 1/90000 s, if the container contains one for this picture. The values continue
    /// after the 33-bit time stamps of the container wrap.
    #[must_use]
    pub fn time(&self) -> Option<i64> {
        self.time
    }

    /// Returns the number of concealed errors.
    #[must_use]
    pub fn damage(&self) -> PictureDamage {
        self.damage
    }

    /// Returns the user data units of the picture and of the headers before it. Each one begins with the start code
    /// `00 00 01 B2`.
    #[must_use]
    pub fn user_data(&self) -> &[u8] {
        &self.frame.user_data
    }

    /// Returns the closed captions (CEA-608 and CEA-708) of the picture.
    #[must_use]
    pub fn captions(&self) -> Captions<'_> {
        Captions::new(&self.frame.user_data)
    }
}

impl std::fmt::Debug for DecodedPicture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DecodedPicture")
            .field("sequence", &self.sequence)
            .field("flags", &self.flags)
            .field("time", &self.time)
            .field("damage", &self.damage)
            .finish_non_exhaustive()
    }
}
