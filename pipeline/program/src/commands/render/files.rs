//! The files of a film, and whether they may be written.

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

/// Files beside the film.
pub(super) struct Files {
    pub report: Option<PathBuf>,
    /// Whether the report is where the user says, and not beside the film.
    pub named_report: bool,
    pub html: Option<PathBuf>,
    pub trace: Option<PathBuf>,
    pub also: Vec<PathBuf>,
}

impl Files {
    /// Adds them to what is read, with the film itself.
    pub fn places(&self, read: FilePlaces, settings: &Settings) -> FilePlaces {
        let places = read
            .reads("--baked", settings.files.baked.as_deref())
            .writes("-o", Some(&settings.output))
            .writes("the checkpoint", Some(&path_for(&settings.output)))
            .writes("--report", self.report.as_deref())
            .writes("--y4m", settings.files.y4m.as_deref())
            .writes("--html", self.html.as_deref())
            .writes("--trace", self.trace.as_deref());
        self.also.iter().fold(places, |places, path| places.writes("--also", Some(path)))
    }

    /// As a file for `--config` has them.
    pub fn options(&self) -> [ProgramOption; 4] {
        let text = |path: &PathBuf| path.display().to_string();
        [
            ProgramOption::text("report", self.report.as_ref().map(text)),
            ProgramOption::text("html", self.html.as_ref().map(text)),
            ProgramOption::text("trace", self.trace.as_ref().map(text)),
            ProgramOption::list("also", self.also.iter().map(text)),
        ]
    }

    /// Whether the film of the job is there, and the report beside it says that it is whole.
    pub fn is_finished(&self, job: &FilmJob) -> bool {
        let report = self.report.as_ref().and_then(|report| std::fs::read(report).ok());
        let made = report.and_then(|report| job_of_report(job.film(), &report));
        let is_whole = made.is_some_and(|made| made.is_same(job) && made.end() == job.end());
        is_whole && job.film().is_file() && !path_for(job.film()).exists()
    }

    /// Asks before a film begins in the place of another, or of one that could be continued.
    ///
    /// # Errors
    /// The user says no.
    pub fn check_replaced(&self, overwrite: Overwrite, resume: bool, settings: &Settings) -> Result<()> {
        let film = &settings.output;
        if resume {
            let what = "has no checkpoint to go on from (--keep-checkpoint keeps that of a finished film)";
            return overwrite.check_for(film, what);
        }
        overwrite.check_for(&path_for(film), "is there: --resume goes on with its film")?;
        overwrite.check(film)?;
        let named = self.named_report.then_some(self.report.as_ref()).flatten();
        let others = [&settings.files.y4m, &self.html, &self.trace].into_iter().flatten();
        others.chain(named).chain(&self.also).try_for_each(|path| overwrite.check(path))?;
        first_frame_there(settings).map_or(Ok(()), |frame| overwrite.check(&frame))
    }

    /// Whether they can be written.
    ///
    /// # Errors
    /// A folder does not exist or may not be written to.
    pub fn try_out(&self) -> FilmResult<()> {
        let paths = [&self.report, &self.html, &self.trace];
        paths.into_iter().flatten().chain(&self.also).try_for_each(|path| Ok(Output::create(path).map(drop)?))
    }
}

/// The first of the pictures that the film is to write into folders which is there already.
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

/// Whether a film on standard output, or in a device, gets along with what else is wanted.
///
/// # Errors
/// Lines of progress would get into the film, or it cannot be read again.
pub fn check_streams(output: &Path, progress: ProgressKind, also: &[PathBuf]) -> Result<()> {
    let fail = |text: &str| Err(render2mpeg::Error::Options(format!("-o {}: {text}", output.display())).into());
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

/// `film.mpg` → `film.report.json`; a device has no neighbors, so its report goes to this folder. Of standard output there is one only
/// where `--report` names it.
pub fn report_beside(output: &Path) -> Option<PathBuf> {
    match output {
        _ if is_standard_output(output) => None,
        _ if is_stream(output) => Some("render2mpeg.report.json".into()),
        _ => Some(path_beside(output)),
    }
}
