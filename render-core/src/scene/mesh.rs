//! Triangles with one material.

use super::{MorphTarget, Skinning, UV_SETS};
use glam::{Vec2, Vec3, Vec4};

/// A triangle mesh in its own space. Every per-vertex list is as long as `positions` or empty.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, or empty.
    pub name: String,
    /// Metres in local space.
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
    pub fn corners(&self, index: usize) -> [Vec3; 3] {
        self.triangles[index].map(|vertex| self.positions[vertex as usize])
    }
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
