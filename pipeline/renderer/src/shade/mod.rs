//! Light of every pixel: a sum of layers, each as accurate as thresholds require. No other module combines rays with
//! the light tree.
//!
//! | module | contents |
//! |---|---|
//! | `layer` | the layer trait, the surfaces that it lights, and its result |
//! | `layers` | the layers of a scene |
//! | `direct`, `coats` | layers of direct light |
//! | `cached`, `per_pixel`, `all_lights`, `baked` | layers of indirect light |
//! | `reprojected`, `coats::reprojected` | layers around other ones: reproject light of the previous frame |
//! | `tolerance` | permitted error of each pixel's light |
//! | `tiles` | tiles of a frame that ranks request on demand |
//! | `importance` | importance map, which sets samples and thresholds |
//! | `audits`, `counts` | errors measured by recomputing light, and counts of the work |
//! | `visibility`, `movement`, `macroblock`, `pixel` | rays, moving objects, and pixels as layers process them |
//! | `gradient_sum` | sums of light with derivatives |
//! | `light_samples` | light of all samples of a frame |
//! | `fine`, `further` | further samples of pixels in which light changes |
//! | `sample`, `samples`, `lit_frame`, `channels`, `mattes`, `state` | the result, as frames, channels and bytes |

mod all_lights;
mod audits;
#[cfg(feature = "bake")]
mod baked;
mod cached;
mod channels;
mod coats;
mod counts;
mod direct;
mod fine;
mod further;
mod gradient_sum;
mod importance;
mod layer;
mod layers;
mod light_samples;
mod lit_frame;
mod macroblock;
mod mattes;
mod movement;
mod per_pixel;
mod pixel;
mod reprojected;
mod sample;
mod samples;
mod state;
mod tiles;
mod tolerance;
mod visibility;

pub use audits::Audits;
#[cfg(feature = "bake")]
pub(crate) use coats::{KnownScene, TexelCoat, arriving_light};
pub use counts::{LightcutCounts, RecordCounts};
pub use layer::{Layer, Lit, RegionLayer, RegionSample, Visible};
pub use tiles::{Crew, SimulatedFrame, SimulatedRanks};
pub use tolerance::{FootprintPixel, Tolerance};
#[cfg(feature = "bake")]
pub(crate) use visibility::{GATHER_RAYS, Visibility};

#[cfg(feature = "bake")]
use super::baked_light::BakedLight;
use super::frame::{Frame, PreparedFrame};
use crate::plan::{Plan, Stage, State};
use crate::settings::{Aov, RenderSettings, Stopping};
use channels::{Known, colors};
use glam::Vec3;
use importance::{ImportanceMap, Looking, SeenLight};
use layers::Layers;
use lighttree::Calibration;
use lit_frame::LitFrame;
use movement::InstancePose;
use pipeline::chunks::begins_chunk;
use pipeline::error::Result;
use pipeline::figures::FrameFigures;
use pipeline::stage::{Channels, LastThresholds, Shade, Shaded};
use plane::Plane;
use render_core::image_file::FrameHeader;
use render_core::ranks::{Alone, Ranks};
use render_core::{Busy, Coverage, InstanceShares, PosedScene};
use sample::Sample;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tiles::Tiling;

/// Number of rays per pixel and axis that find the fraction of a pixel covered by each object: 16 × 16 rays.
const MATTE_RAYS: usize = 16;

/// Second half of the renderer: lights frames one after the other.
pub struct Shading<'a> {
    settings: RenderSettings,
    plan: &'a Plan,
    /// Permitted fraction of luminance for pixels without a threshold.
    share_elsewhere: f32,
    layers: Layers,
    /// Maximum fraction of the pixels for which each layer computes light; `None` without a limit.
    budget: Option<f32>,
    /// Fraction of the lit pixels of the last frame whose errors exceed their tolerance.
    open_share: f64,
    /// Flag that ends further samples, and the light of frames that may be discarded.
    stop: Arc<AtomicBool>,
    /// State before the frame, if the frame may be discarded.
    aside: Option<Aside>,
    /// Poses of the instances in the previous frame; empty before the first frame.
    places: Vec<Option<InstancePose>>,
    /// Light of a static frame, reused for the next frame.
    still: Option<LitFrame>,
    /// Measured errors of lightcuts; `None` without calibrated stopping.
    calibration: Option<Calibration>,
    /// State of importance; `None` without importance.
    looking: Option<Looking>,
    /// Channels requested by observers.
    watched: Vec<Aov>,
    /// Ranks that share the work.
    ranks: Arc<dyn Ranks>,
    /// Tiles that ranks request on demand; `None` without tiles.
    tiling: Option<Tiling>,
    /// Baked light; `None` in films without it.
    #[cfg(feature = "bake")]
    baked: Option<BakedLight>,
}

