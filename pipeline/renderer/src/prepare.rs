//! Everything about a frame that needs no thresholds: objects, photons, light tree, primary rays, motion.

use super::frame::{Frame, PreparedFrame};
use crate::plan::{Plan, Stage};
use crate::settings::{RenderSettings, Size};
use glam::Vec3;
use lighttree::{BuildParams, Emission, Light, LightTree};
use pipeline::chunks::begins_chunk;
use pipeline::error::{Context, Result};
use pipeline::figures::FrameFigures;
use pipeline::parts::{Prepare, Prepared};
use pipeline::state::NONSENSE;
use plane::Correspondence;
use render_core::ranks::{Alone, Ranks};
use render_core::scene::{Pose, Scene};
use render_core::{
    Accelerator, AnchorFlux, Anchors, Busy, DirectLights, Emitters, FinalGather, GBuffer, Geometry, Guide, GuideSearch,
    Photons, PosedScene, Surfaces, SweptVolume, Timed, Units, ZoneSearch, Zones, dome_lights,
};
use std::f32::consts::PI;
use std::sync::Arc;

/// Directions that the sky is split into: 5° apart, below the size of the shadows that a sky throws.
const DOME_LIGHTS: usize = 1024;
/// Points that glowing surfaces are split into when they are lights of the tree, all together.
const EMITTER_POINTS: f32 = 2048.0;
/// The same for a single surface, at least and at most.
const POINTS_OF_A_SURFACE: (f32, f32) = (16.0, 1024.0);
/// More glowing surfaces than this are lights of the tree: evaluating each at every pixel would cost more than a cut.
const MOST_SAMPLED_SURFACES: usize = 8;
/// Moments of a film that photons are guided by, at most: a camera that walks on for 10 s has seen most rooms of its way.
const MOMENTS: u32 = 8;
/// A surface of more pieces than this, and larger than this share of the scene, is a crowd of lights, not one.
const FEW_PATCHES: usize = 4;
const SMALL_EXTENT: f32 = 0.1;

/// The first half of the renderer: makes frames 0, 1, 2 … of a film.
pub struct Preparation<'s> {
    scene: &'s Scene,
    settings: RenderSettings,
    plan: &'s Plan,
    /// Who shares the work.
    ranks: Arc<dyn Ranks>,
    /// Whether light is looked at from anywhere, and not from the camera alone.
    everywhere: bool,
    /// Made with the first frame, which is not before the files of the film are open.
    work: Option<PrepareState<'s>>,
}

impl<'s> Preparation<'s> {
    /// For a film of `scene` from its beginning.
    #[must_use]
    pub fn new(scene: &'s Scene, settings: &RenderSettings, plan: &'s Plan) -> Self {
        Self::among(scene, settings, plan, Arc::new(Alone))
    }

    /// The same, where other `ranks` share the work and prepare the same frames.
    #[must_use]
    pub fn among(scene: &'s Scene, settings: &RenderSettings, plan: &'s Plan, ranks: Arc<dyn Ranks>) -> Self {
        Self { scene, settings: settings.clone(), plan, ranks, everywhere: false, work: None }
    }

    /// For light that is looked at from anywhere: photons are not guided by the camera.
    #[must_use]
    pub fn everywhere(self) -> Self {
        Self { everywhere: true, ..self }
    }

    /// Frame `index`, which may follow any other: motion leads to the one that was made before it.
    pub fn frame(&mut self, index: u32) -> PreparedFrame<'s> {
        let Self { scene, settings, plan, ranks, everywhere, work } = self;
        work.get_or_insert_with(|| PrepareState::new(scene, settings, plan, ranks, *everywhere)).frame(index)
    }
}

impl std::fmt::Debug for Preparation<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Preparation").finish_non_exhaustive()
    }
}

impl<'s> Prepare for Preparation<'s> {
    type Frame = Frame<'s>;

