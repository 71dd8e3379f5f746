//! Checks of a document that the `gltf` crate leaves out, though it panics where one of them fails.

use super::{LoadError, Loader};
use gltf::json::{self, camera, validation::Checked};

/// Bytes of the header of a binary file (glTF 2.0, 4.4.2): magic, version, length.
const HEADER: u32 = 12;

impl Loader<'_> {
    /// Checks the length in the header of a binary file: it counts the header.
    pub(super) fn check_header(&self, bytes: &[u8]) -> Result<(), LoadError> {
        let length = bytes.get(8..HEADER as usize).filter(|_| bytes.starts_with(b"glTF"));
        match length.map(|length| u32::from_le_bytes([length[0], length[1], length[2], length[3]])) {
            Some(length) if length < HEADER => self
                .bad(format!("its header claims {length} bytes, fewer than the header has; export or copy it again")),
            _ => Ok(()),
        }
    }

    /// Checks what the crate reads without looking: indices that its own validation uses or passes over, and parts of which
    /// one must be there.
    pub(super) fn check_document(&self, root: &json::Root) -> Result<(), LoadError> {
        self.check_positions(root)?;
        self.check_cameras(root)?;
        self.check_images(root)?;
        self.check_channels(root)
    }

    fn check_positions(&self, root: &json::Root) -> Result<(), LoadError> {
        let positions = Checked::Valid(json::mesh::Semantic::Positions);
        for (m, mesh) in root.meshes.iter().enumerate() {
            for (p, primitive) in mesh.primitives.iter().enumerate() {
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
                // The crate names it.
                Checked::Invalid => None,
            };
            if let Some(part) = missing {
                return self.bad(format!("camera {c} is of type {part}, but has no part {part}; export it again"));
            }
        }
        Ok(())
    }

    fn check_images(&self, root: &json::Root) -> Result<(), LoadError> {
        for (i, image) in root.images.iter().enumerate() {
            if image.buffer_view.is_none() && image.uri.is_none() {
                return self.bad(format!("image {i} has neither uri nor bufferView; export it again with its images"));
            }
            if image.buffer_view.is_some() && image.mime_type.is_none() {
                return self.bad(format!("image {i} has a bufferView, but no mimeType; export it again"));
            }
        }
        Ok(())
    }

    fn check_channels(&self, root: &json::Root) -> Result<(), LoadError> {
        for (a, animation) in root.animations.iter().enumerate() {
            for (c, channel) in animation.channels.iter().enumerate() {
                let place = format!("animation {a} channel {c}");
                let (node, count) = (channel.target.node.value(), root.nodes.len());
                if node >= count {
                    return self.bad(format!("{place} moves node {node}, but there are {count}; export it again"));
                }
                if matches!(channel.target.path, Checked::Invalid) {
                    return self.bad(format!(
                        "{place}: its path is none of translation, rotation, scale and weights; export it without"
                    ));
                }
            }
        }
        Ok(())
    }
}
