//! Materials, textures and lights.

use super::places::{extreme, member, put};
use super::{Draft, Mutation};
use crate::Random;
use serde_json::{Value, json};

/// Changes of this module.
pub(super) const MUTATIONS: [Mutation; 8] = [
    ("material", material),
    ("material", material),
    ("material extension", extension),
    ("texture", texture),
    ("texture transform", texture_transform),
    ("light", light),
    ("required extension", required),
    ("image", image),
];

/// Returns a factor in or out of range.
fn factor(random: &mut Random) -> Value {
    if random.one_in(3) { extreme(random) } else { json!(random.pick(&[0.0, 0.25, 1.0, 1.5, -0.5, 100.0, 1e6])) }
}

/// Returns a list of factors.
fn factors(random: &mut Random, count: usize) -> Value {
    (0..count).map(|_| factor(random)).collect()
}

/// Changes a factor or a mode of a material.
fn material(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let (one, three, four) = (factor(random), factors(random, 3), factors(random, 4));
    let (change, mode) = (random.below(9), *random.pick(&["OPAQUE", "MASK", "BLEND", "mask"]));
    let (_, material) = draft.entry("materials", random)?;
    match change {
        0 => put(material, "alphaMode", json!(mode)),
        1 => put(material, "alphaMode", json!("MASK")).and_then(|()| put(material, "alphaCutoff", one)),
        2 => put(material, "emissiveFactor", three),
        3 => put(material, "doubleSided", json!(true)),
        4 => put(member(material, "pbrMetallicRoughness")?, "baseColorFactor", four),
        5 => put(member(material, "pbrMetallicRoughness")?, "metallicFactor", one),
        6 => put(member(material, "pbrMetallicRoughness")?, "roughnessFactor", one),
        7 => put(material, "emissiveFactor", json!([1, 1, 1])),
        _ => put(member(material, "normalTexture")?, "scale", one),
    }
}

/// Adds an extension to a material, known or unknown.
fn extension(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let (one, three) = (factor(random), factors(random, 3));
    let extensions = [
        ("KHR_materials_emissive_strength", json!({ "emissiveStrength": one })),
        ("KHR_materials_emissive_strength", json!({ "emissiveStrength": extreme(random) })),
        ("KHR_materials_ior", json!({ "ior": one })),
        ("KHR_materials_specular", json!({ "specularFactor": one, "specularColorFactor": three })),
        ("KHR_materials_transmission", json!({ "transmissionFactor": one })),
        ("KHR_materials_volume", json!({ "thicknessFactor": one, "attenuationColor": three })),
        ("KHR_materials_unlit", json!({})),
        ("KHR_materials_unlit", json!([])),
        ("KHR_materials_sheen", json!({ "sheenColorFactor": three })),
    ];
    let (name, value) = random.pick(&extensions).clone();
    let (_, material) = draft.entry("materials", random)?;
    put(member(material, "extensions")?, name, value)
}

/// Texture slots of a material.
const SLOTS: [(&str, &str); 4] = [
    ("pbrMetallicRoughness", "baseColorTexture"),
    ("pbrMetallicRoughness", "metallicRoughnessTexture"),
    ("", "normalTexture"),
    ("", "emissiveTexture"),
];

/// Returns a texture slot of a random material, created if missing.
fn slot<'a>(draft: &'a mut Draft, random: &mut Random) -> Option<&'a mut Value> {
    let (part, name) = *random.pick(&SLOTS);
    let (_, material) = draft.entry("materials", random)?;
    let owner = if part.is_empty() { material } else { member(material, part)? };
    let slot = member(owner, name)?;
    if slot.get("index").is_none() {
        put(slot, "index", json!(0))?;
    }
    Some(slot)
}

/// Assigns a texture, possibly a missing one, or changes the mode of a sampler.
fn texture(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let any = random.below(4);
    // Add a sampler with a random mode, or a reference to a missing one.
    if random.one_in(3) {
        let mode = *random.pick(&[33071, 33648, 10497, 9728, 9987, 0]);
        let key = *random.pick(&["wrapS", "wrapT", "magFilter", "minFilter"]);
        let sampler = draft.push("samplers", json!({ key: mode }))?;
        let (_, texture) = draft.entry("textures", random)?;
        return put(texture, "sampler", json!(sampler + usize::from(any == 0)));
    }
    let key = *random.pick(&["index", "texCoord"]);
    put(slot(draft, random)?, key, json!(any))
}

/// Changes the transform of a texture.
fn texture_transform(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let (two, one) = (factors(random, 2), extreme(random));
    let changes = [("offset", two.clone()), ("scale", two), ("rotation", one.clone()), ("texCoord", one)];
    let (key, value) = random.pick(&changes).clone();
    let extensions = member(slot(draft, random)?, "extensions")?;
    put(member(extensions, "KHR_texture_transform")?, key, value)
}

/// Attaches a light to a node, with any color, intensity, range and angles.
fn light(draft: &mut Draft, random: &mut Random) -> Option<()> {
    // Describe the light; many properties are optional.
    let kind = *random.pick(&["point", "spot", "directional", "area"]);
    let mut light = json!({ "type": kind, "intensity": factor(random) });
    if random.one_in(2) {
        light["color"] = factors(random, 3);
    }
    if random.one_in(3) {
        light["range"] = factor(random);
    }
    if kind == "spot" {
        light["spot"] = json!({});
        if random.one_in(2) {
            light["spot"] = json!({ "innerConeAngle": factor(random), "outerConeAngle": factor(random) });
        }
    }

    // The list of lights is an extension of the document.
    let list = member(member(&mut draft.json, "extensions")?, "KHR_lights_punctual")?;
    let list = list.as_object_mut()?.entry("lights").or_insert_with(|| json!([])).as_array_mut()?;
    list.push(light);
    let place = list.len() - usize::from(!random.one_in(10));
    let (_, node) = draft.entry("nodes", random)?;
    put(member(node, "extensions")?, "KHR_lights_punctual", json!({ "light": place }))
}

/// Marks an extension as required.
fn required(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let names =
        ["KHR_texture_transform", "KHR_mesh_quantization", "KHR_draco_mesh_compression", "ACME_\u{1b}[2J\nx", ""];
    let name = *random.pick(&names);
    put(&mut draft.json, "extensionsRequired", json!([name]))?;
    put(&mut draft.json, "extensionsUsed", json!([name]))
}

/// Changes the type or the bytes of an image.
fn image(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let kind = *random.pick(&["image/png", "image/jpeg", "image/webp", "text/plain"]);
    let view = random.below(draft.count("bufferViews") + 1);
    let (_, image) = draft.entry("images", random)?;
    put(image, "mimeType", json!(kind))?;
    put(image, "bufferView", json!(view))
}
