//! Welding of vertices: exporters repeat vertices along seams of textures and normals, and round the copies.

use super::near::PointGrid;
use glam::{DVec3, Vec3};

/// Maximum distance between welded vertices, as a fraction of the mesh's length. `uvunwrap` drops triangles thinner than
/// this.
const TOLERANCE: f64 = 1e-6;
/// Minimum cosine of the angle between the normals of vertices on a smooth surface: 20°.
const SMOOTH: f32 = 0.94;

/// Mesh with welded vertices, in world space.
pub(super) struct WeldedMesh {
    /// Opposite corners of the bounding box \[m\].
    pub bounds: [Vec3; 2],
    /// Longest side of the bounding box \[m\], clamped to the range of finite densities.
    pub length: f64,
    /// Positions \[m\]. Vertices at a hard edge have several copies of a position, with equal bits.
    pub positions: Vec<Vec3>,
    /// Vertices of each triangle, as indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
    /// For each vertex, the first vertex at its position.
    pub firsts: Vec<u32>,
}

impl WeldedMesh {
    /// Welds vertices at one position with similar normals. `normals` may be empty: then all vertices at a position are
    /// welded.
    pub fn new(positions: &[Vec3], normals: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut mesh = Self::empty(positions);
        let mut welded = Vec::with_capacity(positions.len());
        let tolerance = TOLERANCE * mesh.length;
        let mut kept_normals: Vec<Option<Vec3>> = Vec::new();
        let mut grid = PointGrid::new(2.0 * tolerance);
        for (vertex, &position) in positions.iter().enumerate() {
            // Find the vertices kept so far at this position, and among them one with a similar normal.
            let (place, normal) = (position.as_dvec3(), normals.get(vertex).copied());
            let is_near = |&&kept: &&u32| mesh.at(kept).distance(place) <= tolerance;
            let near: Vec<u32> = grid.around(place, tolerance).filter(is_near).copied().collect();
            let is_smooth = |&&kept: &&u32| match (kept_normals[kept as usize], normal) {
                (Some(kept), Some(normal)) => kept.dot(normal) >= SMOOTH,
                _ => true,
            };
            if let Some(&kept) = near.iter().find(is_smooth) {
                welded.push(kept);
                continue;
            }

            // Keep a new vertex. At a hard edge, it has the position of the first vertex there.
            let kept = mesh.positions.len() as u32;
            let first = near.first().map_or(kept, |&near| mesh.firsts[near as usize]);
            let position = mesh.positions.get(first as usize).copied().unwrap_or(position);
            mesh.positions.push(position);
            mesh.firsts.push(first);
            kept_normals.push(normal);
            grid.add(kept, position.as_dvec3());
            welded.push(kept);
        }
        mesh.triangles = triangles.iter().map(|corners| corners.map(|corner| welded[corner as usize])).collect();
        mesh
    }

    /// Returns a mesh without vertices, with the size of the mesh at `positions`.
    fn empty(positions: &[Vec3]) -> Self {
        let (mut least, mut most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for &position in positions {
            (least, most) = (least.min(position), most.max(position));
        }
        let length = f64::from((most - least).max_element().clamp(1e-30, 1e30));
        let (positions, triangles, firsts) = (Vec::new(), Vec::new(), Vec::new());
        Self { bounds: [least, most], length, positions, triangles, firsts }
    }

    /// Returns the position of a vertex \[m\].
    pub fn at(&self, vertex: u32) -> DVec3 {
        self.positions[vertex as usize].as_dvec3()
    }

    /// Returns the corners of a triangle \[m\].
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(|vertex| self.at(vertex))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two squares share an edge, with copies of its vertices that differ by rounding. Equal normals weld the copies,
    /// perpendicular normals keep them at one position.
    #[test]
    fn copies_of_vertices_are_welded_on_smooth_surfaces_only() {
        let right = 1.0 + 3e-7;
        let positions =
            [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (right, 0.0), (2.0, 0.0), (2.0, 1.0), (right, 1.0)];
        let positions = positions.map(|(x, y)| Vec3::new(x, y, 0.0));
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        for (normal, count) in [(Vec3::Z, 6), (Vec3::X, 8)] {
            let normals = [[Vec3::Z; 4], [normal; 4]].concat();
            let mesh = WeldedMesh::new(&positions, &normals, &triangles);
            assert_eq!(mesh.positions.len(), count);
            let [left, right] = [mesh.triangles[0][1], mesh.triangles[2][0]];
            assert_eq!(mesh.positions[left as usize], mesh.positions[right as usize]);
            assert_eq!(mesh.firsts[right as usize], left);
        }
        assert_eq!(WeldedMesh::new(&positions, &[], &triangles).positions.len(), 6);
    }
}
