//! Space through which moving geometry passes, as a grid of cells.

use crate::Units;
use crate::scene::Scene;
use glam::{BVec3A, Vec3, Vec3A};

/// Number of cells along each axis.
const SIDE: i32 = 64;

/// Grid of cells over the scene. A cell is marked if moving geometry enters it.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SweptVolume {
    low: Vec3A,
    /// Number of cells per meter.
    density: f32,
    /// Mask of marked cells: one bit per cell in x, and one word per (y, z).
    rows: Vec<u64>,
}

impl SweptVolume {
    /// Length of a segment without an end \[m\]. It is finite, but longer than any scene.
    pub(crate) const FAR: f32 = 1e16;

    /// Returns an empty grid over the bounds of the scene in `units`.
    #[must_use]
    pub fn new(units: &Units) -> Self {
        // Make the grid slightly larger than the scene, so that moving geometry never touches the border of the grid.
        let side = 2.02 * units.radius;
        Self {
            low: units.center - Vec3A::splat(side / 2.0),
            density: SIDE as f32 / side,
            rows: vec![0; (SIDE * SIDE) as usize],
        }
    }

    /// Returns the space through which the moving instances of `scene` pass at `times` \[s\].
    pub fn of(scene: &Scene, units: &Units, times: impl IntoIterator<Item = f32>) -> Self {
        let mut swept = Self::new(units);
        // List the moving instances with the bounds of their meshes, which rigid instances keep.
        let around = |positions: &[Vec3]| {
            let empty = [Vec3A::INFINITY, Vec3A::NEG_INFINITY];
            positions.iter().fold(empty, |[low, high], &p| [low.min(p.into()), high.max(p.into())])
        };
        let mut moving: Vec<(usize, [Vec3A; 2])> = Vec::new();
        for (index, moves) in (0usize..).zip(scene.moving_instances()) {
            if moves {
                moving.push((index, around(&scene.meshes[scene.instances[index].mesh].positions)));
            }
        }

        // Mark the world-space box of each moving shape at each time.
        for time in times {
            let pose = scene.pose(time);
            for &(index, at_rest) in &moving {
                let [low, high] = pose.deformed(index).map_or(at_rest, |shape| around(&shape.positions));
                if !low.cmple(high).all() {
                    continue;
                }
                let world = scene.instance_world(&pose, index);
                let corner = |i: u32| Vec3A::select(BVec3A::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), low, high);
                let corners: Vec<Vec3> = (0..8).map(|i| world.transform_point3a(corner(i)).into()).collect();
                let [low, high] = around(&corners);
                swept.add(low, high);
            }
        }
        swept
    }

    /// Marks the cells that the box from `low` to `high` touches.
    pub fn add(&mut self, low: Vec3A, high: Vec3A) {
        // Enlarge the box by a thousandth of a cell, so that rounding cannot exclude cells.
        let first = self.cell((low - self.low) * self.density - 1e-3);
        let last = self.cell((high - self.low) * self.density + 1e-3);
        let bits = (u64::MAX << first[0]) & (u64::MAX >> (SIDE - 1 - last[0]));
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                self.rows[(z * SIDE + y) as usize] |= bits;
            }
        }
    }

    /// Returns the space enlarged by at least `margin` meters. Whole cells are added along each axis.
    #[must_use]
    pub fn widened(&self, margin: f32) -> Self {
        // Spread the bits of each word, which are neighbors in x.
        let cells = ((margin * self.density).ceil().max(0.0) as i32).min(SIDE);
        let (mut along_x, mut along_y, mut rows) = (self.rows.clone(), self.rows.clone(), self.rows.clone());
        for step in 1..=cells {
            for (wide, row) in along_x.iter_mut().zip(&self.rows) {
                *wide |= row.checked_shl(step as u32).unwrap_or(0) | row.checked_shr(step as u32).unwrap_or(0);
            }
        }
        // Combine adjacent words in y, then in z. A word is a row in x.
        let beside = |from: &[u64], to: &mut [u64], stride: i32| {
            for place in 0..SIDE * SIDE {
                let at = place / stride % SIDE;
                for step in -cells.min(at)..=cells.min(SIDE - 1 - at) {
                    to[place as usize] |= from[(place + step * stride) as usize];
                }
            }
        };
        beside(&along_x, &mut along_y, 1);
        beside(&along_y, &mut rows, SIDE);
        Self { rows, ..*self }
    }

    /// Returns the fraction of cells that are marked.
    #[must_use]
    pub fn share(&self) -> f32 {
        self.rows.iter().map(|row| row.count_ones()).sum::<u32>() as f32 / (SIDE * SIDE * SIDE) as f32
    }

    fn cell(&self, at: Vec3A) -> [i32; 3] {
        at.to_array().map(|x| (x as i32).clamp(0, SIDE - 1))
    }

    /// Returns whether the segment from `from` to `to` passes through a marked cell (Amanatides & Woo 1987).
    pub(crate) fn is_entered(&self, from: Vec3A, to: Vec3A) -> bool {
        let (from, way) = ((from - self.low) * self.density, (to - from) * self.density);
        let inverse = way.recip();
        // Clip the segment to the grid by slabs. The functions min and max ignore NaN (0 · ∞).
        let (a, b) = (-from * inverse, (Vec3A::splat(SIDE as f32) - from) * inverse);
        let enter = a.min(b).max_element().max(0.0);
        let leave = a.max(b).min_element().min(1.0);
        if enter > leave {
            return false;
        }
        // Step from cell to cell, starting at the first cell in the grid.
        let start = from + way * enter;
        let mut cell = self.cell(start);
        let last = self.cell(from + way * leave);
        let step = way.to_array().map(|x| if x > 0.0 { 1 } else { -1 });
        let length = inverse.abs().to_array();
        // Compute where the segment crosses the next border on each axis. The value is infinite for an axis
        // perpendicular to the segment.
        let along = way.to_array();
        let mut next: [f32; 3] = std::array::from_fn(|axis| {
            let border = (cell[axis] + i32::from(step[axis] > 0)) as f32;
            if along[axis] == 0.0 { f32::INFINITY } else { (border - from[axis]) * inverse[axis] }
        });
        // Limit the number of steps: a segment crosses at most as many cells as the three axes have together.
        for _ in 0..3 * SIDE {
            if self.rows[(cell[2] * SIDE + cell[1]) as usize] >> cell[0] & 1 == 1 {
                return true;
            }
            if cell == last {
                return false;
            }
            let axis = if next[0] <= next[1] && next[0] <= next[2] {
                0
            } else if next[1] <= next[2] {
                1
            } else {
                2
            };
            if next[axis] > leave {
                return false;
            }
            cell[axis] += step[axis];
            next[axis] += length[axis];
            if !(0..SIDE).contains(&cell[axis]) {
                return false;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_unit, uniform_sphere};
    use glam::Vec2;

    fn units() -> Units {
        Units { center: Vec3A::new(5.0, -3.0, 2.0), radius: 4.0, epsilon: 1e-4 }
    }

    /// A segment through a box enters the cells of this box from any direction.
    #[test]
    fn no_segment_through_a_box_is_missed() {
        let u = |a, b| hash_unit(5, a, b);
        for k in 0..2000 {
            let mut swept = SweptVolume::new(&units());
            let low = units().center + Vec3A::new(u(k, 0), u(k, 1), u(k, 2)) * 4.0 - 2.5;
            let size = Vec3A::new(u(k, 3), u(k, 4), u(k, 5)) * 0.5;
            swept.add(low, low + size);
            let inside = low + size * Vec3A::new(u(k, 6), u(k, 7), u(k, 8));
            let mut direction = Vec3A::from(uniform_sphere(Vec2::new(u(k, 9), u(k, 10))));
            if k % 5 == 0 {
                direction = Vec3A::AXES[k as usize / 5 % 3];
            }
            let (before, after) = (u(k, 11) * 20.0, u(k, 12) * 20.0);
            assert!(swept.is_entered(inside - direction * before, inside + direction * after));
            assert!(swept.is_entered(inside - direction * before, inside + direction * SweptVolume::FAR));
        }
    }

    #[test]
    fn a_widened_space_has_all_that_is_near() {
        let mut swept = SweptVolume::new(&units());
        let (low, high) = (units().center + Vec3A::new(-0.3, 0.1, 0.7), units().center + Vec3A::new(0.2, 0.4, 1.1));
        swept.add(low, high);
        let near = swept.widened(0.5);
        let u = |a, b| hash_unit(6, a, b);
        for k in 0..2000 {
            let inside = low + (high - low) * Vec3A::new(u(k, 0), u(k, 1), u(k, 2));
            let way = Vec3A::from(uniform_sphere(Vec2::new(u(k, 3), u(k, 4))));
            let (close, far) = (inside + way * 0.49, inside + way * 2.5);
            assert!(near.is_entered(close, close) && !near.is_entered(far, far), "{inside}, {way}");
        }
        assert_eq!(swept.widened(0.0).rows, swept.rows);
    }

    #[test]
    fn what_passes_far_from_the_box_is_free() {
        let mut swept = SweptVolume::new(&units());
        let center = units().center;
        swept.add(center - 0.5, center + 0.5);
        assert!(swept.share() > 0.0015 && swept.share() < 0.004, "{}", swept.share());
        let beside = center + Vec3A::new(0.0, 1.0, 0.0);
        assert!(!swept.is_entered(beside - Vec3A::X * 9.0, beside + Vec3A::X * 9.0));
        assert!(!swept.is_entered(beside, beside + Vec3A::Y * SweptVolume::FAR));
        assert!(!swept.is_entered(center + Vec3A::X * 9.0, center + Vec3A::X * 90.0));
        assert!(!swept.is_entered(beside, beside));
        assert!(swept.is_entered(center, center));
    }
}
