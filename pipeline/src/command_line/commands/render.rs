//! `render2mpeg render`.

use crate::also::Companion;
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
use crate::places::{FilePlaces, is_standard_output, is_stream};
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
    /// When the film is whole, code its pictures again for players of today, by ffmpeg: .mp4 (H.264) or .webm (AV1 or VP9)
    #[arg(long, value_name = "FILE", value_delimiter = ',')]
    also: Vec<PathBuf>,
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
    let Render { source, mut options, report, html, also, resume, checkpoint, threads, trace, .. } = arguments;
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
    let kind = if json_progress { ProgressKind::Json } else { progress.unwrap_or(ProgressKind::Bar) };
    check_streams(&settings.output, kind, &also)?;
    let files = Files { report: report.or_else(|| report_beside(&settings.output)), html, trace, also };
    if only_print {
        let more = [
            ProgramOption::text("checkpoint", checkpoint.map(|every| every.to_string())),
            ProgramOption::text("threads", threads.map(|threads| threads.to_string())),
        ];
        let more: Vec<ProgramOption> =
            files.options().into_iter().chain(more).chain(source.reading.options()).collect();
        say!("{}", print_config::text(&settings.scene, &options, &more)?.trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    files.places(FilePlaces::of(&scene).reads("--config", source.config()), &settings).check()?;
    let companions =
        files.also.iter().map(|path| Companion::new(path, settings.size)).collect::<Result<Vec<_>, _>>()?;
    let job = FilmJob::of(&scene, &settings)?;
    if resume && files.is_finished(&job) {
        if !quiet {
            tell!("{} is finished: nothing is left to do", settings.output.display());
        }
        return Ok(ExitCode::SUCCESS);
    }
    if !(resume && path_for(&settings.output).exists()) {
        files.check_replaced(overwrite, resume, &settings)?;
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
    files.try_out()?;
    let Files { report: report_path, html, trace, .. } = files;
    let log = Log::start(verbose, trace);

    let first = film.first_frame();
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
    report_path.as_deref().map_or(Ok(()), |path| report.write(path))?;
    write_page(html.as_deref(), &report, &observer.importance)?;
    let traced = log.finish()?;
    if !report.summary.interrupted && !arguments.keep_checkpoint {
        checkpoints.remove();
    }
    lines.end(&report);
    if !quiet {
        progress::summary(&report, &settings.output, report_path.as_deref());
        if report.summary.interrupted && every.is_some() && !is_stream(&settings.output) {
            tell!("ended early: the same command with --resume goes on after the last frame");
        }
        traced.into_iter().for_each(|line| tell!("trace:  {line}"));
    }
    if report.summary.interrupted {
        return Ok(interrupt.exit_code());
    }
    for companion in &companions {
        companion.make(&settings.output)?;
        if !quiet {
            tell!("also:   {}, by {}", companion.path().display(), companion.encoder());
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Files beside the film.
struct Files {
    report: Option<PathBuf>,
    html: Option<PathBuf>,
    trace: Option<PathBuf>,
    also: Vec<PathBuf>,
}

impl Files {
    /// Adds them to what is read, with the film itself.
    fn places(&self, read: FilePlaces, settings: &Settings) -> FilePlaces {
        let places = read
            .reads("--baked", settings.baked.as_deref())
            .writes("-o", Some(&settings.output))
            .writes("the checkpoint", Some(&path_for(&settings.output)))
            .writes("--report", self.report.as_deref())
            .writes("--y4m", settings.y4m.as_deref())
            .writes("--html", self.html.as_deref())
            .writes("--trace", self.trace.as_deref());
        self.also.iter().fold(places, |places, path| places.writes("--also", Some(path)))
    }

    /// As a file for `--config` has them.
    fn options(&self) -> [ProgramOption; 4] {
        let text = |path: &PathBuf| path.display().to_string();
        [
            ProgramOption::text("report", self.report.as_ref().map(text)),
            ProgramOption::text("html", self.html.as_ref().map(text)),
            ProgramOption::text("trace", self.trace.as_ref().map(text)),
            ProgramOption::list("also", self.also.iter().map(text)),
        ]
    }

    /// Whether the film of the job is there, and the report beside it says that it is whole.
    fn is_finished(&self, job: &FilmJob) -> bool {
        let report = self.report.as_ref().and_then(|report| std::fs::read(report).ok());
        let made = report.and_then(|report| FilmJob::of_report(job.film(), &report));
        let is_whole = made.is_some_and(|made| made.is_same(job) && made.end() == job.end());
        is_whole && job.film().is_file() && !path_for(job.film()).exists()
    }

    /// Asks before a film begins in the place of another, or of one that could be continued.
    ///
    /// # Errors
    /// The user says no.
    fn check_replaced(&self, overwrite: Overwrite, resume: bool, settings: &Settings) -> Result<()> {
        let film = &settings.output;
        if resume {
            return overwrite.check_for(film, "is finished, and --keep-checkpoint has left nothing to go on from");
        }
        overwrite.check_for(&path_for(film), "is there: --resume goes on with its film")?;
        overwrite.check(film)?;
        settings.y4m.iter().chain(&self.also).try_for_each(|path| overwrite.check(path))
    }

    /// Whether they can be written.
    ///
    /// # Errors
    /// A folder does not exist or may not be written to.
    fn try_out(&self) -> crate::Result<()> {
        let paths = [&self.report, &self.html, &self.trace];
        paths.into_iter().flatten().chain(&self.also).try_for_each(|path| Output::create(path).map(drop))
    }
}

/// Whether a film on standard output, or in a device, gets along with what else is wanted.
///
/// # Errors
/// Lines of progress would get into the film, or it cannot be read again.
fn check_streams(output: &Path, progress: ProgressKind, also: &[PathBuf]) -> Result<()> {
    let fail = |text: &str| Err(crate::Error::Options(format!("-o {}: {text}", output.display())).into());
    if is_standard_output(output) && progress != ProgressKind::Bar {
        return fail(
            "standard output cannot take both the film and lines of progress; choose another place for the film",
        );
    }
    if is_stream(output) && !also.is_empty() {
        return fail("--also makes its files from the film when that is whole; write the film into a file");
    }
    Ok(())
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

/// `film.mpg` → `film.report.json`; a device has no neighbors, so its report goes to this folder. Of standard output there is one only
/// where `--report` names it.
fn report_beside(output: &Path) -> Option<PathBuf> {
    match output {
        _ if is_standard_output(output) => None,
        _ if is_stream(output) => Some("render2mpeg.report.json".into()),
        _ => Some(path_beside(output)),
    }
}
