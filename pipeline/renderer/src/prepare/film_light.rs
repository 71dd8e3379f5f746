//! Light that all frames, chunks and parts of a film have in common: ray trees of the meshes, anchors, photons, and the
//! lights of a static film.

use crate::plan::{Plan, Stage, State};
use crate::settings::{RenderSettings, Size};
use lighttree::LightTree;
use pipeline::error::{Context, Result};
use pipeline::figures::FrameFigures;
use pipeline::state::{NONSENSE, decode, encode};
use render_core::ranks::{Ranks, process_seconds};
use render_core::scene::{Pose, Scene};
use render_core::{
    Accelerator, AnchorFlux, AnchorSpread, Anchors, DirectLights, Emitters, FinalGather, Geometry, Guide, GuideSearch,
    Photons, PosedScene, Surfaces, SweptVolume, Timed, Units, ZoneSearch, Zones,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Maximum number of moments of the film that guide photons: a camera that walks for 10 s has seen most rooms on its
/// path.
const MOMENTS: u32 = 8;

/// Stages that change the lights between frames.
pub(super) const CHANGING: [Stage; 3] = [Stage::Photons, Stage::TreeUpdate, Stage::ObjectPlacing];

/// Light of a film, made once. It does not depend on the rendered range.
pub(super) struct FilmLight {
    pub geometry: Geometry,
    pub units: Units,
    /// Anchors; the bright anchors of frame 0 are split.
    pub anchors: Anchors,
    pub photons: Photons,
    pub first: FirstFrame,
    /// Whether every frame has the lights of frame 0.
    pub is_static: bool,
    /// Exposure of a film in chunks; `None` if it has not been computed.
    pub exposure: Option<f32>,
    /// CPU seconds of the anchors and of the photons of frame 0, for the report of the first prepared frame \[s\].
    pub pending: PendingFigures,
}

/// Results of frame 0 that the film may use again. Films with changing lights use them only for frame 0.
#[derive(Default)]
pub(super) struct FirstFrame {
    pub accelerator: Option<Arc<Accelerator>>,
    pub flux: Option<AnchorFlux>,
    pub lights: Option<Lights>,
    /// Light tree of a static film, from a file.
    pub tree: Option<Arc<LightTree>>,
}

/// Lights of a frame.
#[derive(Clone)]
pub(super) struct Lights {
    pub tree: Arc<LightTree>,
    pub direct: Arc<DirectLights>,
    pub gather: Arc<FinalGather>,
}

/// Work done before the first prepared frame, which reports it.
#[derive(Clone, Copy, Default)]
pub(super) struct PendingFigures {
    /// CPU seconds of the anchors.
    pub anchors: f64,
    /// CPU seconds of placing the objects of frame 0.
    pub update: f64,
    /// CPU seconds of the photons.
    pub photons: f64,
    /// CPU seconds of the light tree.
    pub tree: f64,
    /// Number of traced photons.
    pub photons_traced: u64,
}

impl PendingFigures {
    /// Adds the figures of work that no frame has reported.
    pub fn add(&mut self, figures: &FrameFigures) {
        self.anchors += figures.seconds.anchors;
        self.update += figures.seconds.update;
        self.photons += figures.seconds.photons;
        self.tree += figures.seconds.tree;
        self.photons_traced += figures.photons_traced;
    }
}

/// Film and ranks for which light is made.
pub(super) struct FilmInputs<'a> {
    pub scene: &'a Scene,
    pub settings: &'a RenderSettings,
    pub plan: &'a Plan,
    pub ranks: &'a Arc<dyn Ranks>,
    /// Whether light is needed everywhere, not only in the camera's views.
    pub everywhere: bool,
}

/// Light of a film with borrowed data, for serialization.
#[derive(Serialize)]
struct WrittenLight<'a> {
    anchors: &'a Anchors,
    photons: Photons,
    flux: Option<&'a AnchorFlux>,
    tree: Option<Vec<u8>>,
    exposure: Option<f32>,
}

/// Light of a film with owned data, for deserialization.
#[derive(Deserialize)]
struct ReadLight {
    anchors: Anchors,
    photons: Photons,
    flux: Option<AnchorFlux>,
    tree: Option<Vec<u8>>,
    exposure: Option<f32>,
}

