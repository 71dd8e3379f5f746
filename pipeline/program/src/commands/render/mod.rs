//! Command `render2mpeg render`.

mod files;
mod follow;
mod watch;
mod watching;

use crate::display_server::{DisplayServer, ViewerAddress};
use crate::interrupt::{Interrupt, Reactions};
use crate::lines::{Lines, ProgressKind};
use crate::log::Log;
use crate::overwrite::Overwrite;
use crate::print::single_line;
use crate::print_config::ProgramOption;
use crate::ranks::Ranks;
use crate::source::{MemoryLimit, SceneSource};
use crate::{features, notes, print_config, progress};
use anyhow::Result;
use clap::Args;
use files::{Files, check_streams, report_beside};
use pipeline::Run;
use pipeline::checkpoint::{Checkpoints, FilmJob, path_for};
use pipeline::observe::OnFrame;
use pipeline::report::FrameReport;
use pipeline::streams::{is_stream, make_folder};
use pipeline::team::{Present, Team, muster};
use render_core::scene::Scene;
use render2mpeg::also::Companion;
use render2mpeg::job::job_of;
use render2mpeg::places::FilePlaces;
use render2mpeg::settings::{CheckpointEvery, Settings};
use render2mpeg::{Options, Render};
use renderer::plan::Plan;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};
use std::time::Duration;
use watching::{Watching, keep_for_page, write_page};

/// Scene, settings of its film, and files to write.
#[derive(Args)]
pub(crate) struct RenderArguments {
    /// Scene of the film.
    #[command(flatten)]
    source: SceneSource,
    /// Settings of the film.
    #[command(flatten)]
    options: Options,
    /// JSON report [default: the video's path with .report.json]
    #[arg(long, value_name = "FILE", help_heading = "Output", hide_short_help = true)]
    report: Option<PathBuf>,
    /// Also write an HTML page: the film with a player, maps, and plots of the time, bits, PSNR and cut size of each frame
    #[arg(long, value_name = "FILE.html", help_heading = "Output", hide_short_help = true)]
    html: Option<PathBuf>,
    /// Also code the finished film again with ffmpeg: .mp4 (H.264) or .webm (AV1 or VP9) for players and browsers,
    /// .mov (ProRes) for editing, .webp or .gif as a loop
    #[arg(long, value_name = "FILE", value_delimiter = ',', help_heading = "Output", hide_short_help = true)]
    also: Vec<PathBuf>,
    /// Continue an interrupted or killed run of the same film, to the same bits; without a checkpoint, start at the
    /// first frame
    #[arg(long, help_heading = "Output", hide_short_help = true)]
    resume: bool,
    /// Keep the checkpoint of the finished film, so that --resume with more --frames can extend it
    #[arg(long, help_heading = "Output", hide_short_help = true)]
    keep_checkpoint: bool,
    /// Permission to replace files.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Seconds between the checkpoints for --resume, stored next to the video in .checkpoint: 0 writes one per frame,
    /// off none [default: 60]
    #[arg(long, value_name = "SECONDS", help_heading = "Output", hide_short_help = true)]
    checkpoint: Option<CheckpointEvery>,
    /// Number of threads; the result does not depend on it [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Run", hide_short_help = true)]
    pub threads: Option<u16>,
    /// Write a trace of all stages and frames, for chrome://tracing or Perfetto
    #[arg(long, value_name = "FILE.json", help_heading = "Progress", hide_short_help = true)]
    trace: Option<PathBuf>,
    /// Limit on memory.
    #[command(flatten)]
    memory: MemoryLimit,
    /// Render the film again whenever a file of the scene changes, and replace the previous film
    #[arg(long, conflicts_with = "resume", help_heading = "Run", hide_short_help = true)]
    watch: bool,
    /// Print a file for --config that makes the same film, with every default filled in; render nothing
    #[arg(long, help_heading = "Run", hide_short_help = true)]
    print_config: bool,
    /// Form of progress: a line at a terminal, lines of JSON on standard output, or Open Job Description [default:
    /// bar]
    #[arg(long, value_enum, value_name = "KIND", help_heading = "Progress", hide_short_help = true)]
    progress: Option<ProgressKind>,
    /// Show each frame as linear light in the image viewer tev while the film is made; tev listens at localhost:14158
    #[arg(long, value_name = "HOST:PORT", help_heading = "Progress", hide_short_help = true)]
    display_server: Option<ViewerAddress>,
    /// Log frames and checkpoints; given twice, every stage
    #[arg(short, long, action = clap::ArgAction::Count, conflicts_with = "quiet", help_heading = "Progress", hide_short_help = true)]
    verbose: u8,
    /// Print no progress and no summary, only errors
    #[arg(short, long, help_heading = "Progress", hide_short_help = true)]
    quiet: bool,
}

