//! Changes of nodes: parents, content and transforms; changes of cameras.

use super::places::{extreme, member, put};
use super::{Draft, Mutation};
use crate::Random;
use serde_json::{Value, json};

/// Changes of the hierarchy.
pub(super) const MUTATIONS: [Mutation; 6] = [
    ("child", child),
    ("child", child),
    ("root", root),
    ("many instances", many_instances),
    ("chain", chain),
    ("camera", camera),
];

/// Changes of transforms.
pub(super) const TRANSFORMS: [Mutation; 3] = [("transform", transform), ("transform", transform), ("matrix", matrix)];

/// Adds a child to a node: any node, an ancestor or itself included, or a present child again.
fn child(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let count = draft.count("nodes");
    let child = json!(random.below(count.max(1)));
    let (_, node) = draft.entry("nodes", random)?;
    let children = node.as_object_mut()?.entry("children").or_insert_with(|| json!([])).as_array_mut()?;
    if random.one_in(3) {
        let doubled = children.first().cloned()?;
        children.push(doubled);
    } else {
        children.push(child);
    }
    Some(())
}

/// Adds a root to a scene, or removes one or all.
fn root(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let node = json!(random.below(draft.count("nodes").max(1)));
    let (_, scene) = draft.entry("scenes", random)?;
    let roots = scene.get_mut("nodes")?.as_array_mut()?;
    match random.below(4) {
        0 => drop(roots.pop()?),
        1 => roots.clear(),
        _ => roots.push(node),
    }
    Some(())
}

/// Instances a mesh up to 200 times, at close, distant or equal positions.
fn many_instances(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let mesh = random.below(draft.count("meshes").max(1));
    let (many, step) = (1 + random.below(200), *random.pick(&[0.0, 0.0, 0.01, 0.01, 1.0, 1.0, 30.0, 1e6]));
    for number in 0..many {
        let node = json!({ "mesh": mesh, "translation": [step * number as f64, 0.0, 0.0] });
        let node = draft.push("nodes", node)?;
        draft.json.pointer_mut("/scenes/0/nodes")?.as_array_mut()?.push(json!(node));
    }
    Some(())
}

/// Adds a long chain of nodes with the same transform: scales and positions grow without bound.
fn chain(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let (length, transform) = (1 + random.below(300), random_transform(random));
    for link in 0..length {
        let mut node = transform.clone();
        if link + 1 < length {
            node["children"] = json!([draft.count("nodes") + 1]);
        } else {
            node["mesh"] = json!(0);
        }
        let node = draft.push("nodes", node)?;
        if link == 0 {
            draft.json.pointer_mut("/scenes/0/nodes")?.as_array_mut()?.push(json!(node));
        }
    }
    Some(())
}

/// Changes properties of a camera and of its projection.
fn camera(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let value = extreme(random);
    let kind = *random.pick(&["perspective", "orthographic"]);
    let key = *random.pick(&["yfov", "aspectRatio", "znear", "zfar", "xmag", "ymag"]);
    let (_, camera) = draft.entry("cameras", random)?;
    // Change the type of some cameras.
    if random.one_in(4) {
        put(camera, "type", json!(kind))?;
        let part = json!({ "xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1, "yfov": 1 });
        put(camera, kind, part)?;
    }
    let kind = camera.get("type").and_then(Value::as_str).unwrap_or(kind).to_owned();
    put(member(camera, &kind)?, key, value)
}

/// Returns an unusual number for a transform.
fn unusual(random: &mut Random) -> Value {
    let values = [0.0, -1.0, 1.0, 1e-30, 1e-7, 1e-3, 0.5, 10.0, 1e3, 1e5, 1e7, 1e10, 9e14, 1e19, -1e5];
    if random.one_in(6) { extreme(random) } else { json!(random.pick(&values)) }
}

/// Returns a translation, rotation or scale.
fn random_transform(random: &mut Random) -> Value {
    let kind = random.below(3);
    let three: Vec<Value> = (0..3).map(|_| unusual(random)).collect();
    match kind {
        0 => json!({ "translation": three }),
        1 => json!({ "scale": three }),
        _ => json!({ "rotation": [three[0], three[1], three[2], 1.0] }),
    }
}

/// Moves, rotates, scales, collapses or mirrors a node.
fn transform(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let same = unusual(random);
    let all: Vec<Value> = (0..4).map(|_| unusual(random)).collect();
    let (key, count) = *random.pick(&[("translation", 3), ("scale", 3), ("scale", 3), ("rotation", 4)]);
    let is_even = random.one_in(2);
    let (_, node) = draft.entry("nodes", random)?;
    let value: Value = if is_even { vec![same; count].into() } else { all[..count].into() };
    node.as_object_mut()?.remove("matrix");
    put(node, key, value)
}

/// Gives a node a matrix: singular, huge, with an invalid last row, or in addition to other transforms.
fn matrix(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let mut matrix: Vec<Value> = (0..16).map(|place| json!(f64::from(u8::from(place % 5 == 0)))).collect();
    // Replace a few elements of the identity matrix.
    for _ in 0..=random.below(4) {
        let place = random.below(16);
        matrix[place] = unusual(random);
    }
    let alone = random.one_in(2);
    let (_, node) = draft.entry("nodes", random)?;
    if alone {
        node.as_object_mut()?.retain(|key, _| !["translation", "rotation", "scale"].contains(&key.as_str()));
    }
    put(node, "matrix", matrix.into())
}
