//! Search for items near a position, by a grid of cubes, and comparison of edges.

use glam::{DVec3, I64Vec3};
use std::collections::HashMap;

/// Items by the cubes in which they are. Search results depend on the order of insertion only.
pub(super) struct PointGrid {
    /// Side of the cubes \[m\].
    side: f64,
    cells: HashMap<I64Vec3, Vec<u32>>,
}

impl PointGrid {
    /// Creates an empty grid of cubes with the given side \[m\], above 0.
    pub fn new(side: f64) -> Self {
        Self { side, cells: HashMap::new() }
    }

    /// Adds an item at a point.
    pub fn add(&mut self, item: u32, point: DVec3) {
        self.cells.entry(self.cell(point)).or_default().push(item);
    }

    /// Adds an item along a line from `a` to `b`, within `reach` of it.
    pub fn add_line(&mut self, item: u32, [a, b]: [DVec3; 2], reach: f64) {
        // Divide the line until each piece is in few cubes.
        let pieces = ((b - a).length() / self.side).ceil().clamp(1.0, 1e6) as usize;
        for piece in 0..pieces {
            let [from, to] = [piece, piece + 1].map(|k| a.lerp(b, k as f64 / pieces as f64));
            let (low, high) = (self.cell(from.min(to) - reach), self.cell(from.max(to) + reach));
            for cell in cells(low, high) {
                let items = self.cells.entry(cell).or_default();
                if items.last() != Some(&item) {
                    items.push(item);
                }
            }
        }
    }

    /// Returns the items in the cubes within `reach` of a point. Items along lines may repeat.
    pub fn around(&self, point: DVec3, reach: f64) -> impl Iterator<Item = &u32> {
        let (low, high) = (self.cell(point - reach), self.cell(point + reach));
        cells(low, high).filter_map(|cell| self.cells.get(&cell)).flatten()
    }

    fn cell(&self, point: DVec3) -> I64Vec3 {
        (point / self.side).floor().as_i64vec3()
    }
}

/// Returns the cells of a box, including both corners.
fn cells(low: I64Vec3, high: I64Vec3) -> impl Iterator<Item = I64Vec3> {
    let plane = move |z| (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| I64Vec3::new(x, y, z)));
    (low.z..=high.z).flat_map(plane)
}

/// Returns whether two edges run along each other in opposite directions, within `reach` \[m\].
pub(super) fn run_along(one: [DVec3; 2], other: [DVec3; 2], reach: f64) -> bool {
    let length_squared = |ends: [DVec3; 2]| ends[0].distance_squared(ends[1]);
    let (long, short) = if length_squared(one) < length_squared(other) { (other, one) } else { (one, other) };
    let ([a, b], [c, d]) = (long, short);
    let Some(along) = (b - a).try_normalize() else { return false };

    // The ends of the shorter edge are on the line of the longer one, and the edges have a common interval.
    let is_on_line = [c, d].iter().all(|&end| (end - a).reject_from_normalized(along).length() <= reach);
    let [from, to, whole] = [d, c, b].map(|end| (end - a).dot(along));
    is_on_line && to.min(whole) - from.max(0.0) > 4.0 * reach
}
