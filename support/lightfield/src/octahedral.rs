//! Directions as cells of a square, with the octahedral projection [Praun03], [Cigolle14].
//!
//! ```text
//! p = ω / (|ω_x| + |ω_y| + |ω_z|)                       onto the octahedron
//! (u, v) = (p_x, p_y)                                    if ω_z ≥ 0
//! (u, v) = ((1 − |p_y|) sign(p_x), (1 − |p_x|) sign(p_y))  otherwise: the lower faces are unfolded
//! ```
//!
//! Cell (i, j) of n × n has the direction of the point `u = (2 i + 1) / n − 1`, `v = (2 j + 1) / n − 1`. The neighbor
//! of a cell across an edge of the square is its mirror image about the middle of that edge.
//!
//! # Differences from the papers
//!
//! The papers store normals in few bits. This module stores a function over directions, so it also defines the
//! neighbors across the edges of the square.

use glam::{Vec2, Vec3};

/// A map of n × n directions over the whole sphere. Direction (i, j) has the index i + n · j.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OctahedralMap {
    /// Number n of cells per side, at least 1.
    pub side: usize,
}

/// Indices of the four cells around a direction, and their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionCells {
    /// Indices of the cells. At the edges of tiny maps an index may appear twice.
    pub cells: [usize; 4],
    /// Weights of the cells. Their sum is 1.
    pub weights: [f32; 4],
}

/// Returns the number of cells per side for a surface of roughness r: about 4 / r², from 4 to 24.
///
/// The lobe of a rough surface is about α = r² wide, in radians. A cell is about 2 / n wide, half as wide as the lobe.
/// With cells as wide as the lobe, the error for metal of roughness 0.4 in a Cornell box is four times as large.
///
/// ```
/// assert_eq!([1.0, 0.8, 0.5, 0.4, 0.0].map(lightfield::map_side), [4, 6, 16, 24, 24]);
/// ```
#[must_use]
pub fn map_side(roughness: f32) -> usize {
    // NaN counts as smooth, because `min` returns 24 for NaN.
    let cells = (4.0 / (roughness * roughness)).min(24.0).round();
    cells.max(4.0) as usize
}

impl OctahedralMap {
    /// Number of directions, n².
    #[must_use]
    pub fn len(self) -> usize {
        self.side * self.side
    }

    /// Returns whether the map has no directions.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.side == 0
    }

    /// Returns the unit direction of cell (i, j).
    #[must_use]
    pub fn direction(self, i: usize, j: usize) -> Vec3 {
        let center = Vec2::new((2 * i + 1) as f32, (2 * j + 1) as f32) / self.side as f32 - 1.0;
        from_square(center)
    }

    /// Returns the cells and weights that interpolate samples at `direction`, which may have any length.
    ///
    /// Weights are continuous over the whole sphere. A direction that is zero, infinite or NaN counts as +z.
    #[must_use]
    pub fn bilinear(self, direction: Vec3) -> DirectionCells {
        let n = self.side as isize;
        // Cell centers are at half-integers, so shift by ½.
        let place = (to_square(direction) + 1.0) * (0.5 * self.side as f32) - 0.5;
        let low = place.floor();
        let share = place - low;
        let (i, j) = (low.x as isize, low.y as isize);
        // Cells beyond an edge continue on the adjacent face.
        let corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)];
        let (left, top) = (1.0 - share.x, 1.0 - share.y);
        DirectionCells {
            cells: corners.map(|(i, j)| across(i, j, n)),
            weights: [left * top, share.x * top, left * share.y, share.x * share.y],
        }
    }
}

/// Returns the index of cell (i, j), each coordinate from −1 to n. Cells outside the map are mirrored about the middle
/// of the edge.
fn across(mut i: isize, mut j: isize, n: isize) -> usize {
    // Beyond an edge, the map continues on the same edge, in reverse direction.
    if i < 0 || i >= n {
        (i, j) = (i.clamp(0, n - 1), n - 1 - j);
    }
    if j < 0 || j >= n {
        (i, j) = (n - 1 - i, j.clamp(0, n - 1));
    }
    (i + n * j) as usize
}

/// Maps a direction to a point in [−1, 1]².
fn to_square(direction: Vec3) -> Vec2 {
    // Scale the direction first, so that no sum overflows or underflows.
    let scaled = direction / direction.abs().max_element();
    // Project onto the octahedron |x| + |y| + |z| = 1, and fold its lower half outwards.
    let p = scaled / scaled.abs().element_sum();
    if !p.is_finite() {
        Vec2::ZERO
    } else if p.z >= 0.0 {
        p.truncate()
    } else {
        folded(p.truncate())
    }
}

/// Maps a point in [−1, 1]² to a unit direction.
fn from_square(place: Vec2) -> Vec3 {
    // The lower half of the octahedron is outside the diamond |x| + |y| = 1.
    let z = 1.0 - place.x.abs() - place.y.abs();
    let xy = if z >= 0.0 { place } else { folded(place) };
    xy.extend(z).normalize()
}

/// Mirrors a point about the diagonal of its quadrant. This unfolds the lower faces of the octahedron, or folds them
/// back.
fn folded(place: Vec2) -> Vec2 {
    Vec2::new((1.0 - place.y.abs()).copysign(place.x), (1.0 - place.x.abs()).copysign(place.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns directions spread over the sphere, including axes and diagonals.
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
            // Test that the length has no effect.
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

    /// Returns the weight of each cell.
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
        // Follow great circles through all faces. A step of 1e-3 moves a point by at most √6 e-3 in the octahedron's
        // plane. A weight changes by at most n / 2 times this distance for each of the two axes.
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

    /// Returns the largest distance between a direction and the weighted sum of the directions of its cells. This is
    /// the error of the worst linear function of slope 1.
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
        // Bound: a step (Δu, Δv) moves a point of the octahedron by at most √2 (|Δu| + |Δv|), and its direction by √3
        // times that distance. No point is nearer than 1/√3 to the center. Let h = 2 / n be the cell width. Linear
        // interpolation with weights w and 1 − w errs by at most 2 w (1 − w) h ≤ h / 2 per axis. Together these give
        // √6 · 2 / n. Errors across the creases of the octahedron are of this order.
        for side in [4, 5, 8, 15, 16, 24] {
            let (found, bound) = (largest_error(side), 6f32.sqrt() * 2.0 / side as f32);
            assert!(found <= bound, "{side}: {found} > {bound}");
            // The largest error found is less than half of the bound.
            assert!(found * side as f32 <= 2.0, "{side}: {}", found * side as f32);
        }
        // Check that doubling n halves the error. Confused cells would break this rule.
        let (coarse, fine) = (largest_error(12), largest_error(24));
        assert!(fine < 0.6 * coarse, "{coarse}, {fine}");
    }
}
