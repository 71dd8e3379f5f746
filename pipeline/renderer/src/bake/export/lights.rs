//! Punctual lights of the exported document. The texture contains their light already, so only dynamic surfaces need
//! them.

use super::document::Document;
use render_core::scene::Scene;
use serde_json::{Value, json};

const EXTENSION: &str = "KHR_lights_punctual";

/// Keeps the punctual lights, scaled by `exposure`, if any dynamic surface needs them, and removes them otherwise.
pub(super) fn adapt(document: &mut Document, scene: &Scene, exposure: f32) {
    let moving = scene.moving_instances();
    let is_lit = |mesh: usize| !scene.materials[scene.meshes[mesh].material].unlit;
    let needed = scene.instances.iter().zip(moving).any(|(instance, moves)| moves && is_lit(instance.mesh));
    if !needed {
        leave_out(&mut document.json);
        return;
    }

    // Viewers have no exposure setting: apply the film's exposure to the intensities.
    let lights = document.json.pointer_mut(&format!("/extensions/{EXTENSION}/lights"));
    for light in lights.and_then(Value::as_array_mut).into_iter().flatten() {
        let intensity = light["intensity"].as_f64().unwrap_or(1.0) * f64::from(exposure);
        if intensity.is_finite() && light.is_object() {
            light["intensity"] = json!(intensity);
        }
    }
}

/// Removes the extension of punctual lights from the document and its nodes.
fn leave_out(json: &mut Value) {
    if let Some(Value::Array(nodes)) = json.get_mut("nodes") {
        nodes.iter_mut().for_each(without_lights);
    }
    without_lights(json);
}

/// Removes the extension of punctual lights from an object.
fn without_lights(object: &mut Value) {
    let Some(map) = object.as_object_mut() else { return };
    let Some(Value::Object(extensions)) = map.get_mut("extensions") else { return };
    extensions.remove(EXTENSION);
    if extensions.is_empty() {
        map.remove("extensions");
    }
}
