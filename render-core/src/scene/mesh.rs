//! Triangles with one material, and what may bend them.

use super::UV_SETS;
use glam::{Vec2, Vec3, Vec4};

/// A triangle mesh in its own space. Every per-vertex list is as long as `positions` or empty.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, or empty.
    pub name: String,
    /// Meters in local space.
    pub positions: Vec<Vec3>,
    /// Unit normals; when empty, the mesh is flat shaded as glTF prescribes.
    pub normals: Vec<Vec3>,
    /// Unit tangents along which a normal map's x points, and in w the sign of its y: y = (normal × tangent) · w.
    pub tangents: Vec<Vec4>,
    /// Texture coordinates, those of the sets that the material uses.
    pub uvs: [Vec<Vec2>; UV_SETS],
    /// Linear RGB factor on the base color, and factor on its opacity.
    pub colors: Vec<Vec4>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into the scene's materials.
    pub material: usize,
    /// Shapes that may be mixed in.
    pub morph_targets: Vec<MorphTarget>,
    /// The joints that bend it; its vertices are then placed by them alone.
    pub skinning: Option<Skinning>,
}

impl Mesh {
    /// The three corners of triangle `index` in local space, as the file has them.
    #[inline]
    #[must_use]
    pub fn corners(&self, index: usize) -> [Vec3; 3] {
        self.triangles[index].map(|vertex| self.positions[vertex as usize])
    }

    /// Bytes of all its lists.
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

/// Displacements of the vertices of a mesh at full weight. Every list is as long as the mesh's positions, or empty.
#[derive(Clone, Debug, Default)]
pub struct MorphTarget {
    /// Meters in local space.
    pub positions: Vec<Vec3>,
    /// Added to the normals.
    pub normals: Vec<Vec3>,
    /// Added to the tangents.
    pub tangents: Vec<Vec3>,
}

/// A joint's pull on a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Influence {
    /// Index into [`Skin::joints`](super::Skin::joints).
    pub joint: u32,
    /// Share, 0…1; those of a vertex sum to 1.
    pub weight: f32,
}

/// How a mesh hangs from a skin.
#[derive(Clone, Debug)]
pub struct Skinning {
    /// Index into [`Scene::skins`](super::Scene::skins).
    pub skin: usize,
    /// Influences on each vertex.
    pub per_vertex: usize,
    /// Influences of the first vertex, then of the second …
    pub influences: Vec<Influence>,
}

/// Value at barycentric `(u, v)` with weight `1 - u - v` on the first corner; `None` where the list is empty.
#[inline]
pub(crate) fn interpolate<T>(list: &[T], corners: [u32; 3], u: f32, v: f32) -> Option<T>
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    let [a, b, c] = corners.map(|vertex| vertex as usize);
    (!list.is_empty()).then(|| list[a] * (1.0 - u - v) + list[b] * u + list[c] * v)
}
