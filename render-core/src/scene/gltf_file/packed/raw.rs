//! Access to unvalidated documents.

use super::StoredBuffers;
use crate::scene::gltf_file::LoadError;
use serde_json::{Value, json};

/// Parses an index or a count.
pub(super) fn number(value: &Value) -> Option<usize> {
    let float = || value.as_f64().filter(|x| x.fract() == 0.0 && (0.0..4e9).contains(x));
    value.as_u64().and_then(|number| usize::try_from(number).ok()).or_else(|| float().map(|x| x as usize))
}

/// Returns a list in the document, or an empty list if it is missing.
pub(super) fn list<'a>(root: &'a Value, name: &str) -> &'a [Value] {
    root[name].as_array().map_or(&[], Vec::as_slice)
}

/// Returns the bytes of an object with `buffer`, `byteOffset` and `byteLength`, or `None` if one of them is missing.
pub(super) fn bytes<'s>(
    root: &Value,
    stored: &'s mut StoredBuffers,
    object: &Value,
) -> Result<Option<&'s [u8]>, LoadError> {
    // Without URI, only the first buffer can be the binary chunk.
    let Some(index) = number(&object["buffer"]) else { return Ok(None) };
    let Some(buffer) = list(root, "buffers").get(index) else { return Ok(None) };
    let uri = buffer["uri"].as_str();
    if uri.is_none() && index > 0 {
        return Ok(None);
    }
    // Check the range in the buffer.
    let held = stored.read(index, uri, number(&buffer["byteLength"]).unwrap_or(0))?;
    let first = if object["byteOffset"].is_null() { Some(0) } else { number(&object["byteOffset"]) };
    let (Some(first), Some(length)) = (first, number(&object["byteLength"])) else { return Ok(None) };
    Ok(first.checked_add(length).and_then(|end| held.get(first..end)))
}

/// Adds a buffer that contains `data` and returns its index.
pub(super) fn add_buffer(root: &mut Value, stored: &mut StoredBuffers, data: Vec<u8>) -> usize {
    // The URI is never read, but a buffer without URI could be the file's binary chunk.
    let buffer = json!({ "byteLength": data.len().max(1), "uri": "data:application/octet-stream;base64," });
    let index = add(root, "buffers", buffer);
    stored.put(index, data);
    index
}

/// Appends an item to a list of the document and returns the item's index. A missing list is created.
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

/// Removes these extensions from the document's lists of extensions.
pub(super) fn unlist(root: &mut Value, names: &[&str]) {
    for list in ["extensionsUsed", "extensionsRequired"] {
        let Some(Value::Array(list)) = root.get_mut(list) else { continue };
        list.retain(|name| name.as_str().is_none_or(|name| !names.contains(&name)));
    }
}
