//! Error against run time: the same frames by several methods, through the encoder at several quantisers, all beside a
//! reference that evaluates every light at every pixel.
//!
//! Methods are rows of [`METHODS`]; what is found about each at each quantiser is a [`Run`]. The reference of methods
//! without cache has no compensation, as they have none: what is left between the two is the cuts' own error.
//!
//! Films lie in files and are read frame by frame: a sweep of a long film takes disk, not memory.

mod coded;
mod figures;
mod film;
mod histogram;
mod maps;
mod measurement;
mod method;
mod page;
mod plots;
mod raster;
mod table;
mod write;

pub use coded::DecoderCheck;
pub use figures::{AgainstBaseline, Maps, Outcome, Pictures, ReferenceCost, Run};
pub use histogram::ErrorHistogram;
pub use method::{METHODS, Method, UnknownMethod, Way};

use crate::Options;
use crate::error::{Error, Result};
use crate::laboratory::compare::Picture;
use crate::settings::Size;
use figures::mean_seconds;
use film::{Film, Workshop, settings_for};
use measurement::{Measured, Wanted, measured};
use method::{REFERENCE_WEIGHT, reference_options};
use plane::Plane;
use render_core::scene::Scene;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Options of a sweep.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Options that all methods have in common: frames, size, lights, seed.
    pub common: Options,
    /// The standard's quantiser_scale, one or more.
    pub qscales: Vec<u32>,
    /// Methods to compare; baselines are added.
    pub methods: Vec<&'static Method>,
}

/// Frames of a sweep unless others are wished for, and size: with these, `cornell` takes some three minutes of one core.
pub const DEFAULT_FRAMES: u32 = 5;
/// See [`DEFAULT_FRAMES`].
pub const DEFAULT_SIZE: Size = Size { width: 144, height: 144 };
/// Quantisers unless others are wished for: from nearly lossless to blocks that everyone sees.
pub const DEFAULT_QSCALES: [u32; 5] = [2, 8, 16, 32, 48];

/// Pictures of the clip on the page, at most: it is played again and again.
const CLIP_FRAMES: usize = 50;

/// The scene that a sweep renders.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The scene file, as it stands in reports.
    pub path: &'a Path,
    /// The scene itself.
    pub scene: &'a Scene,
}

/// How far a sweep is.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Progress {
    /// Work done and work there is, in frames of the quickest method, estimated.
    pub done: u64,
    /// See `done`.
    pub all: u64,
    /// The current step, in words.
    pub doing: String,
}

/// A finished sweep.
#[non_exhaustive]
pub struct Swept {
    /// The figures.
    pub outcome: Outcome,
    /// Pictures of each run, in the order of its runs.
    pub pictures: Vec<Pictures>,
    /// The run that can be watched, by its place, and its first decoded pictures.
    pub clip: Option<(usize, Vec<Plane<[u8; 3]>>)>,
    /// The last frame of the reference with compensation or, if there is none, without, before compression.
    pub truth: Plane<[u8; 3]>,
}

impl Sweep {
    /// Runs everything; `progress` is called with every frame. The film in work lies in a folder of its own below
    /// `workspace`, which is gone at the end.
    ///
    /// # Errors
    /// Settings that fit nothing, a disk that is full, a decoder that shows other pictures, or `stop`.
    pub fn run(
        &self,
        source: Source<'_>,
        workspace: &Path,
        stop: &AtomicBool,
        mut progress: impl FnMut(&Progress) + Send,
    ) -> Result<Swept> {
        let begin = Instant::now();
        let Source { path, scene } = source;
        let methods = self.methods_with_baselines();
        let mut qscales = self.qscales.clone();
        qscales.sort_unstable();
        qscales.dedup();
        let Some(&first_qscale) = qscales.first() else {
            return Err(Error::Options("--qscale needs a quantiser at least".into()));
        };
        let common = Options { qscale: Some(first_qscale), ..self.common.clone() };
        let plain = settings_for(path, scene, &common, None)?;
        for &qscale in &qscales {
            // What no table of the standard has is told before the first ray.
            let settings = settings_for(path, scene, &Options { qscale: Some(qscale), ..common.clone() }, None)?;
            settings.encoder_config()?.with_lookahead(0).validate()?;
        }
        let folder = tempfile::Builder::new()
            .prefix("working-")
            .tempdir_in(workspace)
            .map_err(Error::file(workspace, "cannot be written to"))?;
        let mut work = Work::new(qscales.len() as u64, &methods, plain.frames.into(), &mut progress);
        let common = Options { frames: Some(plain.frames), ..common };
        let workshop = Workshop { scene, folder: folder.path(), stop };
        let References { films, exposure } = References::render(path, workshop, &methods, &common, &mut work)?;
        let of_all = films.iter().rev().flatten().next().ok_or_else(|| missing("there are no methods"))?;

        let middle = qscales[qscales.len() / 2];
        let watched = methods
            .iter()
            .rposition(|method| method.is_film() && method.cache)
            .or(methods.iter().rposition(|method| method.is_film()));
        let (mut runs, mut pictures, mut decoder_check, mut clip) = (Vec::new(), Vec::new(), None, None);
        for (index, &method) in methods.iter().enumerate() {
            let truth = films[usize::from(method.compensates())]
                .as_ref()
                .ok_or_else(|| missing("no reference was rendered"))?;
            let mut kept: Option<Film> = None;
            for &qscale in &qscales {
                if kept.is_none() || method.steered {
                    // The one before has had its time: its files go first.
                    drop(kept.take());
                    let options = Options { qscale: Some(qscale), ..common.clone() };
                    let settings = settings_for(path, scene, &method.options(&options), exposure)?;
                    let doing = format!("{} at {qscale}", figures::label(method, &settings));
                    let step = work.begin(doing, method.weight());
                    kept = Some(film::by_method(method, workshop, settings, truth, step)?);
                }
                if stop.load(Ordering::Relaxed) {
                    return Err(Error::Interrupted);
                }
                let film = kept.as_ref().ok_or_else(|| missing("rendered above"))?;
                let is_watched = watched == Some(index) && qscale == middle;
                let check_below = (qscale == middle && decoder_check.is_none()).then(|| folder.path());
                let wanted = Wanted { clip: if is_watched { CLIP_FRAMES } else { 0 }, check_below };
                let found: Measured = measured(method, qscale, film, truth, &wanted)?;
                if is_watched {
                    clip = Some((runs.len(), found.clip));
                }
                decoder_check = decoder_check.or(found.check);
                runs.push(found.run);
                pictures.push(found.pictures);
            }
        }
        figures::set_beside_baselines(&mut runs);
        let last = of_all.frames()?.last().ok_or_else(|| missing("there are no frames"))??;
        let cost = |film: &Film| ReferenceCost {
            compensation: film.settings.compensation,
            seconds: mean_seconds(&film.reports),
        };
        let outcome = Outcome {
            schema: 1,
            program: concat!("render2mpeg ", env!("CARGO_PKG_VERSION")).into(),
            settings: of_all.settings.clone(),
            lights: of_all.reports.iter().map(|frame| frame.cut_size_max).max().unwrap_or(0),
            references: films.iter().flatten().map(cost).collect(),
            runs,
            decoder_check,
            wall_seconds: begin.elapsed().as_secs_f64(),
        };
        Ok(Swept { outcome, pictures, clip, truth: perceptual::to_rgb8(&last.picture) })
    }

