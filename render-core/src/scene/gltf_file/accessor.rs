//! Reader of numbers from accessors: any component type, normalized or not, interleaved or not, sparse or not.
//!
//! The `gltf` crate's own reader does not check strides and counts. It also requires floats for positions, normals and
//! tangents, but `KHR_mesh_quantization` allows bytes and shorts.

use super::stored::Allowance;
use gltf::Accessor;
use gltf::accessor::{DataType, sparse::IndexType};
use gltf::buffer::View;
use std::collections::HashSet;

/// Maximum number of elements of an accessor without a buffer view. The file contains no bytes for these zeros.
const ELEMENTS_WITHOUT_DATA: usize = 1 << 24;

/// Buffers to which accessors refer.
pub(super) struct Buffers {
    bytes: Vec<Vec<u8>>,
    /// Indices of accessors that are all zeros, regardless of the view that they name.
    zeros: HashSet<usize>,
    allowance: Allowance,
}

impl Buffers {
    /// Builds the buffers, with an allowance for the memory of accessors.
    pub(super) fn new(bytes: Vec<Vec<u8>>, zeros: HashSet<usize>, allowance: Allowance) -> Self {
        Self { bytes, zeros, allowance }
    }

    /// Returns whether accessors need more memory than is allowed for a file of this size.
    pub(super) fn is_exhausted(&self) -> bool {
        self.allowance.is_exhausted()
    }

    /// Subtracts `bytes` from the allowance. Returns `None` once the allowance is exhausted.
    pub(super) fn charge(&self, bytes: usize) -> Option<()> {
        self.allowance.charge(bytes)
    }

    /// Returns the bytes of a view, or `None` if they are outside their buffer.
    pub(super) fn view(&self, view: &View) -> Option<&[u8]> {
        let end = view.offset().checked_add(view.length())?;
        self.bytes.get(view.buffer().index())?.get(view.offset()..end)
    }

    /// Reads elements of `N` floats each. Normalized integers become 0…1 or −1…1 (glTF 2.0, 3.6.2.2); other integers
    /// keep their value. Returns `None` if the accessor has a different number of components, or too few bytes.
    pub(super) fn floats<const N: usize>(&self, accessor: &Accessor) -> Option<Vec<[f32; N]>> {
        let scaled = |value: f32, most: f32| if accessor.normalized() { (value / most).max(-1.0) } else { value };
        match accessor.data_type() {
            DataType::F32 => self.elements(accessor, |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            DataType::U8 => self.elements(accessor, |b| scaled(f32::from(b[0]), 255.0)),
            DataType::I8 => self.elements(accessor, |b| scaled(f32::from(b[0] as i8), 127.0)),
            DataType::U16 => self.elements(accessor, |b| scaled(f32::from(u16::from_le_bytes([b[0], b[1]])), 65535.0)),
            DataType::I16 => self.elements(accessor, |b| scaled(f32::from(i16::from_le_bytes([b[0], b[1]])), 32767.0)),
            DataType::U32 => None,
        }
    }

    /// Reads elements of `N` unsigned integers each. Returns `None` if the accessor has another type, a different
    /// number of components, or too few bytes.
    pub(super) fn integers<const N: usize>(&self, accessor: &Accessor) -> Option<Vec<[u32; N]>> {
        match accessor.data_type() {
            DataType::U8 => self.elements(accessor, |b| u32::from(b[0])),
            DataType::U16 => self.elements(accessor, |b| u32::from(u16::from_le_bytes([b[0], b[1]]))),
            DataType::U32 => self.elements(accessor, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            _ => None,
        }
    }

    fn elements<const N: usize, T: Copy + Default>(
        &self,
        accessor: &Accessor,
        component: impl Fn(&[u8]) -> T,
    ) -> Option<Vec<[T; N]>> {
        if accessor.dimensions().multiplicity() != N {
            return None;
        }
        let size = accessor.data_type().size();
        let element = |bytes: &[u8]| std::array::from_fn(|c| component(&bytes[c * size..]));
        // Charge the allowance before memory is allocated.
        let (count, whole) = (accessor.count(), N * size);
        self.charge(count.saturating_mul(size_of::<[T; N]>()))?;

        // Read the dense elements, which are zeros without a view.
        let mut list: Vec<[T; N]> = match accessor.view().filter(|_| !self.zeros.contains(&accessor.index())) {
            Some(view) => {
                let stride = view.stride().unwrap_or(whole);
                strided(self.view(&view)?, accessor.offset(), stride, whole, count)?.map(element).collect()
            }
            None if count <= ELEMENTS_WITHOUT_DATA => vec![[T::default(); N]; count],
            None => return None,
        };

        // Replace elements with sparse ones.
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let (width, index): (usize, fn(&[u8]) -> usize) = match indices.index_type() {
                IndexType::U8 => (1, |b| b[0].into()),
                IndexType::U16 => (2, |b| u16::from_le_bytes([b[0], b[1]]).into()),
                IndexType::U32 => (4, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize),
            };
            let places = strided(self.view(&indices.view())?, indices.offset(), width, width, sparse.count())?;
            let values = strided(self.view(&values.view())?, values.offset(), whole, whole, sparse.count())?;
            for (place, value) in places.map(index).zip(values) {
                *list.get_mut(place)? = element(value);
            }
        }
        Some(list)
    }
}

/// Returns `count` slices of `size` bytes, `stride` apart, or `None` if `bytes` is too short.
fn strided(
    bytes: &[u8],
    offset: usize,
    stride: usize,
    size: usize,
    count: usize,
) -> Option<impl Iterator<Item = &[u8]>> {
    // Check the end of the last element, with overflow checks for damaged files.
    let last = count.saturating_sub(1).checked_mul(stride)?.checked_add(offset)?;
    let fits = count == 0 || (stride > 0 && last.checked_add(size)? <= bytes.len());
    fits.then(|| (0..count).map(move |i| &bytes[offset + i * stride..][..size]))
}
