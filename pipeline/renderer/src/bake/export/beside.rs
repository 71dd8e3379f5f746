//! TOML settings of an export, with which a film of the export looks like a film of the scene.

use super::tone::shown;
use glam::{Vec3, vec3};
use perceptual::ToneMap;
use render_core::Environment;
use render_core::scene::Scene;
use std::f32::consts::TAU;
use toml::{Table, Value};

/// Returns the text of the settings file.
pub(super) fn settings_text(scene: &Scene, tone_map: &ToneMap) -> String {
    let settings = &scene.settings;
    let mut file = Table::new();
    // Use the sRGB operator: the texture already contains display values.
    let operator = ("operator".to_owned(), Value::from("srgb"));
    let exposure = ("exposure".to_owned(), Value::from(1.0));
    file.insert("tone_mapping".into(), Value::Table([operator, exposure].into_iter().collect()));
    file.insert("sky".into(), Value::Table(sky(scene, tone_map)));

    // Copy camera, animation, sun and video, which film and export must share.
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

    // Explain the tone curve in a comment, for readers of the file.
    let head = "# The texture contains the scene's light as display values; no further tone curve is applied.\n\n";
    format!("{head}{file}")
}

/// Returns the shortest decimal that identifies `number`.
fn decimal(number: f32) -> Value {
    Value::from(number.to_string().parse().unwrap_or(f64::from(number)))
}

fn named(name: &str) -> Value {
    Value::Table([("name".to_owned(), Value::from(name))].into_iter().collect())
}

/// Number of directions around the horizon, over which the sky is averaged.
const AROUND: u8 = 32;

/// Returns the sky in display values: straight up, at the horizon and straight down. This only approximates a sky
/// image. The sky is black for a scene without a sky, because the loader would add a white one.
fn sky(scene: &Scene, tone_map: &ToneMap) -> Table {
    let mut table = Table::new();
    let radiance = |sky: &Environment, height: f32| match height {
        // Average over the horizon: the light of a sky image varies with the direction.
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
