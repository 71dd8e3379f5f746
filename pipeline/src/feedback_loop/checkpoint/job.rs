//! The identity of a film: only a run of the same program, settings and inputs continues it.

use super::file::Identity;
use crate::error::{Context, Error, Result};
use crate::settings::Settings;
use render_core::scene::SceneSettings;
use std::fs;
use std::path::{Path, PathBuf};

/// A film, and everything that its bits depend on.
#[derive(Clone, Debug)]
pub struct FilmJob {
    film: PathBuf,
    identity: Identity,
}

impl FilmJob {
    /// The film that `settings` describe. Reads the scene's files for their check sum.
    ///
    /// # Errors
    /// The scene cannot be read.
    pub fn of(settings: &Settings) -> Result<Self> {
        let text = serde_json::to_string(settings).context("the settings cannot be put into JSON")?;
        let program = concat!("render2mpeg ", env!("CARGO_PKG_VERSION"));
        Ok(Self::new(&settings.output, program, &text, sum_of_inputs(settings)?))
    }

    /// A film at `film` that `program` makes: `settings` is a JSON object with all that its bits depend on, `inputs` a check
    /// sum of the files that are read.
    #[must_use]
    pub fn new(film: &Path, program: &str, settings: &str, inputs: u32) -> Self {
        Self { film: film.into(), identity: Identity { program: program.into(), settings: settings.into(), inputs } }
    }

    /// The path of the film.
    #[must_use]
    pub fn film(&self) -> &Path {
        &self.film
    }

    pub(super) fn identity(&self) -> &Identity {
        &self.identity
    }
}

/// CRC-32 of all files that a film is made from.
///
/// # Errors
/// A file cannot be read.
pub(crate) fn sum_of_inputs(settings: &Settings) -> Result<u32> {
    let scene = sum_of_scene(&settings.scene)?;
    let Some(path) = &settings.baked else { return Ok(scene) };
    let baked = fs::read(path).map_err(Error::file(path, "cannot be read; make it with render2mpeg bake"))?;
    let mut sum = crc32fast::Hasher::new_with_initial(scene);
    sum.update(&baked);
    Ok(sum.finalize())
}

/// CRC-32 of a scene's own file, of the one beside it with its settings, and of those that its JSON names.
fn sum_of_scene(path: &Path) -> Result<u32> {
    let mut sum = crc32fast::Hasher::new();
    let bytes = fs::read(path).map_err(Error::file(path, "cannot be read"))?;
    sum.update(&bytes);
    let mut others = vec![SceneSettings::path_for(path)];
    let document: serde_json::Value = serde_json::from_slice(&bytes).unwrap_or_default();
    for list in ["buffers", "images"] {
        let entries = document[list].as_array().into_iter().flatten();
        let names = entries.filter_map(|entry| entry["uri"].as_str()).filter(|uri| !uri.starts_with("data:"));
        others.extend(names.map(|name| path.with_file_name(name)));
    }
    // Names may be escaped; what is not found under them was not what was loaded.
    others.iter().filter_map(|other| fs::read(other).ok()).for_each(|bytes| sum.update(&bytes));
    Ok(sum.finalize())
}
