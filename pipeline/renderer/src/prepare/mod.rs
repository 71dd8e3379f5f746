//! First half of the renderer: all work that needs no thresholds (object poses, photons, light tree, primary rays,
//! motion).

mod film_light;
mod lights;

use super::frame::{Frame, Moment, PreparedFrame};
use crate::plan::{Plan, Stage, State};
use crate::settings::{RenderSettings, Size};
use film_light::{FilmInputs, FilmLight, Lights};
#[cfg(feature = "bake")]
pub(crate) use lights::sampled_areas;
use lighttree::LightTree;
use pipeline::chunks::begins_chunk;
use pipeline::error::{Context, Result};
use pipeline::figures::FrameFigures;
use pipeline::stage::{Prepare, Prepared};
use pipeline::state::NONSENSE;
use plane::Correspondence;
use render_core::ranks::{Alone, Ranks};
use render_core::scene::{Pose, Scene, View};
use render_core::{Accelerator, Busy, DirectLights, FinalGather, GBuffer, PixelSample, PosedScene, Surfaces};
use std::sync::Arc;

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
    /// Creates the preparation stage for a film of `scene`, for a single process.
    #[must_use]
    pub fn new(scene: &'s Scene, settings: &RenderSettings, plan: &'s Plan) -> Self {
        Self::among(scene, settings, plan, Arc::new(Alone))
    }

    /// Creates the preparation stage for a film of `scene` on several `ranks`, which share the work and prepare the
    /// same frames.
    #[must_use]
    pub fn among(scene: &'s Scene, settings: &RenderSettings, plan: &'s Plan, ranks: Arc<dyn Ranks>) -> Self {
        Self { scene, settings: settings.clone(), plan, ranks, everywhere: false, work: None }
    }

    /// Prepares light for all viewpoints: the camera does not guide photons.
    #[must_use]
    pub fn everywhere(self) -> Self {
        Self { everywhere: true, ..self }
    }

    /// Continues with the light of the film, from the bytes of [`film_light`](Self::film_light) of any run with the
    /// same scene and settings.
    ///
    /// # Errors
    /// If the bytes are not the light of a film.
    pub fn with_film_light(mut self, bytes: &[u8]) -> Result<Self> {
        let light = FilmLight::from_bytes(bytes, &self.inputs())?;
        self.work = Some(self.state_with(light));
        Ok(self)
    }

    /// Returns the light that all ranges and chunks of the film have in common, as bytes.
    pub fn film_light(&mut self) -> Vec<u8> {
        self.work().light.to_bytes()
    }

    /// Returns the exposure stored with the light of the film; `None` if it was not computed.
    #[must_use]
    pub fn exposure(&self) -> Option<f32> {
        self.work.as_ref()?.light.exposure
    }

    /// Stores the exposure of a film in chunks with the light of the film.
    pub fn set_exposure(&mut self, exposure: f32) {
        self.work().light.exposure = Some(exposure);
    }

    /// Prepares frame `index`, in any order of frames. Motion refers to the previously prepared frame.
    pub fn frame(&mut self, index: u32) -> PreparedFrame<'s> {
        self.work().frame(index)
    }

    /// Prepares frame `index` at a `moment` of the caller's choice, at any time and from any view. Frames are numbered
    /// from 0 without gaps. Motion refers to the previously prepared frame.
    ///
    /// Frame 0 has the lights of the film's first frame, so its time should be the time of that frame. The plan should
    /// be [`Plan::with_free_camera`].
    pub fn frame_at(&mut self, index: u32, moment: Moment) -> PreparedFrame<'s> {
        self.work().frame_at(index, moment)
    }

    /// Prepares frame 0 at another size, before the frames of the film. The light is the light of the film. Other ranks
    /// do not take part: with several ranks, call [`make_ready`](Prepare::make_ready) on all of them first.
    pub fn frame_0_of_size(&mut self, size: Size) -> PreparedFrame<'s> {
        self.make_ready();
        let work = self.work();
        let own_size = std::mem::replace(&mut work.settings.size, size);
        let own_ranks = std::mem::replace(&mut work.ranks, Arc::new(Alone));
        let prepared = work.frame(0);
        (work.settings.size, work.ranks) = (own_size, own_ranks);
        // Report the light with the first frame of the film, which has no previous frame.
        work.light.pending.add(&prepared.figures);
        work.kept = None;
        prepared
    }

    /// Returns the scene of the film.
    pub(crate) fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// Returns the settings of the film.
    pub(crate) fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    fn inputs(&self) -> FilmInputs<'_> {
        let Self { scene, settings, plan, ranks, everywhere, .. } = self;
        FilmInputs { scene, settings, plan, ranks, everywhere: *everywhere }
    }

    fn state_with(&self, light: FilmLight) -> PrepareState<'s> {
        let Self { scene, settings, plan, ranks, .. } = self;
        PrepareState { scene, settings: settings.clone(), plan, ranks: ranks.clone(), light, tree: None, kept: None }
    }

    /// Returns the state, with the light of the film.
    fn work(&mut self) -> &mut PrepareState<'s> {
        if self.work.is_none() {
            let work = self.state_with(FilmLight::new(&self.inputs()));
            self.work = Some(work);
        }
        self.work.as_mut().expect("it was just made")
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
        if begins_chunk(self.settings.chunk, index)
            && let Some(work) = &mut self.work
        {
            // A chunk starts from a clean state; the light of the film is the same for all chunks.
            (work.tree, work.kept) = (None, None);
        }
        (index < self.settings.end).then(|| self.frame(index))
    }

    /// Makes the light of the film, and the lights of frame 0.
    fn make_ready(&mut self) {
        let work = self.work();
        if work.light.first.lights.is_none() && work.kept.is_none() {
            work.light_frame_0();
        }
    }

    /// Returns the light tree as bytes.
    fn state(&self) -> Vec<u8> {
        let kept = self.work.as_ref().and_then(|work| work.kept.as_ref());
        kept.map_or_else(Vec::new, |kept| kept.tree.to_bytes())
    }

    fn restore(&mut self, state: &[u8], last: u32) -> Result<PreparedFrame<'s>> {
        // Restore only the tree: all other state is computed again from frame `last`.
        let tree = LightTree::from_bytes(state).context(NONSENSE)?;
        let work = self.work();
        work.tree = Some(Arc::new(tree));
        Ok(work.frame(last))
    }
}

