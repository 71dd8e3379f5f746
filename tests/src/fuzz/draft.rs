//! A scene that is being changed.

use crate::glb::glb_file;
use crate::{Glb, Random};
use serde_json::{Value, json};
use std::path::Path;

/// Text that no JSON library writes; a string of the form `RAW<number>` stands for it until the document is written.
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

/// A scene: its document, its binary part, the settings beside it.
#[derive(Clone, Debug)]
pub struct Draft {
    /// Where it comes from.
    pub name: String,
    /// The document.
    pub json: Value,
    /// The first buffer.
    pub bin: Vec<u8>,
    /// Text of the settings file; none is written where it is empty.
    pub toml: String,
}

/// Numbers of an accessor in the binary part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// First byte.
    pub start: usize,
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Elements.
    pub count: usize,
    /// Components of an element.
    pub components: usize,
    /// glTF's number of the type of a component.
    pub component_type: u64,
}

impl Draft {
    /// A scene of the tests.
    pub fn of(name: &str, glb: &Glb) -> Self {
        let mut json = glb.json.clone();
        json["buffers"] = json!([{ "byteLength": glb.bin.len() }]);
        Self { name: name.into(), json, bin: glb.bin.clone(), toml: String::new() }
    }

    /// The document as text.
    pub(super) fn text(&self) -> String {
        let mut text = self.json.to_string();
        for (number, raw) in RAW.iter().enumerate() {
            text = text.replace(&format!("\"RAW<{number}>\""), raw);
        }
        text
    }

    /// A value that is written as something that JSON libraries do not write.
    pub(super) fn raw(random: &mut Random) -> Value {
        json!(format!("RAW<{}>", random.below(RAW.len())))
    }

    /// Writes the scene and its settings into `folder`; the name of the scene's file.
    ///
    /// It is a .glb file mostly, else a .gltf file with its buffer inside or beside it. Once in a while bytes are damaged.
    pub fn write(&self, folder: &Path, random: &mut Random) -> std::io::Result<&'static str> {
        // The settings.
        if !self.toml.is_empty() {
            std::fs::write(folder.join("scene.toml"), &self.toml)?;
        }

        // The scene in one of its three forms. A buffer that the document no longer has, no form can name.
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

        // Damage that no document can express: bytes of headers and text, and files that end too early.
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

    /// Number of entries of a list of the document.
    pub(super) fn count(&self, list: &str) -> usize {
        self.json.get(list).and_then(Value::as_array).map_or(0, Vec::len)
    }

    /// A random entry of a list of the document, if that has any, and its index.
    pub(super) fn entry(&mut self, list: &str, random: &mut Random) -> Option<(usize, &mut Value)> {
        let list = self.json.get_mut(list)?.as_array_mut()?;
        if list.is_empty() {
            return None;
        }
        let index = random.below(list.len());
        Some((index, &mut list[index]))
    }

    /// Adds to a list of the document, which is made if it is not there; the index, unless the list is something else by now.
    pub(super) fn push(&mut self, list: &str, value: Value) -> Option<usize> {
        let root = self.json.as_object_mut()?;
        let list = root.entry(list).or_insert_with(|| json!([])).as_array_mut()?;
        list.push(value);
        Some(list.len() - 1)
    }

    /// Adds bytes to the binary part, with a view and an accessor for them; the index of the accessor.
    pub(super) fn append(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> Option<usize> {
        // Views begin at multiples of four, as floats have to.
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let start = self.bin.len();
        self.bin.extend(bytes);
        if let Some(length) = self.json.pointer_mut("/buffers/0/byteLength") {
            *length = json!(start + bytes.len());
        }
        let view = json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() });
        let view = self.push("bufferViews", view)?;
        let accessor = json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        self.push("accessors", accessor)
    }

    /// Where the numbers of an accessor lie; none where that makes no sense any more.
    pub(super) fn span(&self, accessor: usize) -> Option<Span> {
        let accessor = self.json.get("accessors")?.get(accessor)?;
        let number = |value: &Value, key: &str| value.get(key).and_then(Value::as_u64).unwrap_or(0) as usize;
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
        let stride = match number(view, "byteStride") {
            0 => packed,
            stride => stride,
        };
        let start = number(view, "byteOffset").checked_add(number(accessor, "byteOffset"))?;
        Some(Span { start, stride, count: number(accessor, "count"), components, component_type })
    }

    /// The bytes of one number, as far as they are there.
    pub(super) fn component(&mut self, span: &Span, element: usize, component: usize) -> Option<&mut [u8]> {
        let size = size_of_component(span.component_type);
        let start = element.checked_mul(span.stride)?.checked_add(span.start)?.checked_add(component * size)?;
        self.bin.get_mut(start..start.checked_add(size)?)
    }
}

/// Bytes of a number of this type.
fn size_of_component(component_type: u64) -> usize {
    match component_type {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    }
}

/// The bytes as an address that holds them (RFC 2397; RFC 4648, 4).
pub(super) fn data_uri(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
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
