//! Search for anchors or surfels near a surface point, on the same side of the surface.

mod around;
mod nearest;
mod walls;

use super::Anchor;
use super::exposure::Outlook;
use super::sight::Sight;
use super::zones::{Shares, Zones};
use around::{Around, NearPoints};
use glam::Vec3A;
use nearest::Boxes;
use std::sync::OnceLock;
use walls::Walls;

/// Grid over the bounding box of anchors or surfels. Cells are at least as wide as a kernel's radius.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Grid {
    points: Vec<Anchor>,
    /// Outlook from each point; empty if not measured.
    outlooks: Vec<Outlook>,
    walls: Walls,
    /// Original index of each point.
    index: Vec<u32>,
    /// Index of the first point of each cell, followed by the total number of points. Cells are ordered by x, then y,
    /// then z.
    first: Vec<u32>,
    low: Vec3A,
    size: [usize; 3],
    cell: f32,
    /// Radius of the kernel in zone 0 \[m\].
    radius: f32,
    zones: Zones,
    /// Largest scale of any zone that contains points.
    largest_scale: f32,
    /// Index for [`Grid::nearest`], built on first use.
    #[cfg_attr(feature = "serde", serde(skip))]
    boxes: OnceLock<Boxes>,
}

/// Surface point with light to distribute among neighboring points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub position: Vec3A,
    pub normal: Vec3A,
    /// Index into [`Scene::instances`](crate::scene::Scene::instances) of the surface. Points on this instance are
    /// preferred, because another sheet may lie just behind with the same orientation.
    pub instance: u32,
    /// Whether points of other instances are excluded.
    pub only_own: bool,
    /// Distance that the arriving light has traveled \[m\]. Points without surfaces at about this distance receive
    /// little.
    pub came: Option<f32>,
}

/// Working memory of [`Grid::splat_all`], reused across calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct SplatScratch {
    /// Cell and index of each spot, sorted by cell.
    order: Vec<(u32, u32)>,
    around: Around,
}

/// Expected number of points in a kernel: enough for smoothness, few enough for locality.
const POINTS_PER_KERNEL: f32 = 8.0;
/// Maximum number of cells per point. A cell takes 4 bytes.
const CELLS_FOR_EACH_POINT: usize = 8;
/// Lower limit of the maximum number of cells.
const FEW_CELLS: usize = 1 << 16;
/// Factor between successive trial cell widths.
const WIDER: f32 = 1.25;
/// Minimum cosine of the angle between normals on the same wall (about 45°).
pub(super) const LEAST_COSINE: f32 = 0.7;
/// Maximum height of a point above the plane of the wall, in kernel radii.
const MOST_HEIGHT: f32 = 0.3;
/// Maximum height of a wall that does not block distribution, in kernel radii. Light passes over such a wall except at
/// its foot.
const LOW_WALL: f32 = 0.75;
/// Weight of points on other instances. With a weight of 1, a lampshade of two sheets traps a third of its light
/// between them.
const OTHER_INSTANCE: f32 = 1.0 / 256.0;
/// Factor on squared distances to points on other instances in nearest-point searches. These points count as eight
/// times as far away.
const OTHER_FARTHER: f32 = 64.0;
/// Maximum distance at which a point on the same instance is preferred to all other points, in kernel radii.
const OWN_REACH: f32 = 2.0;

/// Returns the radius R \[m\] of the kernel for points that represent `area_share` m² each.
pub(super) fn kernel_radius(area_share: f32) -> f32 {
    // The disc of radius R contains POINTS_PER_KERNEL points: π R² = POINTS_PER_KERNEL · share.
    (POINTS_PER_KERNEL * area_share / std::f32::consts::PI).sqrt().max(f32::MIN_POSITIVE)
}

