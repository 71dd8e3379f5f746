//! Light for every pixel: direct light, and indirect light by cuts through the light tree that stop at thresholds.
//! The one place where rays and light tree meet.

mod cache;
mod cuts;
mod direct;
mod gloss;
mod layers;
mod macroblock;
mod pixels;
mod resume;

pub(super) use resume::check;

use crate::checkpoint::Checkpoints;
use crate::error::Result;
use crate::message::{LuminanceThresholds, Prepared, Shaded};
use crate::plan::{Plan, Stage, State};
use crate::settings::{Aov, Settings, Stopping, Thresholds};
use cache::Cache;
use crossbeam_channel::{Receiver, Sender};
use cuts::{Allowance, Figures, LightTransport};
use glam::Vec3;
use lighttree::{Calibration, LightTree};
use perceptual::ThresholdMap;
use plane::Plane;
use render_core::{Accelerator, Busy, DirectLights, GBuffer, Gather, NOTHING, luminance, reconstruct, sample_places};
use std::sync::Arc;

/// Share of the luminance that a pixel without a threshold may be wrong by \[Walter05\], \[Herzog08, 5.3\].
const WITHOUT_THRESHOLD: f32 = 0.02;
/// Pixels darker than this share of the picture's mean do not count in the mean relative threshold: 0/0 says nothing.
const DARK: f64 = 1e-4;

/// Lights frame after frame. With masking on, frame n waits for the thresholds of frame n−1, and for no others.
pub fn run(
    settings: &Settings,
    plan: &Plan,
    frames: &Receiver<Prepared>,
    thresholds: &Receiver<LuminanceThresholds>,
    out: &Sender<Shaded>,
) {
    run_from(&Checkpoints::off(), settings, plan, frames, thresholds, out).expect("nothing is read or written");
}

/// The same from where `checkpoints` say: a film that is continued begins with a frame that is done, and what it left is taken
/// up.
///
/// # Errors
/// The checkpoint does not hold what it should, or the next cannot be written.
pub fn run_from(
    checkpoints: &Checkpoints,
    settings: &Settings,
    plan: &Plan,
    frames: &Receiver<Prepared>,
    thresholds: &Receiver<LuminanceThresholds>,
    out: &Sender<Shaded>,
) -> Result<()> {
    let mut cache = plan.is_on(Stage::Cache).then(Cache::default);
    // Where nothing moves, the light of one frame is that of the next.
    let mut still = None;
    let mut calibration = (settings.stopping == Stopping::Calibrated).then(|| Calibration::keeping(settings.within));
    let mut last = None;
    for prepared in frames {
        if prepared.frame < checkpoints.first_frame() {
            (cache, still, calibration) = resume::take_up(checkpoints, &prepared)?;
            continue;
        }
        let (map, before) = match (plan.state(Stage::Masking), &prepared.correspondence) {
            (State::On, Some(correspondence)) => {
                let _span = tracing::debug_span!("wait for thresholds", frame = prepared.frame).entered();
                let Ok(LuminanceThresholds { of, delta, luminance }) = thresholds.recv() else { return Ok(()) };
                assert_eq!(of + 1, prepared.frame, "thresholds out of step");
                let still = (settings.thresholds == Thresholds::Quantised)
                    .then(|| perceptual::still_matches(delta.width(), delta.height()));
                let matches = still.as_ref().unwrap_or(&correspondence.matches);
                let carried = |plane| perceptual::reproject(plane, matches);
                (carried(&delta), calibration.as_ref().map(|_| carried(&luminance)))
            }
            _ => (ThresholdMap::relative(settings.size.width, settings.size.height), None),
        };
        let (frame, checkpoint) = (prepared.frame, prepared.checkpoint);
        let span = tracing::debug_span!("shade", frame).entered();
        let mut allowance = Allowance { map, before, calibration: calibration.take() };
        let shaded = shade(settings, plan, prepared, &mut allowance, cache.as_mut(), &mut still);
        calibration = allowance.calibration;
        if checkpoint {
            resume::leave(checkpoints, frame, cache.as_ref(), still.as_ref(), calibration.as_ref())?;
        }
        drop(span);
        last = Some(frame);
        if out.send(shaded).is_err() {
            break;
        }
    }
    match last.filter(|&frame| checkpoints.ends_behind(frame)) {
        Some(frame) => resume::leave(checkpoints, frame, cache.as_ref(), still.as_ref(), calibration.as_ref()),
        None => Ok(()),
    }
}

