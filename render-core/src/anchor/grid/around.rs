//! Points around a cell, and the distribution of a spot's light among these points.

use super::walls::Doubt;
use super::{Grid, LEAST_COSINE, MOST_HEIGHT, OTHER_INSTANCE, Sight, Spot};
use crate::accel::PACKET;

/// Maximum number of points that share the light of one spot. One packet of rays tests the visibility of these points.
const MOST_NEAR: usize = PACKET;

/// Points of a cell and its adjacent cells, in structure-of-arrays layout.
#[derive(Clone, Debug, Default)]
pub(super) struct Around {
    /// Indices into [`Grid::points`].
    pub places: Vec<u32>,
    position: [Vec<f32>; 3],
    normal: [Vec<f32>; 3],
    pub instance: Vec<u32>,
    /// Kernel weight of each point.
    pub weights: Vec<f32>,
}

impl Around {
    /// Collects the points in a cell of `grid` and in its adjacent cells.
    pub fn find(&mut self, grid: &Grid, cell: [usize; 3]) {
        // Reuse the memory of the previous cell.
        let Self { places, position, normal, instance, weights } = self;
        places.clear();
        instance.clear();
        for axis in 0..3 {
            position[axis].clear();
            normal[axis].clear();
        }
        if !grid.points.is_empty() {
            grid.rows(cell).for_each(|row| places.extend(row));
        }

        // Copy coordinates by axis, so that one instruction processes many points.
        for &p in places.iter() {
            let point = &grid.points[p as usize];
            for axis in 0..3 {
                position[axis].push(point.position[axis]);
                normal[axis].push(point.normal[axis]);
            }
            instance.push(point.instance);
        }
        weights.resize(places.len(), 0.0);
    }

    /// Computes the kernel weight of each point around `spot`. The formula is identical to [`Grid::near`], but
    /// vectorized.
    pub fn weigh(&mut self, spot: &Spot, radius: f32) {
        // Use slices of equal length to avoid bounds checks in the loop.
        let ([x, y, z], [n_x, n_y, n_z]) = (spot.position.to_array(), spot.normal.to_array());
        let (others, instance) = (if spot.only_own { 0.0 } else { OTHER_INSTANCE }, spot.instance);
        let count = self.weights.len();
        let [p_x, p_y, p_z] = self.position.each_ref().map(|axis| &axis[..count]);
        let [m_x, m_y, m_z] = self.normal.each_ref().map(|axis| &axis[..count]);
        let instances = &self.instance[..count];

        // Weight: w = 1 − d² / R² on the same wall and 0 elsewhere, reduced for points on other instances.
        for (i, weight) in self.weights.iter_mut().enumerate() {
            let (d_x, d_y, d_z) = (p_x[i] - x, p_y[i] - y, p_z[i] - z);
            let d2 = (d_x * d_x + d_y * d_y + d_z * d_z) / (radius * radius);
            let cosine = m_x[i] * n_x + m_y[i] * n_y + m_z[i] * n_z;
            let height = n_x * d_x + n_y * d_y + n_z * d_z;
            // Avoid branches, so that the loop is vectorized.
            let same_wall = (d2 < 1.0) & (cosine > LEAST_COSINE) & (height.abs() < MOST_HEIGHT * radius);
            let share = if instances[i] == instance { 1.0 } else { others };
            *weight = if same_wall { (1.0 - d2) * share } else { 0.0 };
        }
    }
}

/// Points that share the light of one spot, with their weights.
pub(super) struct NearPoints {
    parts: [(u32, f32); MOST_NEAR],
    count: usize,
    sum: f32,
    /// Mask of the points on the instance of the spot.
    own: u64,
    /// Maximum doubt over these points.
    doubt: Doubt,
}

impl Default for NearPoints {
    fn default() -> Self {
        Self { parts: [(0, 0.0); MOST_NEAR], count: 0, sum: 0.0, own: 0, doubt: Doubt::Nothing }
    }
}

