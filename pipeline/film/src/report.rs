//! Results and costs of a run, as JSON. Field names are stable; `schema` counts changes.

use crate::error::{Context, Result};
use crate::settings::Settings;
use pipeline::figures::Seconds;
use pipeline::report::FrameReport;
use render_core::scene::Scene;
use renderer::plan::Step;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Report of a run.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Report {
    /// Version of the layout.
    pub schema: u32,
    /// Name and version of the program.
    pub program: String,
    /// The rendered scene.
    pub scene: SceneReport,
    /// All settings of the run, with defaults filled in.
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    pub settings: Settings,
    /// Stages that ran, stages that were left out, and reasons.
    pub plan: Vec<Step>,
    /// Reports of all frames.
    pub frames: Vec<FrameReport>,
    /// Summary of all frames.
    pub summary: Summary,
    /// Checksum of the input files: parts made from other files are refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inputs: Option<u32>,
}

/// Scene of a run.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct SceneReport {
    /// Path of the scene.
    pub file: PathBuf,
    /// Number of triangles of all instances.
    pub triangles: usize,
    /// Number of mesh instances.
    pub instances: usize,
    /// Number of images in use.
    pub textures: usize,
    /// Length of the animation \[s\].
    pub duration: f32,
    /// Features of the scene that were read but not rendered.
    pub warnings: Vec<String>,
}

/// Means and totals of a run's frames.
#[derive(Clone, Debug, Default, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Summary {
    /// Number of frames in the stream.
    pub frames: u32,
    /// True if the user ended the run early.
    pub interrupted: bool,
    /// Size of all coded pictures \[bits\].
    pub bits_total: u64,
    /// Mean size of a frame \[bits\].
    pub bits: f64,
    /// Mean PSNR of luma, over the frames with a finite PSNR \[dB\].
    pub psnr_y: Option<f64>,
    /// Mean CPU seconds of each stage.
    pub seconds: Seconds,
    /// Mean number of clusters in a lightcut.
    pub cut_size_mean: f64,
    /// Largest number of clusters in a lightcut.
    pub cut_size_max: u32,
    /// Mean number of shadow rays per frame.
    pub shadow_rays: f64,
    /// Mean ratio of threshold to luminance, over the frames after the first.
    pub threshold_mean_relative: f64,
    /// Mean fraction of the light tree's inner nodes with changed children.
    pub tree_swaps_share: f64,
    /// Wall-clock time, including loading \[s\].
    pub wall_seconds: f64,
    /// CPU time of all threads \[s\]; null if the system does not report it.
    pub cpu_seconds: Option<f64>,
    /// Peak memory \[bytes\]; null if the system does not report it.
    pub peak_memory_bytes: Option<u64>,
}

/// Duration of a run, and whether the user ended it early.
#[derive(Clone, Copy, Debug)]
pub struct Ending {
    /// Whether the user ended the run early.
    pub interrupted: bool,
    /// Wall-clock time since the start \[s\].
    pub wall_seconds: f64,
}

impl Summary {
    /// Returns the summary of `frames`, which this process made.
    pub fn of(frames: &[FrameReport], ending: Ending) -> Self {
        let Ending { interrupted, wall_seconds } = ending;
        let count = frames.len().max(1) as f64;
        let mean = |f: &dyn Fn(&FrameReport) -> f64| frames.iter().map(f).sum::<f64>() / count;
        // Exclude lossless frames, whose PSNR is infinite, and the first frame, which has default thresholds.
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
            // Add 0.0, because the sum of an empty list is −0.0.
            threshold_mean_relative: (0.0 + steered.iter().sum::<f64>()) / steered.len().max(1) as f64,
            tree_swaps_share: mean(&|frame| frame.figures.tree_swaps_share),
            wall_seconds,
            cpu_seconds: process_cpu_seconds(),
            peak_memory_bytes: peak_memory_bytes(),
        }
    }
}

impl Report {
    /// Returns the report of a run that made `frames`.
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

    /// Writes the report atomically.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(self, path)
    }
}

/// Returns the default path of a video's report: `film.m2v` → `film.report.json`.
#[must_use]
pub fn path_beside(video: &Path) -> PathBuf {
    video.with_extension("report.json")
}

/// Writes `value` as JSON, atomically.
///
/// # Errors
/// If the file cannot be written.
pub fn write_json(value: &impl Serialize, path: &Path) -> Result<()> {
    let mut output = pipeline::output::Output::create(path)?;
    let mut text = serde_json::to_string_pretty(value).context("the report cannot be written as JSON")?;
    text.push('\n');
    output.write(text.as_bytes())?;
    Ok(output.finish()?)
}

/// Returns the CPU time of the whole process \[s\]; `None` if the system does not report it.
#[cfg(unix)]
pub fn process_cpu_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
pub fn process_cpu_seconds() -> Option<f64> {
    None
}

/// Returns the peak resident memory reported by the kernel (proc(5), VmHWM) \[bytes\]; Linux only.
fn peak_memory_bytes() -> Option<u64> {
    // Parse a line such as "VmHWM:   12345 kB".
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}