fn shade(
    settings: &Settings,
    plan: &Plan,
    mut prepared: Prepared,
    allowance: &mut Allowance,
    mut cache: Option<&mut Cache>,
    still: &mut Option<Still>,
) -> Shaded {
    let mut figures = std::mem::take(&mut prepared.figures);
    let size = (settings.size.width, settings.size.height);
    let counts = if settings.aov.is_empty() { Figures::default() } else { Figures::by_pixel(size.0 * size.1) };
    let [visibility, direct_busy, indirect_busy] = [(); 3].map(|()| Busy::default());
    let places = sample_places(settings.samples as usize);
    // Light behind a cache takes thresholds into account only where something is new.
    let may_stay = plan.state(Stage::PrimaryRays) == State::Once && plan.is_on(Stage::Cache);
    let known = still.take().filter(|still| still.is_of(&prepared));
    let lit = known.unwrap_or_else(|| {
        let mut samples: Vec<Sample> = Vec::new();
        for &place in &places {
            // One sample is what `prepare` saw already.
            let own = (places.len() > 1).then(|| {
                let Prepared { accelerator, surfaces, seen, .. } = &prepared;
                GBuffer::trace_at(place, accelerator, surfaces, &seen.view, size, &visibility)
            });
            let seen = own.as_ref().unwrap_or(&prepared.seen);
            let coats = plan.is_on(Stage::Gloss).then(|| gloss::light(&prepared, seen, &direct_busy));
            let below = coats.is_some().then(|| gloss::below_coats(seen));
            let seen = below.as_ref().unwrap_or(seen);
            let (mut direct, rays) = direct::light(&prepared, seen, &direct_busy);
            figures.shadow_rays += rays;
            if let Some((reflected, rays)) = coats {
                figures.shadow_rays += rays;
                direct.samples_mut().iter_mut().zip(reflected.samples()).for_each(|(sum, &coat)| *sum += coat);
            }
            let compensates = plan.is_on(Stage::Compensation);
            let transport = LightTransport::new(settings, &prepared, allowance, (seen, &direct), compensates, &counts);
            let indirect = match (plan.state(Stage::Indirect), cache.as_deref_mut()) {
                (State::Off, _) => Plane::filled(size.0, size.1, Vec3::ZERO),
                (_, Some(cache)) if samples.is_empty() => cache.light(&transport, &indirect_busy, &mut figures),
                (_, Some(cache)) => cache.light_more(&transport, &indirect_busy, &mut figures),
                (_, None) => pixels::light(&transport, &indirect_busy),
            };
            samples.push(Sample { direct, indirect });
        }
        Still::new(&prepared, samples, figures.cache_records)
    });
    let samples = &lit.samples;
    let Sample { direct, indirect } = &samples[0];
    let transport = LightTransport::new(settings, &prepared, allowance, (&prepared.seen, direct), false, &counts);
    figures.threshold_mean_relative = transport.mean_relative_threshold(&sum(direct, indirect));
    figures.cache_records = lit.cache_records;
    figures.visibility += visibility.seconds();
    figures.direct = direct_busy.seconds();
    figures.indirect = indirect_busy.seconds();
    counts.put_into(&mut figures);
    if let Some(learned) = allowance.calibration.as_mut().and_then(|calibration| calibration.learn(&counts.audits)) {
        (figures.audit_error_p95, figures.kappa) = (Some(learned.error_p95), Some(learned.kappa));
    }
    let picture = |of: &dyn Fn(&Sample) -> Plane<[f32; 3]>| {
        let planes: Vec<Plane<[f32; 3]>> = samples.iter().map(of).collect();
        reconstruct(&planes, &places)
    };
    let layers = settings
        .aov
        .iter()
        .flat_map(|&aov| match aov {
            Aov::Direct => layers::colors("direct", &picture(&|sample| sample.direct.map(|rgb| rgb.to_array()))),
            Aov::Indirect => layers::colors("indirect", &picture(&|sample| sample.indirect.map(|rgb| rgb.to_array()))),
            _ => layers::of(aov, &prepared, &allowance.map, &counts, cache.as_deref()),
        })
        .collect();
    let radiance = picture(&|sample| sum(&sample.direct, &sample.indirect));
    *still = may_stay.then_some(lit);
    let Prepared { frame, checkpoint, correspondence, forward, .. } = prepared;
    Shaded { frame, checkpoint, radiance, layers, correspondence, forward, figures }
}

