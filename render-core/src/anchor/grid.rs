//! Anchors or surfels near a point of a surface, and on the same side of it.

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

/// Where anchors or surfels are: a grid of cells at least a kernel's radius wide over the box around them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grid {
    points: Vec<Anchor>,
    /// How far light gets from each; empty where that was not measured.
    outlooks: Vec<Outlook>,
    walls: Walls,
    /// Original index of each point.
    index: Vec<u32>,
    /// First point of each cell, and the end of the last: cells in x, then y, then z.
    first: Vec<u32>,
    low: Vec3A,
    size: [usize; 3],
    cell: f32,
    /// Radius of the kernel in zone 0 \[m\].
    radius: f32,
    zones: Zones,
    /// Largest scale of the zones that points are in.
    largest_scale: f32,
    /// For [`Grid::nearest`], made when it is first asked.
    boxes: OnceLock<Boxes>,
}

/// A place on a surface that is to be shared out among what is near.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub position: Vec3A,
    pub normal: Vec3A,
    /// Index into [`Scene::instances`](crate::scene::Scene::instances) of the surface. Its own points go before all others:
    /// another sheet may lie right behind this one and face the same way.
    pub instance: u32,
    /// Whether no other instance may take.
    pub only_own: bool,
    /// How far the light came that arrives there \[m\]; only those take that have something at about that distance.
    pub came: Option<f32>,
}

/// Working memory of [`Grid::splat_all`], kept from one call to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct SplatScratch {
    /// Cell and index of each spot.
    order: Vec<(u32, u32)>,
    around: Around,
}

/// Points that a kernel is expected to hold: enough to be smooth, few enough to stay local.
const POINTS_PER_KERNEL: f32 = 8.0;
/// Most cells for each point, and in any case: they take 4 bytes each.
const CELLS_FOR_EACH_POINT: usize = 8;
const FEW_CELLS: usize = 1 << 16;
/// Ratio of the widths of cells that are tried.
const WIDER: f32 = 1.25;
/// Half a right angle between normals, or well off the plane in radii: another wall, not this one.
pub(super) const LEAST_COSINE: f32 = 0.7;
const MOST_HEIGHT: f32 = 0.3;
/// Height of a wall that light is shared out over, in radii: light gets over it from anywhere but its foot.
const LOW_WALL: f32 = 0.75;
/// Weight of the points of other instances. With 1, a lampshade of two sheets keeps a third of its light between them.
const OTHER_INSTANCE: f32 = 1.0 / 256.0;
/// Factor on squared distances to points of other instances, where the nearest point is looked for: they count as eight times as
/// far away.
const OTHER_FARTHER: f32 = 64.0;
/// A point of the same instance up to so far away goes before all others, in radii.
const OWN_REACH: f32 = 2.0;

/// Radius R \[m\] of the kernel over points that stand for `area_share` m² each.
pub(super) fn kernel_radius(area_share: f32) -> f32 {
    // A disc of radius R holds as many points as its area has shares:  π R² = POINTS_PER_KERNEL · share.
    (POINTS_PER_KERNEL * area_share / std::f32::consts::PI).sqrt().max(f32::MIN_POSITIVE)
}

