//! Cells of an emissive triangle or parallelogram. Textured pieces are split into cells where their emission is uneven.

use crate::sampling::triangle;
use glam::Vec2;

/// Region of a patch, similar in shape to the patch. In the patch's coordinates, the patch is the unit square or the
/// triangle u, v ≥ 0, u + v ≤ 1.
///
/// ```text
/// p = c + s q          c  corner      s  size, negative for an inverted triangle      q  a point of the whole shape
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    corner: Vec2,
    size: f32,
    /// Whether the shape is the unit square, otherwise a triangle.
    square: bool,
}

impl Cell {
    /// Returns the cell that is the whole patch.
    pub fn whole(square: bool) -> Self {
        Self { corner: Vec2::ZERO, size: 1.0, square }
    }

    /// Returns whether the cell is the whole patch.
    pub fn is_whole(&self) -> bool {
        self.size == 1.0
    }

    /// Returns the side of the cell, as a fraction of the patch's side.
    pub fn side(&self) -> f32 {
        self.size.abs()
    }

    /// Maps `place` in the unit square to a point of the cell, uniformly over the area. The result is barycentric for a
    /// triangle.
    pub fn point(&self, place: Vec2) -> Vec2 {
        let q = if self.square { place } else { Vec2::from(triangle(place)) };
        self.corner + q * self.size
    }

    /// Returns the corners in order around the border. A triangle repeats its last corner.
    pub fn corners(&self) -> [Vec2; 4] {
        let third = if self.square { Vec2::ONE } else { Vec2::Y };
        [Vec2::ZERO, Vec2::X, third, Vec2::Y].map(|q| self.corner + q * self.size)
    }

    /// Splits the cell into four cells of half the side.
    pub fn split(&self) -> [Self; 4] {
        let half = self.size / 2.0;
        let at = |offset: Vec2, size: f32| Self { corner: self.corner + offset * half, size, ..*self };
        // The last quarter of a triangle is in the middle, upside down.
        let last = if self.square { half } else { -half };
        [at(Vec2::ZERO, half), at(Vec2::X, half), at(Vec2::Y, half), at(Vec2::ONE, last)]
    }

    /// Returns whether the cell contains the point `p` of its patch, including the border.
    pub fn contains(&self, p: Vec2) -> bool {
        // With this tolerance, rounding does not lose points on a border between two cells.
        const SLACK: f32 = 1e-4;
        let q = (p - self.corner) / self.size;
        let far = if self.square { q.max_element() } else { q.x + q.y };
        q.min_element() >= -SLACK && far <= 1.0 + SLACK
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hammersley;

    /// Each point of a patch is in one of the four quarters. Points of a quarter are inside the patch.
    #[test]
    fn quarters_tile_a_cell() {
        for square in [false, true] {
            let whole = Cell::whole(square);
            for cell in [whole, whole.split()[3]] {
                for i in 0..500 {
                    let p = cell.point(hammersley(i, 500));
                    assert!(whole.contains(p) && cell.contains(p));
                    assert!(cell.split().iter().any(|quarter| quarter.contains(p)), "{p} in {cell:?}");
                }
                let points = cell.split().map(|quarter| quarter.point(Vec2::splat(0.4)));
                assert!(points.iter().all(|&p| cell.contains(p)), "{points:?} in {cell:?}");
            }
        }
    }
}
