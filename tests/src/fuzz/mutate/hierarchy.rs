//! Nodes: who hangs from whom, what they show, and their transforms; cameras.

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

/// A node gets a child more, which may be itself, one above it, or one that is its child already.
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

/// A scene has a root more or less, or none.
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

/// A mesh is shown many times, at places near each other or all at one.
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

/// A long chain of nodes, the same transform at each: scales and places grow without bound.
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

/// Properties of a camera, and of its kind.
fn camera(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let value = extreme(random);
    let kind = *random.pick(&["perspective", "orthographic"]);
    let key = *random.pick(&["yfov", "aspectRatio", "znear", "zfar", "xmag", "ymag"]);
    let (_, camera) = draft.entry("cameras", random)?;
    if random.one_in(4) {
        put(camera, "type", json!(kind))?;
        let part = json!({ "xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1, "yfov": 1 });
        put(camera, kind, part)?;
    }
    let kind = camera.get("type").and_then(Value::as_str).unwrap_or(kind).to_owned();
    put(member(camera, &kind)?, key, value)
}

/// A number of a transform that is hardly ever met.
fn unusual(random: &mut Random) -> Value {
    let values = [0.0, -1.0, 1.0, 1e-30, 1e-7, 1e-3, 0.5, 10.0, 1e3, 1e5, 1e7, 1e10, 9e14, 1e19, -1e5];
    if random.one_in(6) { extreme(random) } else { json!(random.pick(&values)) }
}

/// A translation, rotation or scale.
fn random_transform(random: &mut Random) -> Value {
    let kind = random.below(3);
    let three: Vec<Value> = (0..3).map(|_| unusual(random)).collect();
    match kind {
        0 => json!({ "translation": three }),
        1 => json!({ "scale": three }),
        _ => json!({ "rotation": [three[0], three[1], three[2], 1.0] }),
    }
}

/// A node moves, turns, grows, shrinks to nothing or is turned inside out.
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

/// A node has a matrix: singular, huge, with a last row that is none, or beside other transforms.
fn matrix(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let mut matrix: Vec<Value> = (0..16).map(|place| json!(f64::from(u8::from(place % 5 == 0)))).collect();
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
