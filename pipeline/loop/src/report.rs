//! The report of each frame, with stable field names.

use crate::figures::FrameFigures;
use crate::stage::CodedFrame;
use plane::PictureType;
use serde::{Deserialize, Deserializer, Serialize};

/// Name of a picture type. The alias prevents serde from borrowing the name from its input.
pub(crate) type PictureTypeName = &'static str;

/// Report of one frame.
#[derive(Clone, Debug, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FrameReport {
    /// Number of the frame from 0, in display order.
    pub index: u32,
    /// Picture type: "I", "P" or "B".
    #[serde(deserialize_with = "picture_type")]
    #[schemars(extend("enum" = ["I", "P", "B"]))]
    pub picture_type: PictureTypeName,
    /// Size of the coded picture with headers \[bits\].
    pub bits: u64,
    /// quantiser_scale of the picture.
    pub qscale: u32,
    /// PSNR of the coded luma against the uncoded luma \[dB\]; null if both are equal.
    pub psnr_y: Option<f64>,
    /// CPU seconds and counts of the frame.
    #[serde(flatten)]
    pub figures: FrameFigures,
}

impl FrameReport {
    /// Returns the report of a coded picture, with the figures of the stages before the encoder.
    #[must_use]
    pub fn new(picture: &CodedFrame, mut figures: FrameFigures) -> Self {
        figures.seconds.add_up();
        Self {
            index: picture.index,
            picture_type: match picture.picture_type {
                PictureType::I => "I",
                PictureType::P => "P",
                PictureType::B => "B",
            },
            bits: picture.bits,
            qscale: picture.quantiser_scale,
            // Omit the infinite PSNR of a lossless picture, which JSON cannot represent.
            psnr_y: picture.psnr_y.is_finite().then_some(picture.psnr_y),
            figures,
        }
    }

    /// Adds the CPU seconds of masking this frame.
    pub fn add_masking(&mut self, seconds: f64) {
        self.figures.seconds.thresholds = seconds;
        self.figures.seconds.add_up();
    }
}

/// Deserializes the name of a picture type.
///
/// # Errors
/// If the name is not a picture type.
pub(crate) fn picture_type<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static str, D::Error> {
    let name = String::deserialize(deserializer)?;
    // Return a static name, so that reports borrow nothing from their input.
    let known = ["I", "P", "B"].into_iter().find(|known| *known == name);
    known.ok_or_else(|| serde::de::Error::custom("the picture type must be I, P or B"))
}
