//! Figures of a sweep: a [`MethodRun`] for each method and quantiser.

use super::coded::DecoderCheck;
use super::histogram::ErrorHistogram;
use super::method::Method;
use crate::compare::Comparison;
use pipeline::figures::Seconds;
use pipeline::report::FrameReport;
use plane::Plane;
use render2mpeg::settings::Settings;
use serde::Serialize;

/// Maximum loss of decoded PSNR at *equal decoded quality* \[dB\]. Higher PSNR than the baseline's also counts as
/// equal.
const EQUAL_PSNR: f64 = 0.1;
/// Maximum relative increase in bits at equal quality.
const EQUAL_BITS: f64 = 0.01;
/// Maximum relative increase in flicker at equal quality. A different seed of the light tree alone changes flicker by
/// several hundredths.
const EQUAL_FLICKER: f64 = 0.1;

/// Figures of a sweep. Means exclude frame 0, which has no thresholds.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Outcome {
    /// Version of the file layout.
    pub schema: u32,
    /// Name and version of the program.
    pub program: String,
    /// Settings of the reference; methods change some of them.
    pub settings: Settings,
    /// Number of lights in the light tree.
    pub lights: u32,
    /// Costs of the references, which evaluate every light at every pixel.
    pub references: Vec<ReferenceCost>,
    /// Runs of each method at each quantiser, grouped by method.
    pub runs: Vec<MethodRun>,
    /// Result of the check by another decoder; null if the sweep ended before it.
    pub decoder_check: Option<DecoderCheck>,
    /// True if the sweep ended early, without the runs of some methods or quantisers.
    pub interrupted: bool,
    /// Wall-clock time of the sweep \[s\].
    pub wall_seconds: f64,
}

/// Cost of a reference.
#[derive(Clone, Debug, Serialize)]
pub struct ReferenceCost {
    /// True if short-range light lost by bounded geometry terms is restored.
    pub compensation: bool,
    /// Mean CPU seconds of the stages per frame.
    pub seconds: Seconds,
}

/// Results of a method at one quantiser.
#[derive(Clone, Debug, Serialize)]
pub struct MethodRun {
    /// Name of the method.
    pub method: &'static str,
    /// Label of the method in plots.
    pub label: String,
    /// quantiser_scale of the run.
    pub qscale: u32,
    /// True if indirect light was cached.
    pub cache: bool,
    /// True for lightcuts, false for path tracing.
    pub lightcuts: bool,
    /// Multiplier on the thresholds, if they depend on masking.
    pub kappa: Option<f32>,
    /// Mean CPU seconds per frame of each stage. Path tracing counts as `direct`.
    pub seconds: Seconds,
    /// Mean ratio of threshold to luminance.
    pub threshold_mean_relative: f64,
    /// Mean fraction of the light tree's nodes with changed children.
    pub tree_swaps_share: f64,
    /// Mean number of clusters in a lightcut.
    pub cut_size_mean: f64,
    /// Mean number of shadow rays per frame, for direct light and lightcuts.
    pub shadow_rays: f64,
    /// Mean size of a coded frame \[bits\].
    pub bits: f64,
    /// Comparison of rendered frames with the reference, before compression.
    pub rendered: Comparison,
    /// Comparison of decoded frames with the uncompressed reference.
    pub decoded: Comparison,
    /// Additional change between frames, compared with the decoded reference, at pixels visible in both frames. Root
    /// mean square of luma \[code values\].
    pub flicker: f64,
    /// Histogram of true error divided by threshold, over all pixels of the counted frames.
    pub error_by_threshold: Option<ErrorHistogram>,
    /// Comparison with the baseline; null if the baseline was not run.
    pub against_baseline: Option<AgainstBaseline>,
}