    fn step(&mut self, index: u32) -> Option<PreparedFrame<'s>> {
        if begins_chunk(self.settings.chunk, index) {
            self.work = None;
        }
        (index < self.settings.end).then(|| self.frame(index))
    }

    /// The light tree.
    fn state(&self) -> Vec<u8> {
        let kept = self.work.as_ref().and_then(|work| work.kept.as_ref());
        kept.map_or_else(Vec::new, |kept| kept.tree.to_bytes())
    }

    fn restore(&mut self, state: &[u8], last: u32) -> Result<PreparedFrame<'s>> {
        let tree = LightTree::from_bytes(state).context(NONSENSE)?;
        let mut work = PrepareState::new(self.scene, &self.settings, self.plan, &self.ranks, self.everywhere);
        work.tree = Some(Arc::new(tree));
        Ok(self.work.insert(work).frame(last))
    }
}

/// State that is kept from frame to frame.
struct PrepareState<'s> {
    scene: &'s Scene,
    settings: RenderSettings,
    plan: &'s Plan,
    geometry: Geometry,
    units: Units,
    anchors: Anchors,
    photons: Photons,
    /// Whether bright anchors were split.
    is_split: bool,
    /// The tree that a checkpoint brought, in place of the first one.
    tree: Option<Arc<LightTree>>,
    kept: Option<Kept>,
}

struct Kept {
    accelerator: Arc<Accelerator>,
    direct: Arc<DirectLights>,
    tree: Arc<LightTree>,
    gather: Arc<FinalGather>,
    seen: Arc<GBuffer>,
    /// Where nothing moves in the picture, what is true of one frame is true of the next.
    of_itself: Option<Arc<Correspondence>>,
}

/// The scene at the time of a frame.
#[derive(Clone, Copy)]
struct PlacedScene<'a> {
    /// The frame's number.
    frame: u32,
    pose: &'a Pose,
    surfaces: &'a Surfaces<'a>,
    accelerator: &'a Accelerator,
}

/// The lights of a frame.
struct Lights {
    tree: Arc<LightTree>,
    direct: Arc<DirectLights>,
    gather: Arc<FinalGather>,
}

/// Which light and which anchors the camera of a film looks at, by what it sees at some moments.
fn look_by_camera(
    scene: &Scene,
    settings: &RenderSettings,
    geometry: &Geometry,
    units: &Units,
) -> (Option<Guide>, Zones) {
    // Moments evenly over the film, whichever part of it is made here.
    let is_still = ![scene.moving_nodes(), scene.moving_instances()].concat().contains(&true);
    let moments = if is_still { 1 } else { settings.frames.clamp(1, MOMENTS) };
    let (mut photons, mut zones) = (GuideSearch::over(moments as usize), ZoneSearch::default());
    for moment in 0..moments {
        let frame = (2 * u64::from(moment) + 1) * u64::from(settings.frames) / (2 * u64::from(moments));
        let pose = scene.pose(settings.time(frame as u32));
        let surfaces = Surfaces::new(scene, &pose);
        let emitters = Emitters::new(&surfaces, &pose, units);
        let Size { width, height } = settings.size;
        let view = scene.view(&pose, width, height).with_pixel_aspect(settings.pixel_aspect);
        let accelerator = geometry.place(&pose);
        let posed = PosedScene::new(&accelerator, &surfaces);
        photons.look(posed, &emitters, &view, units);
        zones.look(posed, &view);
    }
    (photons.finish(), zones.finish())
}

/// Where photons start whose light is looked at from anywhere.
fn guide_by_surfaces(
    surfaces: &Surfaces,
    pose: &Pose,
    geometry: &Geometry,
    anchors: &Anchors,
    units: &Units,
) -> Option<Guide> {
    let emitters = Emitters::new(surfaces, pose, units);
    let accelerator = geometry.place(pose);
    let mut search = GuideSearch::over(1);
    search.look_everywhere(PosedScene::new(&accelerator, surfaces), &emitters, anchors, units);
    search.finish()
}