impl Grid {
    /// Sorts `points` that stand for these `shares`, with their `outlooks` if these are known.
    pub fn new(points: &[Anchor], outlooks: &[Outlook], shares: impl Into<Shares>) -> Self {
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

        // Cells as wide as the kernel's radius, wider if they were too many: points lie on surfaces, and most cells are empty.
        let cells = |cell: f32| (extent / cell).to_array().map(|cells| (cells as usize).saturating_add(1));
        let most = FEW_CELLS.max(CELLS_FOR_EACH_POINT * points.len()) as f64;
        let count = |[x, y, z]: [usize; 3]| x as f64 * y as f64 * z as f64;
        let mut cell = radius;
        while count(cells(cell)) > most {
            cell *= WIDER;
        }
        let size = cells(cell);

        // Points by cell, those of a cell in their old order.
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

    /// Largest radius of a kernel \[m\].
    pub fn reach(&self) -> f32 {
        self.radius * self.largest_scale
    }

    /// Radius of the kernel around `position` \[m\].
    #[inline]
    fn radius_at(&self, position: Vec3A) -> f32 {
        self.radius * self.zones.scale(position)
    }

    /// Height of what light is shared out over at `position` \[m\].
    pub fn height_at(&self, position: Vec3A) -> f32 {
        LOW_WALL * self.radius_at(position)
    }

    /// How many points it holds.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// The cell of a point; outside of the box, the nearest.
    fn cell_of(&self, position: Vec3A) -> [usize; 3] {
        let at = ((self.zones.unfolded(position, self.radius) - self.low) / self.cell).to_array();
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
    pub fn splat(&self, spot: &Spot, sight: Option<&Sight>, mut give: impl FnMut(usize, f32)) -> bool {
        let mut near = NearPoints::default();
        self.near(spot, |p, weight| near.add(self, p, weight, self.points[p as usize].instance == spot.instance));
        let parts = near.parts(self, spot, sight);
        for &(p, weight) in parts {
            give(self.index[p as usize] as usize, weight);
        }
        !parts.is_empty()
    }

    /// As [`Grid::splat`] for many spots: `share(what, parts)` is given what comes with each spot, and the same weights, with
    /// the points by where they stand here ([`Grid::by_index`] undoes that); no parts if there is no point.
    ///
    /// Spots are taken cell by cell: what is around a cell is looked up once for all of them, and what they give to lies
    /// close together. Photons come from everywhere, and one by one they would wait for memory most of the time.
    pub fn splat_all<T: Copy>(
        &self,
        spots: &[(Spot, T)],
        sight: Option<&Sight>,
        scratch: &mut SplatScratch,
        mut share: impl FnMut(T, &[(u32, f32)]),
    ) {
        // Spots by cell, those of a cell in their order.
        let SplatScratch { order, around } = scratch;
        order.clear();
        for (index, (spot, _)) in (0..).zip(spots) {
            order.push((self.place(self.cell_of(spot.position)) as u32, index));
        }
        order.sort_unstable();

        let mut here = Vec::new();
        for same_cell in order.chunk_by(|a, b| a.0 == b.0) {
            // First all spots of the cell: the waits for memory overlap then.
            here.clear();
            here.extend(same_cell.iter().map(|&(_, index)| spots[index as usize]));
            around.find(self, self.cell_of(here[0].0.position));

            // Each spot is shared out among what is around the cell, by the kernel and by how likely its light gets there.
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

    /// The points in the order that they came in.
    pub fn points_by_index(&self) -> Vec<Anchor> {
        self.by_index(&self.points)
    }

    /// Sorts values, one for each point, from the order of the grid into the order that the points came in.
    pub fn by_index<T: Clone>(&self, by_place: &[T]) -> Vec<T> {
        let mut place = vec![0; self.index.len()];
        for (p, &index) in self.index.iter().enumerate() {
            place[index as usize] = p;
        }
        place.into_iter().map(|p| by_place[p].clone()).collect()
    }

    /// How likely light that came from about as far as a bin says arrives at a point.
    #[inline]
    fn likelihood(&self, p: u32, about: Option<usize>) -> f32 {
        match (about, self.outlooks.get(p as usize)) {
            (Some(bin), Some(outlook)) => outlook.likelihood_of(bin),
            _ => 1.0,
        }
    }

    /// The point near `spot` that faces like it and has the largest product of kernel and `rating(point)`; else
    /// the nearest that faces the same way. None that a wall hides by `sight`.
    pub fn best(&self, spot: &Spot, sight: Option<&Sight>, rating: impl Fn(usize) -> f32) -> Option<usize> {
        let mut near = NearPoints::default();
        self.near(spot, |p, weight| {
            let rated = weight * rating(self.index[p as usize] as usize);
            near.add(self, p, rated, self.points[p as usize].instance == spot.instance);
        });
        near.best(self, spot, sight).map(|p| self.index[p] as usize)
    }

    /// Whether a point belongs to the instance of `spot` and is near: a detail may have its own points a little beyond the
    /// kernel.
    fn is_own_beside(&self, p: usize, spot: &Spot) -> bool {
        let Anchor { instance, position, .. } = self.points[p];
        instance == spot.instance
            && position.distance_squared(spot.position) < (OWN_REACH * self.radius_at(spot.position)).powi(2)
    }

    /// Calls `found(p, weight)` with the place in `points` and the kernel's weight of each point that takes from `spot`.
    #[inline]
    fn near(&self, spot: &Spot, mut found: impl FnMut(u32, f32)) {
        // A kernel around the spot reaches no farther than the cells beside its own.
        let Spot { position, normal, instance, only_own, came } = *spot;
        if self.points.is_empty() {
            return;
        }
        let radius = self.radius_at(position);
        let about = came.map(|length| Outlook::bin(length / radius));
        self.rows(self.cell_of(position)).for_each(|row| {
            for p in row {
                // Of the same wall is what is near, faces the same way, and lies neither before nor behind it.
                let point = &self.points[p as usize];
                let d2 = point.position.distance_squared(position) / (radius * radius);
                let is_own = instance == point.instance;
                let same_wall = d2 < 1.0
                    && point.normal.dot(normal) > LEAST_COSINE
                    && normal.dot(point.position - position).abs() < MOST_HEIGHT * radius
                    && (is_own || !only_own);

                // w = 1 − d² / R², less for points of other instances.
                if same_wall {
                    let share = if is_own { 1.0 } else { OTHER_INSTANCE };
                    found(p, (1.0 - d2) * share * self.likelihood(p, about));
                }
            }
        });
    }

    /// The points of a cell and of those beside it: the cells of a row follow each other, and so do their points.
    #[inline]
    fn rows(&self, center: [usize; 3]) -> impl Iterator<Item = std::ops::Range<u32>> {
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

    /// Two sheets that face the same way, closer together than their points: each keeps its own light.
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
