//! Primitives packed by `KHR_draco_mesh_compression`.

use super::draco::{Attribute, Most, Unpacked, decode};
use super::raw::{add, add_buffer, bytes, list, number, unlist};
use super::{LoadError, Loader, StoredBuffers};
use crate::scene::gltf_file::guarded;
use serde_json::{Map, Value, json};
use std::collections::{BTreeSet, HashMap};

const NAME: &str = "KHR_draco_mesh_compression";

/// Size of a triangle's indices \[bytes\].
const TRIANGLE: usize = 12;

/// Index of a primitive: the index of its mesh, and its index in the mesh.
#[derive(Clone, Copy)]
struct PrimitiveIndex {
    mesh: usize,
    primitive: usize,
}

/// Accessors of unpacked data: the indices, and the attributes by name.
#[derive(Clone)]
struct Accessors {
    indices: usize,
    attributes: Vec<(String, usize)>,
}

impl Loader<'_> {
    /// Unpacks the primitives of all meshes that a node shows.
    pub(super) fn unpack_primitives(
        &self,
        root: &mut Value,
        stored: &mut StoredBuffers,
        notes: &mut Vec<String>,
    ) -> Result<(), LoadError> {
        // Unpack only meshes in use.
        let shown: BTreeSet<usize> = list(root, "nodes").iter().filter_map(|node| number(&node["mesh"])).collect();
        let all = packed(root);
        let mut read: HashMap<String, Accessors> = HashMap::new();
        let mut replaced = BTreeSet::new();
        for &place in all.iter().filter(|place| shown.contains(&place.mesh)) {
            let primitive = at(root, place).clone();
            let extension = &primitive["extensions"][NAME];
            // Primitives that differ only in their material share their vertices.
            let key = format!("{} {extension}", primitive["indices"]);
            if !read.contains_key(&key) {
                let unpacked = unpacked(root, stored, &primitive)?;
                if stored.allowance.is_exhausted() {
                    let PrimitiveIndex { mesh, primitive } = place;
                    return self.bad(format!(
                        "mesh {mesh} primitive {primitive} unpacks to far more bytes than the file has; export it again"
                    ));
                }
                match unpacked {
                    Ok(unpacked) => {
                        read.insert(key.clone(), add_accessors(root, stored, &primitive, unpacked));
                    }
                    Err(fault) => self.keep_plain(root, notes, place, &fault)?,
                }
            }

            // Let the primitive refer to plain data, or keep its plain copy.
            let primitive = at(root, place);
            if let Some(accessors) = read.get(&key) {
                replace(primitive, accessors, &mut replaced);
            }
            if let Some(Value::Object(extensions)) = primitive.get_mut("extensions") {
                extensions.remove(NAME);
            }
        }
        // Release the replaced accessors. Keep the extension listed while hidden meshes use it.
        free(root, replaced);
        if all.iter().all(|place| shown.contains(&place.mesh)) {
            unlist(root, &[NAME]);
        }
        Ok(())
    }

    /// Adds a note that the plain copy is read. Without a plain copy, returns an error for the damaged packed data.
    fn keep_plain(
        &self,
        root: &Value,
        notes: &mut Vec<String>,
        place: PrimitiveIndex,
        fault: &str,
    ) -> Result<(), LoadError> {
        let PrimitiveIndex { mesh, primitive: index } = place;
        // A plain copy needs positions, and data for each accessor.
        let primitive = &root["meshes"][mesh]["primitives"][index];
        let view = &primitive["extensions"][NAME]["bufferView"];
        let attributes = primitive["attributes"].as_object().into_iter().flat_map(Map::values);
        let indices = primitive.get("indices");
        let is_plain = |accessor: &Value| {
            let accessor = number(accessor).and_then(|accessor| list(root, "accessors").get(accessor));
            accessor.is_some_and(|a| !a["bufferView"].is_null() || !a["sparse"].is_null())
        };
        let what = format!("mesh {mesh} primitive {index}: its {NAME} data (buffer view {view}) {fault}");
        if primitive["attributes"]["POSITION"].is_null() || !attributes.chain(indices).all(is_plain) {
            return self.bad(format!("{what}; export it again"));
        }
        notes.push(format!("{what}; its plain copy is read"));
        Ok(())
    }
}

/// Returns the primitives with the extension.
fn packed(root: &Value) -> Vec<PrimitiveIndex> {
    let mut places = Vec::new();
    for (m, mesh) in list(root, "meshes").iter().enumerate() {
        for (p, primitive) in list(mesh, "primitives").iter().enumerate() {
            if primitive["extensions"][NAME].is_object() {
                places.push(PrimitiveIndex { mesh: m, primitive: p });
            }
        }
    }
    places
}

fn at(root: &mut Value, place: PrimitiveIndex) -> &mut Value {
    &mut root["meshes"][place.mesh]["primitives"][place.primitive]
}

