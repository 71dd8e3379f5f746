//! `render2mpeg`: arguments, settings, run, report. The one place that prints errors and sets the exit code.

mod args;
mod command;
mod config_file;
mod progress;
mod trace;

use anyhow::{Context, Result};
use args::{Arguments, Command};
use clap::CommandFactory;
use pipeline::checkpoint::Checkpoints;
use pipeline::observe::OnFrame;
use pipeline::output::Output;
use pipeline::reference::{self, Method};
use pipeline::report::FrameReport;
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
    let arguments = config_file::parse(std::env::args_os().collect());
    match arguments.and_then(|arguments| run(arguments.command)) {
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
        Command::Render {
            job,
            output,
            report,
            html,
            exr,
            aov,
            y4m,
            resume,
            checkpoint,
            threads,
            trace,
            print_config,
            json_progress,
            verbose,
            quiet,
        } => {
            use_threads(threads)?;
            let (path, mut wishes) = job.wishes();
            (wishes.output, wishes.exr, wishes.aov, wishes.y4m) = (output, exr, aov, y4m);
            let show = Show { quiet, verbose, json_progress, print_config };
            render(path, wishes, Files { report, html, trace }, Persistence { resume, checkpoint }, threads, show)
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
        Command::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "render2mpeg", &mut text);
            print_whole(&text);
            Ok(ExitCode::SUCCESS)
        }
        Command::Man { command } => {
            print_whole(&man(command.as_deref())?);
            Ok(ExitCode::SUCCESS)
        }
        Command::Sweep(arguments) => {
            use_threads(arguments.threads)?;
            let stop = stop_on_interrupt()?;
            match command::sweep::run(arguments, &stop) {
                Err(error) if stop.load(Ordering::Relaxed) => {
                    eprintln!("render2mpeg: {error:#}");
                    Ok(ExitCode::from(INTERRUPTED))
                }
                result => result,
            }
        }
        Command::Compare(arguments) => command::compare::run(&arguments),
    }
}

fn use_threads(threads: Option<u16>) -> Result<()> {
    if let Some(threads) = threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
        pool.build_global().context("the threads cannot be started")?;
    }
    Ok(())
}

/// What a run leaves besides the film.
struct Files {
    report: Option<PathBuf>,
    /// A page of it.
    html: Option<PathBuf>,
    trace: Option<PathBuf>,
}

/// How a run survives.
struct Persistence {
    resume: bool,
    checkpoint: Option<CheckpointEvery>,
}

/// What of a run is shown.
struct Show {
    quiet: bool,
    verbose: u8,
    json_progress: bool,
    print_config: bool,
}

/// A flag that Ctrl-C sets.
fn stop_on_interrupt() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || {
        // The second time, the user means it.
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED.into());
        }
    })
    .context("Ctrl-C cannot be watched for")?;
    Ok(stop)
}

