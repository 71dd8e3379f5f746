//! First half of the renderer: all work that needs no thresholds (object poses, photons, light tree, primary rays,
//! motion).

use super::frame::{Frame, PreparedFrame};
use crate::plan::{Plan, Stage};
use crate::settings::{RenderSettings, Size};
use glam::Vec3;
use lighttree::{BuildParams, Emission, Light, LightTree};
use pipeline::chunks::begins_chunk;
use pipeline::error::{Context, Result};
use pipeline::figures::FrameFigures;
use pipeline::stage::{Prepare, Prepared};
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

/// Number of directions for sky light. They are 5° apart, less than the width of shadows from a sky.
const DOME_LIGHTS: usize = 1024;
/// Total number of points that represent area lights in the light tree.
const EMITTER_POINTS: f32 = 2048.0;
/// Minimum and maximum number of points that represent one surface in the light tree.
const POINTS_OF_A_SURFACE: (f32, f32) = (16.0, 1024.0);
/// Maximum number of area lights sampled at every pixel. With more emissive surfaces, the light tree is cheaper.
const MOST_SAMPLED_SURFACES: usize = 8;
/// Maximum number of moments of the film that guide photons: a camera that walks for 10 s has seen most rooms on its
/// path.
const MOMENTS: u32 = 8;
/// Maximum number of patches of a static area light of any extent that pixels sample directly.
const FEW_PATCHES: usize = 4;
/// Maximum extent of a static area light with more patches that pixels sample directly, as a fraction of the scene's
/// radius.
const SMALL_EXTENT: f32 = 0.1;

/// First half of the renderer: prepares frames 0, 1, 2 … of a film.
pub struct Preparation<'s> {
    scene: &'s Scene,
    settings: RenderSettings,
    plan: &'s Plan,
    /// Ranks that share the work.
    ranks: Arc<dyn Ranks>,
    /// Whether light is needed everywhere, not only in the camera's views.
    everywhere: bool,
    /// State, created with the first frame, when the film's files are open.
    work: Option<PrepareState<'s>>,
}

impl<'s> Preparation<'s> {
    /// Starts to prepare a film of `scene`.
    #[must_use]
    pub fn new(scene: &'s Scene, settings: &RenderSettings, plan: &'s Plan) -> Self {
        Self::among(scene, settings, plan, Arc::new(Alone))
    }

    /// Starts to prepare a film of `scene` on several `ranks`, which share the work and prepare the same frames.
    #[must_use]
    pub fn among(scene: &'s Scene, settings: &RenderSettings, plan: &'s Plan, ranks: Arc<dyn Ranks>) -> Self {
        Self { scene, settings: settings.clone(), plan, ranks, everywhere: false, work: None }
    }

    /// Prepares light for all viewpoints: the camera does not guide photons.
    #[must_use]
    pub fn everywhere(self) -> Self {
        Self { everywhere: true, ..self }
    }

    /// Prepares frame `index`, in any order of frames. Motion refers to the previously prepared frame.
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

    /// Returns the light tree as bytes.
    fn state(&self) -> Vec<u8> {
        let kept = self.work.as_ref().and_then(|work| work.kept.as_ref());
        kept.map_or_else(Vec::new, |kept| kept.tree.to_bytes())
    }

    fn restore(&mut self, state: &[u8], last: u32) -> Result<PreparedFrame<'s>> {
        // Restore only the tree: all other state is computed again from frame `last`.
        let tree = LightTree::from_bytes(state).context(NONSENSE)?;
        let mut work = PrepareState::new(self.scene, &self.settings, self.plan, &self.ranks, self.everywhere);
        work.tree = Some(Arc::new(tree));
        Ok(self.work.insert(work).frame(last))
    }
}

