//! Conversion of documents to the form that the `gltf` crate expects.
//!
//! The specification lets files omit data, or define it in extensions. The crate refuses these files, so this pass
//! first fills in, removes or replaces such data. Lists keep their length, so that indices stay valid.

mod animations;
mod images;
mod meshes;

pub(super) use animations::PointerChannel;

use super::extensions;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Results of [`normalize`].
#[derive(Debug, Default)]
pub(super) struct Normalized {
    /// Notes on omitted data, one line per type.
    pub notes: Vec<String>,
    /// Animation channels of `KHR_animation_pointer`.
    pub pointers: Vec<PointerChannel>,
    /// Names of extensions with an object in the document.
    pub extensions: BTreeSet<String>,
    /// Image that replaces an unreadable image, by index of the texture.
    pub plain_images: BTreeMap<usize, usize>,
    /// Program that wrote the file.
    pub generator: Option<String>,
    /// Buffer views that an accessor, an image or an extension reads.
    used_views: BTreeSet<usize>,
    /// Buffers with data that the used views refer to.
    pub used_buffers: BTreeSet<usize>,
}

impl Normalized {
    /// Adds a note if it is not yet in the list.
    fn note(&mut self, text: &str) {
        if !self.notes.iter().any(|note| note == text) {
            self.notes.push(text.into());
        }
    }
}

/// Converts the document to the form that the `gltf` crate parses. `has_binary` is true if the first buffer may be the
/// file's binary chunk.
///
/// # Errors
/// The file has a different version of glTF.
pub(super) fn normalize(root: &mut Value, has_binary: bool) -> Result<Normalized, String> {
    // Check the version first: other versions differ in structure.
    check_version(root)?;
    let generator = root.pointer("/asset/generator").and_then(Value::as_str).map(str::to_owned);
    let mut found = Normalized { generator, ..Normalized::default() };
    // Remove optional data before the sections are converted.
    plain(root, &mut found);
    found.notes = extension_notes(root, &found.extensions);
    scenes(root, &mut found);
    nodes(root);
    cameras(root, &mut found);
    lights(root, &mut found);
    buffers(root, &mut found);
    // Follow missing data from buffers to views, images, accessors and animations.
    let dry = meshes::dry_views(root, has_binary, &mut found.used_buffers);
    images::images(root, &dry, &mut found);
    materials(root, &mut found);
    let unreadable = meshes::accessors(root, &dry);
    meshes::primitives(root, &unreadable, &mut found);
    animations::animations(root, &unreadable, &mut found);
    Ok(found)
}

/// Checks the version: accepts 2.x, unless `minVersion` is above 2.0 (glTF 2.0, 3.2). In version 1, objects replace
/// lists.
fn check_version(root: &Value) -> Result<(), String> {
    // Read the version, which some files write as a number.
    let mut version = match root.pointer("/asset/version") {
        Some(Value::String(text)) => text.clone(),
        Some(Value::Number(number)) => number.to_string(),
        _ if root.get("nodes").is_some_and(Value::is_object) => "1.0".into(),
        _ => return Ok(()),
    };
    // A minimum version above 2.0 takes precedence.
    let least = root.pointer("/asset/minVersion").and_then(Value::as_str);
    if let Some(least) = least.filter(|least| least.parse().is_ok_and(|least: f32| least > 2.0)) {
        version = least.into();
    } else if version.split('.').next() == Some("2") {
        return Ok(());
    }
    // Shorten the version in the message, because it is untrusted.
    let shown: String = version.chars().take(8).collect();
    Err(format!("the file is glTF {shown}, but only 2.0 is read; export it as glTF 2.0"))
}

/// Removes nulls and `extras`, which may have any type. Rewrites 4.0 as 4. Collects the names of extensions.
///
/// The depth is bounded: `serde_json` refuses documents nested deeper than 128 levels.
fn plain(value: &mut Value, found: &mut Normalized) {
    /// Number above which f64 cannot represent every integer.
    const LARGEST: f64 = 9_007_199_254_740_992.0;
    match value {
        Value::Object(object) => {
            object.remove("extras");
            object.retain(|_, member| !member.is_null());
            if let Some(Value::Object(list)) = object.get("extensions") {
                found.extensions.extend(list.keys().cloned());
            }
            found.used_views.extend(object.get("bufferView").and_then(index));
            for member in object.values_mut() {
                plain(member, found);
            }
        }
        Value::Array(list) => {
            for item in list {
                plain(item, found);
            }
        }
        // Rewrite whole floats as integers, which the crate requires for indices.
        Value::Number(number) if number.is_f64() => {
            let float = number.as_f64().unwrap_or(f64::NAN);
            if float.fract() == 0.0 && float.is_sign_positive() && float < LARGEST {
                *value = json!(float as u64);
            }
        }
        _ => {}
    }
}

/// Returns a note for each ignored extension that the document names or uses.
fn extension_notes(root: &Value, found: &BTreeSet<String>) -> Vec<String> {
    let list = |name: &str| root.get(name).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let mut names = found.clone();
    names.extend(list("extensionsUsed").iter().filter_map(Value::as_str).map(str::to_owned));
    extensions::notes(&names, list("materials"))
}

