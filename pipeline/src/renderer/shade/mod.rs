//! Light for every pixel: direct light, and indirect light by cuts through the light tree that stop at thresholds.
//! The one place where rays and light tree meet.

mod cache;
mod carry;
mod cuts;
mod direct;
mod gloss;
mod layers;
mod macroblock;
mod pixels;
mod state;

use super::frame::{Frame, PreparedFrame};
use crate::error::Result;
use crate::figures::FrameFigures;
use crate::parts::{LastThresholds, Outline, Prepared, Shade, Shaded};
use crate::plan::{Plan, Stage, State};
use crate::settings::{Aov, Settings, Size, Stopping, Thresholds};
use cache::around::{Movement, Place};
use cache::{Cache, reflected};
use carry::{Carry, To};
use cuts::{Allowance, Figures, LightTransport};
use glam::Vec3;
use lighttree::{Calibration, LightTree};
use perceptual::PixelPart;
use plane::{Correspondence, Plane};
use render_core::cache::CachedLight;
use render_core::{
    Accelerator, Busy, Coverage, DirectLights, FinalGather, GBuffer, MixedPixel, NOTHING, PixelSample, PosedScene,
    luminance, reconstruct, sample_offsets,
};
use std::sync::Arc;

/// Share of the luminance that a pixel without a threshold may be wrong by \[Walter05\], \[Herzog08, 5.3\].
const WITHOUT_THRESHOLD: f32 = 0.02;
/// Pixels darker than this share of the picture's mean do not count in the mean relative threshold: 0/0 says nothing.
const DARK: f64 = 1e-4;

/// The second half of the renderer: lights frame after frame.
pub struct Shading<'a> {
    settings: &'a Settings,
    plan: &'a Plan,
    cache: Option<Cache>,
    /// The light of the frame before, where it may be carried over.
    carry: Option<Carry>,
    /// Where the instances were in the frame before; none before the first.
    places: Vec<Option<Place>>,
    /// Where nothing moves, the light of one frame is that of the next.
    still: Option<Still>,
    calibration: Option<Calibration>,
}

impl<'a> Shading<'a> {
    /// For a film from its beginning.
    #[must_use]
    pub fn new(settings: &'a Settings, plan: &'a Plan) -> Self {
        let cache = plan.is_on(Stage::Cache).then(|| Cache::new(plan));
        let calibrated = settings.stopping == Stopping::Calibrated;
        let calibration = calibrated.then(|| Calibration::keeping(settings.within));
        let carry = plan.is_on(Stage::CarriedLight).then(Carry::default);
        Self { settings, plan, cache, carry, places: Vec::new(), still: None, calibration }
    }
}

impl std::fmt::Debug for Shading<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shading").finish_non_exhaustive()
    }
}

impl<'s> Shade<Frame<'s>> for Shading<'_> {
    fn step(&mut self, prepared: &PreparedFrame<'s>, thresholds: LastThresholds<'_>) -> Shaded {
        let Size { width, height } = self.settings.size;
        let still = (self.settings.thresholds == Thresholds::Quantised).then(|| Correspondence::still(width, height));
        let thresholds = still.iter().fold(thresholds, LastThresholds::along);
        let before = self.calibration.as_ref().and_then(|_| thresholds.luminance());
        let calibration = self.calibration.take();
        let mut allowance = Allowance { map: thresholds.map(width, height), before, calibration };
        let shaded = self.shade(prepared, &mut allowance);
        self.calibration = allowance.calibration;
        shaded
    }

    fn state(&self) -> Vec<u8> {
        state::of(self)
    }

    fn restore(&mut self, state: &[u8], last: &PreparedFrame<'s>) -> Result<()> {
        state::restore(self, state, last)
    }
}

