//! Progress line while frames are made, and a summary at the end.

use crate::heartbeat::Heartbeat;
use crate::print::{counted, rough_time, single_line};
use indicatif::{ProgressBar, ProgressStyle};
use pipeline::report::FrameReport;
use render_core::scene::Scene;
use render2mpeg::Settings;
use render2mpeg::report::Report;
use std::ops::Deref;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Progress of work. It is a line at a terminal, and a new line every half minute in other output.
pub(crate) struct Progress {
    bar: ProgressBar,
    _heartbeat: Option<Heartbeat>,
}

impl Progress {
    /// Returns the progress of work measured in `noun`, a plural or "%".
    fn of(bar: ProgressBar, noun: &'static str) -> Self {
        Self { _heartbeat: Some(Heartbeat::of(&bar, noun)), bar }
    }

    /// Returns progress that is not printed.
    fn hidden() -> Self {
        Self { bar: ProgressBar::hidden(), _heartbeat: None }
    }

    fn warn(&self, warning: &str) {
        self.warner()(warning);
    }

    /// Returns a function that prints warnings above the line from any thread.
    pub fn warner(&self) -> impl Fn(&str) + Send + Sync + 'static {
        let bar = self.bar.clone();
        move |warning| bar.suspend(|| tell!("warning: {}", single_line(warning)))
    }
}

impl Deref for Progress {
    type Target = ProgressBar;

    fn deref(&self) -> &ProgressBar {
        &self.bar
    }
}

/// Progress of a film.
pub(crate) struct ProgressLine {
    bar: Progress,
    pace: Mutex<Pace>,
    is_quiet: bool,
}

/// Mean time per frame. The run's first frame is excluded, because it traces photons, builds trees and fills caches.
#[derive(Clone, Copy, Default)]
struct Pace {
    /// Time at which the run's first frame ended.
    first: Option<Instant>,
    /// Time at which the last frame so far ended.
    last: Option<Instant>,
    /// Number of finished frames after the run's first frame.
    others: u32,
}

impl Pace {
    /// Records a frame that ends at the time `now`.
    fn frame(&mut self, now: Instant) {
        match self.first {
            None => self.first = Some(now),
            Some(_) => self.others += 1,
        }
        self.last = Some(now);
    }

    /// Returns the mean time of the frames after the first \[s\]; `None` before the second frame.
    fn seconds(&self) -> Option<f64> {
        let (first, last) = (self.first?, self.last?);
        (self.others > 0).then(|| (last - first).as_secs_f64() / f64::from(self.others))
    }
}

/// Interval between steps of the spinner, which has eight steps per rotation and shows activity during long frames.
const TICK: Duration = Duration::from_millis(250);

impl ProgressLine {
    /// Prints the film's properties, and starts the line.
    pub fn new(settings: &Settings, scene: &Scene, first_frame: u32, quiet: bool) -> Self {
        // Hide the line in quiet runs, and in verbose runs, which print log lines.
        if quiet {
            return Self { bar: Progress::hidden(), pace: Mutex::default(), is_quiet: quiet };
        }
        tell!(
            "{}: {} triangles, {} of {}x{} at {} fps, quantiser_scale {}",
            settings.scene.display(),
            scene.triangle_count(),
            settings.range.map_or_else(
                || counted(settings.render.frames as usize, "frame"),
                |range| format!("frames {range} of {}", settings.render.frames)
            ),
            settings.render.size.width,
            settings.render.size.height,
            settings.render.fps,
            settings.render.qscale,
        );
        let style = ProgressStyle::with_template("{spinner} {bar:20} {pos}/{len} frames  {wide_msg}");
        let style = style.expect("the template is correct");
        let frames = settings.frame_range();
        let bar = ProgressBar::new(frames.len() as u64).with_style(style);
        // Count the frames of earlier runs as finished.
        if first_frame > frames.start {
            tell!("resuming at frame {first_frame}");
            bar.set_position((first_frame - frames.start).into());
        }
        bar.set_message("the first frame takes longest");
        bar.enable_steady_tick(TICK);
        Self { bar: Progress::of(bar, "frames"), pace: Mutex::default(), is_quiet: quiet }
    }

    /// Advances the line by one frame.
    pub fn frame(&self, frame: &FrameReport) {
        self.bar.inc(1);
        let mut pace = self.pace.lock().unwrap_or_else(PoisonError::into_inner);
        pace.frame(Instant::now());

        // Show the remaining time, estimated from the frames after the first, and size and quality of this frame.
        let left = self.bar.length().unwrap_or(0).saturating_sub(self.bar.position());
        let time = match pace.seconds() {
            Some(seconds) => format!("{seconds:.1} s per frame, {} left", rough_time(seconds * left as f64)),
            None => "estimating the time left".into(),
        };
        let kilobytes = frame.bits as f64 / 8000.0;
        let quality = frame.psnr_y.map_or("lossless".into(), |psnr| format!("quality {psnr:.1} dB"));
        self.bar.set_message(format!("{time}  last {kilobytes:.1} kB, {quality}"));
    }

