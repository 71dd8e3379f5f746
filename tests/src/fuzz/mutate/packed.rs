//! Changes of packed meshes, views and images: properties and bytes.

use super::places::{extreme, put};
use super::{Draft, Mutation};
use crate::Random;
use serde_json::{Value, json};

/// Changes of this module.
pub(super) const MUTATIONS: [Mutation; 4] =
    [("packed view", view), ("packed mesh", mesh), ("packed image", image), ("packed bytes", bytes)];

/// Extensions of views.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
const DRACO: &str = "KHR_draco_mesh_compression";

/// Changes a property of a view compressed by meshoptimizer.
fn view(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let (small, large) = (json!(random.below(70)), extreme(random));
    let mode = json!(random.pick(&["ATTRIBUTES", "TRIANGLES", "INDICES", "STRIPS"]));
    let filter = json!(random.pick(&["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR", "BLUR"]));
    let (key, value) = match random.below(8) {
        0 => ("mode", mode),
        1 => ("filter", filter),
        2 => ("byteStride", json!(4 * random.below(66))),
        3 => ("count", large),
        4 => ("count", small),
        5 => ("byteLength", if random.one_in(2) { small } else { large }),
        6 => ("byteOffset", if random.one_in(2) { small } else { large }),
        _ => ("buffer", json!(random.below(3))),
    };
    // Change a view only if it has an extension for compression.
    let (_, view) = draft.entry("bufferViews", random)?;
    let extensions = view.get_mut("extensions")?;
    let name = MESHOPT.into_iter().find(|name| extensions.get(name).is_some())?;
    put(&mut extensions[name], key, value)
}

/// Changes a property of a mesh's first primitive, compressed by Draco.
fn mesh(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let value = if random.one_in(2) { json!(random.below(12)) } else { extreme(random) };
    let name = *random.pick(&["POSITION", "NORMAL", "COLOR_0", "JOINTS_0", "WEIGHTS_0", "TEXCOORD_0"]);
    let is_view = random.one_in(3);
    let (_, mesh) = draft.entry("meshes", random)?;
    let packed = mesh.pointer_mut(&format!("/primitives/0/extensions/{DRACO}"))?;
    if is_view { put(packed, "bufferView", value) } else { put(packed.get_mut("attributes")?, name, value) }
}

/// Replaces the image of a texture by one in a packed format.
fn image(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let name = *random.pick(&["EXT_texture_webp", "KHR_texture_basisu"]);
    let source = if random.one_in(3) { extreme(random) } else { json!(random.below(12)) };
    let (_, texture) = draft.entry("textures", random)?;
    put(texture, "extensions", json!({ name: { "source": source } }))
}

/// Changes bytes of packed data, mostly near the start, where the counts are.
fn bytes(draft: &mut Draft, random: &mut Random) -> Option<()> {
    // Collect the views of packed meshes and images.
    let mut views = Vec::new();
    for view in draft.json.get("bufferViews")?.as_array()? {
        let extension = |name: &&str| view.get("extensions").and_then(|extensions| extensions.get(*name));
        views.extend(MESHOPT.iter().find_map(extension).cloned());
    }
    for mesh in draft.json.get("meshes")?.as_array()? {
        let packed = mesh.pointer(&format!("/primitives/0/extensions/{DRACO}/bufferView")).and_then(Value::as_u64);
        views.extend(packed.and_then(|view| draft.json["bufferViews"].get(view as usize).cloned()));
    }
    for image in draft.json.get("images").and_then(Value::as_array).into_iter().flatten() {
        let view = image.get("bufferView").and_then(Value::as_u64);
        views.extend(view.and_then(|view| draft.json["bufferViews"].get(view as usize).cloned()));
    }
    if views.is_empty() {
        return None;
    }
    // Change one to three bytes of a view.
    let view = random.pick(&views);
    let number = |key: &str| view.get(key).and_then(Value::as_u64).unwrap_or(0) as usize;
    let (start, length) = (number("byteOffset"), number("byteLength").max(1));
    for _ in 0..=random.below(3) {
        let near = if random.one_in(2) { length.min(100) } else { length };
        let byte = draft.bin.get_mut(start.checked_add(random.below(near))?)?;
        *byte = if random.one_in(3) { 0xff } else { random.below(256) as u8 };
    }
    Some(())
}
