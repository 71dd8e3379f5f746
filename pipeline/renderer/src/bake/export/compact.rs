//! Removes unreferenced objects from a document.

use super::document::{Document, number};
use pipeline::error::Result;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Callback for each reference to an object.
type Visitor<'a> = &'a mut dyn FnMut(&mut Value);
/// Function that calls a visitor with all references of one kind in a document.
type VisitReferences = fn(&mut Value, Visitor);

/// Document extensions that refer to no object of the lists below.
const KEPT: [&str; 3] = ["KHR_lights_punctual", "KHR_materials_variants", "KHR_xmp_json_ld"];

/// Lists of objects, and functions that find references to them. Each list follows the lists that refer to it.
const LISTS: [(&str, VisitReferences); 7] = [
    ("meshes", |json, visit| each(json, "nodes", |node| refer(node, "mesh", visit))),
    ("materials", materials),
    ("textures", |json, visit| each(json, "materials", |material| textures(material, visit))),
    ("samplers", |json, visit| each(json, "textures", |texture| refer(texture, "sampler", visit))),
    ("images", images),
    ("accessors", accessors),
    ("bufferViews", views),
];

/// Removes unreferenced objects, and unknown extensions that may refer to objects by index.
pub(super) fn compact(document: &mut Document) -> Result<()> {
    // Unknown extensions may refer to objects by index.
    if let Some(Value::Object(extensions)) = document.json.get_mut("extensions") {
        extensions.retain(|name, _| KEPT.contains(&name.as_str()));
    }
    for (name, references) in LISTS {
        let count = document.list(name).len();

        // Referenced objects and their new indices.
        let mut new = BTreeMap::new();
        references(&mut document.json, &mut |reference| {
            new.extend(number(reference).map(|index| (index, 0)));
        });
        if new.keys().any(|&index| index >= count) {
            return Err(document.damaged(&format!("a reference to its {name}")));
        }
        new.values_mut().enumerate().for_each(|(place, new)| *new = place);

        // Update the references and drop the other objects.
        references(&mut document.json, &mut |reference| {
            if let Some(place) = number(reference).and_then(|index| new.get(&index)) {
                *reference = json!(place);
            }
        });
        let kept: Vec<Value> = new.keys().map(|&index| document.json[name][index].take()).collect();
        // Lists in glTF must not be empty.
        match document.json.as_object_mut() {
            Some(json) if kept.is_empty() => drop(json.remove(name)),
            _ => document.json[name] = json!(kept),
        }
    }
    Ok(())
}

/// Calls `visit` for each element of a list or an object.
fn each(value: &mut Value, name: &str, mut visit: impl FnMut(&mut Value)) {
    match value.get_mut(name) {
        Some(Value::Array(list)) => list.iter_mut().for_each(&mut visit),
        Some(Value::Object(map)) => map.values_mut().for_each(&mut visit),
        _ => {}
    }
}

/// Calls `visit` for the reference `name` if it exists.
fn refer(value: &mut Value, name: &str, visit: Visitor) {
    if let Some(reference) = value.get_mut(name) {
        visit(reference);
    }
}

fn materials(json: &mut Value, visit: Visitor) {
    each(json, "meshes", |mesh| {
        each(mesh, "primitives", |primitive| {
            refer(primitive, "material", visit);
            if let Some(variants) = primitive.pointer_mut("/extensions/KHR_materials_variants") {
                each(variants, "mappings", |mapping| refer(mapping, "material", visit));
            }
        });
    });
}

/// Texture references have an `index` below a name that ends in "Texture", in materials and in their extensions.
fn textures(value: &mut Value, visit: Visitor) {
    let Value::Object(map) = value else { return };
    for (name, value) in map {
        if name.ends_with("Texture") {
            refer(value, "index", visit);
        } else if name != "extras" {
            textures(value, visit);
        }
    }
}

fn images(json: &mut Value, visit: Visitor) {
    each(json, "textures", |texture| {
        refer(texture, "source", visit);
        // Images of other formats.
        each(texture, "extensions", |extension| refer(extension, "source", visit));
    });
}

fn accessors(json: &mut Value, visit: Visitor) {
    each(json, "meshes", |mesh| {
        each(mesh, "primitives", |primitive| {
            each(primitive, "attributes", &mut *visit);
            refer(primitive, "indices", visit);
            if let Some(Value::Array(targets)) = primitive.get_mut("targets") {
                targets.iter_mut().filter_map(Value::as_object_mut).flatten().for_each(|(_, value)| visit(value));
            }
        });
    });
    each(json, "skins", |skin| refer(skin, "inverseBindMatrices", visit));
    each(json, "animations", |animation| {
        each(animation, "samplers", |sampler| {
            refer(sampler, "input", visit);
            refer(sampler, "output", visit);
        });
    });
    each(json, "nodes", |node| {
        if let Some(instancing) = node.pointer_mut("/extensions/EXT_mesh_gpu_instancing") {
            each(instancing, "attributes", &mut *visit);
        }
    });
}

fn views(json: &mut Value, visit: Visitor) {
    each(json, "accessors", |accessor| {
        refer(accessor, "bufferView", visit);
        each(accessor, "sparse", |part| {
            if part.is_object() {
                refer(part, "bufferView", visit);
            }
        });
    });
    each(json, "images", |image| refer(image, "bufferView", visit));
}
