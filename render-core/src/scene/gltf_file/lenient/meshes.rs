//! Accessors in formats that extensions add, and primitives that cannot be drawn without these accessors.

use super::{Normalized, index, objects};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// Extensions that contain vertices of a primitive outside of its accessors.
const COMPRESSED: [&str; 1] = ["KHR_draco_mesh_compression"];

/// Replaces accessors of unknown types with a single zero, so that all other indices stay valid. Returns the indices of
/// the replaced accessors and of accessors with a buffer without data. No drawn primitive reads any of them.
pub(super) fn accessors(root: &mut Value, dry: &BTreeSet<usize>) -> BTreeSet<usize> {
    let mut unreadable = BTreeSet::new();
    for (place, accessor) in objects(root, "accessors").enumerate() {
        // Replace accessors of unknown element or component types.
        let kind = accessor.get("type").and_then(Value::as_str);
        let component = accessor.get("componentType").and_then(Value::as_u64);
        let known_kind = kind.is_none_or(|k| ["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"].contains(&k));
        if !known_kind || component.is_some_and(|c| ![5120, 5121, 5122, 5123, 5125, 5126].contains(&c)) {
            *accessor = one_zero();
            unreadable.insert(place);
            continue;
        }
        // Mark accessors with a view of a buffer without data.
        let sparse = |part: &str| accessor.get("sparse")?.get(part)?.get("bufferView");
        let views = [accessor.get("bufferView"), sparse("indices"), sparse("values")];
        if views.into_iter().flatten().filter_map(index).any(|view| dry.contains(&view)) {
            unreadable.insert(place);
        }
    }
    // glTF 2.0, 3.7.2.1 requires bounds of positions, but this loader computes them from the positions.
    let mut positions = BTreeSet::new();
    for primitive in primitives_of(root) {
        positions.extend(primitive.get("attributes").and_then(|list| list.get("POSITION")).and_then(index));
    }
    for (_, accessor) in objects(root, "accessors").enumerate().filter(|(place, _)| positions.contains(place)) {
        for name in ["min", "max"] {
            accessor.entry(name).or_insert_with(|| json!([0.0, 0.0, 0.0]));
        }
    }
    unreadable
}

/// Returns an accessor of one scalar zero. Without a view, all elements are zero (glTF 2.0, 3.6.2.1).
fn one_zero() -> Map<String, Value> {
    Map::from_iter([
        ("componentType".into(), json!(5126)),
        ("count".into(), json!(1)),
        ("type".into(), json!("SCALAR")),
    ])
}

/// Returns the views of buffers without data, such as the fallback of `EXT_meshopt_compression`, which an extension
/// fills. Removes these buffers from `used`.
pub(super) fn dry_views(root: &mut Value, has_binary: bool, used: &mut BTreeSet<usize>) -> BTreeSet<usize> {
    // Find buffers without data. Only the first may be the binary chunk.
    let mut dry = BTreeSet::new();
    for (place, buffer) in objects(root, "buffers").enumerate() {
        if !buffer.contains_key("uri") && (place > 0 || !has_binary) {
            dry.insert(place);
            used.remove(&place);
        }
    }
    // Find the views of these buffers.
    let mut views = BTreeSet::new();
    for (place, view) in objects(root, "bufferViews").enumerate() {
        if view.get("buffer").and_then(index).is_some_and(|buffer| dry.contains(&buffer)) {
            views.insert(place);
        }
    }
    views
}

/// Removes unreadable content: attributes of unknown names, and primitives without positions (glTF 2.0, 3.7.2.1:
/// "client implementations SHOULD skip primitive's rendering").
pub(super) fn primitives(root: &mut Value, unreadable: &BTreeSet<usize>, found: &mut Normalized) {
    // Find accessors without data, which only extensions may fill.
    let mut without_view = BTreeSet::new();
    for (place, accessor) in objects(root, "accessors").enumerate() {
        if !accessor.contains_key("bufferView") && !accessor.contains_key("sparse") {
            without_view.insert(place);
        }
    }
    for mesh in objects(root, "meshes") {
        let Some(Value::Array(primitives)) = mesh.get_mut("primitives") else { continue };
        primitives.retain_mut(|primitive| {
            let Value::Object(primitive) = primitive else { return true };
            let compressed = COMPRESSED
                .into_iter()
                .find(|name| primitive.get("extensions").is_some_and(|extensions| extensions.get(name).is_some()));
            // Accessors of compressed vertices specify only count and type.
            let is_missing = |accessor: Option<usize>| {
                accessor.is_some_and(|place| {
                    unreadable.contains(&place) || (compressed.is_some() && without_view.contains(&place))
                })
            };

            // Keep only readable attributes.
            primitive.entry("attributes").or_insert_with(|| json!({}));
            if let Some(Value::Object(attributes)) = primitive.get_mut("attributes") {
                attributes.retain(|name, accessor| is_known(name) && !is_missing(index(accessor)));
            }

            // Skip primitives without positions, with unreadable indices or with an unknown mode.
            let has_positions =
                primitive["attributes"].get("POSITION").is_some() || !primitive["attributes"].is_object();
            let indices = primitive.get("indices").and_then(index);
            let mode = primitive.get("mode").and_then(Value::as_u64);
            let keep = has_positions && !is_missing(indices) && mode.is_none_or(|mode| mode <= 6);
            if !keep {
                found.note(&match compressed {
                    Some(name) => format!("meshes with vertices only in {name} are left out"),
                    None => "primitives without readable positions are left out".into(),
                });
            }
            keep
        });
    }
}

/// Returns whether the specification defines an attribute of this name.
fn is_known(name: &str) -> bool {
    let numbered = |prefix: &str| name.strip_prefix(prefix).is_some_and(|set| set.parse::<u32>().is_ok());
    ["POSITION", "NORMAL", "TANGENT"].contains(&name)
        || ["TEXCOORD_", "COLOR_", "JOINTS_", "WEIGHTS_"].into_iter().any(numbered)
}

/// Returns all primitives of the document.
fn primitives_of(root: &mut Value) -> impl Iterator<Item = &mut Map<String, Value>> {
    let lists = objects(root, "meshes").filter_map(|mesh| mesh.get_mut("primitives")?.as_array_mut());
    lists.flatten().filter_map(Value::as_object_mut)
}
