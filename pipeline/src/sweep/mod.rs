//! Error against run time: the same frames by several methods, through the encoder at several quantisers, all beside a
//! reference that asks every light at every pixel.
//!
//! Methods are rows of [`METHODS`]; what is found about each at each quantiser is a [`Run`]. The reference of methods
//! without cache has no compensation, as they have none: what is left between the two is the cuts' own error.

mod coded;
mod figures;
mod film;
mod histogram;
mod maps;
mod method;
mod page;
mod plots;
mod table;
mod write;

pub use coded::DecoderCheck;
pub use figures::{AgainstBaseline, Maps, Outcome, Pictures, ReferenceCost, Run};
pub use histogram::ErrorHistogram;
pub use method::{METHODS, Method, Way};

use crate::Wishes;
use crate::compare::rgb_of;
use crate::settings::Size;
use anyhow::{Context, Result, bail};
use figures::mean_seconds;
use film::{Film, settings_for};
use method::{REFERENCE_WEIGHT, reference_wishes};
use perceptual::luminance;
use plane::Plane;
use render_core::scene::Scene;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What to compare.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// What all methods have in common: frames, size, lights, seed.
    pub common: Wishes,
    /// The standard's quantiser_scale, one or more.
    pub qscales: Vec<u32>,
    /// Which methods; baselines are added.
    pub methods: Vec<&'static Method>,
}

/// Frames of a sweep unless others are wished for, and size: with these, `cornell` takes about two minutes on two cores.
pub const DEFAULT_FRAMES: u32 = 6;
/// See [`DEFAULT_FRAMES`].
pub const DEFAULT_SIZE: Size = Size { width: 160, height: 160 };
/// Quantisers unless others are wished for: from nearly lossless to blocks that everyone sees.
pub const DEFAULT_QSCALES: [u32; 5] = [2, 8, 16, 32, 48];

/// How far a sweep is.
#[derive(Clone, Debug)]
pub struct Progress {
    /// Work done and work there is, in frames of the quickest method, estimated.
    pub done: u64,
    /// See `done`.
    pub all: u64,
    /// What is going on.
    pub doing: String,
}

