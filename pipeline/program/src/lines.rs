//! Progress as lines on standard output, for calling programs.

use clap::ValueEnum;
use pipeline::report::FrameReport;
use render2mpeg::Settings;
use render2mpeg::report::{Report, Summary};
use schemars::JsonSchema;
use serde::Serialize;
use std::io::Write;
use std::sync::atomic::{AtomicU32, Ordering};

/// Form of progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressKind {
    /// A progress bar on standard error, at a terminal
    Bar,
    /// A line of JSON for the start, each frame and the end
    Json,
    /// openjd_progress and openjd_status for Open Job Description, as in Deadline Cloud
    Openjd,
}

/// A line of `--progress json`.
#[derive(Serialize, JsonSchema)]
#[serde(tag = "event", rename_all = "lowercase")]
pub(crate) enum Event {
    /// The run begins.
    Begin {
        /// Number of frames in the film.
        frames: u32,
        /// The first frame that is still to be made, from 0.
        first_frame: u32,
    },
    /// A frame is in the stream.
    Frame {
        /// Report of the frame, with the figures known so far.
        frame: Box<FrameReport>,
    },
    /// The run has ended.
    End {
        /// Means and totals over the frames.
        summary: Box<Summary>,
    },
}

/// Progress output of a run as lines. A progress bar prints no lines.
pub(crate) struct Lines {
    kind: ProgressKind,
    /// Number of frames of the film.
    film_frames: u32,
    /// Number of frames to make, including frames of earlier runs.
    frames: u32,
    first_frame: u32,
    /// Number of finished frames, including frames of earlier runs.
    made: AtomicU32,
}

impl Lines {
    /// Returns the progress output of a run that begins with `first_frame`.
    pub fn new(kind: ProgressKind, settings: &Settings, first_frame: u32) -> Self {
        let frames = settings.frame_range();
        let made = AtomicU32::new(first_frame - frames.start);
        Self { kind, film_frames: settings.render.frames, frames: frames.len() as u32, first_frame, made }
    }

    /// Announces the start of the run.
    pub fn begin(&self) {
        let &Self { film_frames, first_frame, .. } = self;
        self.print_json(|| Event::Begin { frames: film_frames, first_frame });
        self.print_progress();
    }

    /// Reports a frame that is in the stream, with the figures known so far.
    pub fn frame(&self, frame: &FrameReport) {
        self.made.fetch_add(1, Ordering::Relaxed);
        self.print_json(|| Event::Frame { frame: frame.clone().into() });
        self.print_progress();
    }

    /// Reports the end of the run.
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

    /// Prints progress in percent and a status. Each message begins a line, as Open Job Description ("How Jobs Are
    /// Run") requires.
    fn print_progress(&self) {
        if self.kind == ProgressKind::Openjd {
            let (made, frames) = (self.made.load(Ordering::Relaxed), self.frames);
            print(&format!("openjd_progress: {:.1}", 100.0 * f64::from(made) / f64::from(frames)));
            print(&format!("openjd_status: {made} of {frames} frames"));
        }
    }
}

/// Prints a line at once. If the reader has closed its end, the film continues.
fn print(line: &str) {
    let mut out = std::io::stdout().lock();
    // Flush each line, because the reader shows progress immediately.
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}
