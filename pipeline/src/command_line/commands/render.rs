//! `render2mpeg render`.

use crate::command_line::interrupt::{Interrupt, Reactions};
use crate::command_line::lines::{Lines, ProgressKind};
use crate::command_line::log::Log;
use crate::command_line::overwrite::Overwrite;
use crate::command_line::print_config::ProgramOption;
use crate::command_line::source::{MemoryLimit, Source};
use crate::command_line::{parts, print_config, progress};
use crate::feedback_loop::Run;
use crate::feedback_loop::checkpoint::{Checkpoints, FilmJob, path_for};
use crate::feedback_loop::observe::{Observer, OnFrame};
#[cfg(feature = "html")]
use crate::laboratory::page::ImportanceSum;
use crate::output::Output;
use crate::places::FilePlaces;
use crate::report::{FrameReport, path_beside};
use crate::settings::{CheckpointEvery, Settings};
use crate::{Options, Plan, Render as Film, Report};
use anyhow::{Context, Result};
use clap::Args;
use plane::Plane;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// The scene, settings of its film, and the files to write.
#[derive(Args)]
pub(crate) struct Render {
    /// The scene.
    #[command(flatten)]
    source: Source,
    /// Settings of the film.
    #[command(flatten)]
    options: Options,
    /// Where the JSON report goes [default: beside the video, .report.json]
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Also write a page with plots of every frame's time, bits, PSNR and cut size
    #[arg(long, value_name = "FILE.html", hide = !cfg!(feature = "html"))]
    html: Option<PathBuf>,
    /// Go on where a killed or interrupted run of the same film was, to the same bits; begin at the beginning if there was none
    #[arg(long)]
    resume: bool,
    /// Keep the checkpoint of the finished film, so that --resume with more --frames can lengthen it
    #[arg(long)]
    keep_checkpoint: bool,
    /// Whether files may be replaced.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Seconds between checkpoints, beside the video in .checkpoint, for --resume: 0 is each frame, off is none [default: 60]
    #[arg(long, value_name = "SECONDS")]
    checkpoint: Option<CheckpointEvery>,
    /// Threads [default: one per processor]; the result is the same for any number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Write when each stage worked on which frame, for chrome://tracing or Perfetto
    #[arg(long, value_name = "FILE.json", hide = !cfg!(feature = "trace"))]
    trace: Option<PathBuf>,
    /// How much memory it may take.
    #[command(flatten)]
    memory: MemoryLimit,
    /// Print the file for --config that makes the same film, every default filled in; render nothing
    #[arg(long)]
    print_config: bool,
    /// Progress: as a line at a terminal, as lines of JSON on standard output, or as Open Job Description has it [default: bar]
    #[arg(long, value_enum, value_name = "KIND")]
    progress: Option<ProgressKind>,
    /// The same as --progress json: a line of JSON for the begin, each frame and the end, for other programs
    #[arg(long, conflicts_with = "progress")]
    json_progress: bool,
    /// Say what happens, line by line: once for frames and checkpoints, twice for every stage
    #[arg(short, long, action = clap::ArgAction::Count, conflicts_with = "quiet", hide = !cfg!(feature = "trace"))]
    verbose: u8,
    /// No progress, no summary: only errors are shown
    #[arg(short, long)]
    quiet: bool,
}

/// Interval of checkpoints: a film killed after hours loses a minute.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