/// Adds missing scenes: a scene may have no nodes, and a file no scenes ("a library of individual entities such as
/// materials or meshes", glTF 2.0, 3.5.1).
fn scenes(root: &mut Value, found: &mut Normalized) {
    // Show all nodes without parents if the file has no scene.
    if root.get("scene").is_none() && objects(root, "scenes").next().is_none() {
        let mut is_child = BTreeSet::new();
        let mut count = 0;
        for node in objects(root, "nodes") {
            let children = node.get("children").and_then(Value::as_array);
            is_child.extend(children.into_iter().flatten().filter_map(index));
            count += 1;
        }
        let roots: Vec<usize> = (0..count).filter(|node| !is_child.contains(node)).collect();
        if !roots.is_empty() {
            found.note("the file has no scene: all its nodes are shown");
        }
        root["scenes"] = json!([{ "nodes": roots }]);
    }
    for scene in objects(root, "scenes") {
        scene.entry("nodes").or_insert_with(|| json!([]));
    }
}

/// Removes `KHR_lights_punctual` from nodes if the extension names no light.
fn nodes(root: &mut Value) {
    for node in objects(root, "nodes") {
        let Some(Value::Object(extensions)) = node.get_mut("extensions") else { continue };
        if extensions.get("KHR_lights_punctual").is_some_and(|light| light.get("light").is_none()) {
            extensions.remove("KHR_lights_punctual");
        }
    }
}

/// Replaces cameras of types that extensions add with perspective cameras, which the crate accepts. Removes them from
/// nodes.
fn cameras(root: &mut Value, found: &mut Normalized) {
    // Replace the cameras instead of removing them, so that indices stay valid.
    let mut unknown = BTreeSet::new();
    for (index, camera) in objects(root, "cameras").enumerate() {
        let kind = camera.get("type").and_then(Value::as_str);
        if kind.is_some_and(|kind| !["perspective", "orthographic"].contains(&kind)) {
            unknown.insert(index as u64);
            camera.insert("type".into(), json!("perspective"));
            camera.insert("perspective".into(), json!({ "yfov": 1.0, "znear": 0.1 }));
            found.note("cameras of an unknown type are left out");
        }
    }
    // Remove the replaced cameras from nodes.
    for node in objects(root, "nodes") {
        if node.get("camera").and_then(Value::as_u64).is_some_and(|camera| unknown.contains(&camera)) {
            node.remove("camera");
        }
    }
}

/// Replaces lights of types that extensions add. Adds the default cone to spot lights without one.
fn lights(root: &mut Value, found: &mut Normalized) {
    // Replace the lights instead of removing them, so that indices stay valid.
    let mut unknown = BTreeSet::new();
    let lights = root.pointer_mut("/extensions/KHR_lights_punctual/lights").and_then(Value::as_array_mut);
    for (index, light) in lights.into_iter().flatten().enumerate() {
        let Value::Object(light) = light else { continue };
        match light.get("type").and_then(Value::as_str) {
            Some("directional" | "point") | None => {}
            Some("spot") => {
                light.entry("spot").or_insert_with(|| json!({}));
            }
            Some(_) => {
                unknown.insert(index as u64);
                light.insert("type".into(), json!("point"));
                found.note("lights of an unknown type are left out");
            }
        }
    }
    // Remove the replaced lights from nodes.
    for node in objects(root, "nodes") {
        let Some(Value::Object(extensions)) = node.get_mut("extensions") else { continue };
        let light = extensions.get("KHR_lights_punctual").and_then(|light| light.get("light")?.as_u64());
        if light.is_some_and(|light| unknown.contains(&light)) {
            extensions.remove("KHR_lights_punctual");
        }
    }
}

/// Removes hints that no reader needs from views, and finds the buffers that views use.
fn buffers(root: &mut Value, found: &mut Normalized) {
    // Accessors without a view are zeros, but the crate requires a view for them, so add one.
    if objects(root, "bufferViews").next().is_none() && objects(root, "accessors").next().is_some() {
        if objects(root, "buffers").next().is_none() {
            root["buffers"] = json!([{ "byteLength": 1 }]);
        }
        root["bufferViews"] = json!([{ "buffer": 0, "byteLength": 1 }]);
    }
    // Remove hints and zero strides, and collect the buffers of views in use.
    for (place, view) in objects(root, "bufferViews").enumerate() {
        view.remove("target");
        if view.get("byteStride").and_then(Value::as_u64) == Some(0) {
            view.remove("byteStride");
        }
        if found.used_views.contains(&place) {
            found.used_buffers.extend(view.get("buffer").and_then(index));
        }
    }
}

/// Replaces alpha modes of extensions with the default mode (glTF 2.0, 5.19).
fn materials(root: &mut Value, found: &mut Normalized) {
    for material in objects(root, "materials") {
        let mode = material.get("alphaMode").and_then(Value::as_str);
        if mode.is_some_and(|mode| !["OPAQUE", "MASK", "BLEND"].contains(&mode)) {
            material.remove("alphaMode");
            found.note("materials of an unknown alpha mode are shown opaque");
        }
    }
}

/// Returns the objects in a list of the document, or an empty iterator if the list is missing.
fn objects<'a>(root: &'a mut Value, name: &str) -> impl Iterator<Item = &'a mut Map<String, Value>> {
    let list = root.get_mut(name).and_then(Value::as_array_mut);
    list.into_iter().flatten().filter_map(Value::as_object_mut)
}

/// Returns the value as an index in the document, or `None` if it is not an index.
fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|index| usize::try_from(index).ok())
}
