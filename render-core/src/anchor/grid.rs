//! What is near a point of a surface, and on the same side of it.

use super::Anchor;
use super::exposure::Outlook;
use glam::Vec3A;

/// Where anchors or surfels are: a grid of cells at least a kernel's radius wide over the box around them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grid {
    points: Vec<Anchor>,
    /// How far each sees; empty where nobody looked.
    outlooks: Vec<Outlook>,
    /// Original index of each point.
    index: Vec<u32>,
    /// First point of each cell, and the end of the last: cells in x, then y, then z.
    first: Vec<u32>,
    low: Vec3A,
    size: [usize; 3],
    cell: f32,
    radius: f32,
}

/// A place on a surface that is to be shared out among what is near.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub position: Vec3A,
    pub normal: Vec3A,
    /// The only instance that may take, if not all may.
    pub instance: Option<u32>,
    /// How far the light came that arrives there \[m\]; only those take that have something at about that distance.
    pub came: Option<f32>,
}

/// Points that a kernel is expected to hold: enough to be smooth, few enough to stay local.
const POINTS_PER_KERNEL: f32 = 8.0;
/// Most cells along an axis: 8 MB of them at worst.
const MOST_CELLS: f32 = 128.0;
/// Most points that share what is left at one place.
const MOST_NEAR: usize = 64;

impl Grid {
    /// Sorts `points`, each standing for `area_share` m², with their `outlooks` if these are known.
    pub fn new(points: &[Anchor], outlooks: &[Outlook], area_share: f32) -> Self {
        let radius = (POINTS_PER_KERNEL * area_share / std::f32::consts::PI).sqrt().max(f32::MIN_POSITIVE);
        let low = points.iter().fold(Vec3A::INFINITY, |low, point| low.min(point.position));
        let high = points.iter().fold(Vec3A::NEG_INFINITY, |high, point| high.max(point.position));
        let extent = if points.is_empty() { Vec3A::ZERO } else { high - low };
        let cell = radius.max(extent.max_element() / (MOST_CELLS - 1.0));
        let size = (extent / cell).to_array().map(|cells| cells as usize + 1);
        let mut grid = Self { low, size, cell, radius, ..Self::default() };
        let mut order: Vec<(usize, u32)> =
            points.iter().zip(0..).map(|(point, i)| (grid.place(grid.cell_of(point.position)), i)).collect();
        order.sort_unstable();
        grid.first =
            (0..=size.iter().product()).map(|cell| order.partition_point(|&(place, _)| place < cell) as u32).collect();
        grid.points = order.iter().map(|&(_, i)| points[i as usize]).collect();
        if !outlooks.is_empty() {
            grid.outlooks = order.iter().map(|&(_, i)| outlooks[i as usize]).collect();
        }
        grid.index = order.iter().map(|&(_, i)| i).collect();
        grid
    }

    /// How many points it holds.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// The cell of a point; outside of the box, the nearest.
    fn cell_of(&self, position: Vec3A) -> [usize; 3] {
        let at = ((position - self.low) / self.cell).to_array();
        // Negative values and NaN become 0.
        std::array::from_fn(|axis| (at[axis] as usize).min(self.size[axis] - 1))
    }