    /// Prints a warning above the progress line.
    pub fn warn(&self, warning: &str) {
        self.bar.warn(warning);
    }

    /// Returns a function that prints warnings above the progress line from any thread, even in a quiet run.
    pub fn warner(&self) -> impl Fn(&str) + Send + Sync + 'static {
        self.bar.warner()
    }

    /// Returns a function that prints text above the progress line from any thread. In a quiet run, the function prints
    /// nothing.
    pub fn teller(&self) -> impl Fn(&str) + Send + 'static {
        let (bar, is_quiet) = (self.bar.bar.clone(), self.is_quiet);
        move |text| {
            if !is_quiet {
                bar.suspend(|| tell!("{}", single_line(text)));
            }
        }
    }

    /// Removes the progress line.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

/// Returns the progress of work with a length that is set later.
pub fn of_work(quiet: bool) -> Progress {
    if quiet {
        return Progress::hidden();
    }
    let style = ProgressStyle::with_template("{bar:30} {percent} %  {eta} left").expect("the template is correct");
    Progress::of(ProgressBar::new(0).with_style(style), "%")
}

/// Returns the progress of `count` pictures, which shows activity while a picture is rendered.
pub fn of_pictures(count: usize, quiet: bool) -> Progress {
    if quiet {
        return Progress::hidden();
    }
    let style = ProgressStyle::with_template("{spinner} {pos}/{len} pictures  {elapsed}");
    let bar = ProgressBar::new(count as u64).with_style(style.expect("the template is correct"));
    bar.enable_steady_tick(TICK);
    Progress::of(bar, "pictures")
}

/// Returns the progress of work in many steps, with a message for the current step.
pub fn of_long_work(quiet: bool) -> Progress {
    if quiet {
        return Progress::hidden();
    }
    let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  about {eta} left  {msg}");
    Progress::of(ProgressBar::new(0).with_style(style.expect("the template is correct")), "%")
}

/// Prints the main figures of the run and the paths of its files. The run did not make the first `before` frames.
pub fn summary(report: &Report, before: u32, report_path: Option<&Path>) {
    let s = &report.summary;
    let settings = &report.settings;
    let rate = s.bits * report.settings.render.fps / 1000.0;
    let psnr = s.psnr_y.map_or("lossless".into(), |psnr| format!("{psnr:.1} dB"));
    // Report the frames of this run, without frames of earlier runs.
    let (all, made) = (s.frames, s.frames.saturating_sub(before));
    let of_all = if before > 0 { format!(" ({all} in total)") } else { String::new() };
    let ended = if s.interrupted { ", interrupted" } else { "" };
    tell!("{} in {:.1} s{of_all}{ended}", counted(made as usize, "frame"), s.wall_seconds);
    // Omit the threshold if it is 0, because the first frame has no thresholds.
    let threshold = match s.threshold_mean_relative {
        0.0 => String::new(),
        share => format!(", threshold {:.1} % of luminance", 100.0 * share),
    };
    tell!(
        "  lighting  {:.2} s direct + {:.2} s lightcuts per frame, {:.0} lights per cut{}",
        s.seconds.direct,
        s.seconds.indirect,
        s.cut_size_mean,
        threshold,
    );
    tell!("  video     {rate:.0} kbit/s, luma PSNR {psnr}");
    // Omit peak memory on systems that do not report it.
    if let Some(bytes) = s.peak_memory_bytes {
        tell!("  memory    {:.0} MB peak", bytes as f64 / 1e6);
    }
    let broken: usize = report.frames.iter().map(|frame| frame.figures.non_finite).sum();
    if broken > 0 {
        tell!("  warning   {broken} pixels were not finite and became black");
    }

    // Print the paths of all files.
    tell!("video:  {}", settings.output.display());
    let others = [("y4m:   ", &settings.files.y4m), ("frames:", &settings.files.exr), ("frames:", &settings.files.png)];
    for (name, path) in others {
        path.iter().for_each(|path| tell!("{name} {}", path.display()));
    }
    report_path.into_iter().for_each(|path| tell!("report: {}", path.display()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_frame_is_no_measure_of_the_others() {
        let begin = Instant::now();
        let mut pace = Pace::default();
        let ends = [30.0, 32.0, 33.0, 36.0];
        let expected = [None, Some(2.0), Some(1.5), Some(2.0)];
        for (end, expected) in ends.into_iter().zip(expected) {
            pace.frame(begin + Duration::from_secs_f64(end));
            assert_eq!(pace.seconds(), expected, "after {end} s");
        }
    }
}
