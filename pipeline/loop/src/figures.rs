//! CPU seconds and counts of one frame, collected on its way through the loop.

/// CPU seconds of the stages of a frame, summed over threads: waiting, and other programs, do not count.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct Seconds {
    /// Placing of objects and the ray tree.
    pub update: f64,
    /// Photon tracing.
    pub photons: f64,
    /// Build or update of the light tree.
    pub tree: f64,
    /// Primary rays, motion and importance.
    pub visibility: f64,
    /// Direct light.
    pub direct: f64,
    /// Lightcuts.
    pub indirect: f64,
    /// Tone mapping and color conversion.
    pub tone_map: f64,
    /// Encoding.
    pub encode: f64,
    /// Masking.
    pub thresholds: f64,
    /// Sum of all, once the frame is coded.
    pub total: f64,
}

impl Seconds {
    fn parts(&self) -> [f64; 9] {
        let s = self;
        [s.update, s.photons, s.tree, s.visibility, s.direct, s.indirect, s.tone_map, s.encode, s.thresholds]
    }

    /// Sums up all parts.
    pub fn add_up(&mut self) {
        self.total = self.parts().iter().sum();
    }

    /// Mean of each part.
    pub fn mean<'a>(all: impl Iterator<Item = &'a Seconds> + Clone) -> Seconds {
        let count = all.clone().count().max(1) as f64;
        let mut sums = [0.0; 9];
        for seconds in all {
            sums.iter_mut().zip(seconds.parts()).for_each(|(sum, part)| *sum += part / count);
        }
        let [update, photons, tree, visibility, direct, indirect, tone_map, encode, thresholds] = sums;
        let total = sums.iter().sum();
        Seconds { update, photons, tree, visibility, direct, indirect, tone_map, encode, thresholds, total }
    }
}

/// CPU seconds of the stages and counts of one frame; each stage fills in its part.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct FrameFigures {
    /// CPU seconds of the stages.
    pub seconds: Seconds,
    /// Photons traced; the energy of the others is known from the first frame.
    pub photons_traced: u64,
    /// Mean number of clusters in a cut, over the cuts made for this frame.
    pub cut_size_mean: f64,
    /// Largest number of clusters in a cut.
    pub cut_size_max: u32,
    /// Shadow rays of direct light and cuts.
    pub shadow_rays: u64,
    /// Records of the irradiance cache in use at pixels of this frame.
    pub cache_records: u64,
    /// Records of the irradiance cache computed or recomputed for this frame.
    pub cache_new: u64,
    /// Share of the lit pixels for which some light was computed.
    pub shaded_share: f64,
    /// Share of the lit pixels whose light was reprojected from the previous frame.
    pub carried_share: f64,
    /// Share of the audited pixels whose reprojected light would be within the error they may have; none if none was audited.
    pub audit_carried_within: Option<f64>,
    /// Share of the light tree's inner nodes whose children changed.
    pub tree_swaps_share: f64,
    /// Mean threshold by luminance, over the pixels that show a surface.
    pub threshold_mean_relative: f64,
    /// Mean importance of the pixels, 0…1; none without importance, as the next two.
    pub importance_mean: Option<f64>,
    /// Mean samples of a pixel.
    pub samples_mean: Option<f64>,
    /// Mean change in samples of a surface since the previous frame; none where no surface was seen before.
    pub samples_change: Option<f64>,
    /// Mean multiplier on thresholds: κ of masking, or that of calibrated stopping.
    pub kappa: Option<f64>,
    /// 95th percentile of true error by threshold; none where no pixel was audited.
    pub audit_error_p95: Option<f64>,
    /// Pixels whose radiance was not finite; shown black.
    #[serde(rename = "non_finite_pixels")]
    pub non_finite: usize,
}

/// Figures of a frame that each rank has its own of.
pub(crate) const RANK_FIGURES: usize = 7;

impl FrameFigures {
    /// The figures of this rank alone: CPU seconds up to light, and photons.
    pub(crate) fn of_rank(&self) -> [f64; RANK_FIGURES] {
        let Seconds { update, photons, tree, visibility, direct, indirect, .. } = self.seconds;
        [update, photons, tree, visibility, direct, indirect, self.photons_traced as f64]
    }

    /// Replaces them by the sums over `all` ranks.
    pub(crate) fn add_up_ranks<'a>(&mut self, all: impl Iterator<Item = &'a [f64; RANK_FIGURES]>) {
        let mut sums = [0.0; RANK_FIGURES];
        for figures in all {
            sums.iter_mut().zip(figures).for_each(|(sum, figure)| *sum += figure);
        }
        let [update, photons, tree, visibility, direct, indirect, traced] = sums;
        self.seconds = Seconds { update, photons, tree, visibility, direct, indirect, ..self.seconds.clone() };
        self.photons_traced = traced as u64;
    }
}
