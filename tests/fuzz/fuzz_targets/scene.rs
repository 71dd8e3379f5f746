//! A scene file: it is refused, or it loads and can be rendered.
//!
//! The first byte selects `.gltf` or `.glb`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pipeline::Run;
use pipeline::observe::OnFrame;
use pipeline::report::FrameReport;
use renderer::plan::Plan;
use render2mpeg::{Options, Settings};
use render_core::scene;
use std::path::PathBuf;
use std::sync::OnceLock;

/// Maximum number of triangles of a rendered scene; larger ones would take the time of thousands of small ones.
const MOST_TRIANGLES: usize = 2000;

fuzz_target!(|data: &[u8]| {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| tempfile::tempdir().expect("a folder"));
    let Some((&kind, bytes)) = data.split_first() else { return };
    let path: PathBuf = folder.path().join(if kind % 2 == 0 { "scene.gltf" } else { "scene.glb" });
    std::fs::write(&path, bytes).expect("a file");
    let scene = match scene::load(&path) {
        Ok(scene) => scene,
        Err(error) => {
            assert_eq!(error.to_string().lines().count(), 1, "{error}");
            return;
        }
    };
    if scene.triangle_count() > MOST_TRIANGLES || scene.instances.len() > MOST_TRIANGLES {
        return;
    }
    let options =
        Options { frames: Some(2), size: "8x8".parse().ok(), vpls: Some(10), photons: Some(100), ..Options::default() };
    let options = Options { output: Some(folder.path().join("film.m2v")), ..options };
    let Ok(settings) = Settings::new(path, &scene, &options) else { return };
    let plan = Plan::new(&scene, &settings.render);
    let check = OnFrame::new(|frame: &FrameReport| assert_eq!(frame.figures.non_finite, 0, "light that is no number"));
    let run = Run { observer: &check, ..Run::default() };
    render2mpeg::render(&scene, &settings, &plan, run).expect("a loaded scene can be rendered");
});
