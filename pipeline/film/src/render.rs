//! A film of a scene: this crate's renderer, masking and encoder in the loop.

use crate::error::Result;
use crate::job::sum_of_inputs;
use crate::report::{Ending, Report};
use crate::settings::Settings;
use crate::stages::{Display, Masking, Video};
use pipeline::checkpoint::Checkpoints;
use pipeline::team::{Lead, Team};
use pipeline::{Parts, Run, Start, couple, follow};
use render_core::scene::Scene;
use renderer::plan::{Plan, Stage};
use renderer::settings::Aov;
use renderer::{Crew, Preparation, Shading, SimulatedRanks, exposure_of_first_frame, exposure_of_lit_frames};
use std::path::Path;
#[cfg(feature = "bake")]
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

#[cfg(feature = "bake")]
use renderer::texels::BakedTexels;

/// A film that is ready to be made, from its beginning or from a checkpoint.
#[derive(Debug)]
pub struct Render<'a> {
    scene: &'a Scene,
    settings: &'a Settings,
    plan: &'a Plan,
    parts: Parts<Preparation<'a>, Shading<'a>, Display, Masking, Video>,
    #[cfg(feature = "bake")]
    baked: Option<Arc<BakedTexels>>,
    start: Start<'a>,
    begin: Instant,
}

impl<'a> Render<'a> {
    /// Brings the film to where `checkpoints` say. No file is changed before all of a checkpoint is read.
    ///
    /// # Errors
    /// The settings fit no encoder, the checkpoint makes no sense, or a file of uncompressed frames cannot be written.
    pub fn new(scene: &'a Scene, settings: &'a Settings, plan: &'a Plan, checkpoints: &'a Checkpoints) -> Result<Self> {
        Self::among(scene, settings, plan, checkpoints, &Team::alone())
    }

    /// As [`new`](Self::new), on rank 0 of a `team` whose other ranks [`follow`](Self::follow). They share the work on each frame;
    /// the bytes are those of one process.
    ///
    /// # Errors
    /// Errors of [`new`](Self::new). The other ranks end then.
    pub fn among(
        scene: &'a Scene,
        settings: &'a Settings,
        plan: &'a Plan,
        checkpoints: &'a Checkpoints,
        team: &Team,
    ) -> Result<Self> {
        let begin = Instant::now();
        // First of all: whatever fails below, the others are told.
        let lead = Lead::of(team.shade.clone());
        let masks = plan.is_on(Stage::Masking);
        let light = LightParts::new(scene, settings, plan, team)?;
        let mut parts = Parts {
            prepare: light.prepare,
            shade: light.shade,
            display: Display::of(settings)?,
            encode: Video::new(settings)?,
            mask: masks.then(|| Masking::new(settings)).transpose()?,
        };
        let start = parts.begin_among(settings.frame_range().start, checkpoints, lead)?;
        Ok(Self {
            scene,
            settings,
            plan,
            parts,
            #[cfg(feature = "bake")]
            baked: light.baked,
            start,
            begin,
        })
    }

    /// Shares the work on a film that rank 0 of the `team` makes, on any other rank, and writes nothing. Blocks until rank 0 ends.
    ///
    /// # Errors
    /// The baked light cannot be read, a checkpoint makes no sense, or ranks have found different light.
    pub fn follow(scene: &'a Scene, settings: &'a Settings, plan: &'a Plan, team: &Team) -> Result<()> {
        let LightParts { prepare, shade, .. } = LightParts::new(scene, settings, plan, team)?;
        Ok(follow(prepare, shade, team)?)
    }

    /// Opens the file of the film. Without one, its bytes go only to the observer.
    ///
    /// # Errors
    /// The file cannot be written, or is shorter than at the checkpoint.
    pub fn write_to(&mut self, path: &Path) -> Result<()> {
        Ok(self.start.write_to(path)?)
    }

