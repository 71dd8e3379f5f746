//! Raw elements of accessors, copied as bytes for any type.

use super::document::{ARRAY_BUFFER, Document, number, offset};
use glam::Vec3;
use serde_json::{Value, json};

/// Layout of an accessor's elements.
#[derive(Clone, Copy)]
struct Layout {
    /// Value of `componentType` in glTF.
    component: u64,
    /// Number of bytes per component.
    width: usize,
    /// Number of components per element.
    count: usize,
}

impl Layout {
    /// Returns the layout of an accessor; `None` for matrices and unknown types.
    fn of(accessor: &Value) -> Option<Self> {
        let component = accessor["componentType"].as_u64()?;
        // Map the component types BYTE to FLOAT to their widths (glTF 2.0, 3.6.2.2).
        let width = match component {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            5125 | 5126 => 4,
            _ => return None,
        };
        let count = match accessor["type"].as_str()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => return None,
        };
        Some(Self { component, width, count })
    }

    fn size(self) -> usize {
        self.width * self.count
    }

    /// Returns the value of a component with the bytes `b`.
    fn number(self, b: &[u8]) -> f64 {
        match self.component {
            5120 => f64::from(b[0] as i8),
            5121 => f64::from(b[0]),
            5122 => f64::from(i16::from_le_bytes([b[0], b[1]])),
            5123 => f64::from(u16::from_le_bytes([b[0], b[1]])),
            5125 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        }
    }

    /// Returns the minimum and the maximum of each component, for elements `stride` bytes apart.
    fn bounds(self, bytes: &[u8], stride: usize) -> (Vec<f64>, Vec<f64>) {
        let (mut least, mut most) = (vec![f64::INFINITY; self.count], vec![f64::NEG_INFINITY; self.count]);
        for element in bytes.chunks_exact(stride) {
            for (c, component) in element[..self.size()].chunks_exact(self.width).enumerate() {
                let value = self.number(component);
                (least[c], most[c]) = (least[c].min(value), most[c].max(value));
            }
        }
        (least, most)
    }
}

impl Document {
    /// Returns the elements of an accessor without gaps; `None` if their number is not `count`, or if they exceed their
    /// buffer.
    fn elements(&self, accessor: &Value, count: usize) -> Option<Vec<u8>> {
        // Read the elements; without a buffer view, all are zero (glTF 2.0, 5.1.1).
        let layout = Layout::of(accessor)?;
        let size = layout.size();
        if number(&accessor["count"])? != count {
            return None;
        }
        let mut elements = match &accessor["bufferView"] {
            Value::Null => vec![0; size.checked_mul(count)?],
            view => {
                let view = number(view)?;
                let stride = number(&self.list("bufferViews").get(view)?["byteStride"]).unwrap_or(size);
                strided(self.view(view)?, offset(accessor)?, stride, size, count)?
            }
        };

        // Replace the elements that a sparse accessor lists.
        if let Value::Object(sparse) = &accessor["sparse"] {
            let (places, values) = (sparse.get("indices")?, sparse.get("values")?);
            let replaced = number(sparse.get("count")?)?;
            let index = Layout::of(&json!({ "componentType": places["componentType"], "type": "SCALAR" }))?;
            let bytes = |part: &Value, size: usize| {
                strided(self.view(number(&part["bufferView"])?)?, offset(part)?, size, size, replaced)
            };
            let (places, values) = (bytes(places, index.size())?, bytes(values, size)?);
            for (place, value) in places.chunks_exact(index.size()).zip(values.chunks_exact(size)) {
                // Return `None` for positions outside of the list: a damaged file may contain any index.
                let first = (index.number(place) as usize).checked_mul(size)?;
                elements.get_mut(first..first.checked_add(size)?)?.copy_from_slice(value);
            }
        }
        Some(elements)
    }

    /// Adds an accessor of positions, and returns its index.
    pub fn add_positions(&mut self, positions: &[Vec3]) -> usize {
        let (mut least, mut most, mut bytes) = (Vec3::INFINITY, Vec3::NEG_INFINITY, Vec::new());
        for &position in positions {
            (least, most) = (least.min(position), most.max(position));
            position.to_array().iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        }
        let bounds = [least, most].map(|corner| corner.to_array());
        let accessor = json!({
            "componentType": 5126, "type": "VEC3", "count": positions.len(), "min": bounds[0], "max": bounds[1]
        });
        self.add_accessor(bytes, ARRAY_BUFFER, accessor)
    }

    /// Adds an accessor with the elements of `accessor` at `vertices`, and returns its index. `accessor` must have
    /// `count` elements. `bounded` adds minimum and maximum. Returns `None` if `accessor` cannot be read.
    pub fn gather(&mut self, accessor: usize, count: usize, vertices: &[u32], bounded: bool) -> Option<usize> {
        // Read the original elements.
        let old = self.list("accessors").get(accessor)?.clone();
        let (layout, elements) = (Layout::of(&old)?, self.elements(&old, count)?);
        let size = layout.size();

        // Align elements to four bytes (glTF 2.0, 3.6.2.4).
        let stride = size.next_multiple_of(4);
        let mut bytes = Vec::with_capacity(vertices.len() * stride);
        for &vertex in vertices {
            bytes.extend(elements.get(vertex as usize * size..)?.get(..size)?);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }

        // Describe the new accessor.
        let mut new = json!({ "componentType": old["componentType"], "type": old["type"], "count": vertices.len() });
        if old["normalized"] == json!(true) {
            new["normalized"] = json!(true);
        }
        if bounded {
            let (least, most) = layout.bounds(&bytes, stride);
            (new["min"], new["max"]) = (json!(least), json!(most));
        }
        let index = self.add_accessor(bytes, ARRAY_BUFFER, new);
        if stride != size {
            let view = self.list("bufferViews").len() - 1;
            self.json["bufferViews"][view]["byteStride"] = json!(stride);
        }
        Some(index)
    }
}

/// Returns `count` elements of `size` bytes without gaps, read `stride` bytes apart; `None` if they exceed `bytes`.
fn strided(bytes: &[u8], first: usize, stride: usize, size: usize, count: usize) -> Option<Vec<u8>> {
    if count == 0 {
        return Some(Vec::new());
    }
    // Compute the end with checks for overflow: a damaged file may contain any number.
    let end = stride.checked_mul(count - 1)?.checked_add(first)?.checked_add(size)?;
    if end > bytes.len() || stride == 0 {
        return None;
    }
    let mut elements = Vec::with_capacity(size * count);
    for element in 0..count {
        elements.extend(&bytes[first + element * stride..][..size]);
    }
    Some(elements)
}