impl FilmLight {
    /// Makes the light of a film. All ranks must call this function together.
    pub fn new(inputs: &FilmInputs) -> Self {
        let begin = process_seconds();
        let FilmInputs { scene, settings, plan, ranks, everywhere } = *inputs;
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
            let spread = AnchorSpread { zones: &zones, fixed: settings.vpls, dynamic, ranks: &**ranks };
            (Anchors::spread_exposed(&surfaces, &geometry, &units, &spread), settings.photons)
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

        // Split the anchors that are bright in frame 0.
        let is_static = is_static(plan);
        let pending = PendingFigures { anchors: process_seconds() - begin, ..PendingFigures::default() };
        let first = FirstFrame::default();
        let mut light = Self { geometry, units, anchors, photons, first, is_static, exposure: None, pending };
        light.light_first_frame(scene, settings);
        light
    }

    /// Traces the photons of frame 0, and splits the anchors that are bright there.
    fn light_first_frame(&mut self, scene: &Scene, settings: &RenderSettings) {
        if self.anchors.fixed.is_empty() {
            return;
        }
        let pose = scene.pose(settings.time(0));
        let surfaces = Surfaces::new(scene, &pose);
        let placed = Timed::of(|busy| busy.measure(|| Arc::new(self.geometry.place(&pose))));
        let accelerator = placed.value;
        let emitters = Emitters::new(&surfaces, &pose, &self.units);
        let posed = PosedScene::new(&accelerator, &surfaces);
        let traced = self.photons.trace(posed, &emitters, &self.anchors, &self.units);
        let mut flux = traced.value;
        self.anchors.split_bright(&flux.fixed);
        flux.fixed = self.anchors.fixed_flux(&flux.surfels[0], &flux.moved);
        (self.pending.update, self.pending.photons) = (placed.seconds, traced.seconds);
        self.pending.photons_traced = flux.traced;
        self.first = FirstFrame { accelerator: Some(accelerator), flux: Some(flux), ..FirstFrame::default() };
    }

    /// Returns the light as bytes, for [`from_bytes`](Self::from_bytes). Before frame 0 or the frames of a static film
    /// are lit, it lacks their lights.
    pub fn to_bytes(&self) -> Vec<u8> {
        let lights = self.first.lights.as_ref().filter(|_| self.is_static);
        encode(&WrittenLight {
            anchors: &self.anchors,
            photons: self.photons.for_storage(),
            flux: self.first.flux.as_ref(),
            tree: lights.map(|lights| lights.tree.to_bytes()),
            exposure: self.exposure,
        })
    }

    /// Reads the light of the film from the result of [`to_bytes`](Self::to_bytes).
    ///
    /// # Errors
    /// If the bytes are not the light of a film.
    pub fn from_bytes(bytes: &[u8], inputs: &FilmInputs) -> Result<Self> {
        let begin = process_seconds();
        let ReadLight { anchors, photons, flux, tree, exposure } = decode(bytes)?;
        let tree = tree.map(|tree| LightTree::from_bytes(&tree)).transpose().context(NONSENSE)?.map(Arc::new);
        let first = FirstFrame { flux, tree, ..FirstFrame::default() };
        let light = Self {
            geometry: Geometry::new(inputs.scene),
            units: Units::of(inputs.scene),
            anchors,
            photons: photons.with_ranks(inputs.ranks.clone()),
            first,
            is_static: is_static(inputs.plan),
            exposure,
            pending: PendingFigures::default(),
        };
        let pending = PendingFigures { anchors: process_seconds() - begin, ..PendingFigures::default() };
        Ok(Self { pending, ..light })
    }

    /// Returns whether the results of frame 0 hold for frame `n`.
    pub fn is_lit_as_first(&self, n: u32) -> bool {
        self.is_static || n == 0
    }
}

/// Returns whether every frame of the planned film has the same lights.
fn is_static(plan: &Plan) -> bool {
    CHANGING.iter().all(|&stage| plan.state(stage) != State::On)
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