impl<'s> PrepareState<'s> {
    fn new(
        scene: &'s Scene,
        settings: &RenderSettings,
        plan: &'s Plan,
        ranks: &Arc<dyn Ranks>,
        everywhere: bool,
    ) -> Self {
        let units = Units::of(scene);
        let rest = scene.pose(0.0);
        let geometry = Geometry::new(scene);
        let surfaces = Surfaces::new(scene, &rest);
        let has_photons = !plan.is_off(Stage::Photons);
        let (guide, zones) = match has_photons {
            true => look_by_camera(scene, settings, &geometry, &units),
            false => (None, Zones::default()),
        };
        let (mut anchors, photons) = if !has_photons {
            (Anchors::none(&surfaces, settings.vpls), 0)
        } else {
            let dynamic = if plan.is_off(Stage::DynamicAnchors) { 0 } else { settings.moving_vpls };
            let counts = [settings.vpls, dynamic];
            (Anchors::spread_exposed(&surfaces, &geometry, &units, &zones, counts), settings.photons)
        };
        let mut photons = Photons::new(photons, settings.seed).with_ranks(ranks.clone());
        if let Some(bounces) = settings.bounces {
            // The last reflection is the one that the viewer sees.
            photons = photons.with_bounces(bounces.saturating_sub(1) as usize);
        }
        if has_photons && scene.moving_instances().contains(&true) {
            let swept = SweptVolume::of(scene, &units, (0..settings.frames).map(|n| settings.time(n)));
            anchors.expect_movement(&swept);
            if plan.is_on(Stage::KeptPhotons) {
                photons = photons.with_swept_volume(swept);
            }
        }
        if has_photons && settings.photons > 0 {
            photons = photons.with_guide(match everywhere {
                true => guide_by_surfaces(&surfaces, &rest, &geometry, &anchors, &units),
                false => guide,
            });
        }
        let settings = settings.clone();
        Self { scene, settings, plan, geometry, units, anchors, photons, is_split: false, tree: None, kept: None }
    }

    fn frame(&mut self, n: u32) -> PreparedFrame<'s> {
        // Objects take their places, where any moves.
        let mut figures = FrameFigures::default();
        let busy = Busy::default();
        let pose = self.scene.pose(self.settings.time(n));
        let surfaces = Surfaces::new(self.scene, &pose);
        let accelerator = match &self.kept {
            Some(kept) if !self.plan.runs(Stage::ObjectPlacing, n) => kept.accelerator.clone(),
            _ => busy.measure(|| Arc::new(self.geometry.place(&pose))),
        };
        figures.seconds.update = busy.seconds();

        // Photons light the anchors.
        let lights = tracing::debug_span!("lights", frame = n).entered();
        let placed = PlacedScene { frame: n, pose: &pose, surfaces: &surfaces, accelerator: &accelerator };
        let Lights { tree, direct, gather } = self.lights(placed, &mut figures);
        drop(lights);

        // Primary rays find the visible surfaces.
        let _rays = tracing::debug_span!("primary rays and motion", frame = n).entered();
        let busy = Busy::default();
        let Size { width, height } = self.settings.size;
        let seen = match &self.kept {
            Some(kept) if !self.plan.runs(Stage::PrimaryRays, n) => kept.seen.clone(),
            _ => {
                let view = self.scene.view(&pose, width, height).with_pixel_aspect(self.settings.pixel_aspect);
                Arc::new(busy.take(GBuffer::trace(PosedScene::new(&accelerator, &surfaces), &view, (width, height))))
            }
        };

        // Motion from the frame before; a picture that stays corresponds to itself, which is found once.
        let correspondence = self.kept.as_ref().map(|before| match &before.of_itself {
            Some(known) if Arc::ptr_eq(&before.seen, &seen) => known.clone(),
            _ => Arc::new(busy.take(seen.reproject(&before.seen))),
        });
        let is_still = self.kept.as_ref().is_some_and(|before| Arc::ptr_eq(&before.seen, &seen));
        let of_itself = correspondence.clone().filter(|_| is_still);

        // B pictures are predicted from both sides.
        let wants_forward = self.settings.motion && self.settings.bframes > 0;
        let before = self.kept.as_ref().filter(|_| wants_forward);
        let forward = before.map(|before| Arc::new(busy.take(before.seen.reproject(&seen))));
        figures.seconds.visibility = busy.seconds();

