//! Slots of a scene's instances in the scene's document.

use super::document::{Document, number};
use pipeline::error::Result;
use render_core::scene::Scene;
use serde_json::Value;
use std::collections::BTreeSet;

/// Primitive modes that consist of triangles: lists, strips and fans.
const TRIANGLES: std::ops::RangeInclusive<u64> = 4..=6;

/// A primitive of a node's mesh: indices into the document's lists.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PrimitiveSlot {
    pub node: usize,
    pub mesh: usize,
    pub primitive: usize,
}

/// Returns the slots of a scene's instances, in the order of nodes in the file and primitives in a mesh.
pub(super) fn places(document: &Document, scene: &Scene) -> Result<Vec<PrimitiveSlot>> {
    let mut places = Vec::new();
    // List primitives in the order in which the loader numbers instances.
    for node in shown_nodes(document) {
        let Some(mesh) = document.list("nodes").get(node).and_then(|node| number(&node["mesh"])) else { continue };
        for (primitive, found) in primitives(document, mesh).iter().enumerate() {
            if TRIANGLES.contains(&found["mode"].as_u64().unwrap_or(4)) {
                places.push(PrimitiveSlot { node, mesh, primitive });
            }
        }
    }

    // Compare the numbers of vertices: the loader read the scene separately, and both readers must agree.
    let vertices = |place: &PrimitiveSlot| {
        let position = number(&primitives(document, place.mesh)[place.primitive]["attributes"]["POSITION"])?;
        number(&document.list("accessors").get(position)?["count"])
    };
    let is_same = |(place, mesh): (&PrimitiveSlot, usize)| vertices(place) == Some(scene.meshes[mesh].positions.len());
    let meshes = scene.instances.iter().map(|instance| instance.mesh);
    if places.len() != scene.instances.len() || !places.iter().zip(meshes).all(is_same) {
        return Err(document.damaged("its list of meshes"));
    }
    Ok(places)
}

/// Returns the primitives of a mesh.
pub(super) fn primitives(document: &Document, mesh: usize) -> &[Value] {
    let list = document.list("meshes").get(mesh).and_then(|mesh| mesh["primitives"].as_array());
    list.map_or(&[], Vec::as_slice)
}

/// Returns the nodes of the displayed scene, in file order.
fn shown_nodes(document: &Document) -> BTreeSet<usize> {
    let children = |parent: &Value, name: &str| -> Vec<usize> {
        parent[name].as_array().into_iter().flatten().filter_map(number).collect()
    };
    let shown = number(&document.json["scene"]).unwrap_or(0);
    let mut open = document.list("scenes").get(shown).map_or_else(Vec::new, |scene| children(scene, "nodes"));
    let mut found = BTreeSet::new();
    // Visit each node once: a damaged file may contain cycles.
    while let Some(node) = open.pop() {
        if let Some(value) = document.list("nodes").get(node).filter(|_| found.insert(node)) {
            open.extend(children(value, "children"));
        }
    }
    found
}
