//! Images without data, and textures that use these images.

use super::{Normalized, index, objects};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Placeholder image for indices that must be valid. No material uses it.
const PLACEHOLDER: &str = "data:application/octet-stream;base64,";

/// Extensions for textures in additional formats, each with whether this build reads it.
const FORMATS: [(&str, bool); 2] =
    [("KHR_texture_basisu", cfg!(feature = "basis")), ("EXT_texture_webp", cfg!(feature = "webp"))];

/// Removes textures without a readable image from materials (glTF 2.0, 5.29: `source` may be omitted).
pub(super) fn images(root: &mut Value, dry: &BTreeSet<usize>, found: &mut Normalized) {
    // Find images without data.
    let mut empty = BTreeSet::new();
    for (place, image) in objects(root, "images").enumerate() {
        let view = image.get("bufferView").and_then(index);
        if view.is_some_and(|view| dry.contains(&view)) {
            empty.insert(place);
        }
        if image.contains_key("bufferView") {
            // The decoder inspects the data itself.
            image.entry("mimeType").or_insert_with(|| json!("image/png"));
        } else if !image.contains_key("uri") {
            image.insert("uri".into(), json!(PLACEHOLDER));
            empty.insert(place);
        }
    }

    // Replace unknown filters and wrappings with the defaults.
    for sampler in objects(root, "samplers") {
        for (name, known) in [
            ("magFilter", &[9728, 9729][..]),
            ("minFilter", &[9728, 9729, 9984, 9985, 9986, 9987]),
            ("wrapS", &[33071, 33648, 10497]),
            ("wrapT", &[33071, 33648, 10497]),
        ] {
            if sampler.get(name).and_then(Value::as_u64).is_some_and(|value| !known.contains(&value)) {
                sampler.remove(name);
            }
        }
    }

    // Find textures that use such an image. An extension's image has priority over the plain image.
    let mut without = BTreeSet::new();
    for (place, texture) in objects(root, "textures").enumerate() {
        let formats = FORMATS.into_iter().filter(|(_, is_read)| *is_read);
        let source = |(name, _)| texture.get("extensions")?.get(name)?.get("source").and_then(index);
        if let Some(source) = formats.filter_map(source).find(|source| !empty.contains(source)) {
            let plain = texture.insert("source".into(), json!(source)).as_ref().and_then(index);
            found.plain_images.extend(plain.filter(|plain| !empty.contains(plain)).map(|plain| (place, plain)));
        }
        match texture.get("source").map(index) {
            None => {
                without.insert(place);
                texture.insert("source".into(), json!(0));
            }
            Some(Some(source)) if empty.contains(&source) => {
                without.insert(place);
            }
            Some(_) => {}
        }
    }

    // Remove textures without a readable image from materials.
    if without.is_empty() {
        return;
    }
    // Texture indices must be valid, so add an image if there is none.
    if objects(root, "images").next().is_none() {
        root["images"] = json!([{ "uri": PLACEHOLDER }]);
    }
    let mut removed = 0;
    for material in objects(root, "materials") {
        for member in material.values_mut() {
            removed += remove_slots(member, &without);
        }
        // Remove references that are direct members of the material.
        let names: Vec<String> = material.keys().cloned().collect();
        for name in names {
            if leads_to(&material[&name], &without) {
                material.remove(&name);
                removed += 1;
            }
        }
    }
    if removed > 0 {
        found.note("textures without a readable image are left out: their surfaces have a plain color");
    }
}

/// Removes all references to these textures from an object and its descendants. Returns the number of references.
fn remove_slots(value: &mut Value, without: &BTreeSet<usize>) -> usize {
    let Value::Object(object) = value else { return 0 };
    let count = object.len();
    object.retain(|_, member| !leads_to(member, without));
    let removed = count - object.len();
    removed + object.values_mut().map(|member| remove_slots(member, without)).sum::<usize>()
}

/// Returns whether a value is a reference to one of these textures.
fn leads_to(value: &Value, textures: &BTreeSet<usize>) -> bool {
    value.get("index").and_then(index).is_some_and(|texture| textures.contains(&texture))
}
