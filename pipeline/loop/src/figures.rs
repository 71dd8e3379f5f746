//! CPU seconds and counts of one frame, collected by the loop.

/// CPU seconds of a frame's stages, summed over threads. Waiting and other programs are excluded.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct Seconds {
    /// CPU seconds of the film's anchors: exposure rays, surfels, photon guide; in the first frame of a run.
    #[serde(default)]
    pub anchors: f64,
    /// CPU seconds of placing objects and building the ray tree.
    pub update: f64,
    /// CPU seconds of photon tracing.
    pub photons: f64,
    /// CPU seconds of building or updating the light tree.
    pub tree: f64,
    /// CPU seconds of primary rays, motion and importance.
    pub visibility: f64,
    /// CPU seconds of direct light.
    pub direct: f64,
    /// CPU seconds of lightcuts.
    pub indirect: f64,
    /// CPU seconds of tone mapping and color conversion.
    pub tone_map: f64,
    /// CPU seconds of encoding.
    pub encode: f64,
    /// CPU seconds of masking.
    pub thresholds: f64,
    /// CPU seconds of all stages, set after the frame is coded.
    pub total: f64,
}

impl Seconds {
    fn parts(&self) -> [f64; 10] {
        let s = self;
        [s.anchors, s.update, s.photons, s.tree, s.visibility, s.direct, s.indirect, s.tone_map, s.encode, s.thresholds]
    }

    /// Sets `total` to the sum of all stages.
    pub fn add_up(&mut self) {
        self.total = self.parts().iter().sum();
    }

    /// Returns the mean CPU seconds of each stage over all frames.
    pub fn mean<'a>(all: impl Iterator<Item = &'a Seconds> + Clone) -> Seconds {
        let count = all.clone().count().max(1) as f64;
        let mut sums = [0.0; 10];
        for seconds in all {
            sums.iter_mut().zip(seconds.parts()).for_each(|(sum, part)| *sum += part / count);
        }
        let [anchors, update, photons, tree, visibility, direct, indirect, tone_map, encode, thresholds] = sums;
        let total = sums.iter().sum();
        Seconds { anchors, update, photons, tree, visibility, direct, indirect, tone_map, encode, thresholds, total }
    }
}

/// CPU seconds and counts of one frame. Each stage sets its own fields.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct FrameFigures {
    /// CPU seconds of the stages.
    pub seconds: Seconds,
    /// Number of traced photons. Photons that are not traced have the same energy as in the first frame.
    pub photons_traced: u64,
    /// Mean number of clusters in a lightcut of this frame.
    pub cut_size_mean: f64,
    /// Maximum number of clusters in a lightcut of this frame.
    pub cut_size_max: u32,
    /// Number of shadow rays of direct light and lightcuts.
    pub shadow_rays: u64,
    /// Number of irradiance cache records that pixels of this frame use.
    pub cache_records: u64,
    /// Number of irradiance cache records computed or recomputed for this frame.
    pub cache_new: u64,
    /// Fraction of the lit pixels for which some light was computed.
    pub shaded_share: f64,
    /// Fraction of the lit pixels with light reprojected from the previous frame.
    pub reprojected_share: f64,
    /// Fraction of the audited pixels with reprojected light within the permitted error; `None` without audited
    /// pixels.
    pub audit_reprojected_within: Option<f64>,
    /// Fraction of the light tree's inner nodes with changed children.
    pub tree_swaps_share: f64,
    /// Mean ratio of threshold to luminance, over the pixels that show a surface.
    pub threshold_mean_relative: f64,
    /// Mean importance of the pixels, 0…1; `None` without importance.
    pub importance_mean: Option<f64>,
    /// Mean number of samples per pixel; `None` without importance.
    pub samples_mean: Option<f64>,
    /// Mean change in a surface's number of samples since the previous frame; `None` without previously visible
    /// surfaces.
    pub samples_change: Option<f64>,
    /// Mean factor on thresholds: κ of masking, or λ of calibrated stopping.
    pub kappa: Option<f64>,
    /// 95th percentile of the ratio of true error to threshold; `None` without audited pixels.
    pub audit_error_p95: Option<f64>,
    /// Number of pixels with non-finite radiance, displayed as black.
    #[serde(rename = "non_finite_pixels")]
    pub non_finite: usize,
}

/// Number of figures that each rank measures separately.
pub(crate) const RANK_FIGURES: usize = 8;

impl FrameFigures {
    /// Returns this rank's own figures: CPU seconds of the stages up to light, and photons.
    pub(crate) fn of_rank(&self) -> [f64; RANK_FIGURES] {
        let Seconds { anchors, update, photons, tree, visibility, direct, indirect, .. } = self.seconds;
        [anchors, update, photons, tree, visibility, direct, indirect, self.photons_traced as f64]
    }

    /// Replaces the rank-specific figures by sums over `all` ranks.
    pub(crate) fn add_up_ranks<'a>(&mut self, all: impl Iterator<Item = &'a [f64; RANK_FIGURES]>) {
        let mut sums = [0.0; RANK_FIGURES];
        for figures in all {
            sums.iter_mut().zip(figures).for_each(|(sum, figure)| *sum += figure);
        }
        let [anchors, update, photons, tree, visibility, direct, indirect, traced] = sums;
        self.seconds = Seconds { anchors, update, photons, tree, visibility, direct, indirect, ..self.seconds.clone() };
        self.photons_traced = traced as u64;
    }
}
