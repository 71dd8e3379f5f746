//! Figures of a sweep: one [`MethodRun`] for each method and quantiser.

use super::coded::DecoderCheck;
use super::histogram::ErrorHistogram;
use super::method::Method;
use crate::compare::Comparison;
use pipeline::figures::Seconds;
use pipeline::report::FrameReport;
use plane::Plane;
use render2mpeg::settings::Settings;
use serde::Serialize;

/// Decoded PSNR that may be lost at *equal decoded quality* \[dB\]. What is better than the baseline is at least equal.
const EQUAL_PSNR: f64 = 0.1;
/// Share of bits that there may be more.
const EQUAL_BITS: f64 = 0.01;
/// Share of flicker that there may be more. Another seed of the light tree alone moves it by several hundredths.
const EQUAL_FLICKER: f64 = 0.1;

/// A sweep's figures; means leave out frame 0, for which no thresholds are known.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Outcome {
    /// Version of the layout.
    pub schema: u32,
    /// Version of the program.
    pub program: String,
    /// The reference's settings; all others differ by what their method says.
    pub settings: Settings,
    /// Points of light in the tree.
    pub lights: u32,
    /// CPU seconds a frame of the references: every light at every pixel.
    pub references: Vec<ReferenceCost>,
    /// One for each quantiser and method, methods together.
    pub runs: Vec<MethodRun>,
    /// The check by another decoder; null where there is none.
    pub decoder_check: Option<DecoderCheck>,
    /// Whether it was ended early: runs of some methods or quantisers are missing then.
    pub interrupted: bool,
    /// By the clock, everything \[s\].
    pub wall_seconds: f64,
}

/// Cost of a reference.
#[derive(Clone, Debug, Serialize)]
pub struct ReferenceCost {
    /// Whether light from close by is compensated.
    pub compensation: bool,
    /// CPU seconds of the stages, a frame.
    pub seconds: Seconds,
}

/// A method at a quantiser.
#[derive(Clone, Debug, Serialize)]
pub struct MethodRun {
    /// Name of the method.
    pub method: &'static str,
    /// As in plots.
    pub label: String,
    /// quantiser_scale.
    pub qscale: u32,
    /// Whether indirect light was cached.
    pub cache: bool,
    /// Whether it is a film by lightcuts and not by paths.
    pub lightcuts: bool,
    /// Multiplier on what masking allows, where it steers.
    pub kappa: Option<f32>,
    /// CPU seconds of the stages, a frame; of paths, all in `direct`.
    pub seconds: Seconds,
    /// Threshold by luminance.
    pub threshold_mean_relative: f64,
    /// Share of the light tree's nodes whose children changed places.
    pub tree_swaps_share: f64,
    /// Clusters in a cut, over the cuts that were made.
    pub cut_size_mean: f64,
    /// Shadow rays of direct light and cuts, a frame.
    pub shadow_rays: f64,
    /// A frame.
    pub bits: f64,
    /// Rendered frames against the reference, before compression.
    pub rendered: Comparison,
    /// Decoded frames against the reference before compression.
    pub decoded: Comparison,
    /// How much more the decoded film changes from frame to frame than the decoded reference, in pixels that are seen in both:
    /// root mean square of luma \[code values\].
    pub flicker: f64,
    /// True error by threshold, of all pixels of these frames.
    pub error_by_threshold: Option<ErrorHistogram>,
    /// Beside its baseline; none where that was not run.
    pub against_baseline: Option<AgainstBaseline>,
}

/// A run beside the run with fixed thresholds of 2 % at the same quantiser.
#[derive(Clone, Debug, Serialize)]
pub struct AgainstBaseline {
    /// Decoded PSNR more than the baseline's \[dB\].
    pub psnr_difference: f64,
    /// Bits by the baseline's.
    pub bits_ratio: f64,
    /// The run's flicker by the baseline's.
    pub flicker_ratio: f64,
    /// Whether decoded PSNR is at most 0.1 dB less, bits are at most 1 % more, and flicker at most 10 %.
    pub equal_quality: bool,
    /// The baseline's CPU seconds in indirect light by this run's.
    pub speedup_indirect: f64,
    /// The same of whole frames.
    pub speedup_total: f64,
    /// The baseline's mean cut by this run's.
    pub cut_size_ratio: f64,
    /// The baseline's shadow rays by this run's, those of direct light included.
    pub shadow_rays_ratio: f64,
}

/// Pictures of a run's last frame.
pub struct RunPictures {
    /// Name of the method.
    pub method: &'static str,
    /// quantiser_scale.
    pub qscale: u32,
    /// Decoded.
    pub decoded: Plane<[u8; 3]>,
    /// Threshold by luminance, and cut size.
    pub maps: Option<Maps>,
}

/// Thresholds, cuts and errors of the last frame of a film.
pub struct Maps {
    /// Threshold by luminance.
    pub relative_threshold: Plane<f32>,
    /// Clusters of each pixel's cut; with a cache, at the pixels of records, 0 elsewhere.
    pub cut_size: Plane<f32>,
    /// |luma − the reference's| before compression, in code values.
    pub error: Plane<f32>,
}

/// Mean of a figure over the frames that had thresholds: all but the first, unless there is no other.
pub fn mean_of(frames: &[FrameReport], figure: impl Fn(&FrameReport) -> f64) -> f64 {
    let frames = steered(frames);
    frames.iter().map(figure).sum::<f64>() / frames.len().max(1) as f64
}

/// All but the first, unless there is no other.
pub fn steered<T>(frames: &[T]) -> &[T] {
    if frames.len() > 1 { &frames[1..] } else { frames }
}

/// Mean CPU seconds of the stages.
pub fn mean_seconds(frames: &[FrameReport]) -> Seconds {
    Seconds::mean(steered(frames).iter().map(|frame| &frame.figures.seconds))
}

impl MethodRun {
    fn beside(&self, baseline: &Self) -> AgainstBaseline {
        let ratio = |of: f64, by: f64| if by > 0.0 { of / by } else { 1.0 };
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

/// Sets each run of a method beside its baseline's at the same quantiser.
pub fn set_beside_baselines(runs: &mut [MethodRun]) {
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

/// The method's label with the multiplier in force.
pub fn label(method: &Method, settings: &Settings) -> String {
    method.label.replace("{κ}", &format!("{}", settings.render.kappa))
}
