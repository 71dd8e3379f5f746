//! Identity of a film, determined by settings and input files.

use crate::error::{Context, Error, Result};
use crate::settings::Settings;
use mpeg2enc::Container;
use pipeline::checkpoint::FilmJob;
use render_core::scene::Scene;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// Returns the job of a film of `scene` with `settings`. Paths of the scene and its files do not affect the job.
///
/// # Errors
/// If the baked light cannot be read.
pub fn job_of(scene: &Scene, settings: &Settings) -> Result<FilmJob> {
    let context = "the settings cannot be written as JSON";
    let text = serde_json::to_string(settings).context(context)?;
    let text = identity_of(&text).context(context)?;
    let program = concat!("render2mpeg ", env!("CARGO_PKG_VERSION"));
    let job = FilmJob::new(&settings.output, program, &text, sum_of_inputs(scene, settings)?);
    let reads_light = settings.files.light.as_deref().is_some_and(Path::exists);
    Ok(job.with_end(Some(settings.frame_range().end)).reading_light(reads_light))
}

/// Returns the job of the finished film at `film` that `report` describes; `None` without a finished film in the
/// report.
#[must_use]
pub fn job_of_report(film: &Path, report: &[u8]) -> Option<FilmJob> {
    let report: Value = serde_json::from_slice(report).ok()?;
    // Reject the report of an interrupted run: its film is unfinished.
    let (settings, inputs) = (report.get("settings")?, u32::try_from(report.get("inputs")?.as_u64()?).ok()?);
    if report["summary"]["interrupted"] != false {
        return None;
    }
    let job = FilmJob::new(film, report["program"].as_str()?, &identity_of(&settings.to_string()).ok()?, inputs);

    // Derive the end from the last frame, because a range has fewer frames than the film.
    let frames = report["frames"].as_array()?;
    let end = frames.last()?["index"].as_u64()? + 1;
    Some(job.with_end(u32::try_from(end).ok()))
}

/// Returns the settings as JSON, without the number of frames and without paths of files identified by content. Frames
/// do not depend on the number of frames; only containers that begin with the film's length keep that number.
fn identity_of(settings: &str) -> serde_json::Result<String> {
    let mut value: Value = serde_json::from_str(settings)?;
    if let Some(names) = value.as_object_mut() {
        // Keep the number of frames only for containers that store the film's length.
        let output = names.get("output").and_then(Value::as_str).map(PathBuf::from);
        let container = output.and_then(|path| Container::of(&path));
        if !matches!(container, Some(Container::Mp4 | Container::Matroska)) {
            names.remove("frames");
        }
        ["scene", "output", "baked", "light"].iter().for_each(|name| drop(names.remove(*name)));
        // Keep the paths of additional outputs, because a resumed film continues these files.
        for name in ["png", "exr", "y4m"] {
            let Some(path) = names.get_mut(name).filter(|path| path.is_string()) else { continue };
            let absolute = path.as_str().and_then(|path| std::path::absolute(path).ok());
            if let Some(absolute) = absolute {
                *path = absolute.components().collect::<PathBuf>().display().to_string().into();
            }
        }
    }
    serde_json::to_string(&value)
}

/// Returns the CRC-32 of all input files of a film: the scene's files, the baked light and the importance maps.
///
/// # Errors
/// If the baked light cannot be read.
pub fn sum_of_inputs(scene: &Scene, settings: &Settings) -> Result<u32> {
    let mut sum = crc32fast::Hasher::new_with_initial(scene.origin.sum);
    if let Some(path) = &settings.files.baked {
        sum.update(&fs::read(path).map_err(Error::file(path, "cannot be read; make it with render2mpeg bake"))?);
    }
    if let Some(files) = settings.render.importance.as_ref().and_then(|importance| importance.files.as_ref()) {
        sum.update(&files.sum().to_le_bytes());
    }
    Ok(sum.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Options;

    #[test]
    fn paths_may_be_typed_otherwise() {
        let identity = |scene: &str, y4m: &str, qscale: u32| {
            let options = Options { y4m: Some(y4m.into()), qscale: Some(qscale), ..Options::default() };
            let settings = Settings::new(scene.into(), &Scene::default(), &options).unwrap();
            identity_of(&serde_json::to_string(&settings).unwrap()).unwrap()
        };
        let first = identity("s.glb", "a/f.y4m", 8);
        let absolute = std::env::current_dir().unwrap().join("a/f.y4m");
        for y4m in ["./a/f.y4m", "a//./f.y4m", absolute.to_str().unwrap()] {
            assert_eq!(first, identity("./s.glb", y4m, 8), "{y4m}");
        }
        assert_ne!(first, identity("s.glb", "b/f.y4m", 8));
        assert_ne!(first, identity("s.glb", "a/f.y4m", 10));
    }
}
