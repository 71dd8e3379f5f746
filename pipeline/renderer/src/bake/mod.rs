//! Baked light: the light of what stands still, computed once for films that look it up.
//!
//! [`bake`] lights the texels of an atlas and writes them as a file `.slf`; [`read`] brings it back for a film of the same scene.
//! [`export`] paints the light into a copy of the scene.

mod blocks;
mod coats;
pub mod export;
mod file;
mod fingerprint;
mod inside;
mod light;

use crate::coat_fields::CoatFields;
use crate::plan::{Plan, Stage, lamp_moves};
use crate::settings::{RenderSettings, Size};
use crate::texels::BakedTexels;
use crate::{GATHER_RAYS, Preparation, Visibility};
pub use file::SectionFile;
pub use fingerprint::fingerprint;
use inside::Places;
use pipeline::error::{Context, Error, Result};
use pipeline::state::{decode, encode};
use render_core::scene::Scene;
use render_core::{Atlas, Surfaces};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// The section of a file that holds the atlas and its irradiance.
const TEXELS: [u8; 4] = *b"TEXL";
/// The section of a file that holds the light of coats.
const COATS: [u8; 4] = *b"COAT";

/// Baked light, and how it was found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Bake {
    /// The light.
    pub texels: BakedTexels,
    /// Texels that lie within something and have the light of those around them.
    pub filled: usize,
    /// Time that the light of coats took, by the clock \[s\].
    pub coat_seconds: f64,
}

/// Lights about `texels` texels of all that stands still in `scene`. `progress` is called from any thread with the work
/// done and the work there is. The same scene and settings give the same bits, for any number of threads.
///
/// # Errors
/// The scene's light cannot be baked: a lamp moves, or nothing stands still.
pub fn bake(
    scene: &Scene,
    settings: &RenderSettings,
    texels: usize,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Bake> {
    if lamp_moves(scene) {
        let text = "a lamp moves, so the light of this scene cannot be baked; films of it need no baked light";
        return Err(Error::Options(text.into()));
    }
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let atlas = Atlas::new(&surfaces, texels).map_err(Error::other)?;

    // Moving instances are left out: they would throw shadows and reflect light at one moment of the film only.
    let still = without_moving(scene);
    let settings = RenderSettings {
        size: Size { width: 16, height: 16 },
        frames: 1,
        cache: false,
        aov: Vec::new(),
        ..settings.clone()
    };
    let plan = Plan::new(&still, &settings);
    let frame = Preparation::new(&still, &settings, &plan).everywhere().frame(0).frame;

    // Each texel counts once for each pass over it; the last pass is over coats alone.
    let compensates = plan.is_on(Stage::Compensation);
    let visibility = Visibility::new(&frame, GATHER_RAYS);
    let places = Places { atlas: &atlas, surfaces: &surfaces, frame: &frame, visibility: &visibility };
    let points = places.points();
    let coated = coats::CoatTexels::find(&places, &points);
    let all = light::PASSES * atlas.len() + coated.len();
    let lit = light::light(&places, &points, compensates, &|done| progress(done, all));

    // Light of coats, by rays.
    let begin = Instant::now();
    let done = AtomicUsize::new(light::PASSES * atlas.len());
    let tell = |texels: usize| progress(done.fetch_add(texels, Ordering::Relaxed) + texels, all);
    let instances = standing(scene);
    let bake = coats::CoatBake { places: &places, light: &lit, instances: &instances };
    let coats = Arc::new(bake.fields(&coated, &tell));
    let coat_seconds = begin.elapsed().as_secs_f64();
    let light::TexelLight { direct, indirect, filled } = lit;
    let texels = BakedTexels { atlas, direct, indirect, coats };
    Ok(Bake { texels, filled, coat_seconds })
}

impl Bake {
    /// Writes the light of `scene` as a file, and returns its length in bytes.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, scene: &Scene, path: &Path) -> Result<u64> {
        let sections = vec![(TEXELS, encode(&self.texels)), (COATS, self.texels.coats.to_bytes())];
        SectionFile { fingerprint: fingerprint(scene), sections }.write(path)
    }
}

/// Reads baked light for a film of `scene`.
///
/// # Errors
/// The file cannot be read, is damaged, of another version or of another scene, or the scene's light cannot be baked.
pub fn read(scene: &Scene, path: &Path) -> Result<BakedTexels> {
    if lamp_moves(scene) {
        return Err(Error::Options("--lighting baked: a lamp moves in this scene; leave the option out".into()));
    }
    let file = SectionFile::read(path)?;
    file.check_scene(path, fingerprint(scene))?;
    let remedy = || format!("{}: bake it anew", path.display());
    let mut texels: BakedTexels = decode(file.section(path, TEXELS)?).context(remedy())?;
    let whole = texels.atlas.validate(scene)
        && texels.direct.len() == texels.atlas.len()
        && texels.indirect.len() == texels.atlas.len();
    if !whole {
        return Err(Error::content(path, ": its texels make no sense: bake it anew"));
    }
    let coats = CoatFields::from_bytes(&texels.atlas, file.section(path, COATS)?);
    texels.coats = Arc::new(coats.map_err(|text| Error::content(path, format!(": {text}: bake it anew")))?);
    Ok(texels)
}

/// The instances that never move, by their indices.
fn standing(scene: &Scene) -> Vec<u32> {
    let mut standing = Vec::new();
    for (instance, moves) in scene.moving_instances().into_iter().enumerate() {
        if !moves {
            standing.push(instance as u32);
        }
    }
    standing
}

/// The scene without the instances that ever move.
fn without_moving(scene: &Scene) -> Scene {
    let mut still = scene.clone();
    still.instances = standing(scene).into_iter().map(|instance| scene.instances[instance as usize]).collect();
    still
}