/// The light that the pixels of a picture receive through one place of each.
#[derive(serde::Serialize, serde::Deserialize)]
struct Sample {
    /// Emitted, and reflected straight from its source.
    direct: Plane<Vec3>,
    /// All else.
    indirect: Plane<Vec3>,
}

/// A frame's light, and all that it was made from.
struct Still {
    accelerator: Arc<Accelerator>,
    lights: Arc<DirectLights>,
    tree: Arc<LightTree>,
    gather: Arc<Gather>,
    seen: Arc<GBuffer>,
    samples: Vec<Sample>,
    cache_records: u64,
}

impl Still {
    fn new(prepared: &Prepared, samples: Vec<Sample>, cache_records: u64) -> Self {
        let Prepared { accelerator, direct, tree, gather, seen, .. } = prepared;
        Self {
            accelerator: accelerator.clone(),
            lights: direct.clone(),
            tree: tree.clone(),
            gather: gather.clone(),
            seen: seen.clone(),
            samples,
            cache_records,
        }
    }

    /// Whether `prepared` is the same frame again: its parts are not equal, but the very same.
    fn is_of(&self, prepared: &Prepared) -> bool {
        Arc::ptr_eq(&self.accelerator, &prepared.accelerator)
            && Arc::ptr_eq(&self.lights, &prepared.direct)
            && Arc::ptr_eq(&self.tree, &prepared.tree)
            && Arc::ptr_eq(&self.gather, &prepared.gather)
            && Arc::ptr_eq(&self.seen, &prepared.seen)
    }
}

fn sum(a: &Plane<Vec3>, b: &Plane<Vec3>) -> Plane<[f32; 3]> {
    Plane::from_fn(a.width(), a.height(), |x, y| (a.get(x, y) + b.get(x, y)).to_array())
}

impl LightTransport<'_> {
    /// Mean of threshold by luminance over the pixels that are lit indirectly.
    fn mean_relative_threshold(&self, radiance: &Plane<[f32; 3]>) -> f64 {
        let share = self.relative_threshold();
        let pixels = self.seen.pixels.samples().iter().zip(radiance.samples());
        let (width, seen) = (radiance.width(), |albedo: [f32; 3], instance| instance != NOTHING && albedo != [0.0; 3]);
        let places = (0..).zip(pixels).filter(|(_, (pixel, _))| seen(pixel.albedo, pixel.instance));
        let lit: Vec<(f32, f32)> = places
            .map(|(index, (_, &radiance))| {
                let y = luminance(radiance.into());
                (self.threshold(index % width, index / width).unwrap_or(share * y), y)
            })
            .collect();
        let mean = lit.iter().map(|&(_, y)| f64::from(y)).sum::<f64>() / lit.len().max(1) as f64;
        let relative: Vec<f64> = lit
            .iter()
            .filter(|&&(_, y)| f64::from(y) > DARK * mean)
            .map(|&(t, y)| f64::from(t) / f64::from(y))
            .collect();
        relative.iter().sum::<f64>() / relative.len().max(1) as f64
    }
}
