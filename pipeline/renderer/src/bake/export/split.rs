//! Vertices split at chart boundaries, because a vertex has only one texture coordinate.

use glam::Vec2;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Texture coordinates of the triangles on one side of an instance; `None` for a triangle without coordinates.
pub(in crate::bake) type SideTriangles = Vec<Option<[Vec2; 3]>>;

/// Vertices of a mesh, split so that each has one texture coordinate per side of each instance.
#[derive(Debug, PartialEq)]
pub(in crate::bake) struct Split {
    /// Index of the original vertex of each new vertex.
    pub vertices: Vec<u32>,
    /// Indices of the new vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Split {
    /// Splits the vertices of `triangles`. Each of `sides` contains one entry per triangle.
    pub fn new(triangles: &[[u32; 3]], sides: &[SideTriangles]) -> Self {
        // Start with one class of corners per vertex; each side refines the classes.
        let mut kinds: Vec<u32> = triangles.as_flattened().to_vec();
        for side in sides {
            let mut known: HashMap<(u32, Option<[u32; 2]>), u32> = HashMap::new();
            for (corner, kind) in kinds.iter_mut().enumerate() {
                let place = side[corner / 3].map(|corners| corners[corner % 3].to_array().map(f32::to_bits));
                let next = known.len() as u32;
                *kind = *known.entry((*kind, place)).or_insert(next);
            }
        }

        // Number the classes in order of their first triangle.
        let (mut vertices, mut number_of) = (Vec::new(), HashMap::new());
        let mut new = vec![[0; 3]; triangles.len()];
        let olds = triangles.as_flattened().iter();
        for ((new, kind), &old) in new.as_flattened_mut().iter_mut().zip(kinds).zip(olds) {
            let number = match number_of.entry(kind) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(entry) => {
                    vertices.push(old);
                    *entry.insert(vertices.len() as u32 - 1)
                }
            };
            *new = number;
        }
        Self { vertices, triangles: new }
    }

    /// Returns the texture coordinate of each vertex on a side; (0, 0) for a vertex without a coordinate.
    pub fn places(&self, side: &SideTriangles) -> Vec<Vec2> {
        let mut places = vec![Vec2::ZERO; self.vertices.len()];
        for (triangle, corners) in self.triangles.iter().zip(side) {
            for (&vertex, place) in triangle.iter().zip(corners.iter().flatten()) {
                places[vertex as usize] = *place;
            }
        }
        places
    }

    /// Returns the vertex indices of all triangles with coordinates on a side. A `back` has reverse winding.
    pub fn indices(&self, side: &SideTriangles, back: bool) -> Vec<u32> {
        let mut indices = Vec::with_capacity(3 * self.triangles.len());
        for (&[a, b, c], _) in self.triangles.iter().zip(side).filter(|(_, corners)| corners.is_some()) {
            indices.extend(if back { [a, c, b] } else { [a, b, c] });
        }
        indices
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec2;

    /// Checks two triangles with a common edge, in one chart and in two charts.
    #[test]
    fn vertices_are_split_between_charts_alone() {
        let triangles = [[0, 1, 2], [2, 1, 3]];
        let corners = |shift: f32| [vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(0.0, 1.0)].map(|corner| corner + shift);
        let (first, beside) = (corners(0.0), [vec2(0.0, 1.0), vec2(1.0, 0.0), vec2(1.0, 1.0)]);
        let whole: SideTriangles = vec![Some(first), Some(beside)];
        let cut: SideTriangles = vec![Some(first), Some(beside.map(|corner| corner + 8.0))];

        let one = Split::new(&triangles, std::slice::from_ref(&whole));
        assert_eq!(one, Split { vertices: vec![0, 1, 2, 3], triangles: triangles.to_vec() });

        // Expect a vertex that is split on one side to be split on all sides.
        let two = Split::new(&triangles, &[whole.clone(), cut.clone()]);
        assert_eq!(two, Split { vertices: vec![0, 1, 2, 2, 1, 3], triangles: vec![[0, 1, 2], [3, 4, 5]] });
        assert_eq!(two.places(&whole)[2..4], [vec2(0.0, 1.0); 2]);
        assert_eq!(two.places(&cut)[2..4], [vec2(0.0, 1.0), vec2(8.0, 9.0)]);
        assert_eq!(two.indices(&whole, true), [0, 2, 1, 3, 5, 4]);
        assert_eq!(two.indices(&vec![None, cut[1]], false), [3, 4, 5], "no place, no triangle");
    }
}
