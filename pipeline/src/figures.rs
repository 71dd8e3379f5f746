//! CPU seconds and counts of one frame, collected on its way through the loop.

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
    /// Shadow rays of direct light and cuts.
    pub shadow_rays: u64,
    /// Records of the irradiance cache that pixels took light from.
    pub cache_records: u64,
    /// Records that were computed.
    pub cache_new: u64,
    /// Mean of threshold by luminance over the pixels that see a surface.
    pub threshold_mean_relative: f64,
    /// Error, in thresholds, that 95 in a hundred of the checked pixels keep within; none if none was checked.
    pub audit_error_p95: Option<f64>,
    /// Multiplier on the thresholds that cuts ended at, on average over these pixels.
    pub kappa: Option<f64>,
    /// Pixels whose radiance was not finite; shown black.
    pub non_finite: usize,
}
