//! The TOML file beside an export: with it a film of the export shows what a film of the scene does.

use super::tone::shown;
use glam::{Vec3, vec3};
use perceptual::ToneMap;
use render_core::Environment;
use render_core::scene::Scene;
use std::f32::consts::TAU;
use toml::{Table, Value};

/// The text of the file.
pub(super) fn settings_text(scene: &Scene, tone_map: &ToneMap) -> String {
    let settings = &scene.settings;
    let mut file = Table::new();
    // The picture holds display values already.
    let operator = ("operator".to_owned(), Value::from("srgb"));
    let exposure = ("exposure".to_owned(), Value::from(1.0));
    file.insert("tone_mapping".into(), Value::Table([operator, exposure].into_iter().collect()));
    file.insert("sky".into(), Value::Table(sky(scene, tone_map)));
    if let Some(name) = &settings.camera.name {
        file.insert("camera".into(), named(name));
    }
    if let Some(name) = &settings.animation.name {
        file.insert("animation".into(), named(name));
    }
    let diameter = decimal(settings.sun.angular_diameter);
    let sun = [("angular_diameter".to_owned(), diameter)].into_iter().collect();
    file.insert("sun".into(), Value::Table(sun));
    let mut video = Table::new();
    if let Some(frames) = settings.video.frames {
        video.insert("frames".into(), Value::from(i64::from(frames)));
    }
    if let Some(fps) = settings.video.fps {
        video.insert("fps".into(), Value::from(fps));
    }
    if !video.is_empty() {
        file.insert("video".into(), Value::Table(video));
    }
    let head =
        "# The light of this scene is painted into its texture, as display values: no tone curve comes after it.\n\n";
    format!("{head}{file}")
}

/// The number with as few digits as tell it apart from its neighbors.
fn decimal(number: f32) -> Value {
    Value::from(number.to_string().parse().unwrap_or(f64::from(number)))
}

fn named(name: &str) -> Value {
    Value::Table([("name".to_owned(), Value::from(name))].into_iter().collect())
}

/// Directions around the horizon whose mean stands for all of it.
const AROUND: u8 = 32;

/// The sky as a display shows it, straight up, at the horizon and straight down: between these a pictured sky is only near to
/// itself. A scene without one has a black sky here: without any, the loader would add a plain white one.
fn sky(scene: &Scene, tone_map: &ToneMap) -> Table {
    let mut table = Table::new();
    let radiance = |sky: &Environment, height: f32| match height {
        0.0 => {
            let mut sum = Vec3::ZERO;
            for step in 0..AROUND {
                let (sin, cos) = (f32::from(step) * TAU / f32::from(AROUND)).sin_cos();
                sum += sky.radiance(vec3(sin, 0.0, cos));
            }
            sum / f32::from(AROUND)
        }
        _ => sky.radiance(vec3(0.0, height, 0.0)),
    };
    for (name, height) in [("zenith", 1.0), ("horizon", 0.0), ("ground", -1.0)] {
        let color = scene.sky.as_ref().map_or(Vec3::ZERO, |sky| shown(tone_map, radiance(sky, height)));
        let numbers = color.to_array().map(decimal);
        table.insert(name.into(), Value::Array(numbers.into()));
    }
    table
}
