//! Light files: the light of a film, made by one run and read by others.
//!
//! Parts of a film have the same anchors, photons and exposure, and the same light tree if the light is static. The
//! file contains them, with the settings and input files that determine them.

use crate::error::{Error, Result};
use crate::job::sum_of_inputs;
use crate::settings::Settings;
use pipeline::checkpoint::{FilmJob, Identity};
use pipeline::output::is_being_written;
use pipeline::sealed::SealedFormat;
use pipeline::stage::Prepare;
use render_core::scene::Scene;
use renderer::plan::Plan;
use renderer::{Preparation, Shading};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

const FORMAT: SealedFormat = SealedFormat {
    magic: *b"R2ML",
    version: 1,
    name: "light file",
    remedy: "cannot be used; remove it to make the light again",
};

/// Settings that do not change the light of a film: its files, coding, and division into parts.
const OTHER_SETTINGS: [&str; 25] = [
    "scene",
    "output",
    "range",
    "chunk",
    "baked",
    "light",
    "png",
    "exr",
    "exr_depth",
    "aov",
    "y4m",
    "qscale",
    "aq",
    "gop",
    "bitrate",
    "cbr",
    "bframes",
    "effort",
    "mpeg1",
    "motion",
    "kappa",
    "importance",
    "importance_gain",
    "tiles",
    "within",
];

/// Content of a light file.
#[derive(Serialize, Deserialize)]
struct StoredLight {
    identity: Identity,
    light: Vec<u8>,
}

/// Reads the light of the film from the file that `settings` names. Returns `None` if the settings name no file or the
/// file does not exist yet.
///
/// # Errors
/// If the file cannot be read, is damaged, or contains the light of another film.
pub(crate) fn read(scene: &Scene, settings: &Settings) -> Result<Option<Vec<u8>>> {
    let Some(path) = settings.files.light.as_deref().filter(|path| path.exists()) else { return Ok(None) };
    let stored: StoredLight = FORMAT.read(path)?;
    if let Some(difference) = stored.identity.difference(job(scene, settings, path)?.identity()) {
        let text = format!(" is the light of another film: {difference}; remove it to make the light again");
        return Err(Error::content(path, text));
    }
    Ok(Some(stored.light))
}

/// Writes the light of the film to the file at `path`. Parts that start together make the same light, so the first one
/// writes it.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(scene: &Scene, settings: &Settings, path: &Path, light: Vec<u8>) -> Result<()> {
    let identity = job(scene, settings, path)?.identity().clone();
    match FORMAT.write(path, &StoredLight { identity, light }) {
        Err(_) if path.exists() || is_being_written(path) => Ok(()),
        done => Ok(done?),
    }
}

/// Makes the light of a film and writes it to the file at `path`, for all parts of the film. Returns false if the file
/// already contains this light. The light of another film is replaced.
///
/// # Errors
/// If the baked light cannot be read, the file cannot be written, or it is another kind of file.
pub fn make_light(scene: &Scene, settings: &Settings, plan: &Plan, path: &Path) -> Result<bool> {
    if path.exists() {
        let stored: StoredLight = FORMAT.read(path)?;
        if stored.identity.difference(job(scene, settings, path)?.identity()).is_none() {
            return Ok(false);
        }
    }
    let mut preparation = Preparation::new(scene, &settings.render, plan);
    #[cfg(feature = "bake")]
    let baked = crate::shading::read_baked(scene, settings)?;
    if settings.render.auto_exposure {
        let exposure = crate::shading::exposure_of_chunks(&mut preparation, scene, settings, |settings, plan| {
            let shading = Shading::new(settings, plan);
            #[cfg(feature = "bake")]
            let shading = crate::shading::with_baked(shading, baked.as_ref());
            shading
        });
        preparation.set_exposure(exposure);
    }
    preparation.make_ready();
    write(scene, settings, path, preparation.film_light())?;
    Ok(true)
}

/// Returns the job of making the light of a film.
fn job(scene: &Scene, settings: &Settings, path: &Path) -> Result<FilmJob> {
    let mut value = serde_json::to_value(settings).map_err(Error::other)?;
    if let Some(names) = value.as_object_mut() {
        OTHER_SETTINGS.iter().for_each(|name| drop(names.remove(*name)));
    }
    let program = concat!("render2mpeg ", env!("CARGO_PKG_VERSION"));
    Ok(FilmJob::new(path, program, &Value::to_string(&value), sum_of_inputs(scene, settings)?))
}