impl Shading<'_> {
    fn shade(&mut self, prepared: &PreparedFrame, allowance: &mut Allowance) -> Shaded {
        let &mut Self { settings, plan, .. } = self;
        let Prepared { frame, figures, .. } = prepared;
        let mut figures = figures.clone();
        let pixels = settings.size.width * settings.size.height;
        let counts = if settings.aov.is_empty() { Figures::default() } else { Figures::by_pixel(pixels) };
        // Direct light has no thresholds, and light from a cache takes them into account only where something is new.
        let is_steady = plan.is_on(Stage::Cache) || plan.is_off(Stage::Indirect);
        let may_stay = plan.state(Stage::PrimaryRays) == State::Once && is_steady;
        let known = self.still.take().filter(|still| still.is_of(frame));
        let is_known = known.is_some();
        let lit = known.unwrap_or_else(|| self.light(prepared, allowance, &counts, &mut figures));
        let Sample { direct, indirect } = &lit.samples[0];
        let transport = LightTransport::new(settings, frame, allowance, (&frame.seen, direct), &counts);
        figures.threshold_mean_relative = transport.mean_relative_threshold(&triples(&sum(direct, indirect)));
        figures.cache_records = lit.cache_records;
        counts.put_into(&mut figures);
        (figures.shaded_share, figures.carried_share) = if is_known { (0.0, 1.0) } else { (1.0, 0.0) };
        if let Some(carry) = self.carry.as_ref().filter(|_| !is_known) {
            carry.put_into(&mut figures);
        }
        let learned = allowance.calibration.as_mut().and_then(|calibration| calibration.learn(&counts.audits));
        figures.audit_error_p95 = learned.as_ref().map(|learned| learned.error_p95);
        // Where cuts end by measured errors, their multiplier is the one that holds.
        figures.kappa = Some(learned.map_or(settings.kappa.into(), |learned| learned.kappa));
        let places = sample_offsets(settings.samples as usize);
        let picture = |of: &dyn Fn(&Sample) -> Plane<[f32; 3]>| {
            let planes: Vec<Plane<[f32; 3]>> = lit.samples.iter().map(of).collect();
            reconstruct(&planes, &places)
        };
        let blend = |light: &Plane<Vec3>| lit.coverage.as_ref().map_or_else(|| light.clone(), |of| of.blend(light));
        let blend_reflected =
            |light: &Plane<Vec3>| lit.coverage.as_ref().map_or_else(|| light.clone(), |of| of.blend_reflected(light));
        let known = layers::Known {
            prepared,
            map: &allowance.map,
            counts: &counts,
            cache: self.cache.as_ref(),
            carry: self.carry.as_ref(),
        };
        let layers = settings.aov.iter().flat_map(|&aov| match aov {
            Aov::Direct => layers::colors("direct", &picture(&|sample| triples(&blend(&sample.direct)))),
            Aov::Indirect => {
                layers::colors("indirect", &picture(&|sample| triples(&blend_reflected(&sample.indirect))))
            }
            _ => known.layers(aov),
        });
        let layers = layers.collect();
        let radiance = picture(&|sample| triples(&blend(&sum(&sample.direct, &sample.indirect))));
        let outlines = lit.outlines();
        self.still = may_stay.then_some(lit);
        Shaded { radiance, outlines, layers, figures }
    }

    /// The light of a frame through every place of a pixel.
    fn light(
        &mut self,
        prepared: &PreparedFrame,
        allowance: &Allowance,
        counts: &Figures,
        figures: &mut FrameFigures,
    ) -> Still {
        let &mut Self { settings, plan, ref mut cache, ref mut carry, ref mut places, .. } = self;
        let frame = &prepared.frame;
        let movement = Movement::to(frame, places);
        let size = (settings.size.width, settings.size.height);
        let [visibility, direct_busy, indirect_busy] = [(); 3].map(|()| Busy::default());
        let offsets = sample_offsets(settings.samples as usize);
        let mut samples: Vec<Sample> = Vec::new();
        for &offset in &offsets {
            // The one sample of a pixel is that of the G-buffer.
            let own = (offsets.len() > 1).then(|| {
                let Frame { accelerator, surfaces, seen, .. } = frame;
                let sample = PixelSample::one_of(offsets.len(), offset);
                visibility.take(GBuffer::trace_at(sample, PosedScene::new(accelerator, surfaces), &seen.view, size))
            });
            let seen = own.as_ref().unwrap_or(&frame.seen);
            let coats = plan.is_on(Stage::Gloss).then(|| gloss::light(frame, seen, &direct_busy));
            let below = coats.is_some().then(|| gloss::below_coats(seen));
            let seen = below.as_ref().unwrap_or(seen);
            let known = prepared.correspondence.as_deref();
            let to = To { settings, frame, seen, known, movement: &movement, allowance };
            let mut light = |wanted: Option<&Plane<bool>>| {
                let (irradiance, rays) = direct::irradiance(frame, seen, wanted, &direct_busy);
                figures.shadow_rays += rays;
                irradiance
            };
            let irradiance = match carry.as_mut() {
                Some(carry) => carry.direct(&to, &direct_busy, |missing| light(Some(missing))),
                None => light(None),
            };
            let mut direct = direct::light(seen, &irradiance);
            if let Some((reflected, rays)) = coats {
                figures.shadow_rays += rays;
                direct.samples_mut().iter_mut().zip(reflected.samples()).for_each(|(sum, &coat)| *sum += coat);
            }
            let compensates = plan.is_on(Stage::Compensation);
            let transport =
                LightTransport::new(settings, frame, allowance, (seen, &direct), counts).with_compensation(compensates);
            // Lamps that pixels sample for themselves are not in the tree.
            let nothing_shines = frame.tree.is_empty() && frame.direct.dynamic().anchors.is_empty();
            let indirect = match (plan.state(Stage::Indirect), cache.as_mut()) {
                _ if nothing_shines => Plane::filled(size.0, size.1, Vec3::ZERO),
                (State::Off, _) => Plane::filled(size.0, size.1, Vec3::ZERO),
                (_, Some(cache)) if samples.is_empty() => {
                    let is_unchanged = !movement.is_any && cache.is_lit_as_before(frame);
                    let mut light = |wanted: Option<&Plane<bool>>| {
                        counted(cache.light(&transport, &movement, wanted, &indirect_busy), figures)
                    };
                    let irradiance = match carry.as_mut() {
                        Some(carry) => carry.indirect(&to, is_unchanged, &indirect_busy, light),
                        None => light(None),
                    };
                    reflected(seen, &irradiance)
                }
                (_, Some(cache)) => {
                    reflected(seen, &counted(cache.light_more(&transport, &movement, &indirect_busy), figures))
                }
                (_, None) => pixels::light(&transport, &indirect_busy),
            };
            samples.push(Sample { direct, indirect });
        }
        // Outlines are looked for where they are seen: by the light on either side.
        let coverage = plan.is_on(Stage::Antialiasing).then(|| {
            let Frame { accelerator, surfaces, seen, .. } = frame;
            let light = sum(&samples[0].direct, &samples[0].indirect);
            visibility.take(Coverage::of(seen, PosedScene::new(accelerator, surfaces), &light))
        });
        *places = movement.places;
        figures.seconds.visibility += visibility.seconds();
        figures.seconds.direct = direct_busy.seconds();
        figures.seconds.indirect = indirect_busy.seconds();
        Still::new(frame, samples, coverage, figures.cache_records)
    }
}

