//! glTF file as bytes, for programs that write a modified copy.

use super::stored::StoredBuffers;
use super::{LoadError, Loader};
use crate::scene::files::{Reach, SceneFiles};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Sections of a glTF file, unparsed.
#[derive(Clone, Debug)]
pub struct GltfSource {
    path: PathBuf,
    reach: Reach,
    /// Document as JSON text.
    pub json: Vec<u8>,
    /// Binary chunk of a .glb file; `None` if the file has none.
    pub binary: Option<Vec<u8>>,
}

impl GltfSource {
    /// Reads a .gltf or .glb file, but none of the files to which it refers. `reach` limits the folders of these files.
    ///
    /// # Errors
    /// The file cannot be read, or is a truncated or damaged .glb file.
    pub fn read(path: &Path, reach: Reach) -> Result<Self, LoadError> {
        let bytes =
            SceneFiles::of(path, reach).read(path).map_err(|error| LoadError::Open { path: path.into(), error })?;
        let (json, binary) = Loader { path, files: &SceneFiles::of(path, reach) }.split(&bytes)?;
        let (json, binary) = (json.to_vec(), binary.map(<[u8]>::to_vec));
        Ok(Self { path: path.into(), reach, json, binary })
    }

    /// Reads a `data:` URI or a file next to the scene. Messages refer to the resource by `name`, for instance "image
    /// 3".
    ///
    /// # Errors
    /// The resource cannot be read, is outside the allowed folders, or is not base64.
    pub fn resource(&self, name: &str, uri: &str) -> Result<Vec<u8>, LoadError> {
        Loader { path: &self.path, files: &SceneFiles::of(&self.path, self.reach) }.resource(name, uri)
    }
    /// Unpacks meshes and buffer views that extensions pack. Afterwards, `json` refers to the plain data. Returns the
    /// added buffers, with indices that follow the file's own buffers.
    ///
    /// # Errors
    /// Packed data cannot be read, or is damaged and has no plain copy.
    pub fn unpack(&mut self) -> Result<Vec<Vec<u8>>, LoadError> {
        // Unpack with the loader, which applies its limits.
        let files = SceneFiles::of(&self.path, self.reach);
        let loader = Loader { path: &self.path, files: &files };
        let mut stored = StoredBuffers::new(&loader, self.binary.as_deref());
        let Ok(mut root) = serde_json::from_slice::<Value>(&self.json) else { return Ok(Vec::new()) };
        // Return only the buffers that unpacking added.
        let count = |root: &Value| root["buffers"].as_array().map_or(0, Vec::len);
        let first = count(&root);
        loader.unpack(&mut root, &mut stored)?;
        let (buffers, _) = stored.into_parts(count(&root));
        if buffers.len() > first {
            self.json = root.to_string().into_bytes();
        }
        Ok(buffers.into_iter().skip(first).collect())
    }
}
