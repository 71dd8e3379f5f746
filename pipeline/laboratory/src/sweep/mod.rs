//! Error against run time. Several methods render the same frames, which are encoded at several quantisers and compared
//! with a reference that evaluates every light at every pixel.
//!
//! Methods are rows of [`METHODS`]; the result of a method at a quantiser is a [`MethodRun`]. Methods without cache
//! have no compensation, and are compared with a reference without compensation. The remaining difference is the error
//! of the lightcuts.
//!
//! Films are stored in files and read frame by frame, so a sweep of a long film needs disk space rather than memory.

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
use crate::page::PageStream;
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
    /// Options shared by all methods: frames, size, lights, seed.
    pub common: Options,
    /// List of quantiser_scale values, one or more.
    pub qscales: Vec<u32>,
    /// Methods to compare. Their baselines are added automatically.
    pub methods: Vec<&'static Method>,
}

/// Default number of frames. With the default picture size, a sweep of `cornell` takes about three minutes on one core.
pub const DEFAULT_FRAMES: u32 = 5;
/// Default size of the pictures \[pixels\].
pub const DEFAULT_SIZE: Size = Size { width: 144, height: 144 };
/// Default quantiser_scale values, from almost lossless to obvious blocks.
pub const DEFAULT_QSCALES: [u32; 5] = [2, 8, 16, 32, 48];

/// Maximum length of all streams in the page \[bytes\].
const STREAMS_MAX: usize = 12 << 20;

/// Scene of a sweep.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Path of the scene, as written in reports.
    pub path: &'a Path,
    /// Scene loaded from `path`.
    pub scene: &'a Scene,
}

/// Progress of a sweep.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Progress {
    /// Work done so far, in estimated frames of the fastest method.
    pub done: u64,
    /// Total work, in estimated frames of the fastest method.
    pub all: u64,
    /// Description of the current step.
    pub doing: String,
}

/// Finished sweep.
#[non_exhaustive]
pub struct Swept {
    /// Figures of the sweep.
    pub outcome: Outcome,
    /// Pictures of the last frame of each run, in the order of the runs.
    pub pictures: Vec<RunPictures>,
    /// Streams of the runs for the page, in the order of the runs.
    pub streams: Vec<PageStream>,
    /// Stream of the reference at the finest quantiser.
    pub reference: PageStream,
    /// Last frame of the reference before compression, with compensation if such a reference exists.
    pub truth: Plane<[u8; 3]>,
}

impl Sweep {
    /// Runs all measurements, and calls `progress` for every frame. The current film is stored in a temporary folder in
    /// `workspace`.
    ///
    /// Once `stop` is true, no further film is made, and the result contains only finished measurements; see
    /// [`Outcome::interrupted`].
    ///
    /// # Errors
    /// If settings are invalid, the disk is full, a decoder's pictures differ, or `stop` is true before the first
    /// result.
    pub fn run(
        &self,
        source: Source<'_>,
        workspace: &Path,
        stop: &AtomicBool,
        mut progress: impl FnMut(&Progress) + Send,
    ) -> Result<Swept> {
        let begin = Instant::now();
        let Source { path, scene } = source;

        // Choose and check the measurements before rendering begins.
        let methods = self.methods_with_baselines();
        let qscales = self.sorted_qscales();
        let common = self.checked_options(source, &qscales)?;

        // Render the films of the reference. Dropping the temporary folder removes its files.
        let folder = tempfile::Builder::new()
            .prefix("working-")
            .tempdir_in(workspace)
            .map_err(Error::file(workspace, "cannot be written to"))?;
        let workshop = Workshop { scene, folder: folder.path(), stop };
        let frames = common.frames.unwrap_or_default();
        let mut work = WeightedFrames::new(qscales.len() as u64, &methods, frames.into(), &mut progress);
        let references = ReferenceFilms::render(path, workshop, &methods, &common, &mut work)?;

        // Measure each method at each quantiser.
        let measuring = Measuring {
            path,
            workshop,
            common: &common,
            qscales: &qscales,
            methods: &methods,
            references: &references,
            stream_max: STREAMS_MAX / (qscales.len() * methods.len() + 1),
        };
        let mut found = measuring.measure(&mut work)?;
        figures::compare_with_baselines(&mut found.runs);

        // Collect the figures, and the last frame of the reference.
        let of_all = references.of_all()?;
        let reference = coded::finest_stream(of_all, measuring.stream_max)?;
        let last = of_all.frames()?.last().ok_or_else(|| missing("no frames"))??;
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
        Ok(Swept { outcome, pictures: found.pictures, streams: found.streams, reference, truth })
    }

