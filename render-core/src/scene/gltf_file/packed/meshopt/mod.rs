//! Buffer views packed by `EXT_meshopt_compression` and `KHR_meshopt_compression`. The bitstreams of the KHR extension
//! include all bitstreams of the EXT extension.
//!
//! Section titles refer to the text of `KHR_meshopt_compression`.

mod attributes;
mod filters;
mod indices;

/// Reason why a stream is refused.
pub(super) type Fault = &'static str;

/// Reason for a stream that ends before its last element.
const SHORT: Fault = "ends early";
/// Reason for a stream that continues after its last element.
const LONG: Fault = "has bytes left over";

/// Bitstream of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BufferMode {
    Attributes,
    Triangles,
    Indices,
}

/// Filter applied after decoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Format of a packed view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub mode: BufferMode,
    pub filter: Filter,
    /// Number of elements in the view.
    pub count: usize,
    /// Size of an element \[bytes\].
    pub stride: usize,
}

impl Layout {
    /// Parses `mode` and `filter`, and checks them ("JSON schema updates").
    pub fn new(mode: &str, filter: Option<&str>, count: usize, stride: usize) -> Result<Self, Fault> {
        // Parse the names.
        let mode = match mode {
            "ATTRIBUTES" => BufferMode::Attributes,
            "TRIANGLES" => BufferMode::Triangles,
            "INDICES" => BufferMode::Indices,
            _ => return Err("has an unknown mode"),
        };
        let filter = match filter.unwrap_or("NONE") {
            "NONE" => Filter::None,
            "OCTAHEDRAL" => Filter::Octahedral,
            "QUATERNION" => Filter::Quaternion,
            "EXPONENTIAL" => Filter::Exponential,
            "COLOR" => Filter::Color,
            _ => return Err("has an unknown filter"),
        };
        // Check the stride, which depends on mode and filter.
        let strides: &[usize] = match (mode, filter) {
            (BufferMode::Attributes, Filter::None | Filter::Exponential) => &[],
            (BufferMode::Attributes, Filter::Octahedral | Filter::Color) => &[4, 8],
            (BufferMode::Attributes, Filter::Quaternion) => &[8],
            (_, Filter::None) => &[2, 4],
            _ => return Err("has a filter, which indices cannot have"),
        };
        let is_attribute = strides.is_empty() && stride.is_multiple_of(4) && (4..=256).contains(&stride);
        if !is_attribute && !strides.contains(&stride) {
            return Err("has a stride that its mode and filter do not allow");
        }
        if mode == BufferMode::Triangles && !count.is_multiple_of(3) {
            return Err("has a number of indices that is not a multiple of 3");
        }
        Ok(Self { mode, filter, count, stride })
    }

    /// Returns the size of the unpacked view \[bytes\].
    pub fn size(&self) -> usize {
        self.count.saturating_mul(self.stride)
    }

    /// Unpacks `data`. Before memory is allocated, checks that `data` is long enough for the number of elements in the
    /// document.
    pub fn unpack(&self, data: &[u8]) -> Result<Vec<u8>, Fault> {
        let mut out = match self.mode {
            BufferMode::Attributes => attributes::decode(data, self.count, self.stride)?,
            BufferMode::Triangles => narrowed(indices::triangles(data, self.count)?, self.stride),
            BufferMode::Indices => narrowed(indices::sequence(data, self.count)?, self.stride),
        };
        filters::apply(self.filter, self.stride, &mut out);
        Ok(out)
    }
}

/// Returns the indices as little-endian numbers of 2 or 4 bytes.
fn narrowed(indices: Vec<u32>, stride: usize) -> Vec<u8> {
    if stride == 2 {
        indices.iter().flat_map(|&index| (index as u16).to_le_bytes()).collect()
    } else {
        indices.iter().flat_map(|index| index.to_le_bytes()).collect()
    }
}
