//! A mutable glTF document: its JSON and its buffers.

use pipeline::error::{Error, Result};
use render_core::scene::{GltfSource, Reach};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Target of a buffer view with vertex attributes (glTF 2.0, 5.11.5).
pub(super) const ARRAY_BUFFER: u32 = 34962;
/// Target of a buffer view with indices (glTF 2.0, 5.11.5).
pub(super) const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A document and its buffers. Each addition of bytes is a separate buffer until all buffers are packed into one file.
pub(in crate::bake) struct Document {
    path: PathBuf,
    source: GltfSource,
    pub json: Value,
    buffers: Vec<Vec<u8>>,
}

impl Document {
    /// Reads a previously loaded scene file with all buffers. Compressed meshes and views are decompressed.
    pub fn read(path: &Path, reach: Reach) -> Result<Self> {
        let mut source = GltfSource::read(path, reach).map_err(Error::other)?;
        let unpacked = source.unpack().map_err(Error::other)?;
        let json: Value = serde_json::from_slice(&source.json)
            .map_err(|error| Error::content(path, format!(": invalid JSON ({error}); export or copy it again")))?;
        let mut binary = source.binary.take();
        let mut document = Self { path: path.into(), json, buffers: Vec::new(), source };
        if !document.json.is_object() {
            return Err(document.damaged("the document"));
        }
        // Read the buffers of the file; decompressed buffers follow them in the list.
        let buffers = document.list("buffers").to_vec();
        for (index, buffer) in buffers.iter().take(buffers.len() - unpacked.len()).enumerate() {
            let bytes = match buffer["uri"].as_str() {
                Some(uri) => document.resource(&format!("buffer {index}"), uri)?,
                // Leave the slot of the uncompressed fallback empty: the file lacks its bytes.
                None if index > 0 => Vec::new(),
                None => binary.take().ok_or_else(|| document.damaged(&format!("buffer {index}")))?,
            };
            document.buffers.push(bytes);
        }
        document.buffers.extend(unpacked);
        Ok(document)
    }

    /// Returns the list `name` of the document; empty if the document lacks it.
    pub fn list(&self, name: &str) -> &[Value] {
        self.json[name].as_array().map_or(&[], Vec::as_slice)
    }

    /// Adds an object to the list `name` and returns its index.
    pub fn push(&mut self, name: &str, value: Value) -> usize {
        match self.json[name].as_array_mut() {
            Some(list) => {
                list.push(value);
                list.len() - 1
            }
            None => {
                self.json[name] = json!([value]);
                0
            }
        }
    }

    /// Adds bytes and returns the index of their new buffer view.
    pub fn add_view(&mut self, bytes: Vec<u8>) -> usize {
        let view = json!({ "buffer": self.buffers.len(), "byteLength": bytes.len() });
        self.buffers.push(bytes);
        self.push("bufferViews", view)
    }

    /// Adds vertex data or indices and returns the index of their new accessor. `accessor` describes them, without the
    /// buffer view.
    pub fn add_accessor(&mut self, bytes: Vec<u8>, target: u32, mut accessor: Value) -> usize {
        let view = self.add_view(bytes);
        self.json["bufferViews"][view]["target"] = json!(target);
        accessor["bufferView"] = json!(view);
        self.push("accessors", accessor)
    }

    /// Returns the bytes of a buffer view; `None` if the view does not exist or exceeds its buffer.
    pub fn view(&self, index: usize) -> Option<&[u8]> {
        let view = self.list("bufferViews").get(index)?;
        let (first, length) = (offset(view)?, number(&view["byteLength"])?);
        self.buffers.get(number(&view["buffer"])?)?.get(first..first.checked_add(length)?)
    }

    /// Reads the bytes of a file that the document refers to.
    pub fn resource(&self, name: &str, uri: &str) -> Result<Vec<u8>> {
        self.source.resource(name, uri).map_err(Error::other)
    }

    /// Returns the error for an invalid object at `place` in the document.
    pub fn damaged(&self, place: &str) -> Error {
        Error::content(&self.path, format!(": {place} makes no sense; export the scene again"))
    }
}

/// Converts a JSON value to a nonnegative integer; `None` if it is not one.
pub(in crate::bake) fn number(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|number| usize::try_from(number).ok())
}

/// Returns the `byteOffset` of an object, 0 by default; `None` if it is not a nonnegative integer.
pub(super) fn offset(value: &Value) -> Option<usize> {
    match &value["byteOffset"] {
        Value::Null => Some(0),
        stated => number(stated),
    }
}
