//! Buffer views packed by `EXT_meshopt_compression` or `KHR_meshopt_compression`.

use super::meshopt::Layout;
use super::raw::{add_buffer, bytes, list, number, unlist};
use super::{LoadError, Loader, StoredBuffers};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Names of two extensions with the same members.
const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

impl Loader<'_> {
    /// Unpacks the views that an accessor, an image or an extension uses.
    pub(super) fn unpack_views(
        &self,
        root: &mut Value,
        stored: &mut StoredBuffers,
        notes: &mut Vec<String>,
    ) -> Result<(), LoadError> {
        let packed: Vec<(usize, &str, Value)> =
            list(root, "bufferViews").iter().enumerate().filter_map(|(place, view)| packed_by(place, view)).collect();
        if packed.is_empty() {
            return Ok(());
        }

        // Unpack the views in use.
        let mut used = BTreeSet::new();
        find_views(root, &mut used);
        for (place, name, extension) in packed.into_iter().filter(|(place, ..)| used.contains(place)) {
            let unpacked = unpacked(root, stored, &extension)?;
            if stored.allowance.is_exhausted() {
                return self
                    .bad(format!("buffer view {place} unpacks to far more bytes than the file has; export it again"));
            }
            match unpacked {
                Ok(data) => {
                    // Let the view refer to the unpacked data.
                    let length = data.len();
                    let buffer = add_buffer(root, stored, data);
                    let view = &mut root["bufferViews"][place];
                    view["buffer"] = json!(buffer);
                    view["byteOffset"] = json!(0);
                    view["byteLength"] = json!(length.max(1));
                }
                Err(fault) if has_plain_copy(root, stored, place) => {
                    notes.push(format!("buffer view {place}: its {name} data {fault}; its plain copy is read"));
                }
                Err(fault) => {
                    return self.bad(format!("buffer view {place}: its {name} data {fault}; export it again"));
                }
            }
        }

        // Remove the extensions, even from unused views.
        for view in root["bufferViews"].as_array_mut().into_iter().flatten() {
            if let Some(Value::Object(extensions)) = view.get_mut("extensions") {
                extensions.retain(|name, _| !NAMES.contains(&name.as_str()));
            }
        }
        unlist(root, &NAMES);
        Ok(())
    }
}

/// Returns the extension that packs a view, and the extension's members.
fn packed_by(place: usize, view: &Value) -> Option<(usize, &'static str, Value)> {
    let extension =
        |name: &'static str| view.get("extensions")?.get(name).map(|members| (place, name, members.clone()));
    NAMES.into_iter().find_map(extension)
}

/// Unpacks a view, or returns the reason for the failure.
fn unpacked(
    root: &Value,
    stored: &mut StoredBuffers,
    extension: &Value,
) -> Result<Result<Vec<u8>, &'static str>, LoadError> {
    // Check the layout before any data is read.
    let (Some(count), Some(stride)) = (number(&extension["count"]), number(&extension["byteStride"])) else {
        return Ok(Err("lacks a count or a stride"));
    };
    let layout = Layout::new(extension["mode"].as_str().unwrap_or(""), extension["filter"].as_str(), count, stride);
    let layout = match layout {
        Ok(layout) => layout,
        Err(fault) => return Ok(Err(fault)),
    };
    // Reading a buffer raises the allowance.
    if bytes(root, stored, extension)?.is_none() {
        return Ok(Err("is outside its buffer"));
    }
    if stored.allowance.charge(layout.size()).is_none() {
        return Ok(Err("has too many elements"));
    }
    Ok(bytes(root, stored, extension)?.map_or(Err("is outside its buffer"), |packed| layout.unpack(packed)))
}

/// Returns whether the view's own buffer has data.
fn has_plain_copy(root: &Value, stored: &StoredBuffers, place: usize) -> bool {
    let buffer = number(&root["bufferViews"][place]["buffer"]);
    let Some(buffer) = buffer.filter(|&buffer| buffer < list(root, "buffers").len()) else { return false };
    root["buffers"][buffer]["uri"].is_string() || (buffer == 0 && stored.has_binary())
}

/// Finds all views that any object names.
fn find_views(value: &Value, used: &mut BTreeSet<usize>) {
    match value {
        Value::Object(object) => {
            used.extend(object.get("bufferView").and_then(number));
            object.values().for_each(|member| find_views(member, used));
        }
        Value::Array(list) => list.iter().for_each(|item| find_views(item, used)),
        _ => {}
    }
}
