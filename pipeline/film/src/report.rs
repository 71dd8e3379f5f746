//! Results and costs of a run, as JSON. The names are kept stable; `schema` counts changes.

use crate::error::{Context, Result};
use crate::settings::Settings;
use pipeline::figures::Seconds;
use pipeline::report::FrameReport;
use render_core::scene::Scene;
use renderer::plan::Step;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The whole report.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Report {
    /// Version of the layout.
    pub schema: u32,
    /// Version of the program.
    pub program: String,
    /// The rendered scene.
    pub scene: SceneReport,
    /// Every choice of the run, defaults filled in.
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
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
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
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

/// Means over the frames, and totals.
#[derive(Clone, Debug, Default, Serialize, Deserialize, schemars::JsonSchema)]
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
    pub fn of(frames: &[FrameReport], ending: Ending) -> Self {
        let Ending { interrupted, wall_seconds } = ending;
        let count = frames.len().max(1) as f64;
        let mean = |f: &dyn Fn(&FrameReport) -> f64| frames.iter().map(f).sum::<f64>() / count;
        let psnrs: Vec<f64> = frames.iter().filter_map(|frame| frame.psnr_y).collect();
        let steered: Vec<f64> = frames.iter().skip(1).map(|frame| frame.figures.threshold_mean_relative).collect();
        Self {
            frames: frames.len() as u32,
            interrupted,
            bits_total: frames.iter().map(|frame| frame.bits).sum(),
            bits: mean(&|frame| frame.bits as f64),
            psnr_y: (!psnrs.is_empty()).then(|| psnrs.iter().sum::<f64>() / psnrs.len() as f64),
            seconds: Seconds::mean(frames.iter().map(|frame| &frame.figures.seconds)),
            cut_size_mean: mean(&|frame| frame.figures.cut_size_mean),
            cut_size_max: frames.iter().map(|frame| frame.figures.cut_size_max).max().unwrap_or(0),
            shadow_rays: mean(&|frame| frame.figures.shadow_rays as f64),
            threshold_mean_relative: (0.0 + steered.iter().sum::<f64>()) / steered.len().max(1) as f64,
            tree_swaps_share: mean(&|frame| frame.figures.tree_swaps_share),
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
pub fn write_json(value: &impl Serialize, path: &Path) -> Result<()> {
    let mut output = pipeline::output::Output::create(path)?;
    let mut text = serde_json::to_string_pretty(value).context("the report cannot be put into JSON")?;
    text.push('\n');
    output.write(text.as_bytes())?;
    Ok(output.finish()?)
}

/// CPU time of the whole process \[s\]; nothing where the system does not tell.
#[cfg(unix)]
pub fn process_cpu_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
pub fn process_cpu_seconds() -> Option<f64> {
    None
}

/// The kernel's high-water mark of resident memory (proc(5), VmHWM); Linux only.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}