/// Unpacks a mesh, or returns the reason for the failure.
fn unpacked(
    root: &Value,
    stored: &mut StoredBuffers,
    primitive: &Value,
) -> Result<Result<Unpacked, String>, LoadError> {
    let extension = &primitive["extensions"][NAME];
    // Collect the ids of the attributes.
    let mut ids = Vec::new();
    for id in extension["attributes"].as_object().into_iter().flat_map(Map::values) {
        match number(id).and_then(|id| u32::try_from(id).ok()) {
            Some(id) => ids.push(id),
            None => return Ok(Err("has an attribute with an id that is not a number".into())),
        }
    }
    // Read the packed bytes.
    let view = number(&extension["bufferView"]).and_then(|view| list(root, "bufferViews").get(view));
    let bytes_left = stored.allowance.left();
    let data = match view {
        Some(view) => bytes(root, stored, view)?,
        None => None,
    };
    let Some(data) = data else { return Ok(Err("is outside its buffer".into())) };

    // A strip has two fewer triangles than indices.
    let indices = number(&primitive["indices"]).and_then(|indices| list(root, "accessors").get(indices));
    let stated = indices.and_then(|accessor| number(&accessor["count"]));
    let per_triangle = if number(&primitive["mode"]) == Some(5) { 1 } else { 3 };
    let triangles = stated.map_or(bytes_left / TRIANGLE, |indices| indices / per_triangle);
    let most = Most { triangles, bytes: bytes_left };
    // Decode in a guarded call, and charge the allowance for the result.
    let unpacked = guarded(|| decode(data, &ids, most)).unwrap_or_else(|| Err("is damaged".into()));
    if let Ok(Unpacked { indices, attributes, .. }) = &unpacked {
        let bytes = attributes.iter().map(|attribute| attribute.bytes.len()).sum::<usize>();
        stored.allowance.charge(bytes.saturating_add(indices.len().saturating_mul(4)));
    }
    Ok(unpacked)
}

/// Adds a buffer, views and accessors for the unpacked mesh.
fn add_accessors(root: &mut Value, stored: &mut StoredBuffers, primitive: &Value, unpacked: Unpacked) -> Accessors {
    let Unpacked { indices, vertices, attributes } = unpacked;
    // Add the indices as 32-bit numbers.
    let count = indices.len();
    let indices: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
    let indices = Attribute { bytes: indices, component: 5125, width: 1 };
    let indices = add_accessor(root, stored, indices, count, false);
    // Add the attributes, normalized as the file states. Floats are never normalized.
    let mut named = Vec::new();
    let names = primitive["extensions"][NAME]["attributes"].as_object().into_iter().flat_map(Map::keys);
    for (name, attribute) in names.zip(attributes) {
        let plain = number(&primitive["attributes"][name]).and_then(|plain| list(root, "accessors").get(plain));
        let is_normalized = plain.is_some_and(|plain| plain["normalized"] == true) && attribute.component != 5126;
        named.push((name.clone(), add_accessor(root, stored, attribute, vertices, is_normalized)));
    }
    Accessors { indices, attributes: named }
}

fn add_accessor(
    root: &mut Value,
    stored: &mut StoredBuffers,
    attribute: Attribute,
    count: usize,
    is_normalized: bool,
) -> usize {
    let Attribute { bytes, component, width } = attribute;
    let length = bytes.len().max(1);
    let buffer = add_buffer(root, stored, bytes);
    let view = add(root, "bufferViews", json!({ "buffer": buffer, "byteLength": length }));
    let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
    let mut accessor = json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
    if is_normalized {
        accessor["normalized"] = json!(true);
    }
    add(root, "accessors", accessor)
}

/// Assigns the unpacked accessors to a primitive. Draco data always contains triangles, regardless of the primitive's
/// mode.
fn replace(primitive: &mut Value, accessors: &Accessors, replaced: &mut BTreeSet<usize>) {
    // Assign the indices and the mode of triangles.
    replaced.extend(primitive.get("indices").and_then(number));
    primitive["indices"] = json!(accessors.indices);
    primitive["mode"] = json!(4);
    if !primitive["attributes"].is_object() {
        primitive["attributes"] = json!({});
    }
    // Assign the attributes, and note the accessors that they replace.
    for (name, accessor) in &accessors.attributes {
        replaced.extend(primitive["attributes"].get(name).and_then(number));
        primitive["attributes"][name] = json!(accessor);
    }
}

/// Removes the views from accessors that are no longer in use, since the buffers of these views may be missing.
fn free(root: &mut Value, mut replaced: BTreeSet<usize>) {
    if replaced.is_empty() {
        return;
    }
    keep_named(root, &mut replaced);
    for place in replaced {
        if let Some(Value::Object(accessor)) = root["accessors"].get_mut(place) {
            accessor.retain(|name, _| !["bufferView", "byteOffset", "sparse"].contains(&name.as_str()));
        }
    }
}

/// Removes accessors that the document still refers to from the set.
fn keep_named(value: &Value, accessors: &mut BTreeSet<usize>) {
    let mut forget = |value: &Value| number(value).is_some_and(|accessor| accessors.remove(&accessor));
    match value {
        Value::Object(object) => {
            for (name, member) in object {
                match (name.as_str(), member) {
                    ("indices" | "input" | "output" | "inverseBindMatrices", _) => _ = forget(member),
                    ("attributes", Value::Object(named)) => named.values().for_each(|accessor| _ = forget(accessor)),
                    ("targets", Value::Array(targets)) => {
                        let named = targets.iter().filter_map(Value::as_object).flat_map(Map::values);
                        named.for_each(|accessor| _ = forget(accessor));
                    }
                    _ => {}
                }
            }
            object.values().for_each(|member| keep_named(member, accessors));
        }
        Value::Array(list) => list.iter().for_each(|item| keep_named(item, accessors)),
        _ => {}
    }
}