/// Comparison of a run with its baseline: fixed thresholds of 2 % at the same quantiser.
#[derive(Clone, Debug, Serialize)]
pub struct AgainstBaseline {
    /// Difference in decoded PSNR: this run − baseline \[dB\].
    pub psnr_difference: f64,
    /// Ratio of bits: this run / baseline.
    pub bits_ratio: f64,
    /// Ratio of flicker: this run / baseline.
    pub flicker_ratio: f64,
    /// True if decoded PSNR is at most 0.1 dB lower, bits are at most 1 % higher, and flicker is at most 10 % higher.
    pub equal_quality: bool,
    /// Ratio of CPU seconds of indirect light: baseline / this run.
    pub speedup_indirect: f64,
    /// Ratio of CPU seconds per frame: baseline / this run.
    pub speedup_total: f64,
    /// Ratio of mean cut sizes: baseline / this run.
    pub cut_size_ratio: f64,
    /// Ratio of the numbers of shadow rays, including direct light: baseline / this run.
    pub shadow_rays_ratio: f64,
}

/// Pictures of a run's last frame.
pub struct RunPictures {
    /// Name of the method.
    pub method: &'static str,
    /// quantiser_scale of the run.
    pub qscale: u32,
    /// Decoded picture of the last frame.
    pub decoded: Plane<[u8; 3]>,
    /// Maps of the last frame; `None` for path tracing.
    pub maps: Option<Maps>,
}

/// Thresholds, cut sizes and errors of a film's last frame.
pub struct Maps {
    /// Ratio of threshold to luminance.
    pub relative_threshold: Plane<f32>,
    /// Number of clusters in each pixel's lightcut. With a cache, only pixels of records have lightcuts; other pixels
    /// are 0.
    pub cut_size: Plane<f32>,
    /// Absolute luma difference from the reference before compression \[code values\].
    pub error: Plane<f32>,
}

/// Returns the mean of a figure over the frames with thresholds: all frames except the first, or a single frame.
pub fn mean_of(frames: &[FrameReport], figure: impl Fn(&FrameReport) -> f64) -> f64 {
    let frames = steered(frames);
    frames.iter().map(figure).sum::<f64>() / frames.len().max(1) as f64
}

/// Returns all frames except the first, or a single frame.
pub fn steered<T>(frames: &[T]) -> &[T] {
    if frames.len() > 1 { &frames[1..] } else { frames }
}

/// Returns the mean CPU seconds of the stages.
pub fn mean_seconds(frames: &[FrameReport]) -> Seconds {
    Seconds::mean(steered(frames).iter().map(|frame| &frame.figures.seconds))
}

impl MethodRun {
    fn beside(&self, baseline: &Self) -> AgainstBaseline {
        let ratio = |of: f64, by: f64| if by > 0.0 { of / by } else { 1.0 };
        // Count two lossless pictures as equal: both have infinite PSNR.
        let psnr = |run: &Self| run.decoded.psnr_y.unwrap_or(f64::INFINITY);
        let psnr_difference = if psnr(self) == psnr(baseline) { 0.0 } else { psnr(self) - psnr(baseline) };
        let bits_ratio = ratio(self.bits, baseline.bits);
        let flicker_ratio = ratio(self.flicker, baseline.flicker);
        AgainstBaseline {
            psnr_difference,
            bits_ratio,
            flicker_ratio,
            equal_quality: psnr_difference >= -EQUAL_PSNR
                && bits_ratio <= 1.0 + EQUAL_BITS
                && flicker_ratio <= 1.0 + EQUAL_FLICKER,
            speedup_indirect: ratio(baseline.seconds.indirect, self.seconds.indirect),
            speedup_total: ratio(baseline.seconds.total, self.seconds.total),
            cut_size_ratio: ratio(baseline.cut_size_mean, self.cut_size_mean),
            shadow_rays_ratio: ratio(baseline.shadow_rays, self.shadow_rays),
        }
    }
}

/// Compares each run with its baseline at the same quantiser.
pub fn compare_with_baselines(runs: &mut [MethodRun]) {
    let found: Vec<Option<AgainstBaseline>> = runs
        .iter()
        .map(|run| {
            let baseline = Method::named(run.method).ok()?.baseline()?;
            let same = |other: &&MethodRun| other.method == baseline.name && other.qscale == run.qscale;
            runs.iter().find(same).map(|baseline| run.beside(baseline))
        })
        .collect();
    runs.iter_mut().zip(found).for_each(|(run, found)| run.against_baseline = found);
}

/// Returns the method's label with the multiplier in use.
pub fn label(method: &Method, settings: &Settings) -> String {
    method.label.replace("{κ}", &format!("{}", settings.render.kappa))
}
