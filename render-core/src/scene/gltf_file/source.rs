//! A glTF file as bytes, for programs that write it anew with changes.

use super::{LoadError, Loader, malformed};
use std::path::{Path, PathBuf};

/// The parts of a glTF file that are read before any of them is understood.
#[derive(Clone, Debug)]
pub struct GltfSource {
    path: PathBuf,
    /// The document: JSON as text.
    pub json: Vec<u8>,
    /// The binary part of a .glb file, if it has one.
    pub binary: Option<Vec<u8>>,
}

impl GltfSource {
    /// Reads a .gltf or .glb file, but no other file that it names.
    ///
    /// # Errors
    /// The file cannot be read, or is a .glb file that is cut short or damaged.
    pub fn read(path: &Path) -> Result<Self, LoadError> {
        let bytes = std::fs::read(path).map_err(|error| LoadError::Open { path: path.into(), error })?;
        if !bytes.starts_with(b"glTF") {
            return Ok(Self { path: path.into(), json: bytes, binary: None });
        }
        Loader { path, folder: folder_of(path) }.check_header(&bytes)?;
        let file = gltf::Glb::from_slice(&bytes).map_err(|error| malformed(path, error.to_string()))?;
        let (json, binary) = (file.json.into_owned(), file.bin.map(|bytes| bytes.into_owned()));
        Ok(Self { path: path.into(), json, binary })
    }

    /// Reads a `data:` URI, or a file in the folder of the scene; `name` says what it is, for instance "image 3".
    ///
    /// # Errors
    /// The resource cannot be read, lies outside of the folder of the document, or is not base64.
    pub fn resource(&self, name: &str, uri: &str) -> Result<Vec<u8>, LoadError> {
        Loader { path: &self.path, folder: folder_of(&self.path) }.resource(name, uri)
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}