impl<'a> Shading<'a> {
    /// Creates the shading stage of a film, for a single process.
    #[must_use]
    pub fn new(settings: &RenderSettings, plan: &'a Plan) -> Self {
        Self::among(settings, plan, Arc::new(Alone))
    }

    /// Creates the shading stage of a film on several `ranks`, which share the work and light the same frames.
    #[must_use]
    pub fn among(settings: &RenderSettings, plan: &'a Plan, ranks: Arc<dyn Ranks>) -> Self {
        // Let each rank light its tiles alone if tiles are in use.
        let sharing: Arc<dyn Ranks> = if settings.tiles.is_some() { Arc::new(Alone) } else { ranks.clone() };
        let mut layers = Layers::new(settings, plan, &sharing);
        let (calibration, looking) = (calibration(settings), looking(settings));
        if looking.as_ref().is_some_and(Looking::weighs_costs) {
            layers.keep(&[Aov::CutSize]);
        }
        Self {
            settings: settings.clone(),
            plan,
            share_elsewhere: settings.thresholds.share_elsewhere(),
            budget: None,
            open_share: 0.0,
            stop: Arc::default(),
            aside: None,
            layers,
            places: Vec::new(),
            still: None,
            calibration,
            looking,
            watched: Vec::new(),
            ranks,
            tiling: None,
            #[cfg(feature = "bake")]
            baked: None,
        }
    }

    /// Sets the `crew` that lights tiles on demand, if the settings have tiles.
    pub fn set_crew(&mut self, crew: Crew) {
        self.tiling = self.settings.tiles.map(|settings| Tiling::new(settings, crew, &self.settings, self.plan));
    }

    /// Adds the channels `aov` to [`Shaded::watched`] from the next frame on. The light is unchanged.
    pub fn watch(&mut self, aov: &[Aov]) {
        self.layers.keep(aov);
        self.watched = aov.to_vec();
    }

    /// Adapts the permitted error of reprojected light to the quantiser_scale of the next frames, 1…112.
    pub fn set_quantiser_scale(&mut self, quantiser_scale: u32) {
        self.layers.set_quantiser_scale(quantiser_scale);
    }

    /// Sets the permitted fraction of luminance for pixels without a threshold, such as newly visible ones. Films use
    /// 2 %.
    pub fn set_share_elsewhere(&mut self, share: f32) {
        self.share_elsewhere = share;
    }

    /// Limits the pixels for which each layer computes light to a `share` of the frame, in the next frames. All others
    /// have reprojected light despite its error, or the light of pixels around them. Films have no limit, which is
    /// `None`.
    ///
    /// Frames with a limit are lit within their thresholds only if [`open_share`](Self::open_share) is 0.
    pub fn set_budget(&mut self, share: Option<f32>) {
        self.budget = share;
        self.layers.set_budget(share);
    }

    /// Returns the fraction of the pixels of the last frame whose errors exceed their tolerance because of the limit of
    /// [`set_budget`](Self::set_budget). Pixels count once per layer.
    #[must_use]
    pub fn open_share(&self) -> f64 {
        self.open_share
    }

    /// Ends further samples of pixels as soon as the flag `stop` is true. A frame after [`set_aside`](Self::set_aside)
    /// then ends with any light, so that [`take_back`](Self::take_back) must follow.
    pub fn set_stop(&mut self, stop: Arc<AtomicBool>) {
        self.stop = stop;
    }

    /// Returns whether the frame in work will be discarded.
    fn is_discarded(&self) -> bool {
        self.aside.is_some() && self.has_stopped()
    }

