//! Animations and skins.

use super::places::{extreme, float, put};
use super::{Draft, Mutation};
use crate::Random;
use serde_json::{Value, json};

/// Changes of this module.
pub(super) const MUTATIONS: [Mutation; 6] = [
    ("keys", keys),
    ("keys", keys),
    ("channel", channel),
    ("new animation", new_animation),
    ("new skin", new_skin),
    ("skin", skin),
];

/// Animated properties, two of them invalid.
const PATHS: [&str; 6] = ["translation", "rotation", "scale", "weights", "pointer", ""];
/// Interpolation modes, the last of them invalid.
const WAYS: [&str; 4] = ["LINEAR", "STEP", "CUBICSPLINE", "BEZIER"];

/// Changes times or values of a sampler: equal, descending, far away or NaN.
fn keys(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let key = *random.pick(&["input", "output"]);
    let (_, animation) = draft.entry("animations", random)?;
    let samplers = animation.get("samplers")?.as_array()?;
    let sampler = samplers.get(random.below(samplers.len().max(1)))?;
    let accessor = sampler.get(key)?.as_u64()? as usize;
    let span = draft.span(accessor).filter(|span| span.component_type == 5126 && span.count > 0)?;
    let (value, begin, component) = (float(random), random.below(span.count), random.below(span.components));
    // Change one key, or all keys from this key to the last.
    let end = if random.one_in(2) { begin + 1 } else { span.count };
    for element in begin..end {
        draft.component(&span, element, component)?.copy_from_slice(&value.to_le_bytes());
    }
    Some(())
}

/// Changes the target, path, sampler or interpolation of a channel.
fn channel(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let (node, accessor) = (random.below(draft.count("nodes") + 1), random.below(draft.count("accessors") + 1));
    let (change, path, way) = (random.below(6), *random.pick(&PATHS), *random.pick(&WAYS));
    let any = extreme(random);
    // Choose a random channel or sampler.
    let (_, animation) = draft.entry("animations", random)?;
    let list = if change < 3 { "channels" } else { "samplers" };
    let entries = animation.get_mut(list)?.as_array_mut()?;
    let index = random.below(entries.len().max(1));
    let entry = entries.get_mut(index)?;
    match change {
        0 => put(entry.get_mut("target")?, "node", json!(node)),
        1 => put(entry.get_mut("target")?, "path", json!(path)),
        2 => put(entry, "sampler", any),
        3 => put(entry, "interpolation", json!(way)),
        4 => put(entry, "input", json!(accessor)),
        _ => put(entry, "output", json!(accessor)),
    }
}

/// Replaces all animations by one new animation of one node, with mostly valid keys.
fn new_animation(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let (path, components) = *random.pick(&[("translation", 3), ("rotation", 4), ("scale", 3), ("weights", 1)]);
    let (kind, way) = (["", "SCALAR", "", "VEC3", "VEC4"][components], *random.pick(&WAYS[..3]));
    let count = 1 + random.below(4);

    // Times ascend; one of them may have any value.
    let step = *random.pick(&[0.0, 1e-30, 0.01, 0.5, 1e3, 1e30]);
    let mut times: Vec<f32> = (0..count).map(|key| key as f32 * step).collect();
    if random.one_in(3) {
        let place = random.below(count);
        times[place] = float(random);
    }

    // Use values of moderate size, or any values.
    let values = count * components * if way == "CUBICSPLINE" { 3 } else { 1 };
    let wild = random.one_in(2);
    let values: Vec<f32> =
        (0..values).map(|_| if wild { float(random) } else { random.below(2001) as f32 / 1000.0 - 1.0 }).collect();
    // Add an animation of a random node.
    let input = append_floats(draft, &times, "SCALAR", 1)?;
    let output = append_floats(draft, &values, kind, components)?;
    let node = random.below(draft.count("nodes").max(1));
    let animation = json!([{
        "channels": [{ "sampler": 0, "target": { "node": node, "path": path } }],
        "samplers": [{ "input": input, "output": output, "interpolation": way }]
    }]);
    put(&mut draft.json, "animations", animation)
}

/// Appends an accessor of floats.
fn append_floats(draft: &mut Draft, list: &[f32], kind: &str, components: usize) -> Option<usize> {
    let bytes: Vec<u8> = list.iter().flat_map(|number| number.to_le_bytes()).collect();
    draft.append(&bytes, 5126, kind, list.len() / components)
}

/// Gives a node with a mesh a skin with random joints, and its mesh joints and weights.
fn new_skin(draft: &mut Draft, random: &mut Random) -> Option<()> {
    // Choose the primitive to skin, and count its vertices.
    let mesh = random.below(draft.count("meshes").max(1));
    let place = format!("/meshes/{mesh}/primitives/0/attributes");
    let positions = draft.json.pointer(&place)?.get("POSITION")?.as_u64()? as usize;
    let vertices = draft.span(positions)?.count.min(100_000);
    let joints = 1 + random.below(4);

    // Each vertex has four joints, with weights of any value.
    let of: Vec<u8> = (0..4 * vertices).map(|_| random.below(joints) as u8).collect();
    let wild = random.one_in(3);
    let weights: Vec<f32> =
        (0..4 * vertices).map(|_| if wild { float(random) } else { random.below(3) as f32 / 2.0 }).collect();
    let matrices: Vec<f32> = (0..16 * joints)
        .map(|place| if random.one_in(20) { float(random) } else { f32::from(u8::from(place % 16 % 5 == 0)) })
        .collect();
    // Append joints, weights and inverse bind matrices.
    let of = draft.append(&of, 5121, "VEC4", vertices)?;
    let weights = append_floats(draft, &weights, "VEC4", 4)?;
    let matrices = append_floats(draft, &matrices, "MAT4", 16)?;

    // Add the skin, and assign it to a node with the mesh.
    let nodes = draft.count("nodes").max(1);
    let joints: Value = (0..joints).map(|_| random.below(nodes)).collect();
    let skin = draft.push("skins", json!({ "joints": joints, "inverseBindMatrices": matrices }))?;
    let attributes = draft.json.pointer_mut(&place)?;
    put(attributes, "JOINTS_0", json!(of))?;
    put(attributes, "WEIGHTS_0", json!(weights))?;
    let list = draft.json.get_mut("nodes")?.as_array_mut()?;
    let node = list.iter_mut().find(|node| node.get("mesh").and_then(Value::as_u64) == Some(mesh as u64))?;
    put(node, "skin", json!(skin))
}

/// Changes the joints or matrices of a skin.
fn skin(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let (node, change) = (random.below(draft.count("nodes") + 1), random.below(4));
    let accessor = random.below(draft.count("accessors").max(1));
    let (_, skin) = draft.entry("skins", random)?;
    match change {
        0 => put(skin, "inverseBindMatrices", json!(accessor))?,
        1 => drop(skin.as_object_mut()?.remove("inverseBindMatrices")),
        2 => put(skin, "joints", json!(vec![node; 1 + node % 300]))?,
        _ => skin.get_mut("joints")?.as_array_mut()?.push(json!(node)),
    }
    Some(())
}
