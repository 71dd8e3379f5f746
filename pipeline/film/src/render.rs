//! Films of scenes: this crate's renderer, masking model and encoder in the loop.

use crate::error::Result;
use crate::job::sum_of_inputs;
use crate::light_file;
use crate::report::{Ending, Report};
use crate::settings::Settings;
use crate::shading::exposure_of_chunks;
#[cfg(feature = "bake")]
use crate::shading::{read_baked, with_baked};
use crate::stages::{Display, Masking, Video};
use pipeline::checkpoint::Checkpoints;
use pipeline::team::{Lead, Team};
use pipeline::{Run, Stages, Start, couple, follow};
use render_core::scene::Scene;
use renderer::plan::{Plan, Stage};
use renderer::settings::Aov;
use renderer::{Crew, Preparation, Shading, SimulatedRanks, exposure_of_lit_frames};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

#[cfg(feature = "bake")]
use renderer::baked_light::BakedLight;

/// Film that is ready for rendering, from the first frame or from a checkpoint.
#[derive(Debug)]
pub struct Render<'a> {
    scene: &'a Scene,
    settings: &'a Settings,
    plan: &'a Plan,
    stages: Stages<Preparation<'a>, Shading<'a>, Display, Masking, Video>,
    #[cfg(feature = "bake")]
    baked: Option<BakedLight>,
    start: Start<'a>,
    begin: Instant,
    /// Whether the light of the film was read from a file.
    has_read_light: bool,
}

impl<'a> Render<'a> {
    /// Prepares the film from its first frame or from `checkpoints`. Files are changed only after the whole checkpoint
    /// has been read.
    ///
    /// # Errors
    /// If no encoder supports the settings, the checkpoint is invalid, or a file of uncompressed frames cannot be
    /// written.
    pub fn new(scene: &'a Scene, settings: &'a Settings, plan: &'a Plan, checkpoints: &'a Checkpoints) -> Result<Self> {
        Self::among(scene, settings, plan, checkpoints, &Team::alone())
    }

    /// Prepares the film like [`new`](Self::new), on rank 0 of a `team` that shares the work of each frame. The other
    /// ranks call [`follow`](Self::follow). The film's bytes do not depend on the number of ranks.
    ///
    /// # Errors
    /// Returns the errors of [`new`](Self::new). The other ranks then end.
    pub fn among(
        scene: &'a Scene,
        settings: &'a Settings,
        plan: &'a Plan,
        checkpoints: &'a Checkpoints,
        team: &Team,
    ) -> Result<Self> {
        let begin = Instant::now();
        // Create the lead first: if a later step fails, dropping the lead notifies the other ranks.
        let lead = Lead::of(team.shade.clone());
        let masks = plan.is_on(Stage::Masking);
        let light = LightStages::new(scene, settings, plan, team)?;
        let mut stages = Stages {
            prepare: light.prepare,
            shade: light.shade,
            display: Display::of(settings)?,
            encode: Video::new(settings)?,
            mask: masks.then(|| Masking::new(settings)).transpose()?,
        };
        // Restore the stages from the checkpoint, or prepare them for the first frame.
        let start = stages.begin_among(settings.frame_range().start, checkpoints, lead)?;
        Ok(Self {
            scene,
            settings,
            plan,
            stages,
            #[cfg(feature = "bake")]
            baked: light.baked,
            start,
            begin,
            has_read_light: light.is_read,
        })
    }

    /// Shares the work of a film that rank 0 of the `team` makes. All other ranks must call this function. It writes no
    /// files and blocks until rank 0 ends.
    ///
    /// # Errors
    /// If the baked light cannot be read, a checkpoint is invalid, or the ranks computed different light.
    pub fn follow(scene: &'a Scene, settings: &'a Settings, plan: &'a Plan, team: &Team) -> Result<()> {
        let LightStages { prepare, shade, .. } = LightStages::new(scene, settings, plan, team)?;
        Ok(follow(prepare, shade, team)?)
    }

    /// Opens the film's file. Without a file, the bytes are passed only to the observer.
    ///
    /// # Errors
    /// If the file cannot be written, or is shorter than at the checkpoint.
    pub fn write_to(&mut self, path: &Path) -> Result<()> {
        Ok(self.start.write_to(path)?)
    }

