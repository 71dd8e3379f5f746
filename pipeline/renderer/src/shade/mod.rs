//! Light for every pixel: layers that each find a part of it, as wrong as thresholds allow.
//! The one place where rays and light tree meet.
//!
//! | room | what |
//! |---|---|
//! | `layer` | a layer, the surfaces that it lights, and what it found |
//! | `layers` | the list of them for a scene |
//! | `direct`, `coats` | layers of direct light |
//! | `cached`, `per_pixel`, `all_lights`, `baked` | layers of indirect light |
//! | `carried` | a layer around another: its light of the frame before, where that still holds |
//! | `tolerance` | how wrong the light of a pixel may be |
//! | `tiles` | parts of a picture that ranks take on demand |
//! | `importance` | where people look, and what that makes of samples and thresholds |
//! | `audits`, `counts` | light found twice, and counts of the work |
//! | `visibility`, `movement`, `macroblock`, `pixel` | rays, what has moved, and pixels as layers share them |
//! | `samples`, `lit_frame`, `channels`, `mattes`, `state` | the result, as pictures and as bytes |

mod all_lights;
mod audits;
#[cfg(feature = "bake")]
mod baked;
mod cached;
mod carried;
mod channels;
mod coats;
mod counts;
mod direct;
mod importance;
mod layer;
mod layers;
mod lit_frame;
mod macroblock;
mod mattes;
mod movement;
mod per_pixel;
mod pixel;
mod samples;
mod state;
mod tiles;
mod tolerance;
mod visibility;

pub use audits::Audits;
#[cfg(feature = "bake")]
pub(crate) use coats::{KnownScene, TexelCoat};
pub use counts::{CutCounts, RecordCounts};
pub use layer::{Layer, Lit, PartSample, Visible};
pub use tiles::{Crew, SimulatedFrame, SimulatedRanks};
pub use tolerance::{FootprintPixel, Tolerance};
#[cfg(feature = "bake")]
pub(crate) use visibility::{GATHER_RAYS, Visibility};

use super::frame::{Frame, PreparedFrame};
#[cfg(feature = "bake")]
use super::texels::BakedTexels;
use crate::plan::{Plan, Stage, State};
use crate::settings::{Aov, RenderSettings, Stopping};
use channels::{Known, colors};
use glam::Vec3;
use importance::{ImportanceMap, Looking};
use layer::add_ranks;
use layers::Layers;
use lighttree::Calibration;
use lit_frame::{LitFrame, Reused, Sample, StoredLight};
use movement::{InstancePose, Movement};
use pipeline::chunks::begins_chunk;
use pipeline::error::Result;
use pipeline::figures::FrameFigures;
use pipeline::parts::{Channels, LastThresholds, Shade, Shaded};
use plane::Plane;
use render_core::image_file::FrameHeader;
use render_core::ranks::{Alone, Ranks};
use render_core::{AuditCounts, Busy, Coverage, GBuffer, InstanceShares, PixelSample, PosedScene, sample_offsets};
use samples::{SampleSurfaces, SamplesLight};
use std::sync::Arc;
use tiles::Tiling;

/// Rays that find the share of a pixel's area that each object covers: one to a sixteenth of its width and of its height.
const MATTE_RAYS: usize = 16;

/// The second half of the renderer: lights frame after frame.
pub struct Shading<'a> {
    settings: RenderSettings,
    plan: &'a Plan,
    layers: Layers,
    /// Where the instances were in the frame before; none before the first.
    places: Vec<Option<InstancePose>>,
    /// Where nothing moves, the light of one frame is that of the next.
    still: Option<LitFrame>,
    /// Errors measured so far, if cuts are to end by them.
    calibration: Option<Calibration>,
    /// Where people look, if that is to steer anything.
    looking: Option<Looking>,
    /// Channels for observers.
    watched: Vec<Aov>,
    /// Who shares the work.
    ranks: Arc<dyn Ranks>,
    /// Tiles that ranks take on demand, if they do.
    tiling: Option<Tiling>,
}

impl<'a> Shading<'a> {
    /// For a film from its beginning.
    #[must_use]
    pub fn new(settings: &RenderSettings, plan: &'a Plan) -> Self {
        Self::among(settings, plan, Arc::new(Alone))
    }

    /// The same, where other `ranks` share the work and light the same frames.
    #[must_use]
    pub fn among(settings: &RenderSettings, plan: &'a Plan, ranks: Arc<dyn Ranks>) -> Self {
        // Ranks that take tiles light them alone.
        let sharing: Arc<dyn Ranks> = if settings.tiles.is_some() { Arc::new(Alone) } else { ranks.clone() };
        let layers = Layers::new(settings, plan, &sharing);
        let (calibration, looking) = (calibration(settings), looking(settings));
        Self {
            settings: settings.clone(),
            plan,
            layers,
            places: Vec::new(),
            still: None,
            calibration,
            looking,
            watched: Vec::new(),
            ranks,
            tiling: None,
        }
    }

