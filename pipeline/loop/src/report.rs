//! The line of each frame in a report. The names are kept stable.

use crate::figures::{FrameFigures, Seconds};
use crate::parts::CodedFrame;
use plane::PictureType;
use serde::{Deserialize, Deserializer, Serialize};

/// A name of a picture type. Named here, or serde would believe that it lends from what it reads.
type PictureTypeName = &'static str;

/// One frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FrameReport {
    /// From 0, in display order.
    pub index: u32,
    /// "I", "P" or "B".
    #[serde(deserialize_with = "picture_type")]
    pub picture_type: PictureTypeName,
    /// Size of the coded picture, headers included.
    pub bits: u64,
    /// quantiser_scale.
    pub qscale: u32,
    /// PSNR of the coded luma against the uncoded \[dB\]; null when they are equal.
    pub psnr_y: Option<f64>,
    /// CPU seconds of the stages.
    pub seconds: Seconds,
    /// Photons that were traced; what the others leave is known from the first frame.
    pub photons_traced: u64,
    /// Clusters in a cut; over the cuts that were made for this frame.
    pub cut_size_mean: f64,
    /// Largest cut.
    pub cut_size_max: u32,
    /// Shadow rays of direct light and cuts.
    pub shadow_rays: u64,
    /// Irradiance cache: records that pixels of this frame took light from.
    pub cache_records: u64,
    /// Irradiance cache: records computed for this frame, new ones and old ones afresh.
    pub cache_new: u64,
    /// Share of the lit pixels for which some light was computed.
    pub shaded_share: f64,
    /// Share of the lit pixels whose light was all carried from the frame before.
    pub carried_share: f64,
    /// Share of the audited pixels that carried light would have made wrong by no more than they may be; null where none was
    /// audited.
    pub audit_carried_within: Option<f64>,
    /// Share of the light tree's inner nodes whose children changed places.
    pub tree_swaps_share: f64,
    /// Threshold by luminance.
    pub threshold_mean_relative: f64,
    /// Mean importance of the pixels, 0…1; null without `--importance`, as the two after it.
    pub importance_mean: Option<f64>,
    /// Mean number of samples of the pixels.
    pub samples_mean: Option<f64>,
    /// Mean difference of that number from the number that the same surface had in the frame before; null where nothing was seen
    /// before.
    pub samples_change: Option<f64>,
    /// Multiplier on what masking allows; with calibrated stopping, on the thresholds themselves.
    pub kappa: Option<f64>,
    /// 95th percentile of true error by threshold; null where no pixel is audited.
    pub audit_error_p95: Option<f64>,
    /// Pixels whose radiance was not finite; shown black.
    pub non_finite_pixels: usize,
}

impl FrameReport {
    /// The line of a coded picture, with the figures of the stages before the encoder.
    #[must_use]
    pub fn new(picture: &CodedFrame, figures: FrameFigures) -> Self {
        let mut seconds = figures.seconds;
        seconds.add_up();
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
            seconds,
            photons_traced: figures.photons_traced,
            cut_size_mean: figures.cut_size_mean,
            cut_size_max: figures.cut_size_max,
            shadow_rays: figures.shadow_rays,
            cache_records: figures.cache_records,
            cache_new: figures.cache_new,
            shaded_share: figures.shaded_share,
            carried_share: figures.carried_share,
            audit_carried_within: figures.audit_carried_within,
            tree_swaps_share: figures.tree_swaps_share,
            threshold_mean_relative: figures.threshold_mean_relative,
            importance_mean: figures.importance_mean,
            samples_mean: figures.samples_mean,
            samples_change: figures.samples_change,
            kappa: figures.kappa,
            audit_error_p95: figures.audit_error_p95,
            non_finite_pixels: figures.non_finite,
        }
    }

    /// Adds the seconds that masking this frame took.
    pub fn add_masking(&mut self, seconds: f64) {
        self.seconds.thresholds = seconds;
        self.seconds.add_up();
    }
}

fn picture_type<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static str, D::Error> {
    let name = String::deserialize(deserializer)?;
    let known = ["I", "P", "B"].into_iter().find(|known| *known == name);
    known.ok_or_else(|| serde::de::Error::custom("a picture that is neither I nor P nor B"))
}