impl Grid {
    /// Builds a grid of `points` with these area `shares`. `outlooks` is empty if they were not measured.
    pub fn new(points: &[Anchor], outlooks: &[Outlook], shares: impl Into<Shares>) -> Self {
        // Compute the bounding box of the points, in the space in which all kernels have the same radius.
        let shares = shares.into();
        let (radius, zones) = (kernel_radius(shares.area), shares.zones().clone());
        let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let mut largest_scale: f32 = 1.0;
        for point in points {
            let at = zones.unfolded(point.position, radius);
            (low, high) = (low.min(at), high.max(at));
            largest_scale = largest_scale.max(zones.scale(point.position));
        }
        let extent = if points.is_empty() { Vec3A::ZERO } else { high - low };

        // Make cells as wide as the kernel's radius, or wider to limit the number of cells. Points lie on surfaces, so
        // most cells are empty.
        let cells = |cell: f32| (extent / cell).to_array().map(|cells| (cells as usize).saturating_add(1));
        let most = FEW_CELLS.max(CELLS_FOR_EACH_POINT * points.len()) as f64;
        let count = |[x, y, z]: [usize; 3]| x as f64 * y as f64 * z as f64;
        let mut cell = radius;
        while count(cells(cell)) > most {
            cell *= WIDER;
        }
        let size = cells(cell);

        // Sort points by cell, and keep their order within a cell.
        let mut grid = Self { low, size, cell, radius, zones, largest_scale, ..Self::default() };
        let mut order = Vec::with_capacity(points.len());
        for (index, point) in (0u32..).zip(points) {
            order.push((grid.place(grid.cell_of(point.position)), index));
        }
        order.sort_unstable();
        let first_of = |cell: usize| order.partition_point(|&(place, _)| place < cell) as u32;
        grid.first = (0..=size.iter().product()).map(first_of).collect();
        grid.points = order.iter().map(|&(_, i)| points[i as usize]).collect();
        if !outlooks.is_empty() {
            grid.outlooks = order.iter().map(|&(_, i)| outlooks[i as usize]).collect();
        }
        grid.index = order.iter().map(|&(_, i)| i).collect();
        grid.walls = Walls::unknown(points.len());
        grid
    }

    /// Returns the maximum radius of a kernel in the grid \[m\].
    pub fn reach(&self) -> f32 {
        self.radius * self.largest_scale
    }

    /// Returns the radius of the kernel around `position` \[m\].
    #[inline]
    fn radius_at(&self, position: Vec3A) -> f32 {
        self.radius * self.zones.scale(position)
    }

    /// Returns the maximum height of walls at `position` that do not block distribution \[m\].
    pub fn height_at(&self, position: Vec3A) -> f32 {
        LOW_WALL * self.radius_at(position)
    }

    /// Returns the number of points in the grid.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Returns the cell of a point. Outside the bounding box, returns the nearest cell.
    fn cell_of(&self, position: Vec3A) -> [usize; 3] {
        let at = ((self.zones.unfolded(position, self.radius) - self.low) / self.cell).to_array();
        // Casts map negative values and NaN to 0.
        std::array::from_fn(|axis| (at[axis] as usize).min(self.size[axis] - 1))
    }

