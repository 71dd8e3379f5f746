//! Removal of unreferenced objects from a document.

use super::document::{Document, number};
use pipeline::error::Result;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Function that is called with each reference to an object.
type Visitor<'a> = &'a mut dyn FnMut(&mut Value);
/// Function that calls a visitor with all references to one list of a document.
type VisitReferences = fn(&mut Value, Visitor);

/// Extensions of the document that refer to no object in [`LISTS`].
const KEPT: [&str; 3] = ["KHR_lights_punctual", "KHR_materials_variants", "KHR_xmp_json_ld"];

/// Lists of objects, with functions that visit the references to them. Each list follows the lists that refer to it.
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
    // Remove unknown extensions: they may refer to objects by index.
    if let Some(Value::Object(extensions)) = document.json.get_mut("extensions") {
        extensions.retain(|name, _| KEPT.contains(&name.as_str()));
    }
    for (name, references) in LISTS {
        let count = document.list(name).len();

        // Find the referenced objects and assign their new indices.
        let mut new = BTreeMap::new();
        references(&mut document.json, &mut |reference| {
            new.extend(number(reference).map(|index| (index, 0)));
        });
        if new.keys().any(|&index| index >= count) {
            return Err(document.damaged(&format!("a reference to its {name}")));
        }
        new.values_mut().enumerate().for_each(|(place, new)| *new = place);

        // Update the references, and drop unreferenced objects.
        references(&mut document.json, &mut |reference| {
            if let Some(place) = number(reference).and_then(|index| new.get(&index)) {
                *reference = json!(place);
            }
        });
        let kept: Vec<Value> = new.keys().map(|&index| document.json[name][index].take()).collect();
        // Remove empty lists: glTF does not allow them.
        match document.json.as_object_mut() {
            Some(json) if kept.is_empty() => drop(json.remove(name)),
            _ => document.json[name] = json!(kept),
        }
    }
    Ok(())
}

/// Calls `visit` for each element of the list or object `name`.
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

/// Visits texture references, in materials and their extensions: `index` below a name that ends in "Texture".
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
        // Visit images that extensions add in other formats.
        each(texture, "extensions", |extension| refer(extension, "source", visit));
    });
}

fn accessors(json: &mut Value, visit: Visitor) {
    each(json, "meshes", |mesh| {
        each(mesh, "primitives", |primitive| {
            each(primitive, "attributes", &mut *visit);
            refer(primitive, "indices", visit);
            if let Some(Value::Array(targets)) = primitive.get_mut("targets") {
                for target in targets.iter_mut().filter_map(Value::as_object_mut) {
                    target.values_mut().for_each(&mut *visit);
                }
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
        // Visit the transforms of instanced nodes, which an extension stores in accessors.
        if let Some(instancing) = node.pointer_mut("/extensions/EXT_mesh_gpu_instancing") {
            each(instancing, "attributes", &mut *visit);
        }
    });
}

fn views(json: &mut Value, visit: Visitor) {
    each(json, "accessors", |accessor| {
        refer(accessor, "bufferView", visit);
        // Visit indices and values of sparse accessors; their count is a number, not an object.
        each(accessor, "sparse", |part| {
            if part.is_object() {
                refer(part, "bufferView", visit);
            }
        });
    });
    each(json, "images", |image| refer(image, "bufferView", visit));
}