    /// Ends the film's file when it is called, from any thread and at once, as a film of the frames written until then; it tells
    /// whether there are any. What goes on in [`finish`](Self::finish) then fails. `None` before [`write_to`](Self::write_to).
    #[must_use]
    pub fn early_end(&self) -> Option<impl Fn() -> Result<bool> + Send + 'static> {
        let end = self.start.early_end()?;
        Some(move || Ok(end.end()?))
    }

    /// Lets observers see these channels of each frame, in [`Shaded::watched`](pipeline::parts::Shaded::watched); no file has them.
    pub fn watch(&mut self, aov: &[Aov]) {
        self.parts.shade.watch(aov);
    }

    /// Lets this process stand for several ranks that take tiles, one after the other; they note how long they would take.
    pub fn simulate(&mut self, ranks: SimulatedRanks) {
        self.parts.shade.set_crew(Crew::Simulated(ranks));
    }

    /// The first frame that is still to be made.
    #[must_use]
    pub fn first_frame(&self) -> u32 {
        self.start.first_frame()
    }

    /// Makes the film and reports what it took. Blocks until all is done.
    ///
    /// # Errors
    /// The first failure of a stage: a file that cannot be written, or a fault of this program.
    pub fn finish(mut self, run: Run<'_>) -> Result<Report> {
        if let Some(exposure) = self.exposure_before() {
            self.parts.display.set_exposure(exposure);
        }
        let inputs = Some(sum_of_inputs(self.scene, self.settings)?);
        let Self { scene, settings, plan, parts, start, begin, .. } = self;
        let reports = couple(parts, start, run)?;
        let interrupted = run.stop.load(Ordering::Relaxed) && reports.len() < settings.frame_range().len();
        let ending = Ending { interrupted, wall_seconds: begin.elapsed().as_secs_f64() };
        Ok(Report { inputs, ..Report::new(scene, settings, plan.steps(), reports, ending) })
    }

    /// The exposure that a film has before its first frame: of its lit frames, where the first is no measure of them; else of a small
    /// first frame for a film in chunks, none of which may depend on another's frames. One that is continued has its exposure.
    fn exposure_before(&self) -> Option<f32> {
        let Self { scene, settings, start, .. } = self;
        let begins = start.first_frame() == settings.frame_range().start;
        if !settings.render.auto_exposure || !begins {
            return None;
        }
        let of_lit_frames = exposure_of_lit_frames(scene, &settings.render);
        of_lit_frames.or_else(|| settings.is_in_chunks().then(|| self.exposure_of_chunks()))
    }

    fn exposure_of_chunks(&self) -> f32 {
        let Self { scene, settings, .. } = self;
        exposure_of_first_frame(scene, &settings.render, |settings, plan| {
            let shading = Shading::new(settings, plan);
            #[cfg(feature = "bake")]
            let shading = with_baked(shading, self.baked.as_ref());
            shading
        })
    }
}

/// The parts that make light, which every rank has.
struct LightParts<'a> {
    prepare: Preparation<'a>,
    shade: Shading<'a>,
    #[cfg(feature = "bake")]
    baked: Option<Arc<BakedTexels>>,
}

impl<'a> LightParts<'a> {
    fn new(scene: &'a Scene, settings: &'a Settings, plan: &'a Plan, team: &Team) -> Result<Self> {
        let renderer = settings.render.clone();
        let mut shade = Shading::among(&renderer, plan, team.shade.clone());
        shade.set_crew(Crew::Ranks(team.mail.clone(), team.shade.clone()));
        #[cfg(feature = "bake")]
        let baked =
            settings.files.baked.as_deref().map(|path| renderer::bake::read(scene, path)).transpose()?.map(Arc::new);
        #[cfg(feature = "bake")]
        let shade = with_baked(shade, baked.as_ref());
        Ok(Self {
            prepare: Preparation::among(scene, &renderer, plan, team.prepare.clone()),
            shade,
            #[cfg(feature = "bake")]
            baked,
        })
    }
}

#[cfg(feature = "bake")]
fn with_baked<'a>(shading: Shading<'a>, baked: Option<&Arc<BakedTexels>>) -> Shading<'a> {
    match baked {
        Some(baked) => shading.with_baked(baked.clone()),
        None => shading,
    }
}

/// Renders `scene` into the file that `settings` name, without checkpoints, and reports the cost.
///
/// The caller chooses the threads that rayon may use by installing a pool.
///
/// # Errors
/// Errors of [`Render::new`], [`Render::write_to`] and [`Render::finish`].
pub fn render(scene: &Scene, settings: &Settings, plan: &Plan, run: Run<'_>) -> Result<Report> {
    let checkpoints = Checkpoints::off();
    let mut film = Render::new(scene, settings, plan, &checkpoints)?;
    film.write_to(&settings.output)?;
    film.finish(run)
}