/// State of preparation between frames.
struct PrepareState<'s> {
    scene: &'s Scene,
    settings: RenderSettings,
    plan: &'s Plan,
    /// Ranks that share the work.
    ranks: Arc<dyn Ranks>,
    light: FilmLight,
    /// Light tree of a checkpoint, used instead of a new tree in the first frame.
    tree: Option<Arc<LightTree>>,
    kept: Option<Kept>,
}

struct Kept {
    /// Time of the frame \[s\].
    time: f32,
    accelerator: Arc<Accelerator>,
    direct: Arc<DirectLights>,
    tree: Arc<LightTree>,
    gather: Arc<FinalGather>,
    seen: Arc<GBuffer>,
    /// Correspondence of a static view with itself, computed only once.
    of_itself: Option<Arc<Correspondence>>,
}

impl Kept {
    /// Returns whether the frame shows the scene at `time` from `view`.
    fn shows(&self, time: f32, view: &View) -> bool {
        self.time == time && self.seen.view == *view
    }
}

/// The scene in the pose of a frame.
#[derive(Clone, Copy)]
struct PlacedScene<'a> {
    /// Frame number.
    frame: u32,
    /// Time in the scene's animation \[s\].
    time: f32,
    pose: &'a Pose,
    surfaces: &'a Surfaces<'a>,
    accelerator: &'a Accelerator,
}

