//! Materials that show the baked texture unchanged.

use super::document::Document;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Filter mode of glTF that samples only the finest level of an image.
const LINEAR: u32 = 9729;
/// Wrap mode of glTF that clamps samples to the edge of an image.
const CLAMP_TO_EDGE: u32 = 33071;

/// The baked texture, and one new material for each of the scene's materials.
pub(super) struct Materials {
    texture: usize,
    /// New material for each replaced material; `None` is glTF's default material.
    made: BTreeMap<Option<usize>, usize>,
}

impl Materials {
    /// Adds the baked texture `png` to the document.
    pub fn new(document: &mut Document, png: Vec<u8>) -> Self {
        let view = document.add_view(png);
        let image = json!({ "name": "baked light", "mimeType": "image/png", "bufferView": view });
        let source = document.push("images", image);
        let sampler =
            json!({ "magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE });
        let sampler = document.push("samplers", sampler);
        let texture = document.push("textures", json!({ "source": source, "sampler": sampler }));
        Self { texture, made: BTreeMap::new() }
    }

    /// Returns the unlit, single-sided material that replaces `material`, with unchanged alpha mode.
    pub fn baked(&mut self, document: &mut Document, material: Option<usize>) -> usize {
        if let Some(&made) = self.made.get(&material) {
            return made;
        }
        let old = material.and_then(|index| document.list("materials").get(index)).cloned().unwrap_or_default();
        // Show the texture unlit: it already contains the light.
        let mut new = json!({
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": self.texture, "texCoord": 1 }, "metallicFactor": 0, "roughnessFactor": 1
            },
            "extensions": { "KHR_materials_unlit": {} }
        });
        // Keep the alpha mode: the texture contains opacity, too.
        for name in ["name", "alphaMode", "alphaCutoff", "extras"] {
            if !old[name].is_null() {
                new[name] = old[name].clone();
            }
        }
        let made = document.push("materials", new);
        self.made.insert(material, made);
        made
    }
}

/// Lists the extensions that the document uses. The extension for quantized attributes stays: objects that use it do
/// not name it.
pub(super) fn list_extensions(document: &mut Document) {
    let mut found = vec!["KHR_mesh_quantization".to_owned()];
    collect(&document.json, &mut found);
    // Keep the listed extensions that some object still uses.
    for list in ["extensionsUsed", "extensionsRequired"] {
        let mut names: Vec<String> = Vec::new();
        for name in document.list(list).iter().filter_map(Value::as_str) {
            names.extend(found.iter().any(|found| found == name).then(|| name.to_owned()));
        }
        let unlit = "KHR_materials_unlit";
        if list == "extensionsUsed" && !names.iter().any(|name| name == unlit) {
            names.push(unlit.to_owned());
        }
        match document.json.as_object_mut() {
            Some(json) if names.is_empty() => drop(json.remove(list)),
            _ => document.json[list] = json!(names),
        }
    }
}

/// Collects the names of all extensions of objects below `value`.
fn collect(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Array(list) => list.iter().for_each(|value| collect(value, found)),
        Value::Object(map) => {
            for (name, value) in map {
                if let (Value::Object(extensions), "extensions") = (value, name.as_str()) {
                    found.extend(extensions.keys().cloned());
                }
                collect(value, found);
            }
        }
        _ => {}
    }
}