impl NearPoints {
    /// Adds point `p` of `grid`.
    #[inline]
    pub fn add(&mut self, grid: &Grid, p: u32, weight: f32, is_own: bool) {
        if self.count < MOST_NEAR {
            self.parts[self.count] = (p, weight);
            self.sum += weight;
            self.own |= u64::from(is_own) << self.count;
            self.doubt = self.doubt.max(grid.walls.doubt(p));
            self.count += 1;
        }
    }

    /// Returns the points with weights that sum to 1. These are the points of the kernel that no wall hides, as tested
    /// with `sight`. If no such point is on the instance of the spot, a single point nearby may replace them. The
    /// result is empty if no point can receive light.
    #[inline]
    pub fn parts(&mut self, grid: &Grid, spot: &Spot, sight: Option<&Sight>) -> &[(u32, f32)] {
        // Remove hidden points before normalization, so that visible points receive all light.
        if let Some(sight) = sight.filter(|_| self.doubt != Doubt::Nothing) {
            self.drop_hidden(grid, spot, sight);
        }

        // Search for the nearest point on the spot's instance if the kernel contains none. Otherwise, another sheet
        // would receive all light.
        if self.own == 0
            && let Some(p) = nearest(grid, spot, sight)
            && (self.sum <= 0.0 || grid.is_own_beside(p, spot))
        {
            (self.parts[0], self.count, self.sum) = ((p as u32, 1.0), 1, 1.0);
        }
        let parts = &mut self.parts[..self.count];
        for (_, weight) in parts.iter_mut() {
            *weight /= self.sum;
        }
        parts
    }

    /// Returns the visible point with the largest weight. Points on the spot's instance are preferred, even slightly
    /// beyond the kernel.
    pub fn best(&self, grid: &Grid, spot: &Spot, sight: Option<&Sight>) -> Option<usize> {
        // Try the points on the spot's instance first.
        let mut left = u64::MAX >> (MOST_NEAR - self.count.max(1));
        if let Some(p) = self.best_seen(left & self.own, grid, spot, sight) {
            return Some(p);
        }
        left &= !self.own;

        // Prefer points on the spot's instance slightly beyond the kernel to other points within it.
        let nearest = nearest(grid, spot, sight);
        if let Some(p) = nearest.filter(|&p| grid.is_own_beside(p, spot)) {
            return Some(p);
        }
        self.best_seen(left, grid, spot, sight).or(nearest)
    }

    /// Returns the visible point with the largest weight in the mask `left`.
    fn best_seen(&self, mut left: u64, grid: &Grid, spot: &Spot, sight: Option<&Sight>) -> Option<usize> {
        loop {
            let mut best: Option<usize> = None;
            for i in 0..self.count {
                let (_, weight) = self.parts[i];
                if left >> i & 1 == 1 && weight > best.map_or(0.0, |best| self.parts[best].1) {
                    best = Some(i);
                }
            }
            // Accept the best point if it is visible, otherwise exclude it.
            let i = best?;
            let part = &self.parts[i..=i];
            match sight.filter(|_| self.doubt != Doubt::Nothing) {
                Some(sight) if grid.hidden(spot, sight, part, Doubt::Anything) != 0 => left &= !(1 << i),
                _ => return Some(part[0].0 as usize),
            }
        }
    }

    /// Removes the points that a wall hides from `spot`.
    fn drop_hidden(&mut self, grid: &Grid, spot: &Spot, sight: &Sight) {
        let hidden = grid.hidden(spot, sight, &self.parts[..self.count], self.doubt);
        if hidden == 0 {
            return;
        }

        // Add the visible points again, so that sum and doubt do not include hidden points.
        let (parts, own, count) = (self.parts, self.own, self.count);
        *self = Self::default();
        for i in (0..count).filter(|i| hidden >> i & 1 == 0) {
            let (p, weight) = parts[i];
            self.add(grid, p, weight, own >> i & 1 == 1);
        }
    }
}

/// Returns the nearest point with the orientation of `spot`, or `None` if a wall hides this point.
fn nearest(grid: &Grid, spot: &Spot, sight: Option<&Sight>) -> Option<usize> {
    let p = grid.nearest(spot)?;
    let hides = |sight: &Sight| grid.hidden(spot, sight, &[(p as u32, 1.0)], Doubt::Anything) != 0;
    (!sight.is_some_and(hides)).then_some(p)
}