    /// Lets this `crew` take tiles on demand, if the settings say so.
    pub fn set_crew(&mut self, crew: Crew) {
        self.tiling = self.settings.tiles.map(|settings| Tiling::new(settings, crew, &self.settings, self.plan));
    }

    /// Lets frames have these channels in [`Shaded::watched`] from now on. Their light stays the same.
    pub fn watch(&mut self, aov: &[Aov]) {
        self.layers.keep(aov);
        self.watched = aov.to_vec();
    }

    /// Forgets the frames before: the next one is lit as the first of a film.
    fn forget(&mut self) {
        self.layers.forget();
        self.tiling.iter_mut().for_each(Tiling::forget);
        (self.places, self.still) = (Vec::new(), None);
        (self.calibration, self.looking) = (calibration(&self.settings), looking(&self.settings));
    }

    /// With the light of `texels` for the surfaces that stand still.
    #[cfg(feature = "bake")]
    #[must_use]
    pub fn with_baked(mut self, texels: Arc<BakedTexels>) -> Self {
        self.layers.look_coats_up(&texels);
        let others = self.layers.indirect.pop();
        self.with_indirect(Box::new(baked::Baked::new(texels, others)))
    }

    /// With another layer in place of all that find indirect light.
    #[must_use]
    pub fn with_indirect(mut self, layer: Box<dyn Layer>) -> Self {
        self.layers.indirect = vec![layer];
        self
    }
}

/// Errors of cuts before any was measured, if cuts are to end by them.
fn calibration(settings: &RenderSettings) -> Option<Calibration> {
    (settings.stopping == Stopping::Calibrated).then(|| Calibration::keeping(settings.within))
}

/// The state of importance before any frame, if importance is to steer anything.
fn looking(settings: &RenderSettings) -> Option<Looking> {
    settings.importance.map(|weights| Looking::new(weights, settings))
}

impl std::fmt::Debug for Shading<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shading").finish_non_exhaustive()
    }
}