    fn place(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// Calls `give(point, weight)` for the points near `spot` on the same wall, with weights that sum to 1. Returns
    /// false if no point can receive light.
    ///
    /// The weights are an Epanechnikov kernel over the points within the radius. If the radius contains no suitable
    /// point, the nearest point with the same orientation receives all light. This occurs on details smaller than a
    /// point's area share.
    pub fn splat(&self, spot: &Spot, sight: Option<&Sight>, mut give: impl FnMut(usize, f32)) -> bool {
        let mut near = NearPoints::default();
        self.near(spot, |p, weight| near.add(self, p, weight, self.points[p as usize].instance == spot.instance));
        let parts = near.parts(self, spot, sight);
        for &(p, weight) in parts {
            give(self.index[p as usize] as usize, weight);
        }
        !parts.is_empty()
    }

    /// Distributes many spots with the weights of [`Grid::splat`]. `share(what, parts)` receives the payload of each
    /// spot and its weighted points. Points are identified by their position in the grid, which [`Grid::by_index`]
    /// converts. `parts` is empty if no point can receive light.
    ///
    /// Spots are processed by cell. The neighborhood of a cell is loaded once for all spots in it, and the receivers
    /// are adjacent in memory. In random order, distribution would wait for memory most of the time.
    pub fn splat_all<T: Copy>(
        &self,
        spots: &[(Spot, T)],
        sight: Option<&Sight>,
        scratch: &mut SplatScratch,
        mut share: impl FnMut(T, &[(u32, f32)]),
    ) {
        // Sort spots by cell, and keep their order within a cell.
        let SplatScratch { order, around } = scratch;
        order.clear();
        for (index, (spot, _)) in (0..).zip(spots) {
            order.push((self.place(self.cell_of(spot.position)) as u32, index));
        }
        order.sort_unstable();

        // Process the spots of each cell together.
        let mut here = Vec::new();
        for same_cell in order.chunk_by(|a, b| a.0 == b.0) {
            // Load all spots of the cell first, so that their memory accesses overlap.
            here.clear();
            here.extend(same_cell.iter().map(|&(_, index)| spots[index as usize]));
            around.find(self, self.cell_of(here[0].0.position));

            // Distribute each spot among the points around the cell, by the kernel and the likelihood of its light.
            for &(spot, what) in &here {
                let radius = self.radius_at(spot.position);
                around.weigh(&spot, radius);
                let about = spot.came.map(|length| Outlook::bin(length / radius));
                let mut near = NearPoints::default();
                for (i, (&p, &weight)) in around.places.iter().zip(&around.weights).enumerate() {
                    if weight > 0.0 {
                        near.add(self, p, weight * self.likelihood(p, about), around.instance[i] == spot.instance);
                    }
                }
                share(what, near.parts(self, &spot, sight));
            }
        }
    }

    /// Returns the points in their original order.
    pub fn points_by_index(&self) -> Vec<Anchor> {
        self.by_index(&self.points)
    }

    /// Reorders per-point values from grid order to the original order of points.
    pub fn by_index<T: Clone>(&self, by_place: &[T]) -> Vec<T> {
        let mut place = vec![0; self.index.len()];
        for (p, &index) in self.index.iter().enumerate() {
            place[index as usize] = p;
        }
        place.into_iter().map(|p| by_place[p].clone()).collect()
    }

    /// Returns the likelihood that light from the distance of bin `about` arrives at point `p`. Returns 1 if it is
    /// unknown.
    #[inline]
    fn likelihood(&self, p: u32, about: Option<usize>) -> f32 {
        match (about, self.outlooks.get(p as usize)) {
            (Some(bin), Some(outlook)) => outlook.likelihood_of(bin),
            _ => 1.0,
        }
    }

    /// Returns the point on the same wall as `spot` with the largest product of kernel and `rating(point)`. If no such
    /// point exists, returns the nearest point with the same orientation. Points behind a wall, as tested with `sight`,
    /// are excluded.
    pub fn best(&self, spot: &Spot, sight: Option<&Sight>, rating: impl Fn(usize) -> f32) -> Option<usize> {
        let mut near = NearPoints::default();
        self.near(spot, |p, weight| {
            let rated = weight * rating(self.index[p as usize] as usize);
            near.add(self, p, rated, self.points[p as usize].instance == spot.instance);
        });
        near.best(self, spot, sight).map(|p| self.index[p] as usize)
    }

    /// Returns whether a point is near `spot` and on the same instance. Points on a small detail may be slightly beyond
    /// the kernel.
    fn is_own_beside(&self, p: usize, spot: &Spot) -> bool {
        let Anchor { instance, position, .. } = self.points[p];
        instance == spot.instance
            && position.distance_squared(spot.position) < (OWN_REACH * self.radius_at(spot.position)).powi(2)
    }

    /// Calls `found(p, weight)` with the index in `points` and the kernel weight of each receiver of `spot`.
    #[inline]
    fn near(&self, spot: &Spot, mut found: impl FnMut(u32, f32)) {
        // Visit the adjacent cells only, because a kernel reaches no farther.
        let Spot { position, normal, instance, only_own, came } = *spot;
        if self.points.is_empty() {
            return;
        }
        let radius = self.radius_at(position);
        let about = came.map(|length| Outlook::bin(length / radius));
        self.rows(self.cell_of(position)).for_each(|row| {
            for p in row {
                // Select points on the same wall: near, with similar orientation, and at similar height.
                let point = &self.points[p as usize];
                let d2 = point.position.distance_squared(position) / (radius * radius);
                let is_own = instance == point.instance;
                let same_wall = d2 < 1.0
                    && point.normal.dot(normal) > LEAST_COSINE
                    && normal.dot(point.position - position).abs() < MOST_HEIGHT * radius
                    && (is_own || !only_own);

                // Weight: w = 1 − d² / R², reduced for points on other instances.
                if same_wall {
                    let share = if is_own { 1.0 } else { OTHER_INSTANCE };
                    found(p, (1.0 - d2) * share * self.likelihood(p, about));
                }
            }
        });
    }

    /// Returns the points of a cell and its adjacent cells. The cells of a row are consecutive, so their points form
    /// one range.
    #[inline]
    fn rows(&self, center: [usize; 3]) -> impl Iterator<Item = std::ops::Range<u32>> {
        // Clamp the 3×3×3 neighborhood to the grid.
        let [xs, ys, zs] =
            std::array::from_fn(|axis| center[axis].saturating_sub(1)..=(center[axis] + 1).min(self.size[axis] - 1));
        zs.flat_map(move |z| ys.clone().map(move |y| (z, y))).map(move |(z, y)| {
            self.first[self.place([*xs.start(), y, z])]..self.first[self.place([*xs.end(), y, z]) + 1]
        })
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
            let (instance, only_own) = ((k % 3) as u32, k % 2 == 0);
            let fits = |a: &&Anchor| (!only_own || instance == a.instance) && a.normal.dot(normal) > 0.0;
            let distance2 = |a: &Anchor| {
                let farther = if a.instance == instance { 1.0 } else { OTHER_FARTHER };
                a.position.distance_squared(position) * farther
            };
            let expected = points.iter().filter(fits).map(distance2).min_by(f32::total_cmp).unwrap();
            let spot = Spot { position, normal, instance, only_own, came: None };
            let found = grid.points[grid.nearest(&spot).unwrap()];
            assert!(fits(&&found));
            assert_eq!(distance2(&found), expected);
        }
    }

