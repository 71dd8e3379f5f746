//! Output files of a film, and checks of their paths before writing.

use crate::lines::ProgressKind;
use crate::overwrite::Overwrite;
use crate::print_config::ProgramOption;
use anyhow::Result;
use pipeline::checkpoint::{FilmJob, path_for};
use pipeline::output::Output;
use pipeline::streams::{is_standard_output, is_stream};
use render2mpeg::Result as FilmResult;
use render2mpeg::job::job_of_report;
use render2mpeg::places::FilePlaces;
use render2mpeg::report::path_beside;
use render2mpeg::settings::Settings;
use std::path::{Path, PathBuf};

/// Output files in addition to the film.
pub(super) struct Files {
    pub report: Option<PathBuf>,
    /// True if the user chose the report's path.
    pub named_report: bool,
    pub html: Option<PathBuf>,
    pub trace: Option<PathBuf>,
    pub also: Vec<PathBuf>,
}

impl Files {
    /// Adds these files and the film's files to `read`, the input files so far.
    pub fn places(&self, read: FilePlaces, settings: &Settings) -> FilePlaces {
        let places = read
            .reads("--baked", settings.files.baked.as_deref())
            .writes("--light", settings.files.light.as_deref())
            .writes("-o", Some(&settings.output))
            .writes("the checkpoint", Some(&path_for(&settings.output)))
            .writes("--report", self.report.as_deref())
            .writes("--y4m", settings.files.y4m.as_deref())
            .writes("--html", self.html.as_deref())
            .writes("--trace", self.trace.as_deref());
        self.also.iter().fold(places, |places, path| places.writes("--also", Some(path)))
    }

    /// Returns the options that set these files, for a `--config` file.
    pub fn options(&self) -> [ProgramOption; 4] {
        let text = |path: &PathBuf| path.display().to_string();
        [
            ProgramOption::text("report", self.report.as_ref().map(text)),
            ProgramOption::text("html", self.html.as_ref().map(text)),
            ProgramOption::text("trace", self.trace.as_ref().map(text)),
            ProgramOption::list("also", self.also.iter().map(text)),
        ]
    }

    /// Returns whether the job's film exists and the report describes it as finished.
    pub fn is_finished(&self, job: &FilmJob) -> bool {
        let report = self.report.as_ref().and_then(|report| std::fs::read(report).ok());
        let made = report.and_then(|report| job_of_report(job.film(), &report));
        let is_whole = made.is_some_and(|made| made.is_same(job) && made.end() == job.end());
        // A film with a checkpoint is unfinished.
        is_whole && job.film().is_file() && !path_for(job.film()).exists()
    }

    /// Asks the user before a new film replaces an existing film or a film that could be resumed.
    ///
    /// # Errors
    /// If the user refuses.
    pub fn check_replaced(&self, overwrite: Overwrite, resume: bool, settings: &Settings) -> Result<()> {
        let film = &settings.output;
        // Without a checkpoint, a resumed film starts at the first frame and replaces the existing film.
        if resume {
            let what = "has no checkpoint to resume from (--keep-checkpoint keeps the checkpoint of a finished film)";
            return overwrite.check_for(film, what);
        }
        overwrite.check_for(&path_for(film), "exists: --resume continues its film")?;
        overwrite.check(film)?;

        // Check the other files, and the frames in folders.
        let named = self.named_report.then_some(self.report.as_ref()).flatten();
        let others = [&settings.files.y4m, &self.html, &self.trace].into_iter().flatten();
        for path in others.chain(named).chain(&self.also) {
            overwrite.check(path)?;
        }
        first_frame_there(settings).map_or(Ok(()), |frame| overwrite.check(&frame))
    }

    /// Checks that the files can be written.
    ///
    /// # Errors
    /// If a folder does not exist or cannot be written to.
    pub fn try_out(&self) -> FilmResult<()> {
        let paths = [&self.report, &self.html, &self.trace];
        for path in paths.into_iter().flatten().chain(&self.also) {
            drop(Output::create(path)?);
        }
        Ok(())
    }
}

/// Returns the first existing file among the frames that the film will write into folders.
fn first_frame_there(settings: &Settings) -> Option<PathBuf> {
    let folders = [(&settings.files.exr, "exr"), (&settings.files.png, "png")];
    for (folder, ending) in folders {
        let Some(folder) = folder else { continue };
        for index in settings.frame_range() {
            let frame = folder.join(format!("frame_{index:05}.{ending}"));
            if frame.is_file() {
                return Some(frame);
            }
        }
    }
    None
}

/// Checks that a film on standard output or a device agrees with the other options.
///
/// # Errors
/// If progress lines would enter the film, or if `also` requires a film that cannot be read again.
pub fn check_streams(output: &Path, progress: ProgressKind, also: &[PathBuf]) -> Result<()> {
    let fail = |text: &str| Err(render2mpeg::Error::Options(format!("-o {}: {text}", output.display())).into());
    if is_standard_output(output) && progress != ProgressKind::Bar {
        return fail("standard output cannot carry both the film and progress lines; write the film into a file");
    }
    if is_stream(output) && !also.is_empty() {
        return fail("--also reads the finished film; write the film into a file");
    }
    Ok(())
}

/// Returns the default path of the report: `film.mpg` → `film.report.json`. For a film on a device, the report is in
/// the current folder. A film on standard output has no report unless `--report` names a file.
pub fn report_beside(output: &Path) -> Option<PathBuf> {
    match output {
        _ if is_standard_output(output) => None,
        _ if is_stream(output) => Some("render2mpeg.report.json".into()),
        _ => Some(path_beside(output)),
    }
}
