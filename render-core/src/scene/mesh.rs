//! Triangle meshes, their morph targets and their skinning.

use super::UV_SETS;
use glam::{Vec2, Vec3, Vec4};

/// Triangle mesh in local space. Every per-vertex list is as long as `positions` or empty.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, or an empty string.
    pub name: String,
    /// Positions in local space \[m\].
    pub positions: Vec<Vec3>,
    /// Unit normals. If the list is empty, the mesh is flat shaded, as glTF prescribes.
    pub normals: Vec<Vec3>,
    /// Unit tangents: the x axis of a normal map. The y axis is (normal × tangent) · w, with the sign w.
    pub tangents: Vec<Vec4>,
    /// Texture coordinates of the sets that the material uses.
    pub uvs: [Vec<Vec2>; UV_SETS],
    /// Linear RGB factor on the base color, with the factor on the base color's opacity in w.
    pub colors: Vec<Vec4>,
    /// Vertex indices of each triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into the scene's materials.
    pub material: usize,
    /// Morph targets of the mesh.
    pub morph_targets: Vec<MorphTarget>,
    /// Skinning, if the mesh has a skin. The vertices of a skinned mesh are positioned by joints only.
    pub skinning: Option<Skinning>,
}

impl Mesh {
    /// Returns the three corners of triangle `index` in local space, undeformed.
    #[inline]
    #[must_use]
    pub fn corners(&self, index: usize) -> [Vec3; 3] {
        self.triangles[index].map(|vertex| self.positions[vertex as usize])
    }

    /// Returns the size of all lists \[bytes\].
    #[must_use]
    pub fn byte_count(&self) -> usize {
        let Self { positions, normals, tangents, colors, triangles, .. } = self;
        let mut bytes = size_of_val(&positions[..]) + size_of_val(&normals[..]) + size_of_val(&tangents[..]);
        bytes += size_of_val(&colors[..]) + size_of_val(&triangles[..]);
        bytes += self.uvs.iter().map(|uvs| size_of_val(&uvs[..])).sum::<usize>();
        for MorphTarget { positions, normals, tangents } in &self.morph_targets {
            bytes += size_of_val(&positions[..]) + size_of_val(&normals[..]) + size_of_val(&tangents[..]);
        }
        bytes + self.skinning.as_ref().map_or(0, |skinning| size_of_val(&skinning.influences[..]))
    }
}

/// Displacements of a mesh's vertices at full weight. Every list is as long as the mesh's positions, or empty.
#[derive(Clone, Debug, Default)]
pub struct MorphTarget {
    /// Displacements of the positions in local space \[m\].
    pub positions: Vec<Vec3>,
    /// Displacements of the normals.
    pub normals: Vec<Vec3>,
    /// Displacements of the tangents.
    pub tangents: Vec<Vec3>,
}

/// Weight of one joint on a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Influence {
    /// Index of the joint in [`Skin::joints`](super::Skin::joints).
    pub joint: u32,
    /// Weight of the joint, 0…1. The weights of a vertex sum to 1.
    pub weight: f32,
}

/// Attachment of a mesh to a skin.
#[derive(Clone, Debug)]
pub struct Skinning {
    /// Index of the skin in [`Scene::skins`](super::Scene::skins).
    pub skin: usize,
    /// Number of influences per vertex.
    pub per_vertex: usize,
    /// Influences of the first vertex, then of the second, and so on.
    pub influences: Vec<Influence>,
}

/// Returns the value at barycentric `(u, v)` with weight `1 - u - v` on the first corner, or `None` if the list is
/// empty.
#[inline]
pub(crate) fn interpolate<T>(list: &[T], corners: [u32; 3], u: f32, v: f32) -> Option<T>
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    let [a, b, c] = corners.map(|vertex| vertex as usize);
    (!list.is_empty()).then(|| list[a] * (1.0 - u - v) + list[b] * u + list[c] * v)
}