/// Default interval between checkpoints: if the renderer is killed, at most about a minute of work is lost.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

/// Renders the film and reports on rank 0. On other ranks, follows rank 0.
pub fn run_among(arguments: RenderArguments, ranks: &Ranks) -> Result<ExitCode> {
    if ranks.team().rank() > 0 {
        return follow::run(arguments, ranks);
    }
    // Answer the other ranks even if this rank fails, because they wait for an answer.
    run(arguments, &mut Answer::of(ranks.team()))
}

fn run(mut arguments: RenderArguments, answer: &mut Answer) -> Result<ExitCode> {
    arguments.check_features()?;
    let path = arguments.source.path();
    // Handle --watch, which starts a separate process for each film.
    if arguments.watch && answer.team.count() > 1 {
        let text = "--watch starts a new process for each film: run it without mpirun";
        return Err(render2mpeg::Error::Options(text.into()).into());
    }
    if arguments.watch {
        return watch::run(&path, || arguments.source.reading.load(&path));
    }
    let scene = arguments.source.reading.load(&path)?;
    let settings = arguments.options.fill_in(path, &scene)?;

    // Check all settings and output paths before rendering begins.
    let _ = settings.encoder_config()?;
    let files = arguments.files(&settings);
    check_streams(&settings.output, arguments.progress_kind(), &files.also)?;
    if arguments.print_config {
        let more = files.options().into_iter().chain(arguments.options_of_program());
        let text = print_config::text(&settings.scene, &arguments.options, &more.collect::<Vec<_>>())?;
        say!("{}", text.trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    files.places(FilePlaces::of(&scene).reads("--config", arguments.source.config()), &settings).check()?;
    let companion = |path: &PathBuf| Companion::new(path, &settings);
    let companions = files.also.iter().map(companion).collect::<Result<Vec<_>, _>>()?;

    // Decide whether an existing film is continued, already finished, or replaced.
    let job = job_of(&scene, &settings)?;
    if arguments.resume && files.is_finished(&job) {
        if !arguments.quiet {
            tell!("{} is already finished", settings.output.display());
        }
        return Ok(ExitCode::SUCCESS);
    }
    if !(arguments.resume && path_for(&settings.output).exists()) {
        files.check_replaced(arguments.overwrite, arguments.resume, &settings)?;
    }

    // Reject films that exceed the memory, then announce the film to the other ranks.
    arguments.memory.check(&scene, &settings)?;
    settings.files.exr.iter().chain(&settings.files.png).try_for_each(|folder| make_folder(folder))?;
    let checkpoints = arguments.checkpoints(&job)?;
    answer.ready(&job)?;
    if let Some(code) = arguments.make(&scene, &settings, (&files, answer.team), checkpoints)? {
        return Ok(code);
    }

    // Code the finished film again for other players.
    for companion in &companions {
        companion.make(&settings.output)?;
        if !arguments.quiet {
            tell!("also:   {}, by {}", companion.path().display(), companion.encoder());
        }
    }
    Ok(ExitCode::SUCCESS)
}

impl RenderArguments {
    /// Turns the camera around the scene in `seconds` unless another time is given.
    pub fn turn_in(&mut self, seconds: f32) {
        self.source.reading.turn_in(seconds);
    }

    /// Reports an option that needs a feature missing in this build.
    fn check_features(&self) -> Result<()> {
        features::need("html", self.html.is_some())?;
        features::need("exr", self.options.exr.is_some() || !self.options.aov.is_empty())?;
        features::need("still", self.options.png.is_some())?;
        features::need("trace", self.trace.is_some() || self.verbose > 0)
    }

    /// Returns the output files in addition to the film.
    fn files(&self, settings: &Settings) -> Files {
        Files {
            named_report: self.report.is_some(),
            report: self.report.clone().or_else(|| report_beside(&settings.output)),
            html: self.html.clone(),
            trace: self.trace.clone(),
            also: self.also.clone(),
        }
    }

    fn progress_kind(&self) -> ProgressKind {
        self.progress.unwrap_or(ProgressKind::Bar)
    }

    /// Returns the program's options that are not options of the film, for a `--config` file.
    fn options_of_program(&self) -> impl Iterator<Item = ProgramOption> {
        let own = [
            ProgramOption::text("checkpoint", self.checkpoint.map(|every| every.to_string())),
            ProgramOption::text("threads", self.threads.map(|threads| threads.to_string())),
        ];
        own.into_iter().chain(self.source.reading.options())
    }

    /// Returns the time between checkpoints; `None` for no checkpoints.
    fn checkpoint_every(&self) -> Option<Duration> {
        self.checkpoint.map_or(Some(CHECKPOINT_EVERY), CheckpointEvery::duration)
    }

    /// Returns the checkpoints of the job, either resumed or new.
    fn checkpoints(&self, job: &FilmJob) -> Result<Checkpoints> {
        let every = self.checkpoint_every();
        let checkpoints = if self.resume { Checkpoints::resume(job, every)? } else { Checkpoints::new(job, every) };
        // Keep a checkpoint at the end, so that --resume can extend the film.
        if let Some(end) = job.end().filter(|_| self.keep_checkpoint) {
            checkpoints.leave_at_end(end);
        }
        Ok(checkpoints)
    }

    /// Makes the film with report, page, progress and notes. Returns the exit code of an interrupted run, or else
    /// `None`.
    fn make(
        &self,
        scene: &Scene,
        settings: &Settings,
        (files, team): (&Files, &Team),
        checkpoints: Checkpoints,
    ) -> Result<Option<ExitCode>> {
        // Open all outputs before the first frame, to report errors early.
        let plan = Plan::new(scene, &settings.render);
        let mut film = Render::among(scene, settings, &plan, &checkpoints, team)?;
        film.write_to(&settings.output)?;
        files.try_out()?;
        let log = Log::start(self.verbose, files.trace.clone());

        // Set up progress output and reactions to signals.
        let first = film.first_frame();
        if !self.quiet {
            notes::before(scene, settings).iter().for_each(|note| tell!("note: {}", single_line(note)));
        }
        let progress = progress::ProgressLine::new(settings, scene, first, self.quiet || self.verbose > 0);
        // React to SIGTERM at once: when a rank is lost, the launcher ends all other ranks within about a second.
        let is_hasty = team.count() > 1;
        let interrupt =
            Interrupt::watch(Reactions { is_hasty, ..reactions(&film, &checkpoints, &progress, settings) })?;
        let lines = Lines::new(self.progress_kind(), settings, first);
        lines.begin();
        let frames = OnFrame::new(|frame: &FrameReport| {
            progress.frame(frame);
            lines.frame(frame);
            checkpoints.take_warning().into_iter().for_each(|warning| progress.warn(&warning));
        });

        // Record the maximum brightness of the film for the notes, and pictures for the page.
        let brightest = AtomicU8::new(0);
        let lightest = AtomicU32::new(0);
        let page = files.html.as_ref().map(|_| keep_for_page(&mut film, settings));
        let viewer = self.display_server.as_ref().map(|address| DisplayServer::start(address, progress.warner()));
        let viewer = viewer.map(|viewer| (viewer, settings.output.display().to_string()));
        let mut observer = Watching { frames, brightest, lightest, page, viewer };
        let result = film.finish(Run { observer: &observer, stop: &interrupt.stop });
        observer.viewer.take().into_iter().for_each(|(viewer, _)| viewer.finish());
        progress.clear();
        let brightest = observer.brightest.load(Ordering::Relaxed);
        let lightest = f32::from_bits(observer.lightest.load(Ordering::Relaxed));
        checkpoints.take_warning().into_iter().for_each(|warning| progress.warn(&warning));

        // Write report, page and trace. After that, a finished film needs no checkpoint.
        let report = result?;
        let interrupted = report.summary.interrupted;
        files.report.as_deref().map_or(Ok(()), |path| report.write(path))?;
        write_page(files.html.as_deref(), &report, observer.page, scene)?;
        let traced = log.finish()?;
        if !interrupted && !self.keep_checkpoint {
            checkpoints.remove();
        }
        lines.end(&report);
        if !self.quiet {
            let before = first.saturating_sub(settings.frame_range().start);
            progress::summary(&report, before, files.report.as_deref());
            files.html.iter().for_each(|path| tell!("page:   {}", path.display()));
            // Omit the brightness of a run that ended before its first frame.
            let shown = (brightest > 0).then_some(brightest);
            notes::on_darkness(shown, settings).into_iter().for_each(|note| tell!("note: {}", single_line(&note)));
            notes::on_dimness(lightest, scene).into_iter().for_each(|note| tell!("note: {}", single_line(&note)));
            notes::on_level(&report).into_iter().for_each(|note| tell!("note: {}", single_line(&note)));
            if interrupted {
                self.tell_of_early_end(settings);
            }
            traced.into_iter().for_each(|line| tell!("trace:  {line}"));
        }
        Ok(interrupted.then(|| interrupt.exit_code()))
    }
}

impl RenderArguments {
    /// Prints how to continue a film that ended early, and which files were not made.
    fn tell_of_early_end(&self, settings: &Settings) {
        match self.checkpoint_every() {
            _ if is_stream(&settings.output) => {}
            Some(_) => tell!("ended early: the same command with --resume continues after the last frame"),
            None => tell!("ended early and cannot be resumed: --checkpoint off wrote no checkpoint"),
        }
        self.also.iter().for_each(|path| tell!("{} was not made: the film is incomplete", path.display()));
    }
}

/// Answer of rank 0 to the other ranks, which wait for it. The answer is either a film to make or no film.
struct Answer<'a> {
    team: &'a Team,
    is_given: bool,
}

impl<'a> Answer<'a> {
    fn of(team: &'a Team) -> Self {
        Self { team, is_given: false }
    }

    /// Announces the film to the other ranks.
    ///
    /// # Errors
    /// If another rank is not ready for this film.
    fn ready(&mut self, job: &FilmJob) -> render2mpeg::Result<()> {
        self.is_given = true;
        Ok(muster(&*self.team.shade, &Present::Ready(job.sum())).map(drop)?)
    }
}

impl Drop for Answer<'_> {
    fn drop(&mut self) {
        if !self.is_given && !std::thread::panicking() {
            // Without a film, the result has no effect.
            let _ = muster(&*self.team.shade, &Present::Idle);
        }
    }
}

/// Returns the reactions to signals. The first signal lets frames in progress finish. The second ends the process at
/// once.
fn reactions(
    film: &Render,
    checkpoints: &Checkpoints,
    progress: &progress::ProgressLine,
    settings: &Settings,
) -> Reactions {
    let (tell, end, output) = (progress.teller(), film.early_end(), settings.output.display().to_string());
    let tell_again = progress.teller();
    let first = move || tell("stopping after this frame; interrupt again to stop now");
    // Complete the file, so that the written frames play, and permit --resume.
    let restart = checkpoints.restart();
    let second = move || match end.as_ref().map(|end| end()) {
        Some(Ok(true)) => {
            tell_again(&format!("video:  {output}, incomplete, up to the last written frame"));
            restart().err().into_iter().for_each(|error| tell_again(&error.chain()));
        }
        Some(Err(error)) => tell_again(&error.chain()),
        Some(Ok(false)) | None => {}
    };
    Reactions { first: Box::new(first), second: Box::new(second), ..Reactions::default() }
}