    /// Returns the quantisers in ascending order without duplicates.
    fn sorted_qscales(&self) -> Vec<u32> {
        let mut qscales = self.qscales.clone();
        qscales.sort_unstable();
        qscales.dedup();
        qscales
    }

    /// Returns the options shared by all films, including the number of frames.
    fn checked_options(&self, Source { path, scene }: Source<'_>, qscales: &[u32]) -> Result<Options> {
        let Some(&first_qscale) = qscales.first() else {
            return Err(Error::Options("--qscale needs at least one quantiser".into()));
        };
        let common = Options { qscale: Some(first_qscale), ..self.common.clone() };
        let plain = settings_for(path, scene, &common, None)?;
        for &qscale in qscales {
            // Before rendering begins, report quantisers that the standard does not support.
            let settings = settings_for(path, scene, &Options { qscale: Some(qscale), ..common.clone() }, None)?;
            settings.encoder_config()?.with_lookahead(0).validate()?;
        }
        Ok(Options { frames: Some(plain.render.frames), ..common })
    }

    /// Returns the methods and their baselines in the order of the table without duplicates.
    fn methods_with_baselines(&self) -> Vec<&'static Method> {
        // Include requested methods and the baselines of requested methods.
        let wanted = |candidate: &&Method| {
            self.methods.iter().any(|method| {
                let baseline = method.baseline().map(|baseline| baseline.name);
                method.name == candidate.name || baseline == Some(candidate.name)
            })
        };
        METHODS.iter().filter(wanted).collect()
    }
}

/// Films to measure.
struct Measuring<'a> {
    /// Path of the scene.
    path: &'a Path,
    workshop: Workshop<'a>,
    /// Options shared by all films.
    common: &'a Options,
    /// Quantisers in ascending order.
    qscales: &'a [u32],
    /// Methods in the order of the table.
    methods: &'a [&'static Method],
    /// Reference films, which are compared with the films of every method.
    references: &'a ReferenceFilms,
    /// Maximum length of the stream of each run in the page \[bytes\].
    stream_max: usize,
}

/// Results of all films.
#[derive(Default)]
struct Findings {
    runs: Vec<MethodRun>,
    /// Pictures of each run's last frame.
    pictures: Vec<RunPictures>,
    streams: Vec<PageStream>,
    decoder_check: Option<DecoderCheck>,
    /// True if the work ended early, so that films are missing.
    interrupted: bool,
}

impl Measuring<'_> {
    /// Renders and measures each method at each quantiser, until all are measured or the work must end. Methods that do
    /// not depend on the quantiser are rendered once.
    fn measure(&self, work: &mut WeightedFrames<'_>) -> Result<Findings> {
        let mut findings = Findings::default();
        for index in 0..self.methods.len() {
            match self.measure_method(index, &mut findings, work) {
                // Keep the results of finished films after an interruption.
                Err(Error::Interrupted) if !findings.runs.is_empty() => {
                    findings.interrupted = true;
                    break;
                }
                result => result?,
            }
        }
        Ok(findings)
    }

    /// Adds the results of the method at `index` for each quantiser.
    fn measure_method(&self, index: usize, findings: &mut Findings, work: &mut WeightedFrames<'_>) -> Result<()> {
        let middle = self.qscales[self.qscales.len() / 2];
        let method = self.methods[index];
        let truth = self.references.truth_of(method)?;
        let mut kept: Option<Film> = None;
        for &qscale in self.qscales {
            // Render again only if the film depends on the quantiser.
            if kept.is_none() || method.steered {
                // Remove the previous film's files before rendering the next film.
                drop(kept.take());
                kept = Some(self.film(method, qscale, work)?);
            }
            if self.workshop.stop.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let film = kept.as_ref().ok_or_else(|| missing("rendered above"))?;

            // Check one film with another decoder.
            let is_checked = qscale == middle && findings.decoder_check.is_none();
            let wanted =
                Wanted { stream_max: self.stream_max, check_below: is_checked.then_some(self.workshop.folder) };
            let found: Measured = measured(method, qscale, film, truth, &wanted)?;
            findings.decoder_check = findings.decoder_check.take().or(found.check);
            findings.runs.push(found.run);
            findings.pictures.push(found.pictures);
            findings.streams.push(found.stream);
        }
        Ok(())
    }

    /// Renders the film of a method for one quantiser.
    fn film(&self, method: &Method, qscale: u32, work: &mut WeightedFrames<'_>) -> Result<Film> {
        let &Self { path, workshop, common, references, .. } = self;
        let options = Options { qscale: Some(qscale), ..common.clone() };
        let settings = settings_for(path, workshop.scene, &method.options(&options), references.exposure)?;
        let doing = format!("{} at {qscale}", figures::label(method, &settings));
        let step = work.begin(doing, method.weight());
        film::by_method(method, workshop, settings, references.truth_of(method)?, step)
    }
}

