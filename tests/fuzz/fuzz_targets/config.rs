//! Settings: a scene's TOML file, and all processing of it before the first ray.
#![no_main]

use libfuzzer_sys::fuzz_target;
use renderer::plan::Plan;
use render2mpeg::{Options, Settings};
use render_core::scene::{Scene, SceneSettings};

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match SceneSettings::parse(text) {
        Ok(settings) => {
            let scene = Scene { settings, ..Scene::default() };
            match Settings::new("scene.glb".into(), &scene, &Options::default()) {
                Ok(settings) => {
                    assert!(settings.render.tone_map.check().is_ok());
                    let _ = settings.encoder_config();
                    let _ = Plan::new(&scene, &settings.render).table();
                }
                Err(error) => assert_eq!(error.chain().lines().count(), 1, "{}", error.chain()),
            }
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
