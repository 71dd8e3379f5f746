//! Checks of a document that the `gltf` crate omits, although the crate panics if one of them fails.

use super::{LoadError, Loader};
use gltf::json::{self, camera, validation::Checked};

impl Loader<'_> {
    /// Checks data that the crate reads without a check: indices, and the objects that a camera's type requires.
    pub(super) fn check_document(&self, root: &json::Root) -> Result<(), LoadError> {
        self.check_positions(root)?;
        self.check_cameras(root)?;
        self.check_channels(root)
    }

    fn check_positions(&self, root: &json::Root) -> Result<(), LoadError> {
        let positions = Checked::Valid(json::mesh::Semantic::Positions);
        for (m, mesh) in root.meshes.iter().enumerate() {
            for (p, primitive) in mesh.primitives.iter().enumerate() {
                // The crate reads the bounds of positions without checking the index.
                let accessor = primitive.attributes.get(&positions).map(|index| index.value());
                if let Some(accessor) = accessor.filter(|&accessor| accessor >= root.accessors.len()) {
                    let count = root.accessors.len();
                    return self.bad(format!(
                        "mesh {m} primitive {p}: its positions are accessor {accessor}, but there are {count}; export it again"
                    ));
                }
            }
        }
        Ok(())
    }

    fn check_cameras(&self, root: &json::Root) -> Result<(), LoadError> {
        for (c, camera) in root.cameras.iter().enumerate() {
            let missing = match camera.type_ {
                Checked::Valid(camera::Type::Perspective) => camera.perspective.is_none().then_some("perspective"),
                Checked::Valid(camera::Type::Orthographic) => camera.orthographic.is_none().then_some("orthographic"),
                // The crate `gltf` reports invalid types.
                Checked::Invalid => None,
            };
            if let Some(part) = missing {
                return self.bad(format!("camera {c} has type {part}, but no object {part}; export it again"));
            }
        }
        Ok(())
    }

    fn check_channels(&self, root: &json::Root) -> Result<(), LoadError> {
        for (a, animation) in root.animations.iter().enumerate() {
            for (c, channel) in animation.channels.iter().enumerate() {
                let place = format!("animation {a} channel {c}");
                // The crate uses this index without a check.
                let (node, count) = (channel.target.node.value(), root.nodes.len());
                if node >= count {
                    return self.bad(format!("{place} moves node {node}, but there are {count}; export it again"));
                }
            }
        }
        Ok(())
    }
}
