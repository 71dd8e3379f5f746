//! Changes of accessors, sparse data and views.

use super::places::{extreme, put};
use super::{Draft, Mutation};
use crate::Random;
use serde_json::{Value, json};

/// Changes of this module.
pub(super) const MUTATIONS: [Mutation; 6] = [
    ("accessor", accessor),
    ("accessor", accessor),
    ("view", view),
    ("sparse", sparse),
    ("bounds", bounds),
    ("attribute", attribute),
];

/// Element types, the last of them invalid.
const KINDS: [&str; 8] = ["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4", "VEC5"];
/// Component types: all valid ones, and three invalid ones.
const COMPONENTS: [u32; 9] = [5120, 5121, 5122, 5123, 5125, 5126, 5124, 0, u32::MAX];

/// Changes a property of an accessor.
fn accessor(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let count = random.below(40);
    let (key, value) = match random.below(8) {
        0 => ("type", json!(random.pick(&KINDS))),
        1 => ("componentType", json!(random.pick(&COMPONENTS))),
        2 => ("byteOffset", json!(count)),
        3 => ("byteOffset", extreme(random)),
        4 => ("count", extreme(random)),
        5 => ("count", json!(count)),
        6 => ("normalized", json!(random.one_in(2))),
        _ => ("bufferView", json!(null)),
    };
    let (_, accessor) = draft.entry("accessors", random)?;
    if value.is_null() {
        return accessor.as_object_mut()?.remove(key).map(|_| ());
    }
    put(accessor, key, value)
}

/// Changes a property of a view.
fn view(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let small = json!(random.below(70));
    let value = if random.one_in(2) { small } else { extreme(random) };
    let key = *random.pick(&["byteOffset", "byteLength", "byteStride", "byteStride", "buffer", "target"]);
    let (_, view) = draft.entry("bufferViews", random)?;
    put(view, key, value)
}

/// Adds sparse data over a view or over zeros; one property is often invalid.
fn sparse(draft: &mut Draft, random: &mut Random) -> Option<()> {
    // Choose an accessor, and the number of replaced elements.
    let (index, accessor) = draft.entry("accessors", random)?;
    let count = accessor.get("count").and_then(Value::as_u64).unwrap_or(1).max(1) as usize;
    let few = 1 + random.below(count.min(8));

    // Indices ascend, as glTF requires; the last may be out of order.
    let mut places: Vec<u32> = (0..few as u32).collect();
    if random.one_in(3) {
        places[few - 1] = *random.pick(&[0, count as u32, u32::MAX]);
    }
    let places: Vec<u8> = places.iter().flat_map(|place| place.to_le_bytes()).collect();
    let places = draft.append(&places, 5125, "SCALAR", few)?;
    let values = draft.append(&vec![0x3f; few * 64], 5126, "MAT4", few)?;
    let view = |accessor: usize| draft.json.get("accessors")?.get(accessor)?.get("bufferView").cloned();
    let mut part = json!({
        "count": few,
        "indices": { "bufferView": view(places)?, "componentType": 5125 },
        "values": { "bufferView": view(values)? }
    });

    // Make at most one property wrong.
    match random.below(6) {
        0 => part["count"] = extreme(random),
        1 => part["indices"]["componentType"] = json!(random.pick(&COMPONENTS)),
        2 => part["indices"]["byteOffset"] = extreme(random),
        3 => part["values"]["byteOffset"] = extreme(random),
        4 => part["values"]["bufferView"] = json!(random.below(draft.count("bufferViews") + 1)),
        _ => {}
    }
    // Use zeros in place of the view in some cases.
    let accessor = draft.json.get_mut("accessors")?.get_mut(index)?;
    if random.one_in(3) {
        accessor.as_object_mut()?.remove("bufferView");
    }
    put(accessor, "sparse", part)
}

/// Changes the bounds of an accessor.
fn bounds(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let numbers: Vec<Value> = (0..random.below(5)).map(|_| extreme(random)).collect();
    let key = *random.pick(&["min", "max"]);
    let (_, accessor) = draft.entry("accessors", random)?;
    put(accessor, key, numbers.into())
}

/// Changes the mode, indices, attributes or morph targets of a primitive; accessors are drawn at random.
fn attribute(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let any = json!(random.below(draft.count("accessors").max(1)));
    let names = ["POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "TEXCOORD_9", "COLOR_0", "_OWN"];
    let name = *random.pick(&names);
    let (change, mode) = (random.below(5), random.below(9));
    // Choose a primitive of a random mesh.
    let (_, mesh) = draft.entry("meshes", random)?;
    let primitives = mesh.get_mut("primitives")?.as_array_mut()?;
    let index = random.below(primitives.len().max(1));
    let primitive = primitives.get_mut(index)?;
    match change {
        0 => put(primitive, "mode", json!(mode))?,
        1 => drop(primitive.as_object_mut()?.remove("indices")),
        2 => {
            // Use positions as displacements, because they have the right count.
            let own = primitive.get("attributes")?.get("POSITION").cloned().unwrap_or(any);
            let target = json!({ *random.pick(&["POSITION", "POSITION", "NORMAL", "TANGENT"]): own });
            put(primitive, "targets", vec![target; 1 + mode].into())?;
            put(mesh, "weights", vec![extreme(random); mode].into())?;
        }
        _ => put(primitive.get_mut("attributes")?, name, any)?,
    }
    Some(())
}
