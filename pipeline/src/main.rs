//! `render2mpeg`: arguments, settings, run, report. The one place that prints errors and sets the exit code.

mod args;
mod progress;

use anyhow::{Context, Result};
use args::{Arguments, Command};
use clap::Parser;
use pipeline::checkpoint::Checkpoints;
use pipeline::compare::compare_files;
use pipeline::output::Output;
use pipeline::reference::{self, Method};
use pipeline::settings::CheckpointEvery;
use pipeline::{Plan, Settings};
use render_core::{PathOptions, PixelSampling, scene};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// As shells report a command that was interrupted: 128 + SIGINT.
const INTERRUPTED: u8 = 130;
/// Of a film killed after hours, a minute is to be made again.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("render2mpeg: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<ExitCode> {
    match command {
        Command::Plan { job } => {
            let (path, wishes) = job.wishes();
            let scene = scene::load(&path)?;
            let settings = Settings::new(path, &scene, wishes)?;
            settings.encoder_config()?;
            print!("{}", Plan::new(&scene, &settings).table());
            scene.warnings.iter().for_each(|warning| println!("note: {warning}"));
            Ok(ExitCode::SUCCESS)
        }
        Command::Render { job, output, report, exr, aov, y4m, resume, checkpoint, threads, quiet } => {
            use_threads(threads)?;
            let (path, mut wishes) = job.wishes();
            (wishes.output, wishes.exr, wishes.aov, wishes.y4m) = (output, exr, aov, y4m);
            render(path, wishes, report, (resume, checkpoint), quiet)
        }
        Command::Reference {
            scene: path,
            output,
            frame,
            method,
            spp,
            bounces,
            centre,
            size,
            seed,
            vpls,
            photons,
            fps,
            threads,
            quiet,
        } => {
            use_threads(threads)?;
            let scene = scene::load(&path)?;
            let wishes = pipeline::Wishes { size, seed, bounces, vpls, photons, fps, ..Default::default() };
            let settings = Settings::new(path, &scene, wishes)?;
            // An output that cannot be written is told of before the work, not after it.
            drop(Output::create(&output)?);
            let picture = match method {
                Method::AllLights => reference::by_all_lights(&scene, &settings, frame)?,
                Method::Path => {
                    let pixel = if centre { PixelSampling::Centre } else { PixelSampling::Area };
                    let options = PathOptions { samples: spp, seed: settings.seed, max_bounces: bounces, pixel };
                    let bar = progress::of_work(quiet);
                    let picture = reference::by_paths(&scene, &settings, frame, &options, |done, all| {
                        bar.set_length(all as u64);
                        bar.set_position(done as u64);
                    });
                    bar.finish_and_clear();
                    picture
                }
            };
            picture.write(&output)?;
            Ok(ExitCode::SUCCESS)
        }
        Command::Compare { picture, reference, json } => {
            let comparison = compare_files(&picture, &reference)?;
            if json {
                println!("{}", serde_json::to_string_pretty(&comparison)?);
            } else {
                println!("{comparison}");
            }
            Ok(ExitCode::SUCCESS)
        }
    }
}

fn use_threads(threads: Option<u16>) -> Result<()> {
    if let Some(threads) = threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
        pool.build_global().context("the threads cannot be started")?;
    }
    Ok(())
}

fn render(
    path: PathBuf,
    wishes: pipeline::Wishes,
    report: Option<PathBuf>,
    (resume, checkpoint): (bool, Option<CheckpointEvery>),
    quiet: bool,
) -> Result<ExitCode> {
    let scene = scene::load(&path)?;
    let settings = Settings::new(path, &scene, wishes)?;
    // All that can be wrong with the settings or the places of the files is said before the first ray.
    settings.encoder_config()?;
    if let Some(folder) = &settings.exr {
        std::fs::create_dir_all(folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    }
    let report_path = report.unwrap_or_else(|| report_beside(&settings.output));
    let plan = Plan::new(&scene, &settings);
    let every = checkpoint.map_or(Some(CHECKPOINT_EVERY), CheckpointEvery::duration);
    let checkpoints = match resume {
        true => Checkpoints::resume(&settings, &plan, every)?,
        false => Checkpoints::new(&settings, &plan, every)?,
    };
    let output = checkpoints.output(&settings)?;
    drop(Output::create(&report_path)?);
    if checkpoints.first_frame() == 0 {
        settings.y4m.as_deref().map(Output::create).transpose()?;
    }

    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || {
        // The second time, the user means it.
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED.into());
        }
    })
    .context("Ctrl-C cannot be watched for")?;

    let progress = progress::Progress::new(&settings, &scene, checkpoints.first_frame(), quiet);
    let result =
        pipeline::render_from(&checkpoints, &scene, &settings, &plan, output, &stop, |frame| progress.frame(frame));
    progress.clear();
    let report = result?;
    report.write(&report_path)?;
    if !report.summary.interrupted {
        checkpoints.remove();
    }
    if !quiet {
        progress::summary(&report, &settings.output, &report_path);
    }
    Ok(if report.summary.interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// `film.m2v` → `film.report.json`; a device has no neighbours, so its report goes to this folder.
fn report_beside(output: &Path) -> PathBuf {
    let device = std::fs::metadata(output).is_ok_and(|metadata| !metadata.is_file());
    if device { PathBuf::from("render2mpeg.report.json") } else { output.with_extension("report.json") }
}