    fn place(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// Calls `give(point, weight)` for the points near `spot` that face like it; the weights sum to 1.
    /// Returns false if there is no point at all that may take anything.
    ///
    /// An Epanechnikov kernel over the points within the radius. Where it holds none that fits, as on a
    /// detail smaller than a point's share, the nearest that faces the same way takes all.
    pub fn splat(&self, spot: &Spot, mut give: impl FnMut(usize, f32)) -> bool {
        let mut near: [(u32, f32); MOST_NEAR] = [(0, 0.0); MOST_NEAR];
        let (mut count, mut sum) = (0, 0.0);
        self.near(spot, |p, weight| {
            if count < MOST_NEAR {
                near[count] = (p, weight);
                sum += weight;
                count += 1;
            }
        });
        if sum > 0.0 {
            for &(p, weight) in &near[..count] {
                give(self.index[p as usize] as usize, weight / sum);
            }
            return true;
        }
        match self.nearest(spot) {
            Some(p) => give(self.index[p] as usize, 1.0),
            None => return false,
        }
        true
    }

    /// Of the points near `spot` that face like it, that with the largest product of kernel and `rating(point)`; else
    /// the nearest that faces the same way.
    pub fn best(&self, spot: &Spot, rating: impl Fn(usize) -> f32) -> Option<usize> {
        let mut best = (0.0, None);
        self.near(spot, |p, weight| {
            let index = self.index[p as usize] as usize;
            let rated = weight * rating(index);
            if rated > best.0 {
                best = (rated, Some(index));
            }
        });
        best.1.or_else(|| self.nearest(spot).map(|p| self.index[p] as usize))
    }

    /// Calls `found(p, weight)` with the place in `points` and the kernel's weight of each point that takes from `spot`.
    #[inline]
    fn near(&self, spot: &Spot, mut found: impl FnMut(u32, f32)) {
        let Spot { position, normal, instance, came } = *spot;
        if self.points.is_empty() {
            return;
        }
        let about = came.map(Outlook::bin);
        let center = self.cell_of(position);
        let [xs, ys, zs] =
            std::array::from_fn(|axis| center[axis].saturating_sub(1)..=(center[axis] + 1).min(self.size[axis] - 1));
        for (z, y) in zs.flat_map(|z| ys.clone().map(move |y| (z, y))) {
            // The cells of a row lie behind each other, and so do their points.
            let row = self.first[self.place([*xs.start(), y, z])]..self.first[self.place([*xs.end(), y, z]) + 1];
            for p in row {
                let point = &self.points[p as usize];
                let d2 = point.position.distance_squared(position) / (self.radius * self.radius);
                // Half a right angle apart, or well off the plane: another wall, not this one.
                let same_wall = d2 < 1.0
                    && point.normal.dot(normal) > 0.7
                    && normal.dot(point.position - position).abs() < 0.3 * self.radius
                    && instance.is_none_or(|instance| instance == point.instance);
                if same_wall {
                    let likely = match (about, self.outlooks.get(p as usize)) {
                        (Some(bin), Some(outlook)) => outlook.likelihood_of(bin),
                        _ => 1.0,
                    };
                    found(p, (1.0 - d2) * likely);
                }
            }
        }
    }

    /// The nearest point that faces to the same side, else the nearest at all: in cubes of cells that grow
    /// until what they hold is nearer than anything outside of them could be.
    fn nearest(&self, spot: &Spot) -> Option<usize> {
        let Spot { position, normal, instance, .. } = *spot;
        if self.points.is_empty() {
            return None;
        }
        let center = self.cell_of(position);
        let most = *self.size.iter().max()?;
        let mut best: [Option<(f32, usize)>; 2] = [None, None];
        for reach in 0..=most {
            let span =
                |axis: usize| center[axis].saturating_sub(reach)..=(center[axis] + reach).min(self.size[axis] - 1);
            for z in span(2) {
                for y in span(1) {
                    for x in span(0) {
                        let away = [x.abs_diff(center[0]), y.abs_diff(center[1]), z.abs_diff(center[2])];
                        // Only the shell is new.
                        if away.iter().max() != Some(&reach) {
                            continue;
                        }
                        let place = self.place([x, y, z]);
                        for p in self.first[place] as usize..self.first[place + 1] as usize {
                            let point = &self.points[p];
                            if instance.is_some_and(|instance| instance != point.instance) {
                                continue;
                            }
                            let d2 = point.position.distance_squared(position);
                            let away = usize::from(point.normal.dot(normal) <= 0.0);
                            if best[away].is_none_or(|(nearest, _)| d2 < nearest) {
                                best[away] = Some((d2, p));
                            }
                        }
                    }
                }
            }
            // Cells beyond this shell are at least so far away.
            let beyond = reach as f32 * self.cell;
            if best[0].is_some_and(|(d2, _)| d2 <= beyond * beyond) {
                break;
            }
        }
        best[0].or(best[1]).map(|(_, p)| p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash_unit;

    fn random(key: u64) -> Vec3A {
        Vec3A::new(hash_unit(1, key, 0), hash_unit(1, key, 1), hash_unit(1, key, 2)) * 2.0 - 1.0
    }

    #[test]
    fn the_nearest_that_fits_is_found() {
        let points: Vec<Anchor> = (0..500)
            .map(|k| Anchor {
                position: random(k) * Vec3A::new(3.0, 1.0, 0.1),
                normal: random(1000 + k).normalize(),
                instance: (k % 3) as u32,
            })
            .collect();
        let grid = Grid::new(&points, &[], 0.01);
        for k in 0..300 {
            let (position, normal) = (random(5000 + k) * 4.0, random(9000 + k).normalize());
            let instance = (k % 2 == 0).then_some((k % 3) as u32);
            let fits = |a: &&Anchor| instance.is_none_or(|i| i == a.instance) && a.normal.dot(normal) > 0.0;
            let expected = points
                .iter()
                .filter(fits)
                .map(|a| a.position.distance_squared(position))
                .min_by(f32::total_cmp)
                .unwrap();
            let found = grid.points[grid.nearest(&Spot { position, normal, instance, came: None }).unwrap()];
            assert!(fits(&&found));
            assert_eq!(found.position.distance_squared(position), expected);
        }
    }

    #[test]
    fn weights_sum_to_one_and_nothing_is_given_across_walls() {
        let points: Vec<Anchor> = (0..400)
            .map(|k| {
                let at = random(k) * Vec3A::new(1.0, 0.0, 1.0);
                // Two floors, one above the other, facing up and down.
                let up = k % 2 == 0;
                Anchor {
                    position: at + Vec3A::Y * if up { 0.0 } else { 0.02 },
                    normal: if up { Vec3A::Y } else { -Vec3A::Y },
                    instance: 0,
                }
            })
            .collect();
        let grid = Grid::new(&points, &[], 4.0 / 200.0);
        let spot = |position| Spot { position, normal: Vec3A::Y, instance: None, came: None };
        for k in 0..100 {
            let mut sum = 0.0;
            let at = random(777 + k) * Vec3A::new(0.9, 0.0, 0.9);
            assert!(grid.splat(&spot(at), |point, weight| {
                assert!(point % 2 == 0, "the other side's anchor took light");
                sum += weight;
            }));
            assert!((sum - 1.0f32).abs() < 1e-5);
        }
        let none = Grid::new(&[], &[], 1.0);
        assert!(!none.splat(&spot(Vec3A::ZERO), |_, _| unreachable!("there is no anchor")));
    }
}
