//! Observers of a film while it is made: lines of progress, and the pictures of its page.

#[cfg(feature = "html")]
use crate::Options;
use crate::command_line::notes;
use crate::feedback_loop::observe::{Observer, OnFrame};
#[cfg(feature = "html")]
use crate::laboratory::page::{self, FilmWatch, Made};
#[cfg(feature = "html")]
use crate::output::Output;
use crate::parts::Shaded;
use crate::report::FrameReport;
use crate::settings::Settings;
use crate::{Render as Film, Report};
use anyhow::Result;
use perceptual::YCbCr;
use plane::{Picture, Plane};
use render_core::scene::Scene;
use std::path::Path;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};

/// Lines for each frame, the largest code of bright luma and mean of light, and what the page shows of the film.
pub(super) struct Watching<F> {
    pub frames: OnFrame<F>,
    /// 0 before the first frame.
    pub brightest: AtomicU8,
    /// Bits of the largest mean luminance.
    pub lightest: AtomicU32,
    pub page: Option<FilmWatch>,
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
        // Numbers that are not negative have the order of their bits.
        let mean = notes::mean_luminance(&shaded.radiance).max(0.0);
        self.lightest.fetch_max(mean.to_bits(), Ordering::Relaxed);
        self.page.iter().for_each(|page| page.shaded(index, shaded));
    }

    fn importance(&self, index: u32, importance: &Plane<f32>) {
        self.page.iter().for_each(|page| page.importance(index, importance));
    }

    fn decoded(&self, index: u32, picture: &Picture) {
        self.page.iter().for_each(|page| page.decoded(index, picture));
    }
}

/// Keeps of the film what its page shows.
#[cfg(feature = "html")]
pub fn keep_for_page(film: &mut Film, settings: &Settings) -> FilmWatch {
    film.watch(&page::WATCHED);
    FilmWatch::new(settings)
}

/// Stands for the pictures of pages, where there are none.
#[cfg(not(feature = "html"))]
pub(super) type FilmWatch = ();

/// A wanted page was refused before, without the feature `html`.
#[cfg(not(feature = "html"))]
pub fn keep_for_page(_: &mut Film, _: &Settings) -> FilmWatch {}

/// Writes the page of the run, if one is wanted.
#[cfg(feature = "html")]
pub fn write_page(path: Option<&Path>, report: &Report, watched: Option<FilmWatch>, scene: &Scene) -> Result<()> {
    let Some((path, watched)) = path.zip(watched) else { return Ok(()) };
    let usual = Settings::new(report.settings.scene.clone(), scene, &Options::default()).ok();
    let made = Made { command: page::command_line(std::env::args_os()), usual };
    let mut output = Output::create(path)?;
    output.write(page::run_page(report, &watched, &made)?.as_bytes())?;
    Ok(output.finish()?)
}

/// A wanted page was refused before, without the feature `html`.
#[cfg(not(feature = "html"))]
pub fn write_page(_: Option<&Path>, _: &Report, _: Option<FilmWatch>, _: &Scene) -> Result<()> {
    Ok(())
}