/// Reference films, with which all methods are compared.
struct ReferenceFilms {
    /// Films with every light, without and with compensation; `None` for films that no method needs.
    films: [Option<Film>; 2],
    /// Exposure of the first reference, used for all films because a different tone curve would add a difference.
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
        // Render the compensated reference first; both references use its exposure.
        for compensates in [true, false].into_iter().filter(|&c| methods.iter().any(|m| m.compensates() == c)) {
            let options = reference_options(common, compensates);
            let settings = settings_for(path, workshop.scene, &options, exposure)?;
            let doing = format!("every light{}", if compensates { "" } else { ", uncompensated" });
            let step = work.begin(doing, REFERENCE_WEIGHT);
            let mut film = film::render(workshop, settings, step)?;
            if exposure.is_none() {
                exposure = Some(exposure_of(&film)?);
            }
            // Fix the exposure, so that all films share one tone curve.
            film.settings.render.tone_map = film.settings.render.tone_map.with_exposure(exposure.unwrap_or(1.0));
            film.settings.render.auto_exposure = false;
            films[usize::from(compensates)] = Some(film);
        }
        Ok(Self { films, exposure })
    }

    /// Returns the reference film of `method`.
    fn truth_of(&self, method: &Method) -> Result<&Film> {
        self.films[usize::from(method.compensates())].as_ref().ok_or_else(|| missing("no reference was rendered"))
    }

    /// Returns the film with compensation if rendered, otherwise the film without.
    fn of_all(&self) -> Result<&Film> {
        self.films.iter().rev().flatten().next().ok_or_else(|| missing("no methods"))
    }
}

impl ReferenceCost {
    fn of(film: &Film) -> Self {
        Self { compensation: film.settings.render.compensation, seconds: mean_seconds(&film.reports) }
    }
}

/// Returns an error about a violated invariant of a sweep.
fn missing(what: &str) -> Error {
    Error::fault(what)
}

/// Returns the exposure of a film from its settings; if the exposure is automatic, from the first frame.
fn exposure_of(film: &Film) -> Result<f32> {
    if !film.settings.render.auto_exposure {
        return Ok(film.settings.render.tone_map.exposure);
    }
    let first = film.frames()?.next().ok_or_else(|| missing("no frames"))??;
    Ok(Picture::Linear { radiance: first.radiance, variance: None }.exposure())
}

/// Counter of frames, weighted by approximate render time.
struct WeightedFrames<'a> {
    done: u64,
    all: u64,
    progress: &'a mut (dyn FnMut(&Progress) + Send),
}

impl<'a> WeightedFrames<'a> {
    fn new(qscales: u64, methods: &[&Method], frames: u64, progress: &'a mut (dyn FnMut(&Progress) + Send)) -> Self {
        // Weight each film by its render time. Steered methods render one film per quantiser.
        let renderings = |method: &Method| if method.steered { qscales } else { 1 };
        let references = [true, false].iter().filter(|&&c| methods.iter().any(|m| m.compensates() == c)).count() as u64;
        let films: u64 = methods.iter().map(|method| method.weight() * renderings(method)).sum();
        Self { done: 0, all: frames * (films + references * REFERENCE_WEIGHT), progress }
    }

    /// Reports the start of a film, and returns the function to call for each of its frames.
    fn begin(&mut self, doing: String, weight: u64) -> impl FnMut() + Send {
        (self.progress)(&Progress { done: self.done, all: self.all, doing: doing.clone() });
        move || {
            self.done += weight;
            (self.progress)(&Progress { done: self.done, all: self.all, doing: doing.clone() });
        }
    }
}
