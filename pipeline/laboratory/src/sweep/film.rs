//! Films stored in files: rendered like other films, then read frame by frame with all data.

use super::method::{Method, Way};
use crate::compare::{Picture, Pictures};
use perceptual::YCbCr;
use pipeline::Run;
use pipeline::figures::Seconds;
use pipeline::observe::OnFrame;
use pipeline::report::FrameReport;
use plane::{Correspondence, Plane};
use render_core::scene::Scene;
use render_core::{PathOptions, PixelSampling, image_file};
use render2mpeg::Options;
use render2mpeg::error::{Error, Result};
use render2mpeg::report::process_cpu_seconds;
use render2mpeg::settings::{ExrDepth, FileSettings, Settings};
use render2mpeg::stages::display::Y4m;
use renderer::plan::Plan;
use renderer::reference;
use renderer::settings::Aov;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use tempfile::TempDir;

/// Frame before compression.
#[derive(Clone, Debug)]
pub struct FilmFrame {
    /// Linear light \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Picture as passed to the encoder.
    pub picture: plane::Picture,
    /// Correspondence with the previous frame; `None` for the first frame.
    pub known: Option<Correspondence>,
    /// Permitted luminance error of each pixel; 0 if the pixel has no threshold.
    pub thresholds: Plane<f32>,
    /// Number of clusters in each pixel's lightcut. With a cache, only pixels of records have lightcuts.
    pub cut_sizes: Plane<f32>,
}

/// Film before compression and its cost. The frames are stored in files, so long films need little memory. Dropping the
/// film removes the files.
pub(super) struct Film {
    /// Settings of the film.
    pub settings: Settings,
    /// Reports of the stages. For path tracing, only the time in `direct` is set.
    pub reports: Vec<FrameReport>,
    /// Path of the video that the run wrote; `None` for path tracing.
    pub stream: Option<PathBuf>,
    folder: TempDir,
}

impl Film {
    /// Returns the frames, which are read one by one.
    ///
    /// # Errors
    /// If the files no longer exist.
    pub fn frames(&self) -> Result<impl Iterator<Item = Result<FilmFrame>>> {
        let mut pictures = Pictures::open(&uncompressed(self.folder.path()))?;
        Ok((0..self.settings.render.frames).map(move |n| {
            let Some(Picture::Video(picture, _)) = pictures.next().transpose()? else {
                return Err(Error::content(&pictures.path, " ends early"));
            };
            read_frame(&linear(self.folder.path(), n), n, picture)
        }))
    }
}

/// Returns the path of the uncompressed frames of a film in `folder`.
fn uncompressed(folder: &Path) -> PathBuf {
    folder.join("film.y4m")
}

/// Returns the path of frame `n`, stored as linear light with additional channels.
fn linear(folder: &Path, n: u32) -> PathBuf {
    folder.join(format!("frame_{n:05}.exr"))
}

/// Creates a folder for a film's files.
fn folder_in(workspace: &Path) -> Result<TempDir> {
    let made = tempfile::Builder::new().prefix("film-").tempdir_in(workspace);
    made.map_err(Error::file(workspace, "cannot be written to"))
}

/// Returns the settings of a method with the reference's exposure, since a different tone curve would add a difference.
pub fn settings_for(path: &Path, scene: &Scene, options: &Options, exposure: Option<f32>) -> Result<Settings> {
    let mut settings = Settings::new(path.into(), scene, options)?;
    if let Some(exposure) = exposure {
        settings.render.tone_map = settings.render.tone_map.with_exposure(exposure);
        settings.render.auto_exposure = false;
    }
    Ok(settings)
}

/// Scene of the films, and the folder for the files of all films.
#[derive(Clone, Copy)]
pub struct Workshop<'a> {
    pub scene: &'a Scene,
    /// Folder that contains a folder for each film.
    pub folder: &'a Path,
    /// Flag that ends the work when true.
    pub stop: &'a AtomicBool,
}

/// Renders a film into files.
///
/// # Errors
/// Returns errors of [`render2mpeg::render`], or [`Error::Interrupted`] once `stop` is true.
pub fn render(workshop: Workshop<'_>, settings: Settings, mut each: impl FnMut() + Send) -> Result<Film> {
    let Workshop { scene, folder: workspace, stop } = workshop;
    let folder = folder_in(workspace)?;
    // Request the files that `read_frame` reads, in addition to the video.
    let video = folder.path().join("film.m2v");
    let mut with_files = Settings { output: video.clone(), ..settings.clone() };
    with_files.render.aov = vec![Aov::Motion, Aov::Threshold, Aov::CutSize];
    with_files.files = FileSettings {
        exr: Some(folder.path().to_owned()),
        // Use 32-bit floats, because 16-bit floats would add their own errors to the measured ones.
        exr_depth: Some(ExrDepth::Float),
        y4m: Some(uncompressed(folder.path())),
        y4m_is_coded: true,
        ..with_files.files
    };
    let plan = Plan::new(scene, &with_files.render);
    let observer = OnFrame::new(|_: &FrameReport| each());
    let report = render2mpeg::render(scene, &with_files, &plan, Run { observer: &observer, stop })?;
    // Discard interrupted films, because frames are missing.
    if report.summary.interrupted || stop.load(Ordering::Relaxed) {
        return Err(Error::Interrupted);
    }
    Ok(Film { settings, reports: report.frames, stream: Some(video), folder })
}