impl<'s> Shade<Frame<'s>> for Shading<'_> {
    fn step(&mut self, prepared: &PreparedFrame<'s>, thresholds: LastThresholds<'_>) -> Shaded {
        if begins_chunk(self.settings.chunk, prepared.frame.index) {
            self.forget();
        }

        // Errors that this frame finds steer the next.
        let mut calibration = self.calibration.take();
        let RenderSettings { thresholds: policy, size, kappa, .. } = self.settings;
        let mut tolerance = Tolerance::new(thresholds, policy, size, calibration.as_ref());

        // Light that stays has the importance that it was found with.
        let is_still = self.still.as_ref().is_some_and(|still| still.is_of(&prepared.frame));
        let (looking, busy) = (self.looking.as_mut().filter(|_| !is_still), Busy::default());
        let ahead = busy.measure(|| looking.and_then(|looking| looking.ahead(prepared)));
        let gain = ahead.as_ref().map(|map| map.gain(self.settings.importance_gain));
        if let Some(gain) = &gain {
            tolerance = tolerance.divided_by(gain);
        }
        let (mut shaded, audits) = self.shade(prepared, &tolerance, ahead);
        shaded.figures.seconds.visibility += busy.seconds();
        let learned = calibration.as_mut().and_then(|calibration| calibration.learn(&audits.cuts));
        self.calibration = calibration;

        // Where cuts end by measured errors, their multiplier is the one that holds.
        shaded.figures.kappa = Some(learned.as_ref().map_or(kappa.into(), |learned| learned.kappa));
        shaded.figures.audit_error_p95 = learned.map(|learned| learned.error_p95);
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
    /// A frame, and what its audits found. Its importance may be known ahead.
    fn shade(
        &mut self,
        prepared: &PreparedFrame,
        tolerance: &Tolerance,
        ahead: Option<ImportanceMap>,
    ) -> (Shaded, Audits) {
        let (plan, frame) = (self.plan, &prepared.frame);
        let mut figures = prepared.figures.clone();

        // Direct light has no thresholds, and light from a cache takes them into account only where something is new.
        let is_steady = plan.is_on(Stage::Cache) || plan.is_off(Stage::Indirect);
        let may_stay = plan.state(Stage::PrimaryRays) == State::Once && is_steady;
        let (lit, audits) = match self.still.take().filter(|still| still.is_of(frame)) {
            Some(still) => {
                (figures.shaded_share, figures.carried_share) = (0.0, 1.0);
                (still, Audits::default())
            }
            None => self.light(prepared, tolerance, ahead, &mut figures),
        };
        figures.cache_records = lit.light.cache_records;
        let whole = triples(&lit.light.samples[0].whole());
        figures.threshold_mean_relative = tolerance.mean_relative(&frame.seen, &whole);

        // The picture, and what else is wanted of the frame.
        let radiance = lit.light.picture(|sample| sample.whole(), Coverage::blend);
        let importance = lit.light.importance.as_ref();
        if let (Some(looking), Some(map)) = (&mut self.looking, importance) {
            put_importance(map, looking.change(map, prepared.correspondence.as_deref()), &mut figures);
            looking.keep(map, &radiance);
        }
        let busy = Busy::default();
        let shares = self.instance_shares(frame, &busy);
        figures.seconds.visibility += busy.seconds();
        let (settings, shares) = (&self.settings, shares.as_ref());
        let Self { layers, .. } = self;
        let known = Known { prepared, tolerance, layers, reused: &lit.reused, importance, settings, shares };
        let channels_of = |wanted: &[Aov]| {
            let mut channels = Channels::new();
            for &aov in wanted {
                channels.extend(match aov {
                    Aov::Direct => {
                        colors("direct", &lit.light.picture(|sample| sample.direct.clone(), Coverage::blend))
                    }
                    Aov::Indirect => {
                        let indirect = |sample: &Sample| sample.indirect.clone();
                        colors("indirect", &lit.light.picture(indirect, Coverage::blend_reflected))
                    }
                    _ => known.channels(aov),
                });
            }
            channels
        };
        let (channels, watched) = (channels_of(&self.settings.aov), channels_of(&self.watched));
        let header = self.header(frame);
        let outlines = lit.light.outlines();
        let importance = importance.map(|map| Arc::new(map.importance.clone()));
        self.still = may_stay.then_some(lit);
        (Shaded { radiance, outlines, importance, channels, header, watched, figures }, audits)
    }

    /// The instances that each pixel shows, if mattes are wanted of them. Without anti-aliasing a pixel is what its center shows.
    fn instance_shares(&self, frame: &Frame, busy: &Busy) -> Option<InstanceShares> {
        let RenderSettings { aov, samples, antialiasing, .. } = &self.settings;
        let is_wanted = aov.iter().any(|aov| matches!(aov, Aov::CryptoObject | Aov::CryptoMaterial));
        let has_edges = *antialiasing || *samples > 1;
        let rays = if has_edges { MATTE_RAYS.max(*samples as usize) } else { 1 };
        let scene = PosedScene::new(&frame.accelerator, &frame.surfaces);
        is_wanted.then(|| busy.take(frame.seen.instance_shares(scene, rays)))
    }

    /// Facts for the header of the frame's file.
    fn header(&self, frame: &Frame) -> FrameHeader {
        let mattes = self.settings.aov.iter().filter_map(|&aov| mattes::mattes(aov, frame.surfaces.scene()));
        let texts = mattes.flat_map(|mattes| mattes.texts()).collect();
        FrameHeader { camera: Some(frame.seen.view.frame_camera()), place: self.settings.place(frame.index), texts }
    }

    /// The light of a frame through every place of a pixel, and what its audits found; `figures` get what it took.
    fn light(
        &mut self,
        prepared: &PreparedFrame,
        tolerance: &Tolerance,
        ahead: Option<ImportanceMap>,
        figures: &mut FrameFigures,
    ) -> (LitFrame, Audits) {
        if let Some(mut tiling) = self.tiling.take() {
            let lit = tiling.light(self, prepared, tolerance, ahead);
            self.tiling = Some(tiling);
            return self.finished(prepared, lit, figures);
        }
        let frame = &prepared.frame;
        let movement = Movement::to(frame, &self.places);
        let ranks = self.ranks.clone();
        let mut lit = SamplesLight { importance: ahead, ..SamplesLight::default() };
        for sample in 0..self.settings.samples as usize {
            // Where people look decides which pixels have further samples.
            let wanted = lit.importance.as_ref().filter(|_| sample > 0).map(|map| map.wanted(sample));
            if wanted.as_ref().is_some_and(|wanted| !wanted.samples().contains(&true)) {
                break;
            }

            // Layers find their light on the surfaces of this sample.
            let of_sample = self.surfaces(frame, sample, &lit.visibility);
            let visible = of_sample.visible(prepared, sample, &movement, &*ranks);
            let (light, [of_direct, of_indirect]) = self.layers.sample(&visible, wanted.as_ref(), tolerance);
            if sample == 0 {
                lit.reused = Reused::new([&of_direct, &of_indirect], visible.matte);
                if let Some(looking) = self.looking.as_mut().filter(|_| lit.importance.is_none()) {
                    let map = lit.visibility.measure(|| looking.at(prepared, &triples(&light.whole())));
                    lit.importance = Some(map);
                }
            }
            self.add_layers(prepared, &of_sample, (sample, &light), &mut lit);
            lit.samples.push(light);
            lit.direct.add_counts(of_direct);
            lit.indirect.add_counts(of_indirect);
        }
        lit.places = movement.places;
        self.finished(prepared, lit, figures)
    }

    /// The surfaces of a sample; `visibility` is busy with them.
    fn surfaces<'f>(&self, frame: &'f Frame, sample: usize, visibility: &Busy) -> SampleSurfaces<'f> {
        // A sample that is alone, or may be, is that of the G-buffer.
        let offsets = sample_offsets(self.settings.samples as usize);
        let is_center = offsets.len() == 1 || sample == 0 && self.looking.is_some();
        let seen = &*frame.seen;
        let own = (!is_center).then(|| {
            let place = PixelSample::one_of(offsets.len(), offsets[sample]);
            let size = (seen.pixels.width(), seen.pixels.height());
            let scene = PosedScene::new(&frame.accelerator, &frame.surfaces);
            visibility.take(GBuffer::trace_at(place, scene, &seen.view, size))
        });
        let below = self.plan.is_on(Stage::Gloss).then(|| coats::below_coats(own.as_ref().unwrap_or(seen)));
        let matte = below.as_ref().or(own.as_ref()).unwrap_or(seen);
        let emitted = matte.pixels.map(|pixel| Vec3::from(pixel.emission));
        SampleSurfaces { seen, own, below, emitted }
    }

    /// Adds the layers of pixels that show several, where each pixel has all of several samples.
    fn add_layers(
        &self,
        prepared: &PreparedFrame,
        surfaces: &SampleSurfaces,
        (sample, light): (usize, &Sample),
        lit: &mut SamplesLight,
    ) {
        let offsets = sample_offsets(self.settings.samples as usize);
        if offsets.len() > 1 && self.looking.is_none() {
            let place = PixelSample::one_of(offsets.len(), offsets[sample]);
            lit.layers.push(surfaces.layers(prepared, place, light, &lit.visibility));
        }
    }

    /// The frame of this light, with what it took in its `figures`, and what its audits found.
    fn finished(
        &mut self,
        prepared: &PreparedFrame,
        lit: SamplesLight,
        figures: &mut FrameFigures,
    ) -> (LitFrame, Audits) {
        let SamplesLight { samples, layers, mut direct, indirect, reused, importance, places, visibility } = lit;
        let Frame { accelerator, surfaces, seen, .. } = &prepared.frame;

        // Outlines are looked for where they are seen: by the light on either side.
        let scene = PosedScene::new(accelerator, surfaces);
        let has_outlines = self.plan.is_on(Stage::Antialiasing);
        let has_layers = layers.is_empty() && !seen.layered.is_empty();
        let coverage = (has_outlines || has_layers).then(|| {
            let light = samples[0].whole();
            visibility.take(if has_outlines {
                Coverage::of(seen, scene, &light)
            } else {
                Coverage::of_layers(seen, scene, &light, PixelSample::WHOLE)
            })
        });
        self.places = places;

        // Times and counts of the samples together.
        figures.seconds.visibility += visibility.seconds();
        figures.seconds.direct = direct.seconds;
        figures.seconds.indirect = indirect.seconds;
        figures.shaded_share = reused.shaded_share();
        figures.carried_share = 1.0 - figures.shaded_share;
        direct.add_counts(indirect);
        add_ranks(&*self.ranks, &mut direct);
        put(&direct, figures);
        let light = StoredLight { samples, layers, coverage, cache_records: direct.records.in_use, importance };
        (LitFrame::new(&prepared.frame, light, reused), direct.audits)
    }
}

/// Writes what light has taken into the figures of its frame.
fn put(lit: &Lit, figures: &mut FrameFigures) {
    let CutCounts { cuts, clusters, largest } = lit.cuts;
    figures.cut_size_mean = clusters as f64 / cuts.max(1) as f64;
    figures.cut_size_max = largest;
    figures.shadow_rays += lit.rays;
    figures.cache_new += lit.records.computed;
    let AuditCounts { within, all } = lit.audits.carried;
    figures.audit_carried_within = (all > 0).then(|| within as f64 / all as f64);
}

/// Writes where people look into the figures of a frame.
fn put_importance(map: &ImportanceMap, change: Option<f64>, figures: &mut FrameFigures) {
    let count = map.samples.samples().len().max(1) as f64;
    figures.importance_mean = Some(map.importance.samples().iter().map(|&v| f64::from(v)).sum::<f64>() / count);
    figures.samples_mean = Some(map.samples.samples().iter().map(|&n| f64::from(n)).sum::<f64>() / count);
    figures.samples_change = change;
}

fn triples(light: &Plane<Vec3>) -> Plane<[f32; 3]> {
    light.map(|rgb| rgb.to_array())
}
