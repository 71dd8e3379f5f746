//! Mattes of objects and materials, by the names that the scene's file has.

use crate::settings::Aov;
use pipeline::parts::Channels;
use render_core::image_file::{Cryptomatte, RankedThing};
use render_core::scene::{Instance, Scene};
use render_core::{InstanceShares, NOTHING};
use std::collections::BTreeSet;

/// The mattes that the channel `aov` asks for, one thing for each instance of `scene`; none for other channels.
///
/// Objects are nodes, since those are what animators name: all parts of a node's mesh are one matte. A node without a name has that
/// of its mesh. Nodes of one name are one matte, as in other programs; things without any name have one of their own, by number.
pub(super) fn mattes(aov: Aov, scene: &Scene) -> Option<Cryptomatte> {
    let materials = |&Instance { mesh, .. }: &Instance| scene.meshes[mesh].material;
    match aov {
        Aov::CryptoObject => {
            // Several instances that hang from a node without a name take that of the first one's mesh.
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

/// `own` names, with ones such as node_12 in place of those that are empty: names that no other thing has.
fn with_names(own: &[&str], kind: &str) -> Vec<String> {
    let known: BTreeSet<&str> = own.iter().copied().collect();
    let name = |(index, own): (usize, &&str)| {
        let mut name = (*own).to_owned();
        if name.is_empty() {
            name = format!("{kind}_{index}");
            while known.contains(name.as_str()) {
                name.push('_');
            }
        }
        name
    };
    own.iter().enumerate().map(name).collect()
}

/// The channels of `mattes` for a picture that shows these instances.
pub(super) fn channels(mattes: &Cryptomatte, shares: &InstanceShares) -> Channels {
    let mut pixels = Vec::new();
    for pixel in shares.pixels() {
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
