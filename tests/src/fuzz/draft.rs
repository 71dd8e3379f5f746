//! Scene that the changes apply to.

use crate::glb::glb_file;
use crate::{Glb, Random};
use serde_json::{Value, json};
use std::path::Path;

/// Text that no JSON library writes. The string `RAW<number>` represents it until the document is written.
const RAW: [&str; 12] = [
    "1e999",
    "-1e999",
    "NaN",
    "-0",
    "0.1e-400",
    "\"\\ud800\"",
    "\"\\u0000\"",
    "\"a\\nb\\r\\u001b[2Jc\"",
    "123456789012345678901234567890",
    "{\"a\":1,\"a\":2}",
    "[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]",
    "",
];

/// Scene as JSON document, binary chunk and settings file.
#[derive(Clone, Debug)]
pub struct Draft {
    /// Name of the original scene.
    pub name: String,
    /// JSON document.
    pub json: Value,
    /// Content of the first buffer.
    pub bin: Vec<u8>,
    /// Text of the settings file, which is not written if empty.
    pub toml: String,
}

/// Layout of an accessor's numbers in the binary chunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Offset of the first byte.
    pub start: usize,
    /// Distance between consecutive elements \[bytes\].
    pub stride: usize,
    /// Number of elements.
    pub count: usize,
    /// Components of an element.
    pub components: usize,
    /// glTF's code of the component type.
    pub component_type: u64,
}

impl Draft {
    /// Creates a draft from a scene of the tests.
    pub fn of(name: &str, glb: &Glb) -> Self {
        let mut json = glb.json.clone();
        json["buffers"] = json!([{ "byteLength": glb.bin.len() }]);
        Self { name: name.into(), json, bin: glb.bin.clone(), toml: String::new() }
    }

    /// Returns the document as text.
    pub(super) fn text(&self) -> String {
        let mut text = self.json.to_string();
        for (number, raw) in RAW.iter().enumerate() {
            text = text.replace(&format!("\"RAW<{number}>\""), raw);
        }
        text
    }

    /// Returns a value that is written as text outside JSON.
    pub(super) fn raw(random: &mut Random) -> Value {
        json!(format!("RAW<{}>", random.below(RAW.len())))
    }

    /// Writes the scene and its settings into `folder`, and returns the name of the scene's file.
    ///
    /// Most scenes are .glb files. The others are .gltf files with an embedded or external buffer. Some files have damaged
    /// bytes.
    pub fn write(&self, folder: &Path, random: &mut Random) -> std::io::Result<&'static str> {
        // Write the settings.
        if !self.toml.is_empty() {
            std::fs::write(folder.join("scene.toml"), &self.toml)?;
        }

        // Write the scene in one of three forms. Without a first buffer in the document, only the .glb form is possible.
        let form = random.below(6);
        let mut whole = self.clone();
        let buffer = whole.json.pointer_mut("/buffers/0").and_then(Value::as_object_mut);
        let (name, mut bytes) = match (form, buffer) {
            (0, Some(buffer)) => {
                buffer.insert("uri".into(), json!(data_uri(&self.bin)));
                ("scene.gltf", whole.text().into_bytes())
            }
            (1, Some(buffer)) => {
                buffer.insert("uri".into(), json!("scene.bin"));
                std::fs::write(folder.join("scene.bin"), &self.bin)?;
                ("scene.gltf", whole.text().into_bytes())
            }
            _ => ("scene.glb", glb_file(&self.text(), &self.bin)),
        };

        // Damage bytes of headers and text, and truncate files.
        if random.one_in(20) {
            for _ in 0..=random.below(3) {
                let near = [40, bytes.len()][random.below(2)].min(bytes.len());
                let place = random.below(near);
                bytes[place] = random.below(256) as u8;
            }
        }
        if random.one_in(60) {
            bytes.truncate(random.below(bytes.len()));
        }
        std::fs::write(folder.join(name), bytes)?;
        Ok(name)
    }

    /// Returns the number of entries of a list of the document.
    pub(super) fn count(&self, list: &str) -> usize {
        self.json.get(list).and_then(Value::as_array).map_or(0, Vec::len)
    }

    /// Returns a random entry of a list of the document, with its index; none if the list is empty.
    pub(super) fn entry(&mut self, list: &str, random: &mut Random) -> Option<(usize, &mut Value)> {
        let list = self.json.get_mut(list)?.as_array_mut()?;
        if list.is_empty() {
            return None;
        }
        let index = random.below(list.len());
        Some((index, &mut list[index]))
    }

    /// Appends to a list of the document, which is created if missing. Returns the index; none if the value is not a list.
    pub(super) fn push(&mut self, list: &str, value: Value) -> Option<usize> {
        let root = self.json.as_object_mut()?;
        let list = root.entry(list).or_insert_with(|| json!([])).as_array_mut()?;
        list.push(value);
        Some(list.len() - 1)
    }

    /// Appends bytes to the binary chunk, with a view and an accessor, and returns the accessor's index.
    pub(super) fn append(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> Option<usize> {
        // Views start at multiples of four bytes, as floats require.
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let start = self.bin.len();
        self.bin.extend(bytes);
        // Extend the buffer of the document, and add a view and an accessor.
        if let Some(length) = self.json.pointer_mut("/buffers/0/byteLength") {
            *length = json!(start + bytes.len());
        }
        let view = json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() });
        let view = self.push("bufferViews", view)?;
        let accessor = json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        self.push("accessors", accessor)
    }

    /// Returns the position of an accessor's numbers; none if the document is inconsistent.
    pub(super) fn span(&self, accessor: usize) -> Option<Span> {
        let accessor = self.json.get("accessors")?.get(accessor)?;
        let number = |value: &Value, key: &str| value.get(key).and_then(Value::as_u64).unwrap_or(0) as usize;
        // Find the layout of an element.
        let view = self.json.get("bufferViews")?.get(number(accessor, "bufferView"))?;
        let components = match accessor.get("type")?.as_str()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            _ => return None,
        };
        let component_type = accessor.get("componentType")?.as_u64()?;
        let packed = components * size_of_component(component_type);
        // Elements follow each other if the view has no stride.
        let stride = match number(view, "byteStride") {
            0 => packed,
            stride => stride,
        };
        let start = number(view, "byteOffset").checked_add(number(accessor, "byteOffset"))?;
        Some(Span { start, stride, count: number(accessor, "count"), components, component_type })
    }

    /// Returns the bytes of one number, if they exist.
    pub(super) fn component(&mut self, span: &Span, element: usize, component: usize) -> Option<&mut [u8]> {
        let size = size_of_component(span.component_type);
        let start = element.checked_mul(span.stride)?.checked_add(span.start)?.checked_add(component * size)?;
        self.bin.get_mut(start..start.checked_add(size)?)
    }
}

/// Returns the size of a number of this type \[bytes\].
fn size_of_component(component_type: u64) -> usize {
    match component_type {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    }
}

/// Returns a data URI of the bytes (RFC 2397; RFC 4648, 4).
pub(super) fn data_uri(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    // Write three bytes as four digits, with = for missing bytes.
    let mut uri = "data:application/octet-stream;base64,".to_owned();
    for group in bytes.chunks(3) {
        let bits = (0..3).fold(0usize, |bits, i| bits << 8 | usize::from(group.get(i).copied().unwrap_or(0)));
        for digit in 0..4 {
            let known = digit <= group.len();
            uri.push(if known { char::from(DIGITS[bits >> (18 - 6 * digit) & 63]) } else { '=' });
        }
    }
    uri
}
