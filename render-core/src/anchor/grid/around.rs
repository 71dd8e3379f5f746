//! What is around a place: the points of the cells beside it, and those of them that share what is left there.

use super::{Grid, LEAST_COSINE, MOST_HEIGHT, OTHER_INSTANCE, Spot};

/// Most points that share what is left at one place.
const MOST_NEAR: usize = 64;

/// The points of a cell and of those beside it, by axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Around {
    /// Places in [`Grid::points`].
    pub places: Vec<u32>,
    position: [Vec<f32>; 3],
    normal: [Vec<f32>; 3],
    pub instance: Vec<u32>,
    /// Weight of each in the kernel.
    pub weights: Vec<f32>,
}

impl Around {
    /// Finds what is in a cell of `grid` and in those beside it.
    pub fn find(&mut self, grid: &Grid, cell: [usize; 3]) {
        // The memory of the last cell is used again.
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

        // By axis: one instruction takes a coordinate of many points.
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

    /// The weight of the kernel around `spot` for each: the same arithmetic as [`Grid::near`]'s, many side by side.
    pub fn weigh(&mut self, spot: &Spot, radius: f32) {
        // Slices of one length, so that the loop checks no index.
        let ([x, y, z], [n_x, n_y, n_z]) = (spot.position.to_array(), spot.normal.to_array());
        let (others, instance) = (if spot.only_own { 0.0 } else { OTHER_INSTANCE }, spot.instance);
        let count = self.weights.len();
        let [p_x, p_y, p_z] = self.position.each_ref().map(|axis| &axis[..count]);
        let [m_x, m_y, m_z] = self.normal.each_ref().map(|axis| &axis[..count]);
        let instances = &self.instance[..count];

        // w = 1 − d² / R² on the same wall, 0 elsewhere; less for points of other instances.
        for (i, weight) in self.weights.iter_mut().enumerate() {
            let (d_x, d_y, d_z) = (p_x[i] - x, p_y[i] - y, p_z[i] - z);
            let d2 = (d_x * d_x + d_y * d_y + d_z * d_z) / (radius * radius);
            let cosine = m_x[i] * n_x + m_y[i] * n_y + m_z[i] * n_z;
            let height = n_x * d_x + n_y * d_y + n_z * d_z;
            // Without branches.
            let same_wall = (d2 < 1.0) & (cosine > LEAST_COSINE) & (height.abs() < MOST_HEIGHT * radius);
            let share = if instances[i] == instance { 1.0 } else { others };
            *weight = if same_wall { (1.0 - d2) * share } else { 0.0 };
        }
    }
}

/// The points that share what is left at a place, and their weights.
pub(super) struct Near {
    parts: [(u32, f32); MOST_NEAR],
    count: usize,
    sum: f32,
    /// Whether any of them belongs to the instance of the place.
    has_own: bool,
}

impl Default for Near {
    fn default() -> Self {
        Self { parts: [(0, 0.0); MOST_NEAR], count: 0, sum: 0.0, has_own: false }
    }
}

impl Near {
    #[inline]
    pub fn add(&mut self, p: u32, weight: f32, is_own: bool) {
        if self.count < MOST_NEAR {
            self.parts[self.count] = (p, weight);
            self.sum += weight;
            self.count += 1;
            self.has_own |= is_own;
        }
    }

    /// The points with weights that sum to 1: those of the kernel, or one near by where it holds none of the own instance; none
    /// if there is no point at all that may take anything.
    #[inline]
    pub fn parts(&mut self, grid: &Grid, spot: &Spot) -> &[(u32, f32)] {
        // A kernel that holds nothing of the own instance would give all to another sheet. One of its own may lie close by.
        if !self.has_own
            && let Some(p) = grid.nearest(spot)
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
}