/// Renders and reports.
pub fn run(arguments: Render) -> Result<ExitCode> {
    let Render { source, mut options, report, html, resume, checkpoint, threads, trace, .. } = arguments;
    let Render { memory, overwrite, print_config: only_print, progress, json_progress, verbose, quiet, .. } = arguments;
    parts::need("html", html.is_some())?;
    parts::need("exr", options.exr.is_some() || !options.aov.is_empty())?;
    parts::need("still", options.png.is_some())?;
    parts::need("trace", trace.is_some() || verbose > 0)?;
    let path = source.path();
    let scene = source.reading.load(&path)?;
    let settings = options.fill_in(path, &scene)?;
    // All that can be wrong with the settings or the places of the files is said before the first ray.
    let _ = settings.encoder_config()?;
    let report_path = report.unwrap_or_else(|| report_beside(&settings.output));
    if only_print {
        let text = |path: Option<&PathBuf>| path.map(|path| path.display().to_string());
        let more = [
            ProgramOption::text("report", text(Some(&report_path))),
            ProgramOption::text("html", text(html.as_ref())),
            ProgramOption::text("trace", text(trace.as_ref())),
            ProgramOption::text("checkpoint", checkpoint.map(|every| every.to_string())),
            ProgramOption::text("threads", threads.map(|threads| threads.to_string())),
        ];
        let more: Vec<ProgramOption> = more.into_iter().chain(source.reading.options()).collect();
        say!("{}", print_config::text(&settings.scene, &options, &more)?.trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    let checkpoint_path = path_for(&settings.output);
    FilePlaces::of(&scene)
        .reads("--config", source.config())
        .reads("--baked", settings.baked.as_deref())
        .writes("-o", Some(&settings.output))
        .writes("the checkpoint", Some(&checkpoint_path))
        .writes("--report", Some(&report_path))
        .writes("--y4m", settings.y4m.as_deref())
        .writes("--html", html.as_deref())
        .writes("--trace", trace.as_deref())
        .check()?;
    let job = FilmJob::of(&scene, &settings)?;
    if resume && is_finished(&job, &report_path) {
        if !quiet {
            tell!("{} is finished: nothing is left to do", settings.output.display());
        }
        return Ok(ExitCode::SUCCESS);
    }
    if !(resume && checkpoint_path.exists()) {
        check_replaced(overwrite, resume, &settings)?;
    }
    memory.check(&scene, &settings)?;
    for folder in settings.exr.iter().chain(&settings.png) {
        std::fs::create_dir_all(folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    }
    let plan = Plan::new(&scene, &settings.renderer());
    let every = checkpoint.map_or(Some(CHECKPOINT_EVERY), CheckpointEvery::duration);
    let checkpoints = match resume {
        true => Checkpoints::resume(&job, every)?,
        false => Checkpoints::new(&job, every),
    };
    if arguments.keep_checkpoint {
        checkpoints.leave_at_end(settings.frame_range().end);
    }
    let mut film = Film::new(&scene, &settings, &plan, &checkpoints)?;
    film.write_to(&settings.output)?;
    drop(Output::create(&report_path)?);
    html.as_deref().map(Output::create).transpose()?;
    trace.as_deref().map(Output::create).transpose()?;
    let log = Log::start(verbose, trace);

    let first = film.first_frame();
    let kind = if json_progress { ProgressKind::Json } else { progress.unwrap_or(ProgressKind::Bar) };
    let progress = progress::Progress::new(&settings, &scene, first, quiet || verbose > 0);
    let interrupt = Interrupt::watch(reactions(&film, &progress, &settings))?;
    let lines = Lines::new(kind, &settings, first);
    lines.begin();
    let frames = OnFrame::new(|frame: &FrameReport| {
        progress.frame(frame);
        lines.frame(frame);
        checkpoints.take_warning().into_iter().for_each(|warning| progress.warn(&warning));
    });
    let observer = Watching { frames, importance: ImportanceSum::default() };
    let result = film.finish(Run { observer: &observer, stop: &interrupt.stop });
    progress.clear();
    checkpoints.take_warning().into_iter().for_each(|warning| progress.warn(&warning));
    let report = result?;
    report.write(&report_path)?;
    write_page(html.as_deref(), &report, &observer.importance)?;
    let traced = log.finish()?;
    if !report.summary.interrupted && !arguments.keep_checkpoint {
        checkpoints.remove();
    }
    lines.end(&report);
    if !quiet {
        progress::summary(&report, &settings.output, &report_path);
        if report.summary.interrupted && every.is_some() {
            tell!("ended early: the same command with --resume goes on after the last frame");
        }
        traced.into_iter().for_each(|line| tell!("trace:  {line}"));
    }
    Ok(if report.summary.interrupted { interrupt.exit_code() } else { ExitCode::SUCCESS })
}

/// Whether the film of the job is there, and the report beside it says that it is whole.
fn is_finished(job: &FilmJob, report: &Path) -> bool {
    let made = std::fs::read(report).ok().and_then(|report| FilmJob::of_report(job.film(), &report));
    let is_whole = made.is_some_and(|made| made.is_same(job) && made.end() == job.end());
    is_whole && job.film().is_file() && !path_for(job.film()).exists()
}

/// Asks before a film begins in the place of another, or of one that could be continued.
///
/// # Errors
/// The user says no.
fn check_replaced(overwrite: Overwrite, resume: bool, settings: &Settings) -> Result<()> {
    let film = &settings.output;
    if resume {
        return overwrite.check_for(film, "is finished, and --keep-checkpoint has left nothing to go on from");
    }
    overwrite.check_for(&path_for(film), "is there: --resume goes on with its film")?;
    overwrite.check(film)?;
    settings.y4m.iter().try_for_each(|path| overwrite.check(path))
}

/// What is said and done when signals come: the first lets the frames that are begun be finished, the second does not.
fn reactions(film: &Film, progress: &progress::Progress, settings: &Settings) -> Reactions {
    let (tell, end, output) = (progress.teller(), film.early_end(), settings.output.display().to_string());
    let tell_again = progress.teller();
    let first = move || tell("stopping after this frame; again to stop now");
    let second = move || match end.as_ref().map(|end| end()) {
        Some(Ok(true)) => tell_again(&format!("video:  {output}, as far as it was written")),
        Some(Err(error)) => tell_again(&error.chain()),
        Some(Ok(false)) | None => {}
    };
    Reactions { first: Box::new(first), second: Box::new(second) }
}

/// Lines for each frame, and the maps of where people look for the page.
struct Watching<F> {
    frames: OnFrame<F>,
    importance: ImportanceSum,
}

impl<F: FnMut(&FrameReport) + Send> Observer for Watching<F> {
    fn frame(&self, report: &FrameReport) {
        self.frames.frame(report);
    }

    fn importance(&self, _index: u32, importance: &Plane<f32>) {
        self.importance.add(importance);
    }
}

/// Without pages nobody asks for maps.
#[cfg(not(feature = "html"))]
#[derive(Default)]
struct ImportanceSum;

#[cfg(not(feature = "html"))]
impl ImportanceSum {
    fn add(&self, _: &Plane<f32>) {}
}

/// Writes the page of the run, if one is wanted.
#[cfg(feature = "html")]
fn write_page(path: Option<&Path>, report: &Report, importance: &ImportanceSum) -> Result<()> {
    let Some(path) = path else { return Ok(()) };
    let mut output = Output::create(path)?;
    output.write(crate::laboratory::page::run_page(report, importance)?.as_bytes())?;
    Ok(output.finish()?)
}

/// Without the feature `html` a wanted page was refused before.
#[cfg(not(feature = "html"))]
fn write_page(_: Option<&Path>, _: &Report, _: &ImportanceSum) -> Result<()> {
    Ok(())
}

/// `film.m2v` → `film.report.json`; a device has no neighbors, so its report goes to this folder.
fn report_beside(output: &Path) -> PathBuf {
    let device = std::fs::metadata(output).is_ok_and(|metadata| !metadata.is_file());
    if device { PathBuf::from("render2mpeg.report.json") } else { path_beside(output) }
}
