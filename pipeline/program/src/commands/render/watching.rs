//! Observers of a film in progress: progress lines, brightness, and pictures for the film's page.

use crate::display_server::DisplayServer;
use crate::notes;
use anyhow::Result;
use laboratory::page;
use laboratory::page::{FilmWatch, Made};
use perceptual::YCbCr;
use pipeline::observe::{Observer, OnFrame};
use pipeline::output::Output;
use pipeline::report::FrameReport;
use pipeline::stage::{CodedUnit, Shaded};
use plane::{Picture, Plane};
use render_core::scene::Scene;
use render2mpeg::Options;
use render2mpeg::settings::Settings;
use render2mpeg::{Render, Report};
use std::path::Path;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};

/// Observer that prints a line per frame, tracks maximum brightness, shows frames in a viewer, and records data for the
/// page.
pub(super) struct Watching<F> {
    pub frames: OnFrame<F>,
    /// Maximum over all frames of `notes::bright_code` of luma; 0 before the first frame.
    pub brightest: AtomicU8,
    /// Maximum over all frames of mean luminance, stored as the bits of an `f32`.
    pub lightest: AtomicU32,
    pub page: Option<FilmWatch>,
    /// Viewer of the frames, and name of the film in the viewer.
    pub viewer: Option<(DisplayServer, String)>,
}

impl<F: FnMut(&FrameReport) + Send> Observer for Watching<F> {
    fn frame(&self, report: &FrameReport) {
        self.frames.frame(report);
    }

    fn picture(&self, _: u32, picture: &YCbCr) {
        let bright = notes::bright_code(picture.picture.luma().samples().iter().copied());
        self.brightest.fetch_max(bright, Ordering::Relaxed);
    }

    fn shaded(&self, index: u32, shaded: &Shaded) {
        // Compare floats by their bits, which have the same order if the floats are not negative.
        let mean = notes::mean_luminance(&shaded.radiance).max(0.0);
        self.lightest.fetch_max(mean.to_bits(), Ordering::Relaxed);
        self.viewer.iter().for_each(|(viewer, name)| viewer.show(name, &shaded.radiance));
        self.page.iter().for_each(|page| page.shaded(index, shaded));
    }

    fn importance(&self, index: u32, importance: &Plane<f32>) {
        self.page.iter().for_each(|page| page.importance(index, importance));
    }

    fn decoded(&self, index: u32, picture: &Picture) {
        self.page.iter().for_each(|page| page.decoded(index, picture));
    }

    fn coded(&self, unit: &CodedUnit) {
        self.page.iter().for_each(|page| page.coded(unit));
    }
}

/// Returns an observer that records the data of the film's page.
pub fn keep_for_page(film: &mut Render, settings: &Settings) -> FilmWatch {
    film.watch(&page::WATCHED);
    FilmWatch::new(settings)
}

/// Writes the page of the run, if requested.
pub fn write_page(path: Option<&Path>, report: &Report, watched: Option<FilmWatch>, scene: &Scene) -> Result<()> {
    let Some((path, watched)) = path.zip(watched) else { return Ok(()) };
    // List the defaults for this scene next to the chosen settings.
    let usual = Settings::new(report.settings.scene.clone(), scene, &Options::default()).ok();
    let made = Made { command: page::command_line(std::env::args_os()), usual };
    let mut output = Output::create(path)?;
    output.write(page::run_page(report, &watched, &made)?.as_bytes())?;
    Ok(output.finish()?)
}