    /// The methods in the order of the table, each once, and what they are measured against.
    fn methods_with_baselines(&self) -> Vec<&'static Method> {
        let wanted = |candidate: &&Method| {
            self.methods.iter().any(|method| {
                let baseline = method.baseline().map(|baseline| baseline.name);
                method.name == candidate.name || baseline == Some(candidate.name)
            })
        };
        METHODS.iter().filter(wanted).collect()
    }
}

/// Reference films that all methods are compared with.
struct References {
    /// Every light without compensation, and with it, where a method requires it.
    films: [Option<Film>; 2],
    /// Exposure of the first: a curve of its own would be a difference of its own.
    exposure: Option<f32>,
}

impl References {
    fn render(
        path: &Path,
        workshop: Workshop<'_>,
        methods: &[&Method],
        common: &Options,
        work: &mut Work<'_>,
    ) -> Result<Self> {
        let mut exposure = None;
        let mut films: [Option<Film>; 2] = [None, None];
        for compensates in [true, false].into_iter().filter(|&c| methods.iter().any(|m| m.compensates() == c)) {
            let options = reference_options(common, compensates);
            let settings = settings_for(path, workshop.scene, &options, exposure)?;
            let doing = format!("every light{}", if compensates { "" } else { ", uncompensated" });
            let step = work.begin(doing, REFERENCE_WEIGHT);
            let mut film = film::render(workshop, settings, step)?;
            if exposure.is_none() {
                exposure = Some(exposure_of(&film)?);
            }
            film.settings.tone_map = film.settings.tone_map.with_exposure(exposure.unwrap_or(1.0));
            film.settings.auto_exposure = false;
            films[usize::from(compensates)] = Some(film);
        }
        Ok(Self { films, exposure })
    }
}

/// An invariant of a sweep that does not hold.
fn missing(what: &str) -> Error {
    Error::Fault(what.into())
}

/// The exposure that a film was shown with: as set, else as found in its first frame.
fn exposure_of(film: &Film) -> Result<f32> {
    if !film.settings.auto_exposure {
        return Ok(film.settings.tone_map.exposure);
    }
    let first = film.frames()?.next().ok_or_else(|| missing("there are no frames"))??;
    Ok(Picture::Linear { radiance: first.radiance, variance: None }.exposure())
}

/// Counts frames, weighted by about how long they take.
struct Work<'a> {
    done: u64,
    all: u64,
    progress: &'a mut (dyn FnMut(&Progress) + Send),
}

impl<'a> Work<'a> {
    fn new(qscales: u64, methods: &[&Method], frames: u64, progress: &'a mut (dyn FnMut(&Progress) + Send)) -> Self {
        let renderings = |method: &Method| if method.steered { qscales } else { 1 };
        let references = [true, false].iter().filter(|&&c| methods.iter().any(|m| m.compensates() == c)).count() as u64;
        let films: u64 = methods.iter().map(|method| method.weight() * renderings(method)).sum();
        Self { done: 0, all: frames * (films + references * REFERENCE_WEIGHT), progress }
    }

    /// Begins a film, and returns the function to call with each frame of it.
    fn begin(&mut self, doing: String, weight: u64) -> impl FnMut() + Send {
        (self.progress)(&Progress { done: self.done, all: self.all, doing: doing.clone() });
        move || {
            self.done += weight;
            (self.progress)(&Progress { done: self.done, all: self.all, doing: doing.clone() });
        }
    }
}