        // The frame shares its parts with what is kept for the next.
        let kept = Kept { accelerator, direct, tree, gather, seen, of_itself };
        let frame = Frame {
            index: n,
            surfaces,
            accelerator: kept.accelerator.clone(),
            direct: kept.direct.clone(),
            tree: kept.tree.clone(),
            gather: kept.gather.clone(),
            seen: kept.seen.clone(),
            epsilon: self.units.epsilon,
        };
        self.kept = Some(kept);
        Prepared { frame, correspondence, forward, figures }
    }

    /// The light tree and the direct lights of a frame, with their flux there.
    fn lights(&mut self, placed: PlacedScene, figures: &mut FrameFigures) -> Lights {
        // Where nothing changes, the lights of the frame before are those of this one.
        let PlacedScene { frame: n, pose, surfaces, accelerator } = placed;
        let changing = [Stage::Photons, Stage::TreeUpdate, Stage::ObjectPlacing];
        if let Some(kept) = self.kept.as_ref().filter(|_| !changing.into_iter().any(|stage| self.plan.runs(stage, n))) {
            let Kept { tree, direct, gather, .. } = kept;
            return Lights { tree: tree.clone(), direct: direct.clone(), gather: gather.clone() };
        }

        // Photons bring flux to the anchors. The first frame tells which of them are to be split.
        let emitters = Emitters::new(surfaces, pose, &self.units);
        let scene = PosedScene::new(accelerator, surfaces);
        let Timed { value: mut anchor_flux, seconds } =
            self.photons.trace(scene, &emitters, &self.anchors, &self.units);
        if !std::mem::replace(&mut self.is_split, true) {
            self.split_anchors(n, &anchor_flux.fixed);
            anchor_flux.fixed = self.anchors.fixed_flux(&anchor_flux.surfels[0], &anchor_flux.moved);
        }
        figures.photons_traced = anchor_flux.traced;
        figures.seconds.photons = seconds;

        // The tree: anchors at rest, and glowing surfaces where there are many.
        let busy = Busy::default();
        let sampled = self.sampled_areas(&emitters, surfaces);
        let tree = match self.kept.as_ref().map(|kept| &kept.tree).or(self.tree.as_ref()) {
            Some(before) => {
                let (tree, swapped_share) = busy.measure(|| self.updated(before, &anchor_flux));
                figures.tree_swaps_share = swapped_share;
                tree
            }
            None => {
                // Baked light holds all that the tree would have.
                let lights = match self.settings.lighting.is_baked() && self.plan.is_off(Stage::TreeUpdate) {
                    true => Vec::new(),
                    false => self.tree_lights(&anchor_flux, self.lights_that_stay(&emitters, surfaces, &sampled)),
                };
                let bound = self.anchors.geometry_term_bound(self.plan.is_on(Stage::Compensation));
                let params = BuildParams::bounded_by(bound).with_seed(self.settings.seed);
                Arc::new(busy.measure(|| LightTree::build(&lights, params)))
            }
        };

        // Lights that pixels sample for themselves.
        let mut direct = DirectLights::new(&emitters, surfaces, &self.anchors, &anchor_flux.dynamic, &sampled);
        if self.plan.is_on(Stage::Cache) {
            // Light that moving things send back is as smooth as all indirect light: records hold it too.
            direct = direct.with_dynamic_apart();
        }

        // The surroundings, as final gather sees them: with the glow of all that the tree has.
        let mut virtual_emitters = vec![false; self.scene.instances.len()];
        for (place, area) in emitters.areas.iter().enumerate() {
            virtual_emitters[area.instance] |= !sampled.contains(&place);
        }
        let gather = busy.measure(|| {
            let gather = FinalGather::new(surfaces, &self.anchors, &anchor_flux, &self.units)
                .with_lamps(direct.lamps())
                .with_virtual_emitters(virtual_emitters);
            if self.settings.bounces.is_some() { gather.with_limited_bounces() } else { gather }
        });
        figures.seconds.tree = busy.seconds();
        Lights { tree, direct: Arc::new(direct), gather: Arc::new(gather) }
    }

    /// The lights of a new tree: the anchors at rest, and those `that_stay` as they are for the whole film.
    fn tree_lights(&self, anchor_flux: &AnchorFlux, that_stay: Vec<Light>) -> Vec<Light> {
        let mut lights = Vec::new();
        for (anchor, &flux) in self.anchors.fixed.iter().zip(&anchor_flux.fixed) {
            let emission = Emission::Cosine(anchor.normal.into());
            lights.push(Light { position: anchor.position.into(), emission, intensity: flux / PI });
        }
        lights.extend(that_stay);
        lights
    }

    /// The tree with the flux that its anchors have now, and the share of its nodes whose children changed places.
    fn updated(&self, before: &Arc<LightTree>, anchor_flux: &AnchorFlux) -> (Arc<LightTree>, f64) {
        // After the anchors stand the lights that keep their energy: surfaces and sky.
        let mut intensities: Vec<Vec3> = anchor_flux.fixed.iter().map(|&flux| flux / PI).collect();
        intensities.extend(before.lights()[self.anchors.fixed.len()..].iter().map(|light| light.intensity));

        // The same flux again changes nothing.
        let mut tree = before.clone();
        let same = tree.lights().iter().map(|light| light.intensity).eq(intensities.iter().copied());
        let swapped_share = if same { 0.0 } else { Arc::make_mut(&mut tree).update_drawn(&intensities).swapped_share };
        (tree, swapped_share)
    }

    /// Splits the anchors that are bright in the film's first frame, whatever frame `n` comes first here; `flux` is that of `n`.
    fn split_anchors(&mut self, n: u32, flux: &[Vec3]) {
        if n == 0 || self.anchors.fixed.is_empty() {
            return self.anchors.split_bright(flux);
        }
        let pose = self.scene.pose(self.settings.time(0));
        let surfaces = Surfaces::new(self.scene, &pose);
        let accelerator = self.geometry.place(&pose);
        let emitters = Emitters::new(&surfaces, &pose, &self.units);
        let scene = PosedScene::new(&accelerator, &surfaces);
        let first = self.photons.trace(scene, &emitters, &self.anchors, &self.units).value;
        self.anchors.split_bright(&first.fixed);
    }

    /// Places of the glowing surfaces that each pixel samples for itself: few and compact ones, and those that move.
    fn sampled_areas(&self, emitters: &Emitters, surfaces: &Surfaces) -> Vec<usize> {
        let moves = |place: usize| surfaces.moving()[emitters.areas[place].instance];
        let compact = |place: usize| {
            let light = &emitters.areas[place];
            light.patch_count() <= FEW_PATCHES || light.extent(surfaces) <= SMALL_EXTENT * self.units.radius
        };
        let places = 0..emitters.areas.len();
        let few: Vec<usize> = places.clone().filter(|&place| !moves(place) && compact(place)).collect();
        if few.len() <= MOST_SAMPLED_SURFACES {
            places.filter(|&place| moves(place) || compact(place)).collect()
        } else {
            places.filter(|&place| moves(place)).collect()
        }
    }

    /// The lights of the tree that keep their energy: glowing surfaces that are not in `sampled`, and the sky.
    fn lights_that_stay(&self, emitters: &Emitters, surfaces: &Surfaces, sampled: &[usize]) -> Vec<Light> {
        let luminance = render_core::luminance;
        let areas: Vec<_> = (0..emitters.areas.len()).filter(|place| !sampled.contains(place)).collect();
        let power: f32 = areas.iter().map(|&place| luminance(emitters.areas[place].power())).sum();
        let mut lights = Vec::new();
        for place in areas {
            let area = &emitters.areas[place];
            let (least, most) = POINTS_OF_A_SURFACE;
            let by_power = EMITTER_POINTS * luminance(area.power()) / power.max(f32::MIN_POSITIVE);
            // A surface of many small panels needs a few points on each.
            let by_panels = (4 * area.patch_count()) as f32;
            let count = by_power.max(by_panels).clamp(least, most) as usize;
            lights.extend(area.samples(surfaces, count).into_iter().map(|sample| Light {
                position: sample.position.into(),
                emission: Emission::Cosine(sample.normal.into()),
                intensity: sample.intensity,
            }));
        }
        lights.extend(dome_lights(self.scene, &self.units, DOME_LIGHTS).into_iter().map(|light| Light {
            position: light.position.into(),
            emission: Emission::Omni,
            intensity: light.intensity,
        }));
        lights
    }
}