    fn has_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Sets a copy of the state aside: the next frame may be discarded. Has no effect if some layer cannot be copied.
    pub fn set_aside(&mut self) {
        let copy = self.layers.copy();
        self.aside = copy.map(|layers| Aside { layers, places: self.places.clone() });
    }

    /// Drops the copy of the state.
    pub fn keep(&mut self) {
        self.aside = None;
    }

    /// Discards the last frame, and returns to the state of [`set_aside`](Self::set_aside). Importance and calibration
    /// keep the state after the discarded frame. Returns false if there is no such state.
    pub fn take_back(&mut self) -> bool {
        let Some(Aside { layers, places }) = self.aside.take() else { return false };
        (self.layers, self.places, self.still) = (layers, places, None);
        true
    }

    /// Uses another plan of the same scene from the next frame on. It may differ from the plan so far in the stages
    /// [`Stage::Antialiasing`] and [`Stage::FineSamples`] only.
    pub fn set_plan(&mut self, plan: &'a Plan) {
        self.plan = plan;
    }

    /// Discards the state of earlier frames: the next frame is lit like the first frame of a film.
    pub fn forget(&mut self) {
        self.layers.forget();
        self.tiling.iter_mut().for_each(Tiling::forget);
        (self.places, self.still) = (Vec::new(), None);
        (self.calibration, self.looking) = (calibration(&self.settings), looking(&self.settings));
    }

    /// Uses baked `light` for static surfaces.
    #[cfg(feature = "bake")]
    #[must_use]
    pub fn with_baked(mut self, light: impl Into<BakedLight>) -> Self {
        self.baked = Some(light.into());
        let others = self.layers.indirect.pop();
        self.with_indirect(Box::new(baked::Baked::new(others)))
    }

    /// Replaces all layers of indirect light by `layer`.
    #[must_use]
    pub fn with_indirect(mut self, layer: Box<dyn Layer>) -> Self {
        self.layers.indirect = vec![layer];
        self
    }
}

/// State before a frame that may be discarded.
struct Aside {
    layers: Layers,
    places: Vec<Option<InstancePose>>,
}

/// Returns the initial calibration; `None` without calibrated stopping.
fn calibration(settings: &RenderSettings) -> Option<Calibration> {
    (settings.stopping == Stopping::Calibrated).then(|| Calibration::keeping(settings.within))
}

