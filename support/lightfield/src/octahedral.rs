//! Directions as cells of a square, by the octahedral projection [Praun03], [Cigolle14].
//!
//! ```text
//! p = ω / (|ω_x| + |ω_y| + |ω_z|)                       onto the octahedron
//! (u, v) = (p_x, p_y)                                    where ω_z ≥ 0
//! (u, v) = ((1 − |p_y|) sign(p_x), (1 − |p_x|) sign(p_y))  else: the lower faces are folded out
//! ```
//!
//! Cell (i, j) of n × n has its direction at u = (2 i + 1) / n − 1, v = (2 j + 1) / n − 1. Across an edge of the square lies
//! the cell that is mirrored at the middle of that edge.
//!
//! # Differs from the papers
//!
//! They store normals in few bits. Here the square is a map, so what lies across its edges matters.

use glam::{Vec2, Vec3};

/// A map of n × n directions over the whole sphere. Direction (i, j) has the number i + n · j.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OctahedralMap {
    /// n, cells along a side: at least 1.
    pub side: usize,
}

/// The four cells around a direction, by number, and their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionCells {
    /// Numbers of the cells. One may be there twice, at the edges of tiny maps.
    pub cells: [usize; 4],
    /// Weights, which sum to 1.
    pub weights: [f32; 4],
}

/// Cells along a side for a surface of a roughness r: about 4 / r², from 4 to 24.
///
/// The lobe of a rough surface is about α = r² wide, in radians, and a cell about 2 / n: half as wide. With cells as wide as the lobe,
/// metal of roughness 0.4 in a Cornell box has four times the error of half as wide ones.
///
/// ```
/// assert_eq!([1.0, 0.8, 0.5, 0.4, 0.0].map(lightfield::map_side), [4, 6, 16, 24, 24]);
/// ```
#[must_use]
pub fn map_side(roughness: f32) -> usize {
    // No number counts as smooth: it is not the smaller one.
    let cells = (4.0 / (roughness * roughness)).min(24.0).round();
    cells.max(4.0) as usize
}

impl OctahedralMap {
    /// The number of directions, n².
    #[must_use]
    pub fn len(self) -> usize {
        self.side * self.side
    }

    /// Whether the map has no directions.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.side == 0
    }

    /// The direction of cell (i, j), of length 1.
    #[must_use]
    pub fn direction(self, i: usize, j: usize) -> Vec3 {
        let center = Vec2::new((2 * i + 1) as f32, (2 * j + 1) as f32) / self.side as f32 - 1.0;
        from_square(center)
    }

    /// The cells whose samples, weighted, are those of `direction`, which needs no particular length.
    ///
    /// Weights are continuous over the whole sphere. No direction (zero, infinite, no number) counts as +z.
    #[must_use]
    pub fn bilinear(self, direction: Vec3) -> DirectionCells {
        let n = self.side as isize;
        let place = (to_square(direction) + 1.0) * (0.5 * self.side as f32) - 0.5;
        let low = place.floor();
        let share = place - low;
        let (i, j) = (low.x as isize, low.y as isize);
        let corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)];
        let (left, top) = (1.0 - share.x, 1.0 - share.y);
        DirectionCells {
            cells: corners.map(|(i, j)| across(i, j, n)),
            weights: [left * top, share.x * top, left * share.y, share.x * share.y],
        }
    }
}

/// The number of cell (i, j), each from −1 to n: cells outside are mirrored at the middle of the edge.
fn across(mut i: isize, mut j: isize, n: isize) -> usize {
    if i < 0 || i >= n {
        (i, j) = (i.clamp(0, n - 1), n - 1 - j);
    }
    if j < 0 || j >= n {
        (i, j) = (n - 1 - i, j.clamp(0, n - 1));
    }
    (i + n * j) as usize
}

/// The place in [−1, 1]² of a direction.
fn to_square(direction: Vec3) -> Vec2 {
    // Scaled first, so that no sum overflows or vanishes.
    let scaled = direction / direction.abs().max_element();
    let p = scaled / scaled.abs().element_sum();
    if !p.is_finite() {
        Vec2::ZERO
    } else if p.z >= 0.0 {
        p.truncate()
    } else {
        folded(p.truncate())
    }
}

/// The direction, of length 1, at a place in [−1, 1]².
fn from_square(place: Vec2) -> Vec3 {
    let z = 1.0 - place.x.abs() - place.y.abs();
    let xy = if z >= 0.0 { place } else { folded(place) };
    xy.extend(z).normalize()
}