/// The light that the pixels of a picture show through one place of each, before outlines are blended.
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
    gather: Arc<FinalGather>,
    seen: Arc<GBuffer>,
    samples: Vec<Sample>,
    /// The surfaces of pixels that show several, where these are blended.
    coverage: Option<Coverage>,
    cache_records: u64,
}

impl Still {
    fn new(frame: &Frame, samples: Vec<Sample>, coverage: Option<Coverage>, cache_records: u64) -> Self {
        let Frame { accelerator, direct, tree, gather, seen, .. } = frame;
        Self {
            accelerator: accelerator.clone(),
            lights: direct.clone(),
            tree: tree.clone(),
            gather: gather.clone(),
            seen: seen.clone(),
            samples,
            coverage,
            cache_records,
        }
    }

    /// The light of all parts of the pixels that show several.
    fn outlines(&self) -> Vec<Outline> {
        let Some(coverage) = &self.coverage else { return Vec::new() };
        let Sample { direct, indirect } = &self.samples[0];
        let light = sum(direct, indirect);
        let of = |pixel: MixedPixel| {
            let parts = pixel.parts.iter();
            let parts =
                parts.map(|part| PixelPart { share: part.share, radiance: part.radiance(&light).to_array() }).collect();
            Outline { pixel: pixel.index, parts }
        };
        coverage.pixels().map(of).collect()
    }

    /// Whether `frame` has the same parts, shared and not only equal.
    fn is_of(&self, frame: &Frame) -> bool {
        Arc::ptr_eq(&self.accelerator, &frame.accelerator)
            && Arc::ptr_eq(&self.lights, &frame.direct)
            && Arc::ptr_eq(&self.tree, &frame.tree)
            && Arc::ptr_eq(&self.gather, &frame.gather)
            && Arc::ptr_eq(&self.seen, &frame.seen)
    }
}

/// The irradiance of a picture; its records are added to `figures`.
fn counted(lit: CachedLight, figures: &mut FrameFigures) -> Plane<[f32; 3]> {
    figures.cache_records = figures.cache_records.max(lit.in_use as u64);
    figures.cache_new += lit.computed as u64;
    lit.irradiance
}

fn sum(a: &Plane<Vec3>, b: &Plane<Vec3>) -> Plane<Vec3> {
    Plane::from_fn(a.width(), a.height(), |x, y| a.get(x, y) + b.get(x, y))
}

fn triples(light: &Plane<Vec3>) -> Plane<[f32; 3]> {
    light.map(|rgb| rgb.to_array())
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