fn render(
    path: PathBuf,
    wishes: pipeline::Wishes,
    Files { report, html, trace }: Files,
    Persistence { resume, checkpoint }: Persistence,
    threads: Option<u16>,
    Show { quiet, verbose, json_progress, print_config }: Show,
) -> Result<ExitCode> {
    let scene = scene::load(&path)?;
    let settings = Settings::new(path, &scene, wishes)?;
    // All that can be wrong with the settings or the places of the files is said before the first ray.
    settings.encoder_config()?;
    let report_path = report.unwrap_or_else(|| report_beside(&settings.output));
    if print_config {
        let more = [
            ("report", Some(report_path.display().to_string())),
            ("html", html.map(|path| path.display().to_string())),
            ("checkpoint", checkpoint.map(|every| every.to_string())),
            ("trace", trace.map(|path| path.display().to_string())),
            ("threads", threads.map(|threads| threads.to_string())),
        ];
        print!("{}", config_file::text(&settings, &more));
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(folder) = &settings.exr {
        std::fs::create_dir_all(folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    }
    let plan = Plan::new(&scene, &settings);
    let every = checkpoint.map_or(Some(CHECKPOINT_EVERY), CheckpointEvery::duration);
    let checkpoints = match resume {
        true => Checkpoints::resume(&settings, &plan, every)?,
        false => Checkpoints::new(&settings, &plan, every)?,
    };
    let output = checkpoints.output(&settings)?;
    drop(Output::create(&report_path)?);
    html.as_deref().map(Output::create).transpose()?;
    trace.as_deref().map(Output::create).transpose()?;
    if checkpoints.first_frame() == 0 {
        settings.y4m.as_deref().map(Output::create).transpose()?;
    }
    let tracing = trace.map(|path| (path, trace::Trace::new()));
    log_to(verbose, tracing.as_ref().map(|(_, trace)| trace.clone()));

    let stop = stop_on_interrupt()?;
    let first = checkpoints.first_frame();
    let progress = progress::Progress::new(&settings, &scene, first, quiet || verbose > 0);
    let lines = progress::JsonLines::new(json_progress);
    lines.begin(&settings, first);
    let observer = OnFrame::new(|frame: &FrameReport| {
        progress.frame(frame);
        lines.frame(frame);
    });
    let result = pipeline::render_from(&checkpoints, &scene, &settings, &plan, output, &stop, &observer);
    progress.clear();
    let report = result?;
    report.write(&report_path)?;
    if let Some(path) = &html {
        let mut output = Output::create(path)?;
        output.write(pipeline::page::run_page(&report)?.as_bytes())?;
        output.finish()?;
    }
    if let Some((path, trace)) = &tracing {
        trace.write(path)?;
    }
    if !report.summary.interrupted {
        checkpoints.remove(&settings);
    }
    lines.end(&report);
    if !quiet {
        progress::summary(&report, &settings.output, &report_path);
        if let Some((path, trace)) = &tracing {
            let (wall, sum) = trace.overlap();
            eprintln!("trace:  {}: {wall:.2} s by the clock for {sum:.2} s of stages", path.display());
        }
    }
    Ok(if report.summary.interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// Sends what the stages tell to standard error and into the trace. Without either, telling costs next to nothing.
fn log_to(verbose: u8, trace: Option<trace::Trace>) {
    use std::io::IsTerminal;
    use tracing_subscriber::filter::LevelFilter;
    use tracing_subscriber::fmt::format::FmtSpan;
    use tracing_subscriber::prelude::*;
    let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let lines = (verbose > 0).then(|| {
        let level = if verbose > 1 { LevelFilter::DEBUG } else { LevelFilter::INFO };
        let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(color).with_target(false);
        lines.with_span_events(if verbose > 1 { FmtSpan::CLOSE } else { FmtSpan::NONE }).with_filter(level)
    });
    if lines.is_some() || trace.is_some() {
        tracing_subscriber::registry().with(lines).with(trace.with_filter(LevelFilter::DEBUG)).init();
    }
}

/// Prints a text that was made whole: a reader that closes its end early is no failure.
fn print_whole(text: &[u8]) {
    use std::io::Write;
    let _ = std::io::stdout().write_all(text);
}

fn man(command: Option<&str>) -> Result<Vec<u8>> {
    let mut program = Arguments::command();
    program.build();
    let page = match command {
        None => program,
        Some(name) => {
            let found = program.get_subcommands().find(|one| one.get_name() == name).cloned();
            found.with_context(|| format!("there is no command {name}: see render2mpeg --help"))?
        }
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(page).render(&mut text)?;
    Ok(text)
}

/// `film.m2v` → `film.report.json`; a device has no neighbours, so its report goes to this folder.
fn report_beside(output: &Path) -> PathBuf {
    let device = std::fs::metadata(output).is_ok_and(|metadata| !metadata.is_file());
    if device { PathBuf::from("render2mpeg.report.json") } else { output.with_extension("report.json") }
}
