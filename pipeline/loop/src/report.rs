//! The line of each frame in a report. The names are kept stable.

use crate::figures::FrameFigures;
use crate::parts::CodedFrame;
use plane::PictureType;
use serde::{Deserialize, Deserializer, Serialize};

/// A name of a picture type. Named here, or serde would believe that it lends from what it reads.
pub(crate) type PictureTypeName = &'static str;

/// One frame.
#[derive(Clone, Debug, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FrameReport {
    /// From 0, in display order.
    pub index: u32,
    /// "I", "P" or "B".
    #[serde(deserialize_with = "picture_type")]
    #[schemars(extend("enum" = ["I", "P", "B"]))]
    pub picture_type: PictureTypeName,
    /// Size of the coded picture, headers included.
    pub bits: u64,
    /// quantiser_scale.
    pub qscale: u32,
    /// PSNR of the coded luma against the uncoded \[dB\]; null when they are equal.
    pub psnr_y: Option<f64>,
    /// Seconds and counts of the stages.
    #[serde(flatten)]
    pub figures: FrameFigures,
}

impl FrameReport {
    /// The line of a coded picture, with the figures of the stages before the encoder.
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
            psnr_y: picture.psnr_y.is_finite().then_some(picture.psnr_y),
            figures,
        }
    }

    /// Adds the seconds that masking this frame took.
    pub fn add_masking(&mut self, seconds: f64) {
        self.figures.seconds.thresholds = seconds;
        self.figures.seconds.add_up();
    }
}

/// Reads the name of a picture type.
///
/// # Errors
/// There is no such type.
pub(crate) fn picture_type<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static str, D::Error> {
    let name = String::deserialize(deserializer)?;
    let known = ["I", "P", "B"].into_iter().find(|known| *known == name);
    known.ok_or_else(|| serde::de::Error::custom("a picture that is neither I nor P nor B"))
}
