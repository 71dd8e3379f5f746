//! Baked light: the light of static surfaces, computed once and sampled by films.
//!
//! [`bake`] computes the light of an atlas's texels, and [`bake_keys`] that of moving lamps. [`read`] loads it for a film
//! of the same scene. [`export`] paints the light into a copy of the scene. [`view`] creates a page that shows the scene
//! in a browser.

mod blocks;
mod coats;
mod estimate;
pub mod export;
mod file;
mod fingerprint;
mod inside;
mod keys;
mod light;
mod loops;
mod normals;
mod roughest;
mod seams;
mod stored;
pub mod view;

use crate::plan::{Plan, Stage, lamp_moves, moving_lamps};
use crate::settings::{RenderSettings, Size};
use crate::texels::BakedTexels;
use crate::{GATHER_RAYS, Preparation, Visibility};
pub use estimate::{BakeEstimate, estimate};
pub use file::SectionFile;
pub use fingerprint::fingerprint;
use glam::Vec3;
use inside::Places;
pub use keys::{KeyedBake, KeyedResolution, bake_keys};
pub use loops::{BakeCheckpoint, BakeRun};
use loops::{BakeLoops, LoopEnd};
use pipeline::error::{Error, Result};
use render_core::scene::Scene;
use render_core::{Atlas, Surfaces};
use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
pub use stored::read;

/// Baked light and statistics of its computation.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Bake {
    /// Light of the texels.
    pub texels: BakedTexels,
    /// Number of texels inside geometry; each has the mean light of its neighbors.
    pub filled: usize,
    /// Wall-clock time for the light of coats \[s\].
    pub coat_seconds: f64,
    /// Number of texels, counted once per pass.
    work: usize,
}

/// Number of narrow charts, on which details of light are lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NarrowCharts {
    /// Number of charts narrower than two texels.
    pub count: usize,
    /// Number of texels that halves `count`, unless that exceeds the limit of an atlas.
    pub texels_for_half: Option<usize>,
}

/// Computes the light of about `texels` texels on the static surfaces of `scene`, or of as many as [`Atlas::automatic`]
/// chooses if `texels` is `None`. `progress` is called with the work done and the total work. Equal scenes and settings produce equal bits for any number of threads and ranks. Returns `None`
/// if the `run` was stopped.
///
/// # Errors
/// If the scene cannot be baked, because a lamp moves or no surface is static. If the checkpoint is invalid or cannot be
/// written.
pub fn bake(
    scene: &Scene,
    settings: &RenderSettings,
    texels: impl Into<Option<usize>>,
    run: &BakeRun,
    progress: &dyn Fn(usize, usize),
) -> Result<Option<Bake>> {
    match bake_all(scene, settings, texels.into(), run, progress) {
        Ok(bake) => Ok(Some(bake)),
        Err(LoopEnd::Stopped) => Ok(None),
        Err(LoopEnd::Failed(error)) => Err(error),
    }
}

/// Computes the light of all texels, unless the `run` is stopped.
fn bake_all(
    scene: &Scene,
    settings: &RenderSettings,
    texels: Option<usize>,
    run: &BakeRun,
    progress: &dyn Fn(usize, usize),
) -> Result<Bake, LoopEnd> {
    // Reject moving lamps: their light is not constant.
    if lamp_moves(scene) {
        let text = "the light of this scene cannot be baked at one time because a lamp moves; add --keys 9";
        return Err(Error::Options(text.into()).into());
    }
    let mut loops = BakeLoops::new(run)?;
    BakedScene::new(scene, settings, texels)?.light_at(0.0, Extent::Whole, &mut loops, progress)
}

/// Extent of a bake.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Extent {
    /// Light of all surfaces.
    Whole,
    /// Light of matte surfaces, without normal maps.
    Matte,
}

/// A scene with texels on its static surfaces.
struct BakedScene<'a> {
    scene: &'a Scene,
    /// The scene without moving instances, except lamps.
    still: Scene,
    /// Index in the scene of each instance of `still`.
    instances: Vec<u32>,
    settings: RenderSettings,
    atlas: Arc<Atlas>,
}

impl<'a> BakedScene<'a> {
    /// Lays out the texels on the static surfaces.
    fn new(scene: &'a Scene, settings: &RenderSettings, texels: Option<usize>) -> Result<Self> {
        let pose = scene.pose(0.0);
        let surfaces = Surfaces::new(scene, &pose);
        let atlas = match texels {
            Some(texels) => Atlas::new(&surfaces, texels),
            None => Atlas::automatic(&surfaces),
        };
        // Omit moving instances: their shadows and reflections would be valid for only one moment of the film.
        let instances = lit_instances(scene);
        let mut still = scene.clone();
        still.instances = instances.iter().map(|&instance| scene.instances[instance as usize]).collect();
        let settings = RenderSettings {
            size: Size { width: 16, height: 16 },
            frames: 1,
            every: 1,
            cache: false,
            aov: Vec::new(),
            ..settings.clone()
        };
        Ok(Self { scene, still, instances, settings, atlas: Arc::new(atlas.map_err(Error::other)?) })
    }

