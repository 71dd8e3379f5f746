//! Progress as lines on standard output, for programs that wait for this one.

use clap::ValueEnum;
use pipeline::report::FrameReport;
use render2mpeg::Settings;
use render2mpeg::report::{Report, Summary};
use schemars::JsonSchema;
use serde::Serialize;
use std::io::Write;
use std::sync::atomic::{AtomicU32, Ordering};

/// The form of progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressKind {
    /// A line on standard error that moves on, at a terminal
    Bar,
    /// A line of JSON for the begin, each frame and the end
    Json,
    /// openjd_progress and openjd_status, for Open Job Description: OpenJD, Deadline Cloud
    Openjd,
}

/// A line of `--progress json`.
#[derive(Serialize, JsonSchema)]
#[serde(tag = "event", rename_all = "lowercase")]
pub(crate) enum Event {
    /// The run begins.
    Begin {
        /// Frames of the film.
        frames: u32,
        /// The first frame that is still to be made, from 0.
        first_frame: u32,
    },
    /// A frame is in the stream.
    Frame {
        /// Its line of the report, up to here.
        frame: Box<FrameReport>,
    },
    /// The run has ended.
    End {
        /// Means and totals over the frames.
        summary: Box<Summary>,
    },
}

/// Lines of a run, in one of the forms; none where a bar is wanted.
pub(crate) struct Lines {
    kind: ProgressKind,
    /// Frames of the film.
    film_frames: u32,
    /// Frames to make, those of earlier runs included.
    frames: u32,
    first_frame: u32,
    /// Frames that are made, those of earlier runs included.
    made: AtomicU32,
}

impl Lines {
    /// For a run that begins with `first_frame`.
    pub fn new(kind: ProgressKind, settings: &Settings, first_frame: u32) -> Self {
        let frames = settings.frame_range();
        let made = AtomicU32::new(first_frame - frames.start);
        Self { kind, film_frames: settings.render.frames, frames: frames.len() as u32, first_frame, made }
    }

    /// Announces the run.
    pub fn begin(&self) {
        let &Self { film_frames, first_frame, .. } = self;
        self.print_json(|| Event::Begin { frames: film_frames, first_frame });
        self.print_progress();
    }

    /// A frame is in the stream, with all that the report says of it up to here.
    pub fn frame(&self, frame: &FrameReport) {
        self.made.fetch_add(1, Ordering::Relaxed);
        self.print_json(|| Event::Frame { frame: frame.clone().into() });
        self.print_progress();
    }

    /// All is done.
    pub fn end(&self, report: &Report) {
        self.print_json(|| Event::End { summary: report.summary.clone().into() });
    }

    fn print_json(&self, event: impl FnOnce() -> Event) {
        if self.kind == ProgressKind::Json
            && let Ok(line) = serde_json::to_string(&event())
        {
            print(&line);
        }
    }

    /// Share of the frames in percent, and a status, each at the beginning of a line (Open Job Description, How Jobs Are Run).
    fn print_progress(&self) {
        if self.kind == ProgressKind::Openjd {
            let (made, frames) = (self.made.load(Ordering::Relaxed), self.frames);
            print(&format!("openjd_progress: {:.1}", 100.0 * f64::from(made) / f64::from(frames)));
            print(&format!("openjd_status: {made} of {frames} frames"));
        }
    }
}

/// Prints a line at once. Nobody may listen any more: the film is made all the same.
fn print(line: &str) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}
