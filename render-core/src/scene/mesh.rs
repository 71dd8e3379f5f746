//! Triangles with one material.

use glam::{Vec2, Vec3};

/// A triangle mesh in its own space. Every per-vertex list is as long as `positions` or empty.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, or empty.
    pub name: String,
    /// Metres in local space.
    pub positions: Vec<Vec3>,
    /// Unit normals; when empty, the mesh is flat shaded as glTF prescribes.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of the sets 0 and 1.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGB factor on the base colour.
    pub colors: Vec<Vec3>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into the scene's materials.
    pub material: usize,
}

impl Mesh {
    /// The three corners of triangle `index` in local space.
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
