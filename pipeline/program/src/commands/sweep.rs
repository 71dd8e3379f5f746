//! Command `render2mpeg sweep`.

use crate::interrupt::{Interrupt, Reactions};
use crate::overwrite::Overwrite;
use crate::print::single_line;
use crate::progress;
use crate::source::Reading;
use anyhow::{Context, Result};
use clap::Args;
use laboratory::sweep::{DEFAULT_FRAMES, DEFAULT_QSCALES, DEFAULT_SIZE, METHODS, Method, Source};
use render2mpeg::Options;
use render2mpeg::settings::parse_fps;
use renderer::settings::Size;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// Methods to compare, and the folder for the results.
#[derive(Args)]
pub(crate) struct Sweep {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Options for reading the scene: folders, camera, animation and scene settings.
    #[command(flatten)]
    reading: Reading,
    /// Folder for sweep.html, sweep.json, sweep.csv, plots and maps [default: the scene's name and "-sweep"]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Quantisers: a list of MPEG-2 quantiser_scale, 1 (best) to 112 (smallest) [default: 2,8,16,32,48]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    qscale: Vec<u32>,
    /// Methods: a list of lightcuts, paper, perceptual, calibrated, codec, each also with -cache, paper-calibrated,
    /// codec-calibrated, and paths-4, -16, -64 [default: all]
    #[arg(long, value_delimiter = ',', value_name = "LIST", value_parser = Method::named)]
    methods: Vec<&'static Method>,
    /// Number of frames; the first has no thresholds yet and does not count [default: 5]
    #[arg(long, value_name = "N")]
    frames: Option<u32>,
    /// Picture size in pixels [default: 144x144]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Frames per second [default: the scene's TOML file, else 25]
    #[arg(long, value_parser = parse_fps)]
    fps: Option<f64>,
    /// Multiplier on the error that masking permits, for the methods "perceptual" [default: as for films]
    #[arg(long, value_name = "K")]
    kappa: Option<f32>,
    /// Number of anchor lights, the sources of indirect light [default: as for films]
    #[arg(long, value_name = "N")]
    vpls: Option<usize>,
    /// Photons per frame [default: as for `render` at each quantiser; for the reference, 36 per anchor light]
    #[arg(long, value_name = "N")]
    photons: Option<u64>,
    /// Random seed of photons and light tree [default: 1]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Number of threads; the pictures do not depend on it [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Permission to replace the results of another sweep.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print no progress and no summary, only errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the sweep and writes the results. After a signal, writes the results obtained so far.
pub fn run(arguments: Sweep) -> Result<ExitCode> {
    let Sweep {
        scene: path,
        reading,
        output,
        qscale,
        methods,
        frames,
        size,
        fps,
        kappa,
        vpls,
        photons,
        seed,
        overwrite,
        quiet,
        ..
    } = arguments;
    let scene = reading.load(&path)?;
    // By default, name the folder after the scene.
    let folder = match output {
        Some(folder) => folder,
        None => {
            let stem = path.file_stem().context("the scene's path has no file name")?;
            PathBuf::from(format!("{}-sweep", stem.to_string_lossy()))
        }
    };
    // Ask before replacing the results of another sweep.
    overwrite.check(&folder.join("sweep.json"))?;
    pipeline::streams::make_folder(&folder)?;
    // Report an unwritable folder before rendering begins.
    drop(pipeline::output::Output::create(&folder.join("sweep.json"))?);

    // Use the sweep's own defaults for options that were not given.
    let sweep = laboratory::sweep::Sweep {
        common: Options {
            frames: Some(frames.unwrap_or(DEFAULT_FRAMES)),
            size: Some(size.unwrap_or(DEFAULT_SIZE)),
            fps,
            kappa,
            vpls,
            photons,
            seed,
            ..Options::default()
        },
        qscales: if qscale.is_empty() { DEFAULT_QSCALES.to_vec() } else { qscale },
        methods: if methods.is_empty() { METHODS.iter().collect() } else { methods },
    };

    // End the sweep after the current frame on the first signal, and end the process on the second.
    let line = progress::of_long_work(quiet);
    let above = (*line).clone();
    let first = move || {
        let text = "stopping after this frame and keeping the results; interrupt again to stop now and discard them";
        if !quiet {
            above.suspend(|| tell!("{text}"));
        }
    };
    let interrupt = Interrupt::watch(Reactions { first: Box::new(first), ..Reactions::default() })?;
    let result = sweep.run(Source { path: &path, scene: &scene }, &folder, &interrupt.stop, |progress| {
        line.set_length(progress.all);
        line.set_position(progress.done);
        line.set_message(progress.doing.clone());
    });
    line.finish_and_clear();

    // Write complete or partial results.
    let swept = match result {
        Err(error) if interrupt.stop.load(Ordering::Relaxed) => {
            tell!("render2mpeg: {}", single_line(&error.chain()));
            return Ok(interrupt.exit_code());
        }
        result => result?,
    };
    swept.write(&folder)?;
    if !quiet {
        say!("{}", swept.outcome.table());
        say!("page: {} (after {:.0} s)", folder.join("sweep.html").display(), swept.outcome.wall_seconds);
    }
    Ok(if swept.outcome.interrupted { interrupt.exit_code() } else { ExitCode::SUCCESS })
}
