//! Films in memory: rendered as always, and read back with all that is known of them.

use super::method::{Method, Way};
use crate::compare::{Picture, Pictures};
use crate::output::Output;
use crate::plan::Plan;
use crate::report::{FrameReport, Report, process_cpu_seconds};
use crate::settings::{Aov, Settings};
use crate::{Wishes, reference};
use anyhow::{Context, Result, bail};
use mpeg2enc::Frame;
use perceptual::YCbCr;
use plane::Plane;
use render_core::scene::Scene;
use render_core::{PathOptions, PixelSampling, image_file};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// A frame before compression.
#[derive(Clone, Debug)]
pub struct FilmFrame {
    /// Linear light.
    pub radiance: Plane<[f32; 3]>,
    /// As the encoder gets it.
    pub picture: Frame,
    /// Pixels to the same point in the frame before; not a number where it was not seen there. None in the first.
    pub motion: Option<Plane<[f32; 2]>>,
    /// Luminance that each pixel may be wrong by; 0 where 2 % of its own hold.
    pub thresholds: Plane<f32>,
    /// Clusters of each pixel's cut; with the cache, at the pixels of records.
    pub cut_sizes: Plane<f32>,
}

/// A film before compression, and what it cost.
pub struct Film {
    /// Every choice.
    pub settings: Settings,
    /// In order.
    pub frames: Vec<FilmFrame>,
    /// What the stages say; of paths, only the time in `direct`.
    pub reports: Vec<FrameReport>,
    /// The video as the run wrote it; paths write none.
    pub stream: Option<Vec<u8>>,
}

/// Settings of a method, with the exposure of the reference: a curve of its own would be a difference of its own.
pub fn settings_for(path: &Path, scene: &Scene, wishes: Wishes, exposure: Option<f32>) -> Result<Settings> {
    let mut settings = Settings::new(path.into(), scene, wishes)?;
    if let Some(exposure) = exposure {
        settings.tone_map = settings.tone_map.with_exposure(exposure);
        settings.auto_exposure = false;
    }
    Ok(settings)
}

/// Renders in `folder`, which holds the frames for as long as they are read.
///
/// # Errors
/// What [`crate::render`] says, or that `stop` was set.
pub fn render(
    scene: &Scene,
    mut settings: Settings,
    folder: &Path,
    stop: &AtomicBool,
    mut each: impl FnMut() + Send,
) -> Result<Film> {
    let (video, y4m, frames) = (folder.join("film.m2v"), folder.join("film.y4m"), folder.join("frames"));
    std::fs::create_dir_all(&frames).with_context(|| format!("{} cannot be made", frames.display()))?;
    settings.aov = vec![Aov::Motion, Aov::Threshold, Aov::CutSize];
    (settings.output, settings.exr, settings.y4m) = (video.clone(), Some(frames.clone()), Some(y4m.clone()));
    let plan = Plan::new(scene, &settings);
    let report = crate::render(scene, &settings, &plan, Output::create(&video)?, stop, |_| each())?;
    if report.summary.interrupted || stop.load(Ordering::Relaxed) {
        bail!("interrupted; a sweep has no result before its end");
    }
    let Report { frames: reports, .. } = report;
    let mut pictures = Pictures::open(&y4m)?;
    let read = (0..settings.frames).map(|n| {
        let Some(Picture::Video(picture)) = pictures.next().transpose()? else { bail!("{} ends early", y4m.display()) };
        read_frame(&frames.join(format!("frame_{n:05}.exr")), n, picture)
    });
    let frames_read = read.collect::<Result<Vec<FilmFrame>>>()?;
    let stream = std::fs::read(&video).with_context(|| format!("{} cannot be read", video.display()))?;
    std::fs::remove_dir_all(&frames).with_context(|| format!("{} cannot be removed", frames.display()))?;
    Ok(Film { settings, frames: frames_read, reports, stream: Some(stream) })
}

fn read_frame(path: &Path, n: u32, picture: Frame) -> Result<FilmFrame> {
    let layers = image_file::read_layers(path).map_err(anyhow::Error::msg)?;
    let (width, height) = (layers.width, layers.height);
    let channel = |name: &str| layers.channel(name).with_context(|| format!("{}: no channel {name}", path.display()));
    let plane = |name: &str| Ok::<_, anyhow::Error>(Plane::from_vec(width, height, channel(name)?.to_vec()));
    let (x, y, known) = (channel("motion.X")?, channel("motion.Y")?, channel("motion.A")?);
    let vectors = x.iter().zip(y).zip(known);
    let vectors = vectors.map(|((&x, &y), &known)| if known > 0.0 { [x, y] } else { [f32::NAN; 2] }).collect();
    Ok(FilmFrame {
        radiance: layers.colors("").with_context(|| format!("{}: no colours", path.display()))?,
        picture,
        motion: (n > 0).then(|| Plane::from_vec(width, height, vectors)),
        thresholds: plane("threshold.Y")?,
        cut_sizes: plane("cut.size")?,
    })
}

/// Renders by `spp` paths through the centre of each pixel; motion is that of `like`, a film of the same scene.
///
/// # Errors
/// `stop` was set.
pub fn by_paths(
    scene: &Scene,
    settings: Settings,
    spp: u32,
    like: &Film,
    stop: &AtomicBool,
    mut each: impl FnMut(),
) -> Result<Film> {
    let (mut frames, mut reports) = (Vec::new(), Vec::new());
    for (known, report) in like.frames.iter().zip(&like.reports) {
        if stop.load(Ordering::Relaxed) {
            bail!("interrupted; a sweep has no result before its end");
        }
        // A seed for each frame: with one for all, noise would stand still and cost no bits.
        let seed = settings.seed.wrapping_add(u64::from(report.index) << 32);
        let options = PathOptions { samples: spp, seed, max_bounces: settings.bounces, pixel: PixelSampling::Centre };
        let before = process_cpu_seconds();
        let radiance = reference::by_paths(scene, &settings, report.index, &options, |_, _| ()).radiance;
        let mut report = FrameReport { cut_size_mean: 0.0, cut_size_max: 0, shadow_rays: 0, ..report.clone() };
        report.seconds = Default::default();
        report.seconds.direct = process_cpu_seconds().zip(before).map_or(0.0, |(after, before)| after - before);
        (report.tree_swaps_share, report.threshold_mean_relative) = (0.0, 0.0);
        let YCbCr { y, cb, cr, .. } = YCbCr::from_radiance(&radiance, &settings.tone_map);
        let picture = Frame::new(y, cb, cr)?;
        let nothing = Plane::filled(radiance.width(), radiance.height(), 0.0);
        let motion = known.motion.clone();
        frames.push(FilmFrame { radiance, picture, motion, thresholds: nothing.clone(), cut_sizes: nothing });
        reports.push(report);
        each();
    }
    Ok(Film { settings, frames, reports, stream: None })
}

/// Renders by `method`; `reference` lends paths its motion.
///
/// # Errors
/// See [`render`] and [`by_paths`].
pub fn by_method(
    method: &Method,
    scene: &Scene,
    settings: Settings,
    reference: &Film,
    folder: &Path,
    stop: &AtomicBool,
    each: impl FnMut() + Send,
) -> Result<Film> {
    match method.way {
        Way::Film(_) => render(scene, settings, folder, stop, each),
        Way::Paths(spp) => by_paths(scene, settings, spp, reference, stop, each),
    }
}
