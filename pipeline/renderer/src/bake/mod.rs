//! Baked light: the light of static surfaces, computed once and sampled by films.
//!
//! [`bake`] computes the light of an atlas's texels and writes an `.slf` file. [`read`] loads it for a film of the same scene.
//! [`export`] paints the light into a copy of the scene. [`view`] creates a page that shows the scene in a browser.

mod blocks;
mod coats;
pub mod export;
mod file;
mod fingerprint;
mod inside;
mod light;
mod loops;
mod normals;
mod seams;
pub mod view;

use crate::coat_fields::CoatFields;
use crate::normal_texels::NormalTexels;
use crate::plan::{Plan, Stage, lamp_moves};
use crate::settings::{RenderSettings, Size};
use crate::texels::BakedTexels;
use crate::{GATHER_RAYS, Preparation, Visibility};
pub use file::SectionFile;
pub use fingerprint::fingerprint;
use glam::Vec3;
use inside::Places;
pub use loops::{BakeCheckpoint, BakeRun};
use loops::{BakeLoops, LoopEnd};
use pipeline::error::{Context, Error, Result};
use pipeline::state::{decode, encode};
use render_core::scene::Scene;
use render_core::{Atlas, Surfaces};
use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Tag of the file section with the atlas and its irradiance.
const TEXELS: [u8; 4] = *b"TEXL";
/// Tag of the file section with the light of normal-mapped surfaces.
const NORMALS: [u8; 4] = *b"NORM";
/// Tag of the file section with the light of coats.
const COATS: [u8; 4] = *b"COAT";

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
/// chooses if `texels` is `None`. `progress` is called with the work done
/// and the total work. Equal scenes and settings produce equal bits for any number of threads and ranks. Returns `None`
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
        let text = "the light of this scene cannot be baked because a lamp moves; render without baked light";
        return Err(Error::Options(text.into()).into());
    }
    let mut loops = BakeLoops::new(run)?;

    // Lay out the texels on the static surfaces.
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let atlas = match texels {
        Some(texels) => Atlas::new(&surfaces, texels),
        None => Atlas::automatic(&surfaces),
    };
    let atlas = atlas.map_err(Error::other)?;

    // Omit moving instances: their shadows and reflections would be valid for only one moment of the film.
    let still = without_moving(scene);
    let settings = RenderSettings {
        size: Size { width: 16, height: 16 },
        frames: 1,
        cache: false,
        aov: Vec::new(),
        ..settings.clone()
    };
    let plan = Plan::new(&still, &settings);
    let frame = Preparation::among(&still, &settings, &plan, run.ranks.clone()).everywhere().frame(0).frame;

    // Count each texel once per pass; the last pass covers only coats.
    let compensates = plan.is_on(Stage::Compensation);
    let visibility = Visibility::new(&frame, GATHER_RAYS);
    let places = Places { atlas: &atlas, surfaces: &surfaces, frame: &frame, visibility: &visibility };
    let (points, is_reliable) = places.points();
    let coated = coats::CoatTexels::find(&places, &points);
    let mapped = normals::MappedTexels::find(&places, &points);
    let all = light::PASSES * atlas.len() + mapped.len() + coated.len();
    let lit = light::light(&places, &points, compensates, &mut loops, &|done| progress(done, all))?;

    // Trace the light of normal-mapped surfaces and of coats.
    let done = Cell::new(light::PASSES * atlas.len());
    let tell = |texels: usize| {
        done.set(done.get() + texels);
        progress(done.get(), all);
    };
    let instances = standing(scene);
    let bake = coats::CoatBake { places: &places, light: &lit, instances: &instances };
    let normals = Arc::new(bake.normals(&mapped, &mut loops, &tell)?);
    let begin = Instant::now();
    let coats = Arc::new(bake.fields(&coated, &mut loops, &tell)?);
    let coat_seconds = begin.elapsed().as_secs_f64();
    let facing = points.iter().map(|point| point.map_or([0; 3], |point| facing(point.normal.into()))).collect();
    let light::TexelLight { direct, indirect, filled } = lit;
    let texels = BakedTexels { atlas, direct, indirect, is_reliable, facing, normals, coats };
    Ok(Bake { texels, filled, coat_seconds })
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
        let BakedTexels { normals, coats, .. } = &self.texels;
        let sections = vec![(TEXELS, encode(&self.texels)), (NORMALS, normals.to_bytes()), (COATS, coats.to_bytes())];
        SectionFile { fingerprint: fingerprint(scene), sections }.write(path)
    }
}

/// Reads baked light of `scene`.
///
/// # Errors
/// If the file cannot be read, is damaged, or has another version or scene. If a lamp moves.
pub fn read(scene: &Scene, path: &Path) -> Result<BakedTexels> {
    if lamp_moves(scene) {
        return Err(Error::Options("--lighting baked: a lamp moves in this scene; remove the option".into()));
    }
    // Reject damaged files and files of other scenes before decoding any section.
    let file = SectionFile::read(path)?;
    file.check_scene(path, fingerprint(scene))?;
    let remedy = || format!("{}: bake it again", path.display());
    let mut texels: BakedTexels = decode(file.section(path, TEXELS)?).context(remedy())?;
    // Check indices and lengths: a forged file may contain any value.
    let whole = texels.atlas.validate(scene)
        && texels.direct.len() == texels.atlas.len()
        && texels.indirect.len() == texels.atlas.len()
        && texels.is_reliable.len() == texels.atlas.len()
        && texels.facing.len() == texels.atlas.len();
    if !whole {
        return Err(Error::content(path, ": its texels are invalid: bake it again"));
    }
    let invalid = |text: String| Error::content(path, format!(": {text}: bake it again"));
    let normals = NormalTexels::from_bytes(file.section(path, NORMALS)?, texels.atlas.len());
    texels.normals = Arc::new(normals.map_err(invalid)?);
    let coats = CoatFields::from_bytes(&texels.atlas, file.section(path, COATS)?);
    texels.coats = Arc::new(coats.map_err(invalid)?);
    Ok(texels)
}

/// Returns a unit normal as three bytes.
fn facing(normal: Vec3) -> [i8; 3] {
    normal.to_array().map(|value| (value * 127.0).round() as i8)
}

/// Returns the indices of the static instances.
fn standing(scene: &Scene) -> Vec<u32> {
    let mut standing = Vec::new();
    for (instance, moves) in scene.moving_instances().into_iter().enumerate() {
        if !moves {
            standing.push(instance as u32);
        }
    }
    standing
}

/// Returns the scene without its dynamic instances.
fn without_moving(scene: &Scene) -> Scene {
    let mut still = scene.clone();
    still.instances = standing(scene).into_iter().map(|instance| scene.instances[instance as usize]).collect();
    still
}