    #[test]
    fn weights_sum_to_one_and_nothing_is_given_across_walls() {
        let points: Vec<Anchor> = (0..400)
            .map(|k| {
                let at = random(k) * Vec3A::new(1.0, 0.0, 1.0);
                // Build two floors, one above the other, facing up and down.
                let up = k % 2 == 0;
                Anchor {
                    position: at + Vec3A::Y * if up { 0.0 } else { 0.02 },
                    normal: if up { Vec3A::Y } else { -Vec3A::Y },
                    instance: 0,
                }
            })
            .collect();
        let grid = Grid::new(&points, &[], 4.0 / 200.0);
        let spot = |position| Spot { position, normal: Vec3A::Y, instance: 0, only_own: false, came: None };
        for k in 0..100 {
            let mut sum = 0.0;
            let at = random(777 + k) * Vec3A::new(0.9, 0.0, 0.9);
            assert!(grid.splat(&spot(at), None, |point, weight| {
                assert!(point % 2 == 0, "the other side's anchor took light");
                sum += weight;
            }));
            assert!((sum - 1.0f32).abs() < 1e-5);
        }
        let none = Grid::new(&[], &[], 1.0);
        assert!(!none.splat(&spot(Vec3A::ZERO), None, |_, _| unreachable!("there is no anchor")));
    }

    /// Two sheets with the same orientation are closer together than their points. Each sheet keeps its own light.
    #[test]
    fn nothing_is_given_to_a_sheet_behind() {
        let points: Vec<Anchor> = (0..400)
            .map(|k| {
                let instance = (k % 2) as u32;
                let position = random(k) * Vec3A::new(1.0, 0.0, 1.0) - Vec3A::Y * 0.01 * instance as f32;
                Anchor { position, normal: Vec3A::Y, instance }
            })
            .collect();
        let grid = Grid::new(&points, &[], 4.0 / 200.0);
        for k in 0..100 {
            let instance = (k % 2) as u32;
            let position = random(777 + k) * Vec3A::new(0.9, 0.0, 0.9) - Vec3A::Y * 0.01 * instance as f32;
            let spot = Spot { position, normal: Vec3A::Y, instance, only_own: false, came: None };
            let mut own = 0.0;
            grid.splat(&spot, None, |point, weight| {
                own += if points[point].instance == instance { weight } else { 0.0 }
            });
            assert!(own > 0.9, "{own} of the light stays on its sheet");
            assert_eq!(points[grid.best(&spot, None, |_| 1.0).unwrap()].instance, instance);
        }
    }

    #[test]
    fn many_spots_get_what_each_gets_alone() {
        let points: Vec<Anchor> = (0..600)
            .map(|k| Anchor {
                position: random(k) * Vec3A::new(2.0, 1.0, 0.05),
                normal: (random(1000 + k) * 0.3 + Vec3A::Z).normalize(),
                instance: (k % 3) as u32,
            })
            .collect();
        let grid = Grid::new(&points, &[], 0.01);
        let spots: Vec<(Spot, usize)> = (0..2000)
            .map(|k| {
                let position = random(5000 + k) * Vec3A::new(2.2, 1.1, 0.1);
                let normal = (random(9000 + k) * 0.3 + Vec3A::Z).normalize();
                (Spot { position, normal, instance: (k % 4) as u32, only_own: k % 2 == 0, came: None }, k as usize)
            })
            .collect();
        let mut shares: Vec<Vec<(usize, f32)>> = vec![Vec::new(); spots.len()];
        grid.splat_all(&spots, None, &mut SplatScratch::default(), |k, parts| {
            shares[k] = parts.iter().map(|&(p, weight)| (grid.index[p as usize] as usize, weight)).collect();
        });
        for ((spot, _), shares) in spots.iter().zip(shares) {
            let mut alone = Vec::new();
            grid.splat(spot, None, |point, weight| alone.push((point, weight)));
            assert_eq!(shares, alone);
        }
        let by_place: Vec<u32> = grid.points.iter().map(|point| point.instance).collect();
        assert_eq!(grid.by_index(&by_place), points.iter().map(|point| point.instance).collect::<Vec<_>>());
        Grid::new(&[], &[], 1.0)
            .splat_all(&spots, None, &mut SplatScratch::default(), |_, parts| assert!(parts.is_empty()));
    }
}
