//! Changes of values regardless of their meaning (deletion, duplication, swap, replacement), and of indices.

use super::places::{any_place, extreme, places_under, put, remove};
use super::{Draft, Mutation};
use crate::Random;
use serde_json::{Value, json};

/// Changes of this module.
pub(super) const MUTATIONS: [Mutation; 9] = [
    ("index", index),
    ("index", index),
    ("delete", delete),
    ("double", double),
    ("swap", swap),
    ("copy", copy),
    ("number", number),
    ("type", kind),
    ("raw text", raw),
];

/// Keys of index values.
const INDICES: [&str; 23] = [
    "node",
    "nodes",
    "mesh",
    "skin",
    "camera",
    "children",
    "joints",
    "skeleton",
    "inverseBindMatrices",
    "indices",
    "POSITION",
    "NORMAL",
    "JOINTS_0",
    "WEIGHTS_0",
    "TEXCOORD_0",
    "material",
    "bufferView",
    "buffer",
    "input",
    "output",
    "source",
    "index",
    "scene",
];

/// Replaces an index: another object, one just or far out of range, a negative one.
fn index(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let places = places_under(&draft.json, &INDICES);
    if places.is_empty() {
        return None;
    }
    let place = random.pick(&places);
    let most = ["nodes", "accessors", "meshes"].map(|list| draft.count(list));
    let end = random.pick(&most) + 1;
    let value = match random.below(8) {
        0 => json!(end - 1),
        1 => json!(u32::MAX),
        2 => json!(-1),
        3 => extreme(random),
        // An existing object is the hardest to distinguish from the right one.
        _ => json!(random.below(end)),
    };
    *draft.json.pointer_mut(place)? = value;
    Some(())
}

/// Removes any value.
fn delete(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let place = any_place(&draft.json, random)?;
    remove(&mut draft.json, &place).map(|_| ())
}

/// Duplicates an entry of a list or a member of an object.
fn double(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let place = any_place(&draft.json, random)?;
    let value = draft.json.pointer(&place)?.clone();
    let (parent, _) = place.rsplit_once('/')?;
    match draft.json.pointer_mut(parent)? {
        Value::Array(list) => {
            let index = random.below(list.len() + 1);
            list.insert(index, value);
        }
        object => put(object, "doubled", value)?,
    }
    Some(())
}

/// Swaps two values.
fn swap(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let places = [any_place(&draft.json, random)?, any_place(&draft.json, random)?];
    let [first, second] = places.clone().map(|place| draft.json.pointer(&place).cloned());
    *draft.json.pointer_mut(&places[0])? = second?;
    // The second pointer is invalid if the first value contained the second.
    if let Some(value) = draft.json.pointer_mut(&places[1]) {
        *value = first?;
    }
    Some(())
}

/// Overwrites a value with another.
fn copy(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let from = any_place(&draft.json, random)?;
    let to = any_place(&draft.json, random)?;
    let value = draft.json.pointer(&from)?.clone();
    *draft.json.pointer_mut(&to)? = value;
    Some(())
}

/// Replaces a number by an extreme one.
fn number(draft: &mut Draft, random: &mut Random) -> Option<()> {
    // Most walks end at a number within a few tries.
    for _ in 0..20 {
        let place = any_place(&draft.json, random)?;
        let value = draft.json.pointer_mut(&place)?;
        if value.is_number() {
            *value = extreme(random);
            return Some(());
        }
    }
    None
}

/// Replaces a value by one of another type.
fn kind(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let place = any_place(&draft.json, random)?;
    let others = [json!(null), json!(true), json!("text"), json!([]), json!({}), json!([[0]]), json!(0.5), json!("")];
    *draft.json.pointer_mut(&place)? = random.pick(&others).clone();
    Some(())
}

/// Replaces a value by text that no JSON library writes.
fn raw(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let place = any_place(&draft.json, random)?;
    *draft.json.pointer_mut(&place)? = Draft::raw(random);
    Some(())
}
