//! `EXT_mesh_gpu_instancing`: copies of a node's mesh, each with a separate transform.

use super::{DocumentSource, LoadError, Loader};
use crate::scene::{Node, Scene, Transform};
use glam::{Quat, Vec3};
use serde_json::Value;
use std::collections::BTreeSet;

impl Loader<'_> {
    /// Adds a node for each copy of the mesh of `node`, as a child of scene node `parent`. Returns the new nodes, or
    /// `None` if the extension is not used.
    pub(super) fn copies(
        &self,
        node: &gltf::Node,
        parent: usize,
        source: DocumentSource,
        scene: &mut Scene,
    ) -> Result<Option<std::ops::Range<usize>>, LoadError> {
        let DocumentSource { document, buffers, .. } = source;
        let Some(extension) = node.extension_value("EXT_mesh_gpu_instancing") else { return Ok(None) };
        let place = format!("node {}: EXT_mesh_gpu_instancing", node.index());
        let accessor = |name: &str| {
            let index = extension.get("attributes")?.get(name)?.as_u64()?;
            document.accessors().nth(usize::try_from(index).ok()?)
        };

        // "All attribute accessors MUST have the same count"; each attribute is optional.
        let (translations, rotations, scales) = (accessor("TRANSLATION"), accessor("ROTATION"), accessor("SCALE"));
        let given = [&translations, &rotations, &scales];
        let mut counts = given.into_iter().flatten().map(gltf::Accessor::count);
        let Some(count) = counts.next() else { return Ok(None) };
        if counts.any(|other| other != count) {
            return self.bad(format!("{place}: its attributes have different numbers of elements; export it again"));
        }
        if buffers.charge(count.saturating_mul(size_of::<Node>())).is_none() {
            return Ok(None);
        }

        // Use defaults for missing attributes.
        let vectors = |accessor: &Option<gltf::Accessor>, default: [f32; 3]| match accessor {
            Some(accessor) => buffers.floats::<3>(accessor),
            None => Some(vec![default; count]),
        };
        let rotations = match &rotations {
            Some(accessor) => buffers.floats::<4>(accessor),
            None => Some(vec![Quat::IDENTITY.to_array(); count]),
        };
        let lists = (vectors(&translations, [0.0; 3]), rotations, vectors(&scales, [1.0; 3]));
        let (Some(translations), Some(rotations), Some(scales)) = lists else {
            return self.bad(format!("{place}: its attributes cannot be read; export it again"));
        };

        // Add each copy as a child of the node.
        let first = scene.nodes.len();
        for k in 0..count {
            let rotation = Quat::from_array(rotations[k]);
            let rest = Transform {
                translation: Vec3::from(translations[k]),
                rotation: if rotation.length_squared() > 0.0 { rotation.normalize() } else { Quat::IDENTITY },
                scale: Vec3::from(scales[k]),
            };
            if !rest.matrix().is_finite() {
                return self.bad(format!("{place}: copy {k} has a transform that is not finite"));
            }
            scene.nodes.push(Node { name: String::new(), parent: Some(parent), rest });
        }
        Ok(Some(first..scene.nodes.len()))
    }
}

/// Returns which nodes are hidden, by glTF index: coarser levels of other nodes (`MSFT_lod`), and nodes that
/// `KHR_node_visibility` hides. Nodes in `blinking` have an animated visibility and are not hidden.
pub(super) fn hidden_nodes(document: &gltf::Document, blinking: &BTreeSet<usize>) -> Vec<bool> {
    let mut hidden = vec![false; document.nodes().len()];
    for node in document.nodes() {
        // An animated visibility overrides the file's constant.
        let visible = node.extension_value("KHR_node_visibility").and_then(|extension| extension.get("visible"));
        if visible.and_then(Value::as_bool) == Some(false) && !blinking.contains(&node.index()) {
            hidden[node.index()] = true;
        }
        // The node itself is the finest level; the list contains the coarser ones.
        let levels = node.extension_value("MSFT_lod").and_then(|extension| extension.get("ids")?.as_array());
        for level in levels.into_iter().flatten().filter_map(Value::as_u64) {
            if let Some(hidden) = usize::try_from(level).ok().and_then(|level| hidden.get_mut(level)) {
                *hidden = true;
            }
        }
    }
    hidden
}
