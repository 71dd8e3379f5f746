//! Parts of documents that no pass has checked yet.

use super::StoredBuffers;
use crate::scene::gltf_file::LoadError;
use serde_json::{Value, json};

/// An index or a count.
pub(super) fn number(value: &Value) -> Option<usize> {
    let float = || value.as_f64().filter(|x| x.fract() == 0.0 && (0.0..4e9).contains(x));
    value.as_u64().and_then(|number| usize::try_from(number).ok()).or_else(|| float().map(|x| x as usize))
}

/// A list of the document; empty where there is none.
pub(super) fn list<'a>(root: &'a Value, name: &str) -> &'a [Value] {
    root[name].as_array().map_or(&[], Vec::as_slice)
}

/// The bytes of an object with `buffer`, `byteOffset` and `byteLength`; `None` where there are none.
pub(super) fn bytes<'s>(
    root: &Value,
    stored: &'s mut StoredBuffers,
    object: &Value,
) -> Result<Option<&'s [u8]>, LoadError> {
    let Some(index) = number(&object["buffer"]) else { return Ok(None) };
    let Some(buffer) = list(root, "buffers").get(index) else { return Ok(None) };
    let uri = buffer["uri"].as_str();
    if uri.is_none() && index > 0 {
        return Ok(None);
    }
    let held = stored.read(index, uri, number(&buffer["byteLength"]).unwrap_or(0))?;
    let first = if object["byteOffset"].is_null() { Some(0) } else { number(&object["byteOffset"]) };
    let (Some(first), Some(length)) = (first, number(&object["byteLength"])) else { return Ok(None) };
    Ok(first.checked_add(length).and_then(|end| held.get(first..end)))
}

/// Adds a buffer of these bytes and returns its index.
pub(super) fn add_buffer(root: &mut Value, stored: &mut StoredBuffers, data: Vec<u8>) -> usize {
    // The address is never read, but a buffer without one could be the binary part of the file.
    let buffer = json!({ "byteLength": data.len().max(1), "uri": "data:application/octet-stream;base64," });
    let index = add(root, "buffers", buffer);
    stored.put(index, data);
    index
}

/// Adds to a list of the document, which exists or is made, and returns the index.
pub(super) fn add(root: &mut Value, name: &str, item: Value) -> usize {
    if !root[name].is_array() {
        root[name] = json!([]);
    }
    let list = root[name].as_array_mut();
    list.map_or(0, |list| {
        list.push(item);
        list.len() - 1
    })
}

/// Removes extensions that the document no longer has from its lists.
pub(super) fn unlist(root: &mut Value, names: &[&str]) {
    for list in ["extensionsUsed", "extensionsRequired"] {
        let Some(Value::Array(list)) = root.get_mut(list) else { continue };
        list.retain(|name| name.as_str().is_none_or(|name| !names.contains(&name)));
    }
}
