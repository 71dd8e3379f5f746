//! Seeds of the cases: small scenes that load, each in one file.

use super::Draft;
use crate::{Moving, checkered_room, textured_square};
use render_core::scene::{self, GltfSource, Reach};
use serde_json::{Value, json};
use std::path::Path;

/// Maximum size of a seed \[bytes\]. Rendering a larger scene takes longer than rendering many small scenes.
const LARGEST: usize = 200_000;

/// Extensions of views that refer to a buffer.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Moves a view to the only buffer of a draft, or to the second one, which has no data.
fn move_view(view: &mut Value, starts: &[usize], absent: &[bool]) -> Option<()> {
    let number = |key: &str| view.get(key).and_then(Value::as_u64).unwrap_or(0) as usize;
    let buffer = number("buffer");
    if absent.get(buffer) == Some(&true) {
        view["buffer"] = json!(1);
        return Some(());
    }
    let start = starts.get(buffer)? + number("byteOffset");
    view["buffer"] = json!(0);
    view["byteOffset"] = json!(start);
    Some(())
}

/// Returns the seeds of the tests: two rooms with motion, and a textured square with a spot light.
pub fn own_seeds() -> Vec<Draft> {
    let rooms = [("room, box", Moving::Box), ("room, camera", Moving::Camera)];
    let mut seeds: Vec<Draft> = rooms.map(|(name, moving)| Draft::of(name, &checkered_room(moving))).into();
    seeds.push(Draft::of("square", &textured_square()));
    seeds
}

/// Returns all small scenes below `folder` that load, in order of their paths.
pub fn seeds_below(folder: &Path) -> Vec<Draft> {
    // Search the folder and its subfolders.
    let (mut found, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let is_scene = path.extension().is_some_and(|ending| ending == "glb" || ending == "gltf");
            if path.is_dir() {
                open.push(path);
            } else if is_scene {
                found.push(path);
            }
        }
    }
    found.sort();
    found.iter().filter_map(|path| in_one_piece(path)).collect()
}

/// Loads a scene with all its resources in its binary chunk.
fn in_one_piece(path: &Path) -> Option<Draft> {
    let source = GltfSource::read(path, Reach::Folder).ok()?;
    let mut json: Value = serde_json::from_slice(&source.json).ok()?;
    let mut bin = Vec::new();

    // Concatenate the buffers. Each view moves by the length of the buffers before its own.
    let mut starts = Vec::new();
    let buffers = json.get("buffers").and_then(Value::as_array).cloned().unwrap_or_default();
    for (index, buffer) in buffers.iter().enumerate() {
        bin.resize(bin.len().next_multiple_of(4), 0);
        starts.push(bin.len());
        bin.extend(match buffer.get("uri").and_then(Value::as_str) {
            Some(uri) => source.resource(&format!("buffer {index}"), uri).ok()?,
            // Skip a fallback buffer, which has no data in the file.
            None if index > 0 => continue,
            None => source.binary.clone()?,
        });
    }
    let absent: Vec<bool> = buffers.iter().enumerate().map(|(i, b)| i > 0 && b.get("uri").is_none()).collect();
    // Move each view, and its compressed data, into the joined buffer.
    for view in json.get_mut("bufferViews").and_then(Value::as_array_mut).into_iter().flatten() {
        move_view(view, &starts, &absent)?;
        for name in MESHOPT {
            if let Some(packed) = view.get_mut("extensions").and_then(|extensions| extensions.get_mut(name)) {
                move_view(packed, &starts, &absent)?;
            }
        }
    }

    // Append the images, each with a view of its own.
    let mut views = json.get("bufferViews").and_then(Value::as_array).cloned().unwrap_or_default();
    for image in json.get_mut("images").and_then(Value::as_array_mut).into_iter().flatten() {
        let Some(uri) = image.get("uri").and_then(Value::as_str) else { continue };
        let bytes = source.resource("image", uri).ok()?;
        let kind = if bytes.starts_with(b"\x89PNG") { "image/png" } else { "image/jpeg" };
        *image = json!({ "bufferView": views.len(), "mimeType": kind });
        views.push(json!({ "buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len() }));
        bin.extend(bytes);
    }
    if !bin.is_empty() {
        json["bufferViews"] = json!(views);
        json["buffers"] = json!([{ "byteLength": bin.len() }]);
        if absent.contains(&true) {
            json["buffers"] = json!([{ "byteLength": bin.len() }, { "byteLength": LARGEST }]);
        }
    }

    // Keep settings that refer to no other file.
    let toml = std::fs::read_to_string(path.with_extension("toml")).unwrap_or_default();
    let toml = if toml.contains("image") { String::new() } else { toml };
    let name = path.file_name()?.to_string_lossy().into_owned();
    let is_small = bin.len() + source.json.len() <= LARGEST;
    (is_small && scene::load(path).is_ok()).then_some(Draft { name, json, bin, toml })
}
