//! Error against run time: the same frames by several methods, through the encoder at several quantisers, all beside a
//! reference that evaluates every light at every pixel.
//!
//! Methods are rows of [`METHODS`]; what is found about each at each quantiser is a [`MethodRun`]. The reference of methods
//! without cache has no compensation, as they have none: what is left between the two is the cuts' own error.
//!
//! Films lie in files and are read frame by frame: a sweep of a long film takes disk, not memory.

mod coded;
mod data;
mod figures;
mod film;
mod histogram;
mod maps;
mod measurement;
mod method;
mod page;
mod plots;
mod table;
mod write;

pub use coded::DecoderCheck;
pub use figures::{AgainstBaseline, Maps, MethodRun, Outcome, ReferenceCost, RunPictures};
pub use histogram::ErrorHistogram;
pub use method::{METHODS, Method, UnknownMethod, Way};

use crate::compare::Picture;
use figures::mean_seconds;
use film::{Film, Workshop, settings_for};
use measurement::{Measured, Wanted, measured};
use method::{REFERENCE_WEIGHT, reference_options};
use plane::Plane;
use render_core::scene::Scene;
use render2mpeg::Options;
use render2mpeg::error::{Error, Result};
use renderer::settings::Size;
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
    pub pictures: Vec<RunPictures>,
    /// The run that can be watched, by its place, and its first decoded pictures.
    pub clip: Option<(usize, Vec<Plane<[u8; 3]>>)>,
    /// The last frame of the reference with compensation or, if there is none, without, before compression.
    pub truth: Plane<[u8; 3]>,
}

impl Sweep {
    /// Runs everything; `progress` is called with every frame. The film in work lies in a folder of its own below
    /// `workspace`, which is gone at the end.
    ///
    /// Once `stop` is set, no further film is made, and what is measured so far is the result: [`Outcome::interrupted`].
    ///
    /// # Errors
    /// Settings that fit nothing, a disk that is full, a decoder that shows other pictures, or `stop` before anything was measured.
    pub fn run(
        &self,
        source: Source<'_>,
        workspace: &Path,
        stop: &AtomicBool,
        mut progress: impl FnMut(&Progress) + Send,
    ) -> Result<Swept> {
        let begin = Instant::now();
        let Source { path, scene } = source;

        // The measurements are chosen and checked before the first ray.
        let methods = self.methods_with_baselines();
        let qscales = self.sorted_qscales();
        let common = self.checked_options(source, &qscales)?;

        // The films that all methods are compared with; the folder of all films goes when it is dropped.
        let folder = tempfile::Builder::new()
            .prefix("working-")
            .tempdir_in(workspace)
            .map_err(Error::file(workspace, "cannot be written to"))?;
        let workshop = Workshop { scene, folder: folder.path(), stop };
        let frames = common.frames.unwrap_or_default();
        let mut work = WeightedFrames::new(qscales.len() as u64, &methods, frames.into(), &mut progress);
        let references = ReferenceFilms::render(path, workshop, &methods, &common, &mut work)?;

        // Each method at each quantiser, beside them.
        let measuring = Measuring {
            path,
            workshop,
            common: &common,
            qscales: &qscales,
            methods: &methods,
            references: &references,
        };
        let mut found = measuring.measure(&mut work)?;
        figures::set_beside_baselines(&mut found.runs);

        // The figures, and the last frame as it should be.
        let of_all = references.of_all()?;
        let last = of_all.frames()?.last().ok_or_else(|| missing("there are no frames"))??;
        let outcome = Outcome {
            schema: 1,
            program: concat!("render2mpeg ", env!("CARGO_PKG_VERSION")).into(),
            settings: of_all.settings.clone(),
            lights: of_all.reports.iter().map(|frame| frame.figures.cut_size_max).max().unwrap_or(0),
            references: references.films.iter().flatten().map(ReferenceCost::of).collect(),
            runs: found.runs,
            decoder_check: found.decoder_check,
            interrupted: found.interrupted,
            wall_seconds: begin.elapsed().as_secs_f64(),
        };
        let truth = perceptual::to_rgb8(&last.picture);
        Ok(Swept { outcome, pictures: found.pictures, clip: found.clip, truth })
    }

    /// The quantisers in rising order, each once.
    fn sorted_qscales(&self) -> Vec<u32> {
        let mut qscales = self.qscales.clone();
        qscales.sort_unstable();
        qscales.dedup();
        qscales
    }

    /// Options that all films have in common, with their number of frames.
    fn checked_options(&self, Source { path, scene }: Source<'_>, qscales: &[u32]) -> Result<Options> {
        let Some(&first_qscale) = qscales.first() else {
            return Err(Error::Options("--qscale needs a quantiser at least".into()));
        };
        let common = Options { qscale: Some(first_qscale), ..self.common.clone() };
        let plain = settings_for(path, scene, &common, None)?;
        for &qscale in qscales {
            // What no table of the standard has is told before the first ray.
            let settings = settings_for(path, scene, &Options { qscale: Some(qscale), ..common.clone() }, None)?;
            settings.encoder_config()?.with_lookahead(0).validate()?;
        }
        Ok(Options { frames: Some(plain.render.frames), ..common })
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

/// The films to measure.
struct Measuring<'a> {
    /// The scene file.
    path: &'a Path,
    workshop: Workshop<'a>,
    /// Options that all films have in common.
    common: &'a Options,
    /// In rising order.
    qscales: &'a [u32],
    /// In the order of the table.
    methods: &'a [&'static Method],
    /// Films of the references, which every method is compared with.
    references: &'a ReferenceFilms,
}

