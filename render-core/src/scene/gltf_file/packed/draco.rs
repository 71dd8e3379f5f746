//! Meshes packed by `KHR_draco_mesh_compression`.

use crate::scene::gltf_file::document::one_line;
use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex};

/// Values of one attribute at all vertices.
pub(super) struct Attribute {
    /// Little-endian numbers without gaps.
    pub bytes: Vec<u8>,
    /// glTF's `componentType` of the numbers.
    pub component: u32,
    /// Number of components per vertex, 1 to 4.
    pub width: usize,
}

/// Unpacked mesh of triangles.
pub(super) struct Unpacked {
    /// Vertex indices of the corners of all triangles.
    pub indices: Vec<u32>,
    /// Number of vertices in the mesh.
    pub vertices: usize,
    /// Attributes in the order of their ids.
    pub attributes: Vec<Attribute>,
}

/// Limits on the contents of a stream.
#[derive(Clone, Copy)]
pub(super) struct Most {
    pub triangles: usize,
    /// Maximum memory of vertices \[bytes\].
    pub bytes: usize,
}

/// Unpacks the attributes with these ids.
pub(super) fn decode(data: &[u8], ids: &[u32], most: Most) -> Result<Unpacked, String> {
    // Each vertex is a corner of at least one triangle.
    let limits = DecodeLimits::default()
        .with_max_faces(most.triangles as u64)
        .with_max_points(3 * most.triangles as u64)
        .with_max_decoded_bytes(most.bytes as u64);
    let mut mesh = Mesh::new();
    let decoded = MeshDecoder::new().decode(&mut DecoderBuffer::new(data).with_limits(limits), &mut mesh);
    decoded.map_err(|error| format!("cannot be decoded ({})", one_line(error.message())))?;
    // Refuse more triangles than the accessors state, and vertices without a triangle.
    let vertices = mesh.num_points();
    let indices: Vec<u32> = mesh.faces().iter().flatten().map(|corner| corner.0).collect();
    if indices.len() > 3 * most.triangles || vertices > indices.len() {
        return Err(format!(
            "has {} triangles and {vertices} vertices, more than its accessors state",
            indices.len() / 3
        ));
    }
    // Copy the attributes in the order of their ids.
    let mut attributes = Vec::new();
    for &id in ids {
        let attribute = mesh.attribute_by_unique_id(id).ok_or_else(|| format!("has no attribute {id}"))?;
        attributes.push(numbers(attribute, vertices).ok_or_else(|| format!("has an attribute {id} that glTF lacks"))?);
    }
    Ok(Unpacked { indices, vertices, attributes })
}

/// Returns the numbers of an attribute in vertex order. Returns `None` if their type does not exist in glTF, or if they
/// are outside the data.
fn numbers(attribute: &PointAttribute, vertices: usize) -> Option<Attribute> {
    // Map the data type to glTF's component type.
    let (component, size) = match attribute.data_type() {
        DataType::Int8 => (5120, 1),
        DataType::Uint8 => (5121, 1),
        DataType::Int16 => (5122, 2),
        DataType::Uint16 => (5123, 2),
        DataType::Uint32 => (5125, 4),
        DataType::Float32 => (5126, 4),
        _ => return None,
    };
    let width = usize::from(attribute.num_components());
    // Check the layout, then gather the mapped values of all vertices.
    let (stride, data) = (usize::try_from(attribute.byte_stride()).ok()?, attribute.buffer().data());
    if !(1..=4).contains(&width) || stride < width * size {
        return None;
    }
    let mut bytes = Vec::with_capacity(vertices * width * size);
    for vertex in 0..vertices {
        let value = attribute.mapped_index(PointIndex(vertex as u32)).0 as usize;
        bytes.extend_from_slice(data.get(value.checked_mul(stride)?..)?.get(..width * size)?);
    }
    Some(Attribute { bytes, component, width })
}
