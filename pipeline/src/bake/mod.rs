//! Baked light: the light of what stands still, computed once for films that look it up.
//!
//! [`bake`] lights the texels of an atlas and writes them as a file `.slf`; [`read`] brings it back for a film of the same scene.

mod blocks;
mod file;
mod fingerprint;
mod inside;
mod light;

use crate::error::{Context, Error, Result};
use crate::plan::{Plan, Stage};
use crate::renderer::Preparation;
use crate::renderer::texels::BakedTexels;
use crate::settings::{RenderSettings, Settings, Size};
use crate::state::{decode, encode};
pub use file::SectionFile;
pub use fingerprint::fingerprint;
use render_core::scene::Scene;
use render_core::{Atlas, Surfaces};
use std::path::Path;

/// The section of a file that holds the atlas and its light.
const TEXELS: [u8; 4] = *b"TEXL";

/// Baked light, and how it was found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Bake {
    /// The light.
    pub texels: BakedTexels,
    /// Texels that lie within something and have the light of those around them.
    pub filled: usize,
}

/// Lights about `texels` texels of all that stands still in `scene`. `progress` is called from any thread with the work
/// done and the work there is. The same scene and settings give the same bits, for any number of threads.
///
/// # Errors
/// The scene's light cannot be baked: a lamp moves, or nothing stands still.
pub fn bake(
    scene: &Scene,
    settings: &Settings,
    texels: usize,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Bake> {
    if let Some(reason) = unbakable(scene) {
        return Err(Error::Options(format!("the light of this scene cannot be baked: {reason}")));
    }
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let atlas = Atlas::new(&surfaces, texels).map_err(Error::other)?;

    // What moves is neither lit nor a mirror of light: the lights are those of the scene without it.
    let still = without_moving(scene);
    let settings = RenderSettings {
        size: Size { width: 16, height: 16 },
        frames: 1,
        cache: false,
        aov: Vec::new(),
        ..settings.renderer()
    };
    let plan = Plan::new(&still, &settings);
    let frame = Preparation::new(&still, &settings, &plan).frame(0).frame;

    // Each texel counts twice: once for each pass over it.
    let all = 2 * atlas.len();
    let compensates = plan.is_on(Stage::Compensation);
    let lit = light::light(&atlas, &surfaces, &frame, compensates, &|done| progress(done, all));
    let light::TexelLight { direct, indirect, filled } = lit;
    Ok(Bake { texels: BakedTexels { atlas, direct, indirect }, filled })
}

impl Bake {
    /// Writes the light of `scene` as a file, and returns its length in bytes.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, scene: &Scene, path: &Path) -> Result<u64> {
        let sections = vec![(TEXELS, encode(&self.texels))];
        SectionFile { fingerprint: fingerprint(scene), sections }.write(path)
    }
}

/// Reads baked light for a film of `scene`.
///
/// # Errors
/// The file cannot be read, is damaged, of another version or of another scene, or the scene's light cannot be baked.
pub fn read(scene: &Scene, path: &Path) -> Result<BakedTexels> {
    if let Some(reason) = unbakable(scene) {
        return Err(Error::Options(format!("--lighting baked: {reason}; leave the option out")));
    }
    let file = SectionFile::read(path)?;
    file.check_scene(path, fingerprint(scene))?;
    let remedy = || format!("{}: bake it anew", path.display());
    let texels: BakedTexels = decode(file.section(path, TEXELS)?).context(remedy())?;
    let whole = texels.atlas.validate(scene)
        && texels.direct.len() == texels.atlas.len()
        && texels.indirect.len() == texels.atlas.len();
    if !whole {
        return Err(Error::content(path, ": its texels make no sense: bake it anew"));
    }
    Ok(texels)
}

/// The reason for which the light of a scene cannot be baked, if there is one.
#[must_use]
pub fn unbakable(scene: &Scene) -> Option<&'static str> {
    let (nodes, instances) = (scene.moving_nodes(), scene.moving_instances());
    if scene.punctual_lights.iter().any(|light| nodes[light.node]) {
        return Some("a light moves");
    }
    let shines = |instance: usize| scene.materials[scene.meshes[scene.instances[instance].mesh].material].emits();
    if (0..instances.len()).any(|instance| instances[instance] && shines(instance)) {
        return Some("something that glows moves");
    }
    None
}

/// The scene without the instances that ever move.
fn without_moving(scene: &Scene) -> Scene {
    let moving = scene.moving_instances();
    let mut still = scene.clone();
    still.instances.clear();
    for (instance, moves) in scene.instances.iter().zip(moving) {
        if !moves {
            still.instances.push(*instance);
        }
    }
    still
}