/// Findings over all films.
#[derive(Default)]
struct Findings {
    runs: Vec<MethodRun>,
    /// Pictures of each run.
    pictures: Vec<RunPictures>,
    decoder_check: Option<DecoderCheck>,
    clip: Option<(usize, Vec<Plane<[u8; 3]>>)>,
    /// Whether films are missing: the work was ended early.
    interrupted: bool,
}

impl Measuring<'_> {
    /// Renders each method, at each quantiser where that steers it, and measures it through the encoder, until all is measured
    /// or the work is to end.
    fn measure(&self, work: &mut WeightedFrames<'_>) -> Result<Findings> {
        let mut findings = Findings::default();
        for index in 0..self.methods.len() {
            match self.measure_method(index, &mut findings, work) {
                // A film that was not finished is no finding, and those before it are.
                Err(Error::Interrupted) if !findings.runs.is_empty() => {
                    findings.interrupted = true;
                    break;
                }
                result => result?,
            }
        }
        Ok(findings)
    }

    /// Adds the method at place `index`, at each quantiser, to the findings.
    fn measure_method(&self, index: usize, findings: &mut Findings, work: &mut WeightedFrames<'_>) -> Result<()> {
        let middle = self.qscales[self.qscales.len() / 2];
        let method = self.methods[index];
        let truth = self.references.truth_of(method)?;
        let mut kept: Option<Film> = None;
        for &qscale in self.qscales {
            // A film that its quantiser does not steer serves for all of them.
            if kept.is_none() || method.steered {
                // The one before has had its time: its files go first.
                drop(kept.take());
                kept = Some(self.film(method, qscale, work)?);
            }
            if self.workshop.stop.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let film = kept.as_ref().ok_or_else(|| missing("rendered above"))?;

            // Of all films one is shown as a clip, and one is checked by another decoder.
            let is_watched = self.watched() == Some(index) && qscale == middle;
            let is_checked = qscale == middle && findings.decoder_check.is_none();
            let wanted = Wanted {
                clip: if is_watched { CLIP_FRAMES } else { 0 },
                check_below: is_checked.then_some(self.workshop.folder),
            };
            let found: Measured = measured(method, qscale, film, truth, &wanted)?;
            if is_watched {
                findings.clip = Some((findings.runs.len(), found.clip));
            }
            findings.decoder_check = findings.decoder_check.take().or(found.check);
            findings.runs.push(found.run);
            findings.pictures.push(found.pictures);
        }
        Ok(())
    }

    /// The film of a method, made for a quantiser.
    fn film(&self, method: &Method, qscale: u32, work: &mut WeightedFrames<'_>) -> Result<Film> {
        let &Self { path, workshop, common, references, .. } = self;
        let options = Options { qscale: Some(qscale), ..common.clone() };
        let settings = settings_for(path, workshop.scene, &method.options(&options), references.exposure)?;
        let doing = format!("{} at {qscale}", figures::label(method, &settings));
        let step = work.begin(doing, method.weight());
        film::by_method(method, workshop, settings, references.truth_of(method)?, step)
    }

    /// The method that is shown as a clip: the last film, if possible one with the cache.
    fn watched(&self) -> Option<usize> {
        let cached = self.methods.iter().rposition(|method| method.is_film() && method.cache);
        cached.or(self.methods.iter().rposition(|method| method.is_film()))
    }
}

/// Reference films that all methods are compared with.
struct ReferenceFilms {
    /// Every light without compensation, and with it, where a method requires it.
    films: [Option<Film>; 2],
    /// Exposure of the first: a curve of its own would be a difference of its own.
    exposure: Option<f32>,
}

impl ReferenceFilms {
    fn render(
        path: &Path,
        workshop: Workshop<'_>,
        methods: &[&Method],
        common: &Options,
        work: &mut WeightedFrames<'_>,
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
            film.settings.render.tone_map = film.settings.render.tone_map.with_exposure(exposure.unwrap_or(1.0));
            film.settings.render.auto_exposure = false;
            films[usize::from(compensates)] = Some(film);
        }
        Ok(Self { films, exposure })
    }

    /// The film that shows what `method` aims at.
    fn truth_of(&self, method: &Method) -> Result<&Film> {
        self.films[usize::from(method.compensates())].as_ref().ok_or_else(|| missing("no reference was rendered"))
    }

    /// The film with compensation or, if there is none, without.
    fn of_all(&self) -> Result<&Film> {
        self.films.iter().rev().flatten().next().ok_or_else(|| missing("there are no methods"))
    }
}

impl ReferenceCost {
    fn of(film: &Film) -> Self {
        Self { compensation: film.settings.render.compensation, seconds: mean_seconds(&film.reports) }
    }
}

/// An invariant of a sweep that does not hold.
fn missing(what: &str) -> Error {
    Error::fault(what)
}

/// The exposure that a film was shown with: as set, else as found in its first frame.
fn exposure_of(film: &Film) -> Result<f32> {
    if !film.settings.render.auto_exposure {
        return Ok(film.settings.render.tone_map.exposure);
    }
    let first = film.frames()?.next().ok_or_else(|| missing("there are no frames"))??;
    Ok(Picture::Linear { radiance: first.radiance, variance: None }.exposure())
}

/// Counts frames, weighted by about how long they take.
struct WeightedFrames<'a> {
    done: u64,
    all: u64,
    progress: &'a mut (dyn FnMut(&Progress) + Send),
}

impl<'a> WeightedFrames<'a> {
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
