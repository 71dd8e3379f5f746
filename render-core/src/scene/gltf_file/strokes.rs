//! Points and lines as thin bodies, since rays only intersect surfaces.
//!
//! A disc facing the camera would be inconsistent, because shadow rays, reflections and photons see it from other
//! sides. An octahedron needs eight triangles, is equally wide along all three axes, and looks the same to all of them.

use glam::Vec3;
use gltf::mesh::Mode;

/// Width of points and lines relative to the diagonal of their mesh: about two pixels in an image of the whole mesh.
const WIDTH: f32 = 1.0 / 200.0;

/// Maximum memory of a point or segment: vertices, triangles and the vertices' sources \[bytes\].
pub(super) const BYTES_PER_STROKE: usize = 8 * size_of::<[f32; 4]>() + 12 * size_of::<[u32; 3]>();

/// Bodies around points or lines.
pub(super) struct Strokes {
    /// Corners of the bodies \[m\].
    pub positions: Vec<Vec3>,
    /// Triangles of the bodies.
    pub triangles: Vec<[u32; 3]>,
    /// Index of the vertex to which each corner belongs.
    pub sources: Vec<u32>,
}

impl Strokes {
    /// Builds octahedra around points, or square tubes around lines. `width` \[m\] replaces the default width. Returns
    /// `None` for triangles.
    pub fn of(mode: Mode, indices: &[u32], positions: &[Vec3], width: Option<f32>) -> Option<Self> {
        // List the segments of lines.
        let segments: Vec<[u32; 2]> = match mode {
            Mode::Points => Vec::new(),
            Mode::Lines => indices.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect(),
            Mode::LineStrip => indices.windows(2).map(|pair| [pair[0], pair[1]]).collect(),
            Mode::LineLoop => {
                let next = indices.iter().cycle().skip(1);
                indices.iter().zip(next).map(|(&from, &to)| [from, to]).collect()
            }
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => return None,
        };
        // Build one body per point or segment.
        let radius = width.unwrap_or_else(|| WIDTH * diagonal(positions)) / 2.0;
        let mut strokes = Self { positions: Vec::new(), triangles: Vec::new(), sources: Vec::new() };
        if mode == Mode::Points {
            for &vertex in indices {
                strokes.add_point(vertex, positions[vertex as usize], radius);
            }
        }
        for ends in segments {
            strokes.add_segment(ends, ends.map(|vertex| positions[vertex as usize]), radius);
        }
        Some(strokes)
    }

    fn add_point(&mut self, vertex: u32, center: Vec3, radius: f32) {
        let first = self.positions.len() as u32;
        for axis in Vec3::AXES {
            self.positions.extend([center + radius * axis, center - radius * axis]);
            self.sources.extend([vertex; 2]);
        }
        // Corners 0 and 1 are ±x, 2 and 3 are ±y, 4 and 5 are ±z. An odd number of minus signs mirrors a face.
        for side in 0..8u32 {
            let [x, y, z] = [side & 1, 2 + (side >> 1 & 1), 4 + (side >> 2 & 1)].map(|corner| first + corner);
            self.triangles.push(if side.count_ones() % 2 == 0 { [x, y, z] } else { [x, z, y] });
        }
    }

    fn add_segment(&mut self, vertices: [u32; 2], [from, to]: [Vec3; 2], radius: f32) {
        // Skip segments of length zero: they have no direction.
        let Some(along) = (to - from).try_normalize() else { return };
        let across = along.any_orthonormal_vector();
        let up = along.cross(across);
        let first = self.positions.len() as u32;
        // Place a square of corners around each end.
        for (vertex, center) in vertices.into_iter().zip([from, to]) {
            for side in [across, up, -across, -up] {
                self.positions.push(center + radius * side);
                self.sources.push(vertex);
            }
        }
        // Connect the squares with four sides, and close the ends.
        for k in 0..4 {
            let [a, b] = [first + k, first + (k + 1) % 4];
            self.triangles.extend([[a, b, a + 4], [b, b + 4, a + 4]]);
        }
        let [a, b] = [first, first + 4];
        self.triangles.extend([[a, a + 2, a + 1], [a, a + 3, a + 2], [b, b + 1, b + 2], [b, b + 2, b + 3]]);
    }
}

/// Copies the values of vertices to the corners that belong to the vertices.
pub(super) fn spread<T: Copy>(values: Vec<T>, sources: Option<&[u32]>) -> Vec<T> {
    match sources {
        Some(sources) if !values.is_empty() => sources.iter().map(|&vertex| values[vertex as usize]).collect(),
        _ => values,
    }
}

/// Returns the diagonal of the bounding box, or 1 if all points coincide.
fn diagonal(positions: &[Vec3]) -> f32 {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &position in positions {
        (low, high) = (low.min(position), high.max(position));
    }
    let diagonal = (high - low).length();
    if diagonal > 0.0 && diagonal.is_finite() { diagonal } else { 1.0 }
}