    /// Returns the settings of a film whose first frame is at a `time` \[s\].
    fn settings_at(&self, time: f32) -> RenderSettings {
        let (from, fps) = if time > 0.0 { (1, 1.0 / f64::from(time)) } else { (0, self.settings.fps) };
        RenderSettings { from, fps, ..self.settings.clone() }
    }

    /// Computes the light at a `time` \[s\], unless the run is stopped. `progress` is called with the work done, and
    /// with the total work.
    fn light_at(
        &self,
        time: f32,
        extent: Extent,
        loops: &mut BakeLoops,
        progress: &dyn Fn(usize, usize),
    ) -> Result<Bake, LoopEnd> {
        let (atlas, settings) = (&*self.atlas, self.settings_at(time));
        let pose = self.scene.pose(time);
        let surfaces = Surfaces::new(self.scene, &pose);
        let plan = Plan::new(&self.still, &settings);
        let frame = Preparation::among(&self.still, &settings, &plan, loops.ranks()).everywhere().frame(0).frame;

        // Count each texel once per pass; the last passes cover only normal maps and coats.
        let compensates = plan.is_on(Stage::Compensation);
        let visibility = Visibility::new(&frame, GATHER_RAYS);
        let places = Places { atlas, surfaces: &surfaces, frame: &frame, visibility: &visibility };
        let (points, is_reliable) = places.points();
        let (mut coated, mut mapped) = Default::default();
        if extent == Extent::Whole {
            coated = coats::CoatTexels::find(&places, &points);
            mapped = normals::MappedTexels::find(&places, &points);
        }
        let all = light::PASSES * atlas.len() + mapped.len() + coated.len();
        let lit = light::light(&places, &points, compensates, loops, &|done| progress(done, all))?;

        // Trace the light of normal-mapped surfaces and of coats.
        let done = Cell::new(light::PASSES * atlas.len());
        let tell = |texels: usize| {
            done.set(done.get() + texels);
            progress(done.get(), all);
        };
        let bake = coats::CoatBake { places: &places, light: &lit, instances: &self.instances };
        let normals = Arc::new(bake.normals(&mapped, loops, &tell)?);
        let begin = Instant::now();
        let coats = Arc::new(bake.fields(&coated, loops, &tell)?);
        let coat_seconds = begin.elapsed().as_secs_f64();
        let facing = points.iter().map(|point| point.map_or([0; 3], |point| facing(point.normal.into()))).collect();
        let light::TexelLight { direct, indirect, filled } = lit;
        let atlas = self.atlas.clone();
        let texels = BakedTexels { atlas, direct, indirect, is_reliable, facing, normals, coats, later_coats: None };
        Ok(Bake { texels, filled, coat_seconds, work: all })
    }
}

impl Bake {
    /// Returns the number of charts of `scene` that are narrower than two texels.
    ///
    /// # Errors
    /// If surfaces cannot be flattened.
    pub fn narrow_charts(&self, scene: &Scene) -> Result<NarrowCharts> {
        let atlas = &self.texels.atlas;
        let (pose, count) = (scene.pose(0.0), atlas.narrow_charts());
        let texels_for_half = match count {
            0 => None,
            _ => atlas.texels_for_half_as_narrow(&Surfaces::new(scene, &pose)).map_err(Error::other)?,
        };
        Ok(NarrowCharts { count, texels_for_half })
    }

    /// Writes the light of `scene` to a file and returns its length in bytes.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, scene: &Scene, path: &Path) -> Result<u64> {
        stored::write(scene, path, &Arc::new(self.texels.clone()).into())
    }
}

/// Returns a unit normal as three bytes.
fn facing(normal: Vec3) -> [i8; 3] {
    normal.to_array().map(|value| (value * 127.0).round() as i8)
}

/// Returns the indices of the static instances and of all lamps.
fn lit_instances(scene: &Scene) -> Vec<u32> {
    let lamps = moving_lamps(scene);
    let mut instances = Vec::new();
    for (instance, moves) in scene.moving_instances().into_iter().enumerate() {
        if !moves || lamps[instance] {
            instances.push(instance as u32);
        }
    }
    instances
}
