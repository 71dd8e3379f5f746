//! Mattes of objects and materials, named as in the scene file.

use crate::settings::Aov;
use pipeline::stage::Channels;
use render_core::image_file::{Cryptomatte, RankedThing};
use render_core::scene::{Instance, Scene};
use render_core::{InstanceShares, NOTHING};
use std::collections::BTreeSet;

/// Returns the mattes for the channel `aov`, with one entry per instance of `scene`; `None` for other channels.
///
/// Objects are nodes, because animators name nodes: all primitives of a node's mesh form one matte. A node without a
/// name has its mesh's name. As in other programs, nodes of equal name share a matte. A nameless entry has a unique
/// name with a number.
pub(super) fn mattes(aov: Aov, scene: &Scene) -> Option<Cryptomatte> {
    // Repeat each name for all instances of a node or material: equal names form one matte.
    let materials = |&Instance { mesh, .. }: &Instance| scene.meshes[mesh].material;
    match aov {
        Aov::CryptoObject => {
            // Give each unnamed node the mesh name of its first instance.
            let mut own: Vec<&str> = scene.nodes.iter().map(|node| node.name.as_str()).collect();
            for &Instance { node, mesh } in &scene.instances {
                if own[node].is_empty() {
                    own[node] = &scene.meshes[mesh].name;
                }
            }
            let names = with_names(&own, "node");
            let names: Vec<String> = scene.instances.iter().map(|instance| names[instance.node].clone()).collect();
            Some(Cryptomatte::new("CryptoObject", &names))
        }
        Aov::CryptoMaterial => {
            let own: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
            let names = with_names(&own, "material");
            let names: Vec<String> =
                scene.instances.iter().map(|instance| names[materials(instance)].clone()).collect();
            Some(Cryptomatte::new("CryptoMaterial", &names))
        }
        _ => None,
    }
}

/// Returns `own` with unique names such as node_12 in place of empty ones.
fn with_names(own: &[&str], kind: &str) -> Vec<String> {
    let known: BTreeSet<&str> = own.iter().copied().collect();
    let mut names = Vec::with_capacity(own.len());
    for (index, own) in own.iter().enumerate() {
        // Append underscores to a new name until no other entry has it.
        let mut name = (*own).to_owned();
        if name.is_empty() {
            name = format!("{kind}_{index}");
            while known.contains(name.as_str()) {
                name.push('_');
            }
        }
        names.push(name);
    }
    names
}

/// Returns the channels of `mattes` for a frame. `shares` is the frame's coverage by instance.
pub(super) fn channels(mattes: &Cryptomatte, shares: &InstanceShares) -> Channels {
    let mut pixels = Vec::new();
    for pixel in shares.pixels() {
        // Omit the background: the coverage of a pixel may sum to less than 1.
        let seen = pixel.iter().filter(|part| part.instance != NOTHING);
        pixels.push(mattes.ranked(seen.map(|part| RankedThing { thing: part.instance as usize, share: part.share })));
    }
    mattes.channels(&pixels).into_iter().map(|channel| (channel.name, channel.samples)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_made_up_where_there_are_none_and_are_nobody_elses() {
        assert_eq!(with_names(&["", "a", "node_3", "", "a"], "node"), ["node_0", "a", "node_3", "node_3_", "a"]);
    }
}