/// State of preparation between frames.
struct PrepareState<'s> {
    scene: &'s Scene,
    settings: RenderSettings,
    plan: &'s Plan,
    geometry: Geometry,
    units: Units,
    anchors: Anchors,
    photons: Photons,
    /// Whether bright anchors have been split.
    is_split: bool,
    /// Light tree of a checkpoint, used instead of a new tree in the first frame.
    tree: Option<Arc<LightTree>>,
    kept: Option<Kept>,
}

struct Kept {
    accelerator: Arc<Accelerator>,
    direct: Arc<DirectLights>,
    tree: Arc<LightTree>,
    gather: Arc<FinalGather>,
    seen: Arc<GBuffer>,
    /// Correspondence of a static view with itself, computed only once.
    of_itself: Option<Arc<Correspondence>>,
}

/// The scene in the pose of a frame.
#[derive(Clone, Copy)]
struct PlacedScene<'a> {
    /// Frame number.
    frame: u32,
    pose: &'a Pose,
    surfaces: &'a Surfaces<'a>,
    accelerator: &'a Accelerator,
}

/// Lights of a frame.
struct Lights {
    tree: Arc<LightTree>,
    direct: Arc<DirectLights>,
    gather: Arc<FinalGather>,
}

/// Finds the photon guide and the anchor zones of a film, from the camera's views at several moments.
fn look_by_camera(
    scene: &Scene,
    settings: &RenderSettings,
    geometry: &Geometry,
    units: &Units,
) -> (Option<Guide>, Zones) {
    // Spread the moments evenly over the film, regardless of the rendered range.
    let is_still = ![scene.moving_nodes(), scene.moving_instances()].concat().contains(&true);
    let moments = if is_still { 1 } else { settings.frames.clamp(1, MOMENTS) };
    let (mut photons, mut zones) = (GuideSearch::over(moments as usize), ZoneSearch::default());
    for moment in 0..moments {
        // Pose the scene at the middle of each of `moments` equal intervals.
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

/// Finds the photon guide of a film in which light is needed everywhere.
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
        // Place anchors in the pose at time 0: they must not depend on the rendered range.
        let units = Units::of(scene);
        let rest = scene.pose(0.0);
        let geometry = Geometry::new(scene);
        let surfaces = Surfaces::new(scene, &rest);
        // Derive the photon guide and the anchor zones from views of the camera, if the film needs photons.
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
            // Photons make one reflection less: the last one is toward the camera.
            photons = photons.with_bounces(bounces.saturating_sub(1) as usize);
        }
        // Keep photon paths that moving geometry cannot cross.
        if has_photons && scene.moving_instances().contains(&true) {
            let swept = SweptVolume::of(scene, &units, (0..settings.frames).map(|n| settings.time(n)));
            anchors.expect_movement(&swept);
            if plan.is_on(Stage::KeptPhotons) {
                photons = photons.with_swept_volume(swept);
            }
        }
        // Guide photon emission towards surfaces that need the light.
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
        // Place the objects if any object moves.
        let mut figures = FrameFigures::default();
        let busy = Busy::default();
        let pose = self.scene.pose(self.settings.time(n));
        let surfaces = Surfaces::new(self.scene, &pose);
        let accelerator = match &self.kept {
            Some(kept) if !self.plan.runs(Stage::ObjectPlacing, n) => kept.accelerator.clone(),
            _ => busy.measure(|| Arc::new(self.geometry.place(&pose))),
        };
        figures.seconds.update = busy.seconds();

        // Trace photons to the anchors.
        let lights = tracing::debug_span!("lights", frame = n).entered();
        let placed = PlacedScene { frame: n, pose: &pose, surfaces: &surfaces, accelerator: &accelerator };
        let Lights { tree, direct, gather } = self.lights(placed, &mut figures);
        drop(lights);

        // Trace primary rays to the visible surfaces.
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

        // Find the motion from the previous frame. The correspondence of a static view with itself is computed only
        // once.
        let correspondence = self.kept.as_ref().map(|before| match &before.of_itself {
            Some(known) if Arc::ptr_eq(&before.seen, &seen) => known.clone(),
            _ => Arc::new(busy.take(seen.reproject(&before.seen))),
        });
        let is_still = self.kept.as_ref().is_some_and(|before| Arc::ptr_eq(&before.seen, &seen));
        let of_itself = correspondence.clone().filter(|_| is_still);

        // Find the motion to this frame, too, for B pictures: they are predicted from both sides.
        let wants_forward = self.settings.motion && self.settings.bframes > 0;
        let before = self.kept.as_ref().filter(|_| wants_forward);
        let forward = before.map(|before| Arc::new(busy.take(before.seen.reproject(&seen))));
        figures.seconds.visibility = busy.seconds();

        // Share the data between the frame and the state for the next frame.
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

    /// Returns the lights of a frame, with their current flux.
    fn lights(&mut self, placed: PlacedScene, figures: &mut FrameFigures) -> Lights {
        // Reuse the lights of the previous frame if nothing changes.
        let PlacedScene { frame: n, pose, surfaces, accelerator } = placed;
        let changing = [Stage::Photons, Stage::TreeUpdate, Stage::ObjectPlacing];
        if let Some(kept) = self.kept.as_ref().filter(|_| !changing.into_iter().any(|stage| self.plan.runs(stage, n))) {
            let Kept { tree, direct, gather, .. } = kept;
            return Lights { tree: tree.clone(), direct: direct.clone(), gather: gather.clone() };
        }

        // Trace photons, which bring flux to the anchors. The first frame determines the anchors to split.
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

        // Build or update the tree, which contains static anchors, and area lights if they are numerous.
        let busy = Busy::default();
        let sampled = self.sampled_areas(&emitters, surfaces);
        let tree = match self.kept.as_ref().map(|kept| &kept.tree).or(self.tree.as_ref()) {
            Some(before) => {
                let (tree, swapped_share) = busy.measure(|| self.updated(before, &anchor_flux));
                figures.tree_swaps_share = swapped_share;
                tree
            }
            None => {
                // Omit all lights if baked light replaces them.
                let lights = match self.settings.lighting.is_baked() && self.plan.is_off(Stage::TreeUpdate) {
                    true => Vec::new(),
                    false => self.tree_lights(&anchor_flux, self.lights_that_stay(&emitters, surfaces, &sampled)),
                };
                let bound = self.anchors.geometry_term_bound(self.plan.is_on(Stage::Compensation));
                let params = BuildParams::bounded_by(bound).with_seed(self.settings.seed);
                Arc::new(busy.measure(|| LightTree::build(&lights, params)))
            }
        };

        // Collect the lights that each pixel samples directly.
        let mut direct = DirectLights::new(&emitters, surfaces, &self.anchors, &anchor_flux.dynamic, &sampled);
        if self.plan.is_on(Stage::Cache) {
            // Let records cache light reflected by moving objects: it is as smooth as other indirect light.
            direct = direct.with_dynamic_apart();
        }

        // Let final gather find the emission of area lights that are in the tree.
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

    /// Returns the lights of a new tree: the static anchors, and the lights `that_stay` constant for the whole film.
    fn tree_lights(&self, anchor_flux: &AnchorFlux, that_stay: Vec<Light>) -> Vec<Light> {
        let mut lights = Vec::new();
        // List anchors first: updates of the tree replace their intensities by index.
        for (anchor, &flux) in self.anchors.fixed.iter().zip(&anchor_flux.fixed) {
            let emission = Emission::Cosine(anchor.normal.into());
            lights.push(Light { position: anchor.position.into(), emission, intensity: flux / PI });
        }
        lights.extend(that_stay);
        lights
    }

    /// Returns the tree with the current flux of the anchors, and the fraction of nodes with swapped children.
    fn updated(&self, before: &Arc<LightTree>, anchor_flux: &AnchorFlux) -> (Arc<LightTree>, f64) {
        // Append the constant intensities of surfaces and sky, which follow the anchors in the tree.
        let mut intensities: Vec<Vec3> = anchor_flux.fixed.iter().map(|&flux| flux / PI).collect();
        intensities.extend(before.lights()[self.anchors.fixed.len()..].iter().map(|light| light.intensity));

        // Update the tree only if the flux has changed.
        let mut tree = before.clone();
        let same = tree.lights().iter().map(|light| light.intensity).eq(intensities.iter().copied());
        let swapped_share = if same { 0.0 } else { Arc::make_mut(&mut tree).update_drawn(&intensities).swapped_share };
        (tree, swapped_share)
    }

    /// Splits the anchors that are bright in the film's first frame. `flux` belongs to frame `n`, the first frame
    /// prepared by this process.
    fn split_anchors(&mut self, n: u32, flux: &[Vec3]) {
        if n == 0 || self.anchors.fixed.is_empty() {
            return self.anchors.split_bright(flux);
        }
        // Trace the photons of frame 0 again: all chunks and resumed films must split the same anchors.
        let pose = self.scene.pose(self.settings.time(0));
        let surfaces = Surfaces::new(self.scene, &pose);
        let accelerator = self.geometry.place(&pose);
        let emitters = Emitters::new(&surfaces, &pose, &self.units);
        let scene = PosedScene::new(&accelerator, &surfaces);
        let first = self.photons.trace(scene, &emitters, &self.anchors, &self.units).value;
        self.anchors.split_bright(&first.fixed);
    }

    /// Returns the indices of the area lights that each pixel samples directly: moving ones, and compact ones if these
    /// are few.
    fn sampled_areas(&self, emitters: &Emitters, surfaces: &Surfaces) -> Vec<usize> {
        let moves = |place: usize| surfaces.moving()[emitters.areas[place].instance];
        let compact = |place: usize| {
            let light = &emitters.areas[place];
            light.patch_count() <= FEW_PATCHES || light.extent(surfaces) <= SMALL_EXTENT * self.units.radius
        };
        let places = 0..emitters.areas.len();
        // Sample compact lights only if they are few: every pixel evaluates each of them.
        let few: Vec<usize> = places.clone().filter(|&place| !moves(place) && compact(place)).collect();
        if few.len() <= MOST_SAMPLED_SURFACES {
            places.filter(|&place| moves(place) || compact(place)).collect()
        } else {
            places.filter(|&place| moves(place)).collect()
        }
    }

    /// Returns the lights of constant intensity for the tree: area lights not in `sampled`, and the sky.
    fn lights_that_stay(&self, emitters: &Emitters, surfaces: &Surfaces, sampled: &[usize]) -> Vec<Light> {
        let luminance = render_core::luminance;
        let areas: Vec<_> = (0..emitters.areas.len()).filter(|place| !sampled.contains(place)).collect();
        // Divide the points between the surfaces in proportion to power.
        let power: f32 = areas.iter().map(|&place| luminance(emitters.areas[place].power())).sum();
        let mut lights = Vec::new();
        for place in areas {
            let area = &emitters.areas[place];
            let (least, most) = POINTS_OF_A_SURFACE;
            let by_power = EMITTER_POINTS * luminance(area.power()) / power.max(f32::MIN_POSITIVE);
            // Put a few points on each panel of a surface that consists of many small panels.
            let by_panels = (4 * area.patch_count()) as f32;
            let count = by_power.max(by_panels).clamp(least, most) as usize;
            lights.extend(area.samples(surfaces, count).into_iter().map(|sample| Light {
                position: sample.position.into(),
                emission: Emission::Cosine(sample.normal.into()),
                intensity: sample.intensity,
            }));
        }
        // Represent the sky by points on a dome far outside the scene.
        lights.extend(dome_lights(self.scene, &self.units, DOME_LIGHTS).into_iter().map(|light| Light {
            position: light.position.into(),
            emission: Emission::Omni,
            intensity: light.intensity,
        }));
        lights
    }
}