/// Returns the initial state of importance; `None` if the settings have no weights.
fn looking(settings: &RenderSettings) -> Option<Looking> {
    settings.importance.as_ref().map(|weights| Looking::new(weights, settings))
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

        // Multiply thresholds by the calibration from earlier frames.
        let mut calibration = self.calibration.take();
        let RenderSettings { thresholds: policy, size, kappa, .. } = self.settings;
        let tolerance = Tolerance::new(thresholds, policy, size, calibration.as_ref());
        let mut tolerance = tolerance.with_share_elsewhere(self.share_elsewhere);

        // Keep the importance map with which reused light was computed.
        let is_still = self.still.as_ref().is_some_and(|still| still.is_of(&prepared.frame));
        let (looking, busy) = (self.looking.as_mut().filter(|_| !is_still), Busy::default());
        let ahead = busy.measure(|| looking.and_then(|looking| looking.ahead(prepared)));
        let gain = ahead.as_ref().map(|map| map.gain(self.settings.importance_gain));
        if let Some(gain) = &gain {
            tolerance = tolerance.divided_by(gain);
        }
        let (mut shaded, audits) = self.shade(prepared, &tolerance, ahead);
        shaded.figures.seconds.visibility += busy.seconds();

        // Derive the next frame's calibration factors from the errors measured in this frame.
        let learned = calibration.as_mut().and_then(|calibration| calibration.learn(&audits.cuts));
        self.calibration = calibration;

        // With calibrated stopping, report the mean calibration factor as κ.
        shaded.figures.kappa = Some(learned.as_ref().map_or(kappa.into(), |learned| learned.lambda));
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
    /// Lights a frame and returns the errors of its audits. `ahead` is the importance map if it is available before
    /// lighting.
    fn shade(
        &mut self,
        prepared: &PreparedFrame,
        tolerance: &Tolerance,
        ahead: Option<ImportanceMap>,
    ) -> (Shaded, Audits) {
        let (plan, frame) = (self.plan, &prepared.frame);
        let mut figures = prepared.figures.clone();

        // Reuse the light of a static view if possible: direct and baked light have no thresholds, and cached light
        // applies them only to new records.
        let has_steady_layer = [Stage::Cache, Stage::BakedLight].into_iter().any(|stage| plan.is_on(stage));
        let is_steady = has_steady_layer || plan.is_off(Stage::Indirect);
        let may_stay = plan.state(Stage::PrimaryRays) == State::Once && is_steady;
        let (lit, audits) = match self.still.take().filter(|still| still.is_of(frame)) {
            Some(still) => {
                (figures.shaded_share, figures.reprojected_share) = (0.0, 1.0);
                self.open_share = 0.0;
                (still, Audits::default())
            }
            None => self.light(prepared, tolerance, ahead, &mut figures),
        };
        figures.cache_records = lit.light.cache_records;
        let whole = triples(&lit.light.samples[0].whole());
        figures.threshold_mean_relative = tolerance.mean_relative(&frame.seen, &whole);

        // Assemble the frame and its channels.
        let radiance = lit.light.picture(|sample| sample.whole(), Coverage::blend);
        if let Some(fine) = &lit.light.fine {
            figures.samples_mean = Some(fine.mean_count(radiance.samples().len()));
        }
        let importance = lit.light.importance.as_ref();
        if let (Some(looking), Some(map)) = (&mut self.looking, importance) {
            put_importance(map, looking.change(map, prepared.correspondence.as_deref()), &mut figures);
            let cut_sizes = looking.weighs_costs().then(|| self.layers.channel(Aov::CutSize, frame)).flatten();
            looking.keep(map, &SeenLight { radiance: &radiance, cut_sizes });
        }

        // Find the coverage of pixels by instance, which mattes need.
        let busy = Busy::default();
        let shares = self.instance_shares(frame, &busy);
        figures.seconds.visibility += busy.seconds();

        // Compute the channels for files and for observers.
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

        // Keep the light if the next frame may reuse it.
        let importance = importance.map(|map| Arc::new(map.importance.clone()));
        self.still = (may_stay && self.budget.is_none() && !self.has_stopped()).then_some(lit);
        (Shaded { radiance, outlines, importance, channels, header, watched, figures }, audits)
    }

    /// Returns the coverage of each pixel by instance, if mattes are requested. Without antialiasing, each pixel shows
    /// only the surface at its center.
    fn instance_shares(&self, frame: &Frame, busy: &Busy) -> Option<InstanceShares> {
        let RenderSettings { aov, samples, antialiasing, .. } = &self.settings;
        let is_wanted = aov.iter().any(|aov| matches!(aov, Aov::CryptoObject | Aov::CryptoMaterial));
        let most = samples.most() as usize;
        let has_edges = *antialiasing || most > 1;
        let rays = if has_edges { MATTE_RAYS.max(most) } else { 1 };
        let scene = PosedScene::new(&frame.accelerator, &frame.surfaces);
        is_wanted.then(|| busy.take(frame.seen.instance_shares(scene, rays)))
    }

    /// Returns the header of the frame's OpenEXR file.
    fn header(&self, frame: &Frame) -> FrameHeader {
        // Add the manifests of the mattes, which name objects and materials.
        let mattes = self.settings.aov.iter().filter_map(|&aov| mattes::mattes(aov, frame.surfaces.scene()));
        let texts = mattes.flat_map(|mattes| mattes.texts()).collect();
        FrameHeader { camera: Some(frame.seen.view.frame_camera()), place: self.settings.place(frame.index), texts }
    }
}

/// Writes importance into a frame's figures.
fn put_importance(map: &ImportanceMap, change: Option<f64>, figures: &mut FrameFigures) {
    let count = map.samples.samples().len().max(1) as f64;
    figures.importance_mean = Some(map.importance.samples().iter().map(|&v| f64::from(v)).sum::<f64>() / count);
    figures.samples_mean = Some(map.samples.samples().iter().map(|&n| f64::from(n)).sum::<f64>() / count);
    figures.samples_change = change;
}

fn triples(light: &Plane<Vec3>) -> Plane<[f32; 3]> {
    light.map(|rgb| rgb.to_array())
}