impl<'s> PrepareState<'s> {
    fn frame(&mut self, n: u32) -> PreparedFrame<'s> {
        self.frame_at(n, Moment { time: self.settings.time(n), view: None })
    }

    fn frame_at(&mut self, n: u32, Moment { time, view }: Moment) -> PreparedFrame<'s> {
        // Place the objects if any object moves.
        let mut figures = FrameFigures::default();
        let pose = self.scene.pose(time);
        let surfaces = Surfaces::new(self.scene, &pose);
        let accelerator = self.placed(n, time, &pose, &mut figures);

        // Trace photons to the anchors.
        let lights = tracing::debug_span!("lights", frame = n).entered();
        let placed = PlacedScene { frame: n, time, pose: &pose, surfaces: &surfaces, accelerator: &accelerator };
        let Lights { tree, direct, gather } = self.lights(placed, &mut figures);
        drop(lights);

        // Trace primary rays to the visible surfaces.
        let _rays = tracing::debug_span!("primary rays and motion", frame = n).entered();
        let busy = Busy::default();
        let Size { width, height } = self.settings.size;
        let view = view.unwrap_or_else(|| self.view(&pose));
        let seen = match &self.kept {
            Some(kept) if !self.plan.runs(Stage::PrimaryRays, n) || kept.shows(time, &view) => kept.seen.clone(),
            _ => {
                let scene = PosedScene::new(&accelerator, &surfaces);
                let traced = GBuffer::trace_among(PixelSample::WHOLE, scene, &view, (width, height), &*self.ranks);
                Arc::new(busy.take(traced))
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
        let kept = Kept { time, accelerator, direct, tree, gather, seen, of_itself };
        let frame = Frame {
            index: n,
            surfaces,
            accelerator: kept.accelerator.clone(),
            direct: kept.direct.clone(),
            tree: kept.tree.clone(),
            gather: kept.gather.clone(),
            seen: kept.seen.clone(),
            epsilon: self.light.units.epsilon,
        };
        self.kept = Some(kept);
        Prepared { frame, correspondence, forward, figures }
    }

    /// Returns the view of the scene's filming camera in `pose`.
    fn view(&self, pose: &Pose) -> View {
        let Size { width, height } = self.settings.size;
        self.scene.view(pose, width, height).with_pixel_aspect(self.settings.pixel_aspect)
    }

    /// Returns the ray tree of the scene in `pose` of frame `n` at `time`.
    fn placed(&mut self, n: u32, time: f32, pose: &Pose, figures: &mut FrameFigures) -> Arc<Accelerator> {
        let is_placed = |kept: &&Kept| kept.time == time || !self.plan.runs(Stage::ObjectPlacing, n);
        if let Some(kept) = self.kept.as_ref().filter(is_placed) {
            return kept.accelerator.clone();
        }
        // Reuse the tree of frame 0 if it is in the same pose.
        let is_same = n == 0 || self.plan.state(Stage::ObjectPlacing) != State::On;
        if let Some(accelerator) = self.light.first.accelerator.as_ref().filter(|_| is_same) {
            return accelerator.clone();
        }
        let busy = Busy::default();
        let accelerator = busy.measure(|| Arc::new(self.light.geometry.place(pose)));
        figures.seconds.update = busy.seconds();
        accelerator
    }

    /// Computes the lights of frame 0, as part of the film's light.
    fn light_frame_0(&mut self) {
        let mut figures = FrameFigures::default();
        let time = self.settings.time(0);
        let pose = self.scene.pose(time);
        let surfaces = Surfaces::new(self.scene, &pose);
        let accelerator = self.placed(0, time, &pose, &mut figures);
        let placed = PlacedScene { frame: 0, time, pose: &pose, surfaces: &surfaces, accelerator: &accelerator };
        self.light.first.lights = Some(self.lights(placed, &mut figures));
        // Report the cost with the first frame of the film.
        self.light.pending.add(&figures);
    }
}
