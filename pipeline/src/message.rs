//! What travels between the stages, each thing stamped with its frame.

use crate::video::CodingOutcome;
use lighttree::LightTree;
use perceptual::{NextPicture, ToneMap, YCbCr};
use plane::Plane;
use render_core::{Accelerator, Correspondence, DirectLights, GBuffer, Gather, Surfaces};
use std::sync::Arc;

/// CPU seconds of the stages and counts of one frame; each stage fills in its part.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct FrameFigures {
    /// Placing of objects and the ray tree \[s\].
    pub update: f64,
    /// Photon tracing \[s\].
    pub photons: f64,
    /// Photons that were traced; the others' energy was known from the frames before.
    pub photons_traced: u64,
    /// Build or update of the light tree \[s\].
    pub tree: f64,
    /// Primary rays and motion \[s\].
    pub visibility: f64,
    /// Direct light \[s\].
    pub direct: f64,
    /// Lightcuts \[s\].
    pub indirect: f64,
    /// Tone mapping and conversion \[s\].
    pub tone_map: f64,
    /// Encoding \[s\].
    pub encode: f64,
    /// Masking \[s\].
    pub thresholds: f64,
    /// Share of the tree's inner nodes whose children changed places.
    pub tree_swaps_share: f64,
    /// Over the cuts that were made for this frame.
    pub cut_size_mean: f64,
    /// Largest of them.
    pub cut_size_max: u32,
    /// Of direct light and cuts.
    pub shadow_rays: u64,
    /// Records of the irradiance cache that pixels took light from.
    pub cache_records: u64,
    /// Records that were computed.
    pub cache_new: u64,
    /// Mean of threshold by luminance over the pixels that see a surface.
    pub threshold_mean_relative: f64,
    /// Of the pixels that were checked, 95 in a hundred are wrong by at most so many thresholds; none if none was.
    pub audit_error_p95: Option<f64>,
    /// Multiplier on the thresholds that cuts ended at, on average over these pixels.
    pub kappa: Option<f64>,
    /// Pixels whose radiance was not finite; shown black.
    pub non_finite: usize,
}

/// A frame up to where thresholds are needed.
pub struct Prepared<'s> {
    /// Which one.
    pub frame: u32,
    /// Whether each stage leaves what it carries on, once it is done with this frame, for a checkpoint.
    pub checkpoint: bool,
    /// The scene in this frame's pose.
    pub surfaces: Surfaces<'s>,
    /// The scene, ready for shadow rays.
    pub accelerator: Arc<Accelerator>,
    /// What lights a pixel directly.
    pub direct: Arc<DirectLights>,
    /// What lights it otherwise.
    pub tree: Arc<LightTree>,
    /// What is around a point, and the light that the lights of the tree lose close by.
    pub gather: Arc<Gather>,
    /// What each pixel sees.
    pub seen: Arc<GBuffer>,
    /// Where that was in the frame before; none for the first.
    pub correspondence: Option<Arc<Correspondence>>,
    /// Where what the frame before sees is in this one, if the encoder wants to know.
    pub forward: Option<Arc<Correspondence>>,
    /// Rays start this far off their surface, metres.
    pub epsilon: f32,
    /// So far.
    pub figures: FrameFigures,
}

/// A frame as light.
pub struct Shaded {
    /// Which one.
    pub frame: u32,
    /// As in [`Prepared`].
    pub checkpoint: bool,
    /// Linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Further channels for the frame's OpenEXR file: names and samples.
    pub layers: Vec<(String, Vec<f32>)>,
    /// As in [`Prepared`].
    pub correspondence: Option<Arc<Correspondence>>,
    /// As in [`Prepared`].
    pub forward: Option<Arc<Correspondence>>,
    /// So far.
    pub figures: FrameFigures,
}

/// A frame as a picture, for the encoder.
pub struct Displayed {
    /// Which one.
    pub frame: u32,
    /// As in [`Prepared`].
    pub checkpoint: bool,
    /// Y′C_BC_R.
    pub picture: Arc<YCbCr>,
    /// As in [`Prepared`].
    pub correspondence: Option<Arc<Correspondence>>,
    /// As in [`Prepared`].
    pub forward: Option<Arc<Correspondence>>,
    /// So far.
    pub figures: FrameFigures,
}

/// The same frame, for the masking model.
pub struct ToMask {
    /// Which one.
    pub frame: u32,
    /// As in [`Prepared`].
    pub checkpoint: bool,
    /// Its luma.
    pub picture: Arc<YCbCr>,
    /// Its luminance before tone mapping.
    pub luminance: Plane<f32>,
    /// The curve between the two.
    pub tone_map: ToneMap,
    /// As in [`Prepared`].
    pub correspondence: Option<Arc<Correspondence>>,
}

/// How a picture was coded, as far as it is known when masking asks.
pub struct Coding {
    /// quantiser_scale, the mean over the picture.
    pub quantiser_scale: f32,
    /// What became of the picture, where masking goes by that.
    pub outcome: Option<CodingOutcome>,
    /// How the next picture will be coded.
    pub next: NextPicture,
}

impl Coding {
    /// Nothing is known but the quantiser.
    pub fn of_quantiser(quantiser_scale: f32) -> Self {
        Self { quantiser_scale, outcome: None, next: NextPicture::Predicted }
    }
}

/// ΔY of a frame, on its way back to the renderer.
pub struct LuminanceThresholds {
    /// The frame that they were derived from; the frame after it uses them.
    pub of: u32,
    /// \[W·m⁻²·sr⁻¹\] of luminance.
    pub delta: Plane<f32>,
    /// Luminance of the frame itself \[W·m⁻²·sr⁻¹\].
    pub luminance: Plane<f32>,
}

/// Seconds that masking frame `of` took, for the report: it ends after the frame has left the encoder's queue.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct MaskingTime {
    /// Which frame.
    pub of: u32,
    /// How long \[s\].
    pub seconds: f64,
}