/// Mirrors a place at the diagonal of its quadrant: folds lower faces out, and back.
fn folded(place: Vec2) -> Vec2 {
    Vec2::new((1.0 - place.y.abs()).copysign(place.x), (1.0 - place.x.abs()).copysign(place.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions spread over the sphere, with axes and diagonals among them.
    fn sphere(rings: usize) -> Vec<Vec3> {
        let mut directions = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        for ring in 0..=rings {
            for step in 0..2 * rings {
                let (theta, phi) = (ring as f32 / rings as f32, step as f32 / rings as f32);
                let ((sin, cos), (y, x)) =
                    ((theta * std::f32::consts::PI).sin_cos(), (phi * std::f32::consts::PI).sin_cos());
                directions.push(Vec3::new(sin * x, sin * y, cos));
            }
        }
        directions
    }

    #[test]
    fn directions_come_back_from_the_square() {
        for direction in sphere(90) {
            let place = to_square(direction);
            assert!(place.abs().max_element() <= 1.0 + 1e-6);
            assert!((from_square(place) - direction).length() < 1e-6, "{direction}");
            // No length matters.
            for length in [1e-30, 1e30] {
                assert!((to_square(direction * length) - place).length() < 1e-6);
            }
        }
        for none in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            assert_eq!(to_square(none), Vec2::ZERO);
        }
    }

    #[test]
    fn a_direction_of_a_cell_is_that_cell() {
        for side in 1..=24 {
            let map = OctahedralMap { side };
            for k in 0..map.len() {
                let DirectionCells { cells, weights } = map.bilinear(map.direction(k % side, k / side));
                let own: f32 = (0..4).filter(|&corner| cells[corner] == k).map(|corner| weights[corner]).sum();
                assert!((own - 1.0).abs() < 1e-4, "cell {k} of {side}: {own}");
            }
        }
    }

    /// Weights by cell.
    fn spread(map: OctahedralMap, direction: Vec3) -> Vec<f32> {
        let mut all = vec![0.0; map.len()];
        let DirectionCells { cells, weights } = map.bilinear(direction);
        for corner in 0..4 {
            all[cells[corner]] += weights[corner];
        }
        all
    }

    #[test]
    fn weights_are_continuous_over_edges_and_sum_to_one() {
        // Great circles through all faces. A step of 1e-3 moves a place by at most √6 e-3 in the octahedron's plane, and a
        // weight by at most n / 2 times that for each of the two axes.
        let step = 1e-3f32;
        for side in [1, 2, 3, 4, 7, 24] {
            let map = OctahedralMap { side };
            for axis in sphere(5) {
                let (a, b) = axis.any_orthonormal_pair();
                let mut before: Option<Vec<f32>> = None;
                for k in 0..=6284 {
                    let (sin, cos) = (k as f32 * step).sin_cos();
                    let weights = spread(map, a * cos + b * sin);
                    assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                    if let Some(before) = before {
                        let largest = weights.iter().zip(&before).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
                        let bound = side as f32 * 6f32.sqrt() * step * 1.01 + 1e-5;
                        assert!(largest <= bound, "{side}: {largest} > {bound}");
                    }
                    before = Some(weights);
                }
            }
        }
    }

    /// The largest length of the difference between a direction and the weighted sum of the directions of its cells: the
    /// error of the worst linear function of slope 1.
    fn largest_error(side: usize) -> f32 {
        let map = OctahedralMap { side };
        let mut largest = 0f32;
        for direction in sphere(300) {
            let DirectionCells { cells, weights } = map.bilinear(direction);
            let cell = |corner: usize| map.direction(cells[corner] % side, cells[corner] / side) * weights[corner];
            largest = largest.max(((0..4).map(cell).sum::<Vec3>() - direction).length());
        }
        largest
    }

    #[test]
    fn linear_functions_are_interpolated() {
        // Bound: a step (Δu, Δv) moves a point of the octahedron by at most √2 (|Δu| + |Δv|), and its direction by √3 times
        // that, for no point is nearer than 1/√3 to the center. Weights w and 1 − w leave 2 w (1 − w) h ≤ h / 2 of a cell's
        // width h = 2 / n in each axis: together √6 · 2 / n. Across the creases of the octahedron errors are of this order.
        for side in [4, 5, 8, 15, 16, 24] {
            let (found, bound) = (largest_error(side), 6f32.sqrt() * 2.0 / side as f32);
            assert!(found <= bound, "{side}: {found} > {bound}");
            // Dense evaluation finds less than a half of it.
            assert!(found * side as f32 <= 2.0, "{side}: {}", found * side as f32);
        }
        // Twice as fine, half of the error: no cell is mistaken for another.
        let (coarse, fine) = (largest_error(12), largest_error(24));
        assert!(fine < 0.6 * coarse, "{coarse}, {fine}");
    }
}
