//! `render2mpeg sweep`.

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

/// Methods to compare, and the folder for the findings.
#[derive(Args)]
pub(crate) struct Sweep {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Reading of the scene: folders, camera, animation, settings.
    #[command(flatten)]
    reading: Reading,
    /// The folder for sweep.html, sweep.json, sweep.csv, plots and maps [default: the scene's name and "-sweep"]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Quantisers: a list of MPEG-2's quantiser_scale, 1 (best) to 112 (smallest) [default: 2,8,16,32,48]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    qscale: Vec<u32>,
    /// Methods: a list of lightcuts, paper, perceptual, calibrated, codec, each also with -cache, paper-calibrated,
    /// codec-calibrated, and paths-4, -16, -64 [default: all]
    #[arg(long, value_delimiter = ',', value_name = "LIST", value_parser = Method::named)]
    methods: Vec<&'static Method>,
    /// Pictures; the first, for which no thresholds are known, does not count [default: 5]
    #[arg(long, value_name = "N")]
    frames: Option<u32>,
    /// Size of the picture, in pixels [default: 144x144]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Pictures a second [default: as the TOML file says, else 25]
    #[arg(long, value_parser = parse_fps)]
    fps: Option<f64>,
    /// Multiplier on what masking allows, of the methods "perceptual" [default: as for films]
    #[arg(long, value_name = "K")]
    kappa: Option<f32>,
    /// Anchor lights that carry the indirect light [default: as for films]
    #[arg(long, value_name = "N")]
    vpls: Option<usize>,
    /// Photons a frame [default: as for `render` at each quantiser; 36 for each anchor light of the reference]
    #[arg(long, value_name = "N")]
    photons: Option<u64>,
    /// Seed of photons and light tree [default: 1]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Threads [default: one per processor]; the pictures are the same for any number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Whether the findings of another sweep may be replaced.
    #[command(flatten)]
    overwrite: Overwrite,
    /// No progress, no summary: only errors are shown
    #[arg(short, long)]
    quiet: bool,
}

/// Sweeps and writes; after a signal, what is measured by then.
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
    let folder = match output {
        Some(folder) => folder,
        None => {
            let stem = path.file_stem().context("the scene's path has no file name")?;
            PathBuf::from(format!("{}-sweep", stem.to_string_lossy()))
        }
    };
    overwrite.check(&folder.join("sweep.json"))?;
    pipeline::streams::make_folder(&folder)?;
    // A folder that cannot be written to is told of before the work, not after it.
    drop(pipeline::output::Output::create(&folder.join("sweep.json"))?);
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

    // The first signal ends the sweep after the frame in work, the second the process.
    let line = progress::of_long_work(quiet);
    let above = line.clone();
    let first = move || {
        let text = "stopping after this frame, and keeping what is measured; again to stop now, and keep nothing";
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

    // Findings, whole or in part.
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