    /// Returns a function that ends the film's file at once, from any thread, with the frames written so far. The
    /// function returns true if the file has frames; [`finish`](Self::finish) then fails. Returns `None` before
    /// [`write_to`](Self::write_to).
    #[must_use]
    pub fn early_end(&self) -> Option<impl Fn() -> Result<bool> + Send + 'static> {
        let end = self.start.early_end()?;
        Some(move || Ok(end.end()?))
    }

    /// Passes the channels `aov` of each frame to observers, in [`Shaded::watched`](pipeline::stage::Shaded::watched).
    /// These channels are not written to files.
    pub fn watch(&mut self, aov: &[Aov]) {
        self.stages.shade.watch(aov);
    }

    /// Makes this process simulate several ranks: it shades their tiles in sequence, and records simulated times.
    pub fn simulate(&mut self, ranks: SimulatedRanks) {
        self.stages.shade.set_crew(Crew::Simulated(ranks));
    }

    /// Returns the first frame that is not finished yet.
    #[must_use]
    pub fn first_frame(&self) -> u32 {
        self.start.first_frame()
    }

    /// Makes the film, and returns its report. Blocks until the film is finished.
    ///
    /// # Errors
    /// Returns the first error of a stage: a file cannot be written, or the stage has a bug.
    pub fn finish(mut self, run: Run<'_>) -> Result<Report> {
        // Set the exposure in advance if the first frame must not determine it.
        if let Some(exposure) = self.exposure_before() {
            self.stages.display.set_exposure(exposure);
        }
        self.write_light()?;

        // Store a checksum of the inputs, so that `join` refuses parts made from other files.
        let inputs = Some(sum_of_inputs(self.scene, self.settings)?);
        let Self { scene, settings, plan, stages, start, begin, .. } = self;
        let reports = couple(stages, start, run)?;
        // Report an interruption only if frames are missing: `stop` may be set after the last frame.
        let interrupted = run.stop.load(Ordering::Relaxed) && reports.len() < settings.frame_range().len();
        let ending = Ending { interrupted, wall_seconds: begin.elapsed().as_secs_f64() };
        Ok(Report { inputs, ..Report::new(scene, settings, plan.steps(), reports, ending) })
    }

    /// Returns the exposure to set before the first frame, if needed. Films in independent chunks have the exposure of
    /// their light. For other films, it is the exposure of the lit frames if the first frame is not representative. A
    /// resumed film already has its exposure.
    fn exposure_before(&mut self) -> Option<f32> {
        let Self { scene, settings, stages, start, .. } = self;
        // Keep an exposure that is constant, or that the checkpoint restored.
        let begins = start.first_frame() == settings.frame_range().start;
        if !settings.render.auto_exposure || !begins {
            return None;
        }
        if !settings.is_in_chunks() {
            return exposure_of_lit_frames(scene, &settings.render);
        }

        // Use one exposure for all chunks, because no chunk may depend on an earlier one.
        let known = stages.prepare.exposure();
        let exposure = known.unwrap_or_else(|| {
            start.make_ready(&mut stages.prepare);
            exposure_of_chunks(&mut stages.prepare, scene, settings, |settings, plan| {
                let shading = Shading::new(settings, plan);
                #[cfg(feature = "bake")]
                let shading = with_baked(shading, self.baked.as_ref());
                shading
            })
        });
        stages.prepare.set_exposure(exposure);
        Some(exposure)
    }

    /// Writes the light of the film to the file that the settings name, unless it was read from there.
    fn write_light(&mut self) -> Result<()> {
        let Self { scene, settings, stages, .. } = self;
        let Some(path) = settings.files.light.as_deref().filter(|_| !self.has_read_light) else { return Ok(()) };
        self.start.make_ready(&mut stages.prepare);
        let light = stages.prepare.film_light();
        light_file::write(scene, settings, path, light)
    }
}

/// Stages that compute light, needed on every rank.
struct LightStages<'a> {
    prepare: Preparation<'a>,
    shade: Shading<'a>,
    #[cfg(feature = "bake")]
    baked: Option<BakedLight>,
    /// Whether the light of the film was read from a file.
    is_read: bool,
}

impl<'a> LightStages<'a> {
    fn new(scene: &'a Scene, settings: &'a Settings, plan: &'a Plan, team: &Team) -> Result<Self> {
        let renderer = settings.render.clone();
        let mut shade = Shading::among(&renderer, plan, team.shade.clone());
        // Divide the shading of each frame among the ranks of the team.
        shade.set_crew(Crew::Ranks(team.mail.clone(), team.shade.clone()));
        // Read the baked light once: shading and the exposure of chunks share it.
        #[cfg(feature = "bake")]
        let baked = read_baked(scene, settings)?;
        #[cfg(feature = "bake")]
        let shade = with_baked(shade, baked.as_ref());

        // Read the light of the film if a file contains it.
        let light = light_file::read(scene, settings)?;
        let prepare = Preparation::among(scene, &renderer, plan, team.prepare.clone());
        let is_read = light.is_some();
        let prepare = match light {
            Some(light) => prepare.with_film_light(&light)?,
            None => prepare,
        };
        Ok(Self {
            prepare,
            shade,
            #[cfg(feature = "bake")]
            baked,
            is_read,
        })
    }
}

/// Renders `scene` into the output file of `settings`, without checkpoints, and returns the report.
///
/// To choose the number of threads, call this function inside a rayon pool.
///
/// # Errors
/// Returns the errors of [`Render::new`], [`Render::write_to`] and [`Render::finish`].
pub fn render(scene: &Scene, settings: &Settings, plan: &Plan, run: Run<'_>) -> Result<Report> {
    let checkpoints = Checkpoints::off();
    let mut film = Render::new(scene, settings, plan, &checkpoints)?;
    film.write_to(&settings.output)?;
    film.finish(run)
}