fn read_frame(path: &Path, n: u32, picture: plane::Picture) -> Result<FilmFrame> {
    let layers = image_file::read_layers(path).map_err(Error::other)?;
    let (width, height) = (layers.width, layers.height);
    let channel = |name: &str| layers.channel(name).ok_or_else(|| Error::content(path, format!(": no channel {name}")));
    let plane = |name: &str| Ok::<_, Error>(Plane::from_vec(width, height, channel(name)?.to_vec()));
    // Build the motion vectors; NaN marks pixels without a match in the previous frame.
    let (x, y, known) = (channel("motion.X")?, channel("motion.Y")?, channel("motion.A")?);
    let vectors = x.iter().zip(y).zip(known);
    let vectors = vectors.map(|((&x, &y), &known)| if known > 0.0 { [x, y] } else { [f32::NAN; 2] }).collect();
    Ok(FilmFrame {
        radiance: layers.colors("").ok_or_else(|| Error::content(path, ": no colors"))?,
        picture,
        known: (n > 0).then(|| Correspondence::from_motion(Plane::from_vec(width, height, vectors))),
        thresholds: plane("threshold.Y")?,
        cut_sizes: plane("cut.size")?,
    })
}

/// Renders frames with `spp` paths per pixel; without anti-aliasing, paths start at pixel centers. Motion is copied
/// from `like`, a film of the same scene.
///
/// # Errors
/// If `stop` is true, or the disk is full.
pub fn by_paths(
    workshop: Workshop<'_>,
    settings: Settings,
    spp: u32,
    like: &Film,
    mut each: impl FnMut(),
) -> Result<Film> {
    let Workshop { scene, folder: workspace, stop } = workshop;
    let folder = folder_in(workspace)?;
    let mut pictures = Y4m::create(&uncompressed(folder.path()), &settings)?;
    let mut reports = Vec::new();
    for (known, report) in like.frames()?.zip(&like.reports) {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        // Use a different seed for each frame, since static noise would cost no bits.
        let seed = settings.render.seed.wrapping_add(u64::from(report.index) << 32);
        let pixel = if settings.render.antialiasing { PixelSampling::Area } else { PixelSampling::Center };
        let options = PathOptions { samples: spp, seed, max_bounces: settings.render.bounces, pixel };
        let before = process_cpu_seconds();
        let radiance = reference::by_paths(scene, &settings.render, report.index, &options, |_, _| ()).radiance;
        // Clear the figures of lightcuts and thresholds, which path tracing does not use.
        let mut report = report.clone();
        let figures = &mut report.figures;
        (figures.cut_size_mean, figures.cut_size_max, figures.shadow_rays) = (0.0, 0, 0);
        (figures.tree_swaps_share, figures.threshold_mean_relative) = (0.0, 0.0);
        figures.seconds = Seconds::default();
        figures.seconds.direct = process_cpu_seconds().zip(before).map_or(0.0, |(after, before)| after - before);

        // Write picture and light to files, as for other films.
        pictures.write(&YCbCr::from_radiance(&radiance, &settings.render.tone_map).picture)?;
        write_frame(&linear(folder.path(), report.index), &radiance, known?.known.as_ref())?;
        reports.push(report);
        each();
    }
    pictures.finish()?;
    Ok(Film { settings, reports, stream: None, folder })
}

/// Writes a frame for [`read_frame`], with zeros for thresholds and cut sizes.
fn write_frame(path: &Path, radiance: &Plane<[f32; 3]>, known: Option<&Correspondence>) -> Result<()> {
    let (width, height) = (radiance.width(), radiance.height());
    let color = |c: usize| radiance.samples().iter().map(|rgb| rgb[c]).collect();
    // Store zero vectors and `motion.A` = 0 for pixels without a match.
    let motion = |index: usize| known.and_then(|known| known.motion_of(index % width, index / width));
    let vector = |c: usize| (0..width * height).map(|index| motion(index).map_or(0.0, |vector| vector[c])).collect();
    let is_known = (0..width * height).map(|index| if motion(index).is_some() { 1.0 } else { 0.0 }).collect();
    let nothing = vec![0.0; width * height];
    let channels = [
        ("R", color(0)),
        ("G", color(1)),
        ("B", color(2)),
        ("motion.X", vector(0)),
        ("motion.Y", vector(1)),
        ("motion.A", is_known),
        ("threshold.Y", nothing.clone()),
        ("cut.size", nothing),
    ];
    let channels = channels.map(|(name, samples)| (name.to_owned(), samples)).to_vec();
    image_file::write_layers(path, width, height, channels).map_err(Error::other)
}

/// Renders a film with `method`. Path tracing copies the motion of `reference`.
///
/// # Errors
/// Returns the errors of [`render`] and [`by_paths`].
pub fn by_method(
    method: &Method,
    workshop: Workshop<'_>,
    settings: Settings,
    reference: &Film,
    each: impl FnMut() + Send,
) -> Result<Film> {
    match method.way {
        Way::Film(_) => render(workshop, settings, each),
        Way::Paths(spp) => by_paths(workshop, settings, spp, reference, each),
    }
}