/// A finished sweep.
pub struct Swept {
    /// The figures.
    pub outcome: Outcome,
    /// Pictures of each run, in the order of its runs.
    pub pictures: Vec<Pictures>,
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
        path: &Path,
        scene: &Scene,
        workspace: &Path,
        stop: &AtomicBool,
        mut progress: impl FnMut(&Progress) + Send,
    ) -> Result<Swept> {
        let begin = Instant::now();
        let methods = self.methods_with_baselines();
        let mut qscales = self.qscales.clone();
        qscales.sort_unstable();
        qscales.dedup();
        let Some(&first_qscale) = qscales.first() else { bail!("--qscale needs a quantiser at least") };
        let common = Wishes { qscale: Some(first_qscale), ..self.common.clone() };
        let plain = settings_for(path, scene, common.clone(), None)?;
        for &qscale in &qscales {
            // What no table of the standard has is told before the first ray.
            let settings = settings_for(path, scene, Wishes { qscale: Some(qscale), ..common.clone() }, None)?;
            settings.encoder_config()?.encoder()?;
        }
        let folder = tempfile::Builder::new()
            .prefix("working-")
            .tempdir_in(workspace)
            .with_context(|| format!("{} cannot be written to", workspace.display()))?;
        let mut work = Work::new(qscales.len() as u64, &methods, plain.frames.into(), &mut progress);

        let references = Wishes { frames: Some(plain.frames), ..common.clone() };
        let mut exposure = None;
        let mut films: [Option<Film>; 2] = [None, None];
        for compensates in [true, false].into_iter().filter(|&c| methods.iter().any(|m| m.compensates() == c)) {
            let wishes = reference_wishes(&references, compensates);
            let settings = settings_for(path, scene, wishes, exposure)?;
            let step = work
                .begin(format!("every light{}", if compensates { "" } else { ", uncompensated" }), REFERENCE_WEIGHT);
            let mut film = film::render(scene, settings, folder.path(), stop, step)?;
            if exposure.is_none() && film.settings.auto_exposure {
                // Every other film takes the exposure that the first reference found for itself.
                let picture =
                    crate::compare::Picture::Linear { radiance: film.frames[0].radiance.clone(), variance: None };
                exposure = Some(picture.exposure());
            } else {
                exposure = exposure.or(Some(film.settings.tone_map.exposure));
            }
            film.settings = settings_for(path, scene, reference_wishes(&references, compensates), exposure)?;
            films[usize::from(compensates)] = Some(film);
        }
        let reference = |compensates: bool| films[usize::from(compensates)].as_ref().expect("rendered above");

        let (mut runs, mut pictures, mut decoder_check) = (Vec::new(), Vec::new(), None);
        for &method in &methods {
            let mut kept: Option<Film> = None;
            for (index, &qscale) in qscales.iter().enumerate() {
                let truth = reference(method.compensates());
                if kept.is_none() || method.steered {
                    let wishes = Wishes { qscale: Some(qscale), frames: Some(plain.frames), ..common.clone() };
                    let settings = settings_for(path, scene, method.wishes(&wishes), exposure)?;
                    let doing = format!("{} at {qscale}", figures::label(method, &settings));
                    let step = work.begin(doing, method.weight());
                    kept = Some(film::by_method(method, scene, settings, truth, folder.path(), stop, step)?);
                }
                if stop.load(Ordering::Relaxed) {
                    bail!("interrupted; a sweep has no result before its end");
                }
                let film = kept.as_ref().expect("rendered above");
                let coded = coded::encode(film, qscale)?;
                if index == qscales.len() / 2 && decoder_check.is_none() {
                    decoder_check = coded::check_with_ffmpeg(&coded, folder.path())?;
                }
                runs.push(Run::new(method, qscale, film, &coded, truth));
                let whole = index == qscales.len() / 2;
                pictures.push(pictures_of(method, qscale, film, &coded, truth, whole));
            }
        }
        figures::set_beside_baselines(&mut runs);
        let [uncompensated, compensated] = &films;
        let of_all = compensated.as_ref().or(uncompensated.as_ref()).context("there are no methods")?;
        let truth = rgb_of(of_all.frames.last().context("there are no frames")?.picture.clone());
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
        Ok(Swept { outcome, pictures, truth })
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

/// Pictures of the last frame or, of a `whole` film, of all.
fn pictures_of(method: &Method, qscale: u32, film: &Film, coded: &coded::Coded, truth: &Film, whole: bool) -> Pictures {
    let first = if whole { 0 } else { coded.frames.len().saturating_sub(1) };
    let decoded: Vec<Plane<[u8; 3]>> =
        coded.frames[first..].iter().map(|frame| rgb_of(frame.decoded.clone())).collect();
    let last = film.frames.last().zip(truth.frames.last()).filter(|_| film.stream.is_some());
    let maps = last.map(|(frame, truth)| {
        let share = match film.settings.thresholds {
            crate::settings::Thresholds::Fixed(share) => share,
            _ => 0.02,
        };
        let relative = |x, y| {
            let (threshold, light) = (frame.thresholds.get(x, y), luminance(frame.radiance.get(x, y)));
            if threshold > 0.0 && light > 0.0 { threshold / light } else { share }
        };
        let (width, height) = (frame.radiance.width(), frame.radiance.height());
        let luma =
            |frame: &film::FilmFrame| perceptual::YCbCr::from_radiance(&frame.radiance, &film.settings.tone_map).luma;
        let (own, other) = (luma(frame), luma(truth));
        Maps {
            relative_threshold: Plane::from_fn(width, height, relative),
            cut_size: frame.cut_sizes.clone(),
            error: Plane::from_fn(width, height, |x, y| (own.get(x, y) - other.get(x, y)).abs()),
        }
    });
    let last = decoded.last().cloned().unwrap_or_default();
    Pictures { method: method.name, qscale, decoded: last, maps, film: decoded }
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

    /// What to call with each frame of a film.
    fn begin(&mut self, doing: String, weight: u64) -> impl FnMut() + Send {
        (self.progress)(&Progress { done: self.done, all: self.all, doing: doing.clone() });
        move || {
            self.done += weight;
            (self.progress)(&Progress { done: self.done, all: self.all, doing: doing.clone() });
        }
    }
}
