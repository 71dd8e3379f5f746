//! Results and costs of a run, as JSON. The names are kept stable; `schema` counts changes.

use crate::error::{Context, Result};
use crate::figures::{FrameFigures, Seconds};
use crate::parts::CodedFrame;
use crate::plan::Step;
use crate::settings::Settings;
use mpeg2enc::PictureType;
use render_core::scene::Scene;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::{Path, PathBuf};

/// The whole report.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of the layout.
    pub schema: u32,
    /// Version of the program.
    pub program: String,
    /// The rendered scene.
    pub scene: SceneReport,
    /// Every choice of the run, defaults filled in.
    pub settings: Settings,
    /// The stages that ran, the stages that were left out, and why.
    pub plan: Vec<Step>,
    /// One per frame.
    pub frames: Vec<FrameReport>,
    /// Over all frames.
    pub summary: Summary,
    /// Check sum of the files that the film was made from: parts of other files do not belong to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inputs: Option<u32>,
}

/// The rendered scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneReport {
    /// The scene file.
    pub file: PathBuf,
    /// Triangles of all instances.
    pub triangles: usize,
    /// Meshes in their places.
    pub instances: usize,
    /// Images in use.
    pub textures: usize,
    /// Length of the animation \[s\].
    pub duration: f32,
    /// Parts of the scene that were read but not rendered.
    pub warnings: Vec<String>,
}

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

/// Means over the frames, and totals.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Summary {
    /// Frames in the stream.
    pub frames: u32,
    /// Whether the run was ended early by the user.
    pub interrupted: bool,
    /// Size of all pictures.
    pub bits_total: u64,
    /// Mean.
    pub bits: f64,
    /// Mean over the frames that have one \[dB\].
    pub psnr_y: Option<f64>,
    /// Means.
    pub seconds: Seconds,
    /// Mean.
    pub cut_size_mean: f64,
    /// Largest of all frames.
    pub cut_size_max: u32,
    /// Mean.
    pub shadow_rays: f64,
    /// Mean over the frames that took thresholds from the one before.
    pub threshold_mean_relative: f64,
    /// Mean.
    pub tree_swaps_share: f64,
    /// By the clock, loading included \[s\].
    pub wall_seconds: f64,
    /// CPU time of all threads \[s\]; null where the system does not tell.
    pub cpu_seconds: Option<f64>,
    /// Most memory that was ever in use; null where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
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

/// How a run ended.
#[derive(Clone, Copy, Debug)]
pub struct Ending {
    /// Whether the user ended it early.
    pub interrupted: bool,
    /// Wall-clock time from its beginning \[s\].
    pub wall_seconds: f64,
}

impl Summary {
    /// Of `frames`, made by this process.
    pub(crate) fn of(frames: &[FrameReport], ending: Ending) -> Self {
        let Ending { interrupted, wall_seconds } = ending;
        let count = frames.len().max(1) as f64;
        let mean = |f: &dyn Fn(&FrameReport) -> f64| frames.iter().map(f).sum::<f64>() / count;
        let psnrs: Vec<f64> = frames.iter().filter_map(|frame| frame.psnr_y).collect();
        let steered: Vec<f64> = frames.iter().skip(1).map(|frame| frame.threshold_mean_relative).collect();
        Self {
            frames: frames.len() as u32,
            interrupted,
            bits_total: frames.iter().map(|frame| frame.bits).sum(),
            bits: mean(&|frame| frame.bits as f64),
            psnr_y: (!psnrs.is_empty()).then(|| psnrs.iter().sum::<f64>() / psnrs.len() as f64),
            seconds: Seconds::mean(frames.iter().map(|frame| &frame.seconds)),
            cut_size_mean: mean(&|frame| frame.cut_size_mean),
            cut_size_max: frames.iter().map(|frame| frame.cut_size_max).max().unwrap_or(0),
            shadow_rays: mean(&|frame| frame.shadow_rays as f64),
            threshold_mean_relative: (0.0 + steered.iter().sum::<f64>()) / steered.len().max(1) as f64,
            tree_swaps_share: mean(&|frame| frame.tree_swaps_share),
            wall_seconds,
            cpu_seconds: process_cpu_seconds(),
            peak_memory_bytes: peak_memory_bytes(),
        }
    }
}

impl Report {
    /// A report of `frames`.
    pub fn new(scene: &Scene, settings: &Settings, plan: &[Step], frames: Vec<FrameReport>, ending: Ending) -> Self {
        let summary = Summary::of(&frames, ending);
        Self {
            schema: 1,
            program: concat!("render2mpeg ", env!("CARGO_PKG_VERSION")).into(),
            scene: SceneReport {
                file: settings.scene.clone(),
                triangles: scene.triangle_count(),
                instances: scene.instances.len(),
                textures: scene.textures.len(),
                duration: scene.duration(),
                warnings: scene.warnings.clone(),
            },
            settings: settings.clone(),
            plan: plan.to_vec(),
            frames,
            summary,
            inputs: None,
        }
    }

    /// Writes the report, whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(self, path)
    }
}

/// `film.m2v` → `film.report.json`: the report of a video, unless another place was chosen.
#[must_use]
pub fn path_beside(video: &Path) -> PathBuf {
    video.with_extension("report.json")
}

/// Writes `value` as JSON, whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_json(value: &impl Serialize, path: &Path) -> Result<()> {
    let mut output = crate::output::Output::create(path)?;
    let mut text = serde_json::to_string_pretty(value).context("the report cannot be put into JSON")?;
    text.push('\n');
    output.write(text.as_bytes())?;
    output.finish()
}

fn picture_type<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static str, D::Error> {
    let name = String::deserialize(deserializer)?;
    let known = ["I", "P", "B"].into_iter().find(|known| *known == name);
    known.ok_or_else(|| serde::de::Error::custom("a picture that is neither I nor P nor B"))
}

/// CPU time of the whole process \[s\]; nothing where the system does not tell.
#[cfg(unix)]
pub(crate) fn process_cpu_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
pub(crate) fn process_cpu_seconds() -> Option<f64> {
    None
}

/// The kernel's high-water mark of resident memory (proc(5), VmHWM); Linux only.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}
