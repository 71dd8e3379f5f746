//! Binary chunk of a glTF file, with its buffer views and accessors.

use serde_json::{Map, Value, json};

/// Writer of the binary chunk, with its buffer views and accessors.
#[derive(Default)]
pub(crate) struct Writer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Writer {
    /// Appends bytes as a separate buffer view and returns its index.
    pub(crate) fn view(&mut self, data: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": data.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(data);
        // Accessors must start at multiples of their component size.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Appends an accessor of floats and returns its index. With `bounds`, adds the minimum and maximum that the format
    /// requires.
    pub(crate) fn floats(&mut self, data: &[f32], kind: &str, target: Option<u32>, bounds: bool) -> usize {
        // An accessor counts elements of one to four floats.
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let bytes: Vec<u8> = data.iter().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes, target);
        let mut accessor = json!({
            "bufferView": view, "componentType": 5126, "count": data.len() / width, "type": kind
        });
        if bounds {
            let pick = |f: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
                // Fold each component of all elements separately.
                let mut picked = vec![start; width];
                for values in data.chunks(width) {
                    for (picked, &value) in picked.iter_mut().zip(values) {
                        *picked = f(*picked, value);
                    }
                }
                picked
            };
            accessor["min"] = json!(pick(f32::min, f32::INFINITY));
            accessor["max"] = json!(pick(f32::max, f32::NEG_INFINITY));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Appends an accessor of indices and returns its index. Indices take two bytes each if they fit, otherwise four.
    pub(crate) fn indices(&mut self, data: &[u32]) -> usize {
        // The largest 16-bit index is reserved for primitive restart.
        let small = data.iter().all(|&i| i < 65_535);
        let bytes: Vec<u8> = if small {
            data.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect()
        } else {
            data.iter().flat_map(|i| i.to_le_bytes()).collect()
        };
        let view = self.view(&bytes, Some(34963));
        self.accessors.push(json!({
            "bufferView": view, "componentType": if small { 5123 } else { 5125 },
            "count": data.len(), "type": "SCALAR"
        }));
        self.accessors.len() - 1
    }

    /// Assembles the whole file. `root` is the rest of the glTF description.
    pub(crate) fn finish(mut self, mut root: Map<String, Value>) -> Vec<u8> {
        root.insert("bufferViews".into(), self.views.into());
        root.insert("accessors".into(), self.accessors.into());
        root.insert("buffers".into(), json!([{"byteLength": self.bytes.len()}]));
        // Pad both chunks to multiples of four bytes: the text with spaces, the buffer with zeros.
        let mut text = serde_json::to_vec(&root).expect("plain values");
        text.resize(text.len().next_multiple_of(4), b' ');
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let total = 12 + 8 + text.len() + 8 + self.bytes.len();
        let mut out = Vec::with_capacity(total);
        // Write the header (version 2), then the JSON and the binary chunk.
        out.extend(b"glTF");
        for word in [2, total as u32, text.len() as u32] {
            out.extend(word.to_le_bytes());
        }
        out.extend(b"JSON");
        out.extend(&text);
        out.extend((self.bytes.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(&self.bytes);
        out
    }
}
