//! Baked light: the light of what stands still, computed once for films that look it up.
//!
//! [`bake`] lights the texels of an atlas and writes them as a file `.slf`; [`read`] brings it back for a film of the same scene.
//! [`export`] paints the light into a copy of the scene.

mod blocks;
pub mod export;
mod file;
mod fingerprint;
mod inside;
mod light;

use crate::error::{Context, Error, Result};
use crate::plan::{Plan, Stage, lamp_moves};
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
        ..settings.renderer()
    };
    let plan = Plan::new(&still, &settings);
    let frame = Preparation::new(&still, &settings, &plan).frame(0).frame;

    // Each texel counts once for each pass over it.
    let all = light::PASSES * atlas.len();
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
    if lamp_moves(scene) {
        return Err(Error::Options("--lighting baked: a lamp moves in this scene; leave the option out".into()));
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
