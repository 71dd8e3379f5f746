//! Anchor lights: virtual point lights that never move over the surface they sit on.
//!
//! A fixed number is spread evenly by area over the surfaces that stand still, and a few over the
//! things that move. Photons give them their energy, frame by frame ([`crate::photon`]).

mod exposure;

use crate::Units;
use crate::sampling::{Distribution, radical_inverse, triangle};
use crate::scene::Scene;
use crate::surface::Surfaces;
use glam::Vec3A;

/// A place that stands for the light its share of surface sends back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// A little off the surface, world space.
    pub position: Vec3A,
    /// Unit normal of the side it stands for.
    pub normal: Vec3A,
    /// Index into [`Scene::instances`].
    pub instance: u32,
}

/// An anchor bound to a point of a triangle: it goes where that goes, however its mesh moves or bends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarriedAnchor {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Barycentric weights of the second and the third corner.
    pub place: (f32, f32),
    /// Whether it stands for the front.
    pub front: bool,
    /// Metres off the surface.
    pub offset: f32,
}

/// The anchors of a scene.
#[derive(Clone, Debug, Default)]
pub struct Anchors {
    /// On surfaces that never move: the lights of the tree.
    pub fixed: Vec<Anchor>,
    /// On surfaces that move or bend.
    pub carried: Vec<CarriedAnchor>,
    /// Square metres that each fixed anchor stands for.
    pub area_share: f32,
    /// Square metres that each carried anchor stands for.
    pub carried_area_share: f32,
}

impl Anchors {
    /// Spreads `fixed` anchors over what stands still and `carried` over what moves.
    pub fn spread(scene: &Scene, surfaces: &Surfaces, units: &Units, fixed: usize, carried: usize) -> Self {
        let moving = scene.moving_instances();
        let mut anchors = Anchors::default();
        for (wanted, on_moving) in [(fixed, false), (carried, true)] {
            let patches: Vec<(usize, usize, bool, f32)> = scene
                .instances
                .iter()
                .enumerate()
                .filter(|(index, _)| moving[*index] == on_moving)
                .flat_map(|(index, instance)| {
                    let mesh = &scene.meshes[instance.mesh];
                    let material = &scene.materials[mesh.material];
                    // Both sides of a sheet reflect, each with its own anchors; unlit surfaces reflect nothing.
                    let sides: &[bool] = match (material.unlit, material.double_sided) {
                        (true, _) => &[],
                        (false, false) => &[true],
                        (false, true) => &[true, false],
                    };
                    (0..mesh.triangles.len()).flat_map(move |t| {
                        let [a, b, c] = surfaces.corners(index, t);
                        let area = (b - a).cross(c - a).length() / 2.0;
                        sides.iter().map(move |&front| (index, t, front, area))
                    })
                })
                .collect();
            let Some(choice) = Distribution::new(patches.iter().map(|patch| f64::from(patch.3))) else { continue };
            let share = (choice.total() / wanted.max(1) as f64) as f32;
            let list: Vec<CarriedAnchor> = (0..wanted as u64)
                .map(|i| {
                    let (patch, _, _) = choice.pick((i as f64 + 0.5) / wanted as f64);
                    let (instance, t, front, _) = patches[patch];
                    let place = triangle(glam::Vec2::new(radical_inverse(2, i), radical_inverse(3, i)));
                    let (instance, triangle) = (instance as u32, t as u32);
                    CarriedAnchor { instance, triangle, place, front, offset: units.epsilon }
                })
                .collect();
            if on_moving {
                anchors.carried = list;
                anchors.carried_area_share = share;
            } else {
                anchors.fixed = list.iter().map(|anchor| anchor.in_world(surfaces)).collect();
                anchors.area_share = share;
            }
        }
        anchors
    }

    /// The carried anchors in world space at the pose that `surfaces` has.
    pub fn carried_in_world(&self, surfaces: &Surfaces) -> Vec<Anchor> {
        self.carried.iter().map(|anchor| anchor.in_world(surfaces)).collect()
    }

    /// A sensible number of fixed anchors for a scene: 2000 for a box, 9000 for a building, as in \[Herzog08\], table 1.
    pub fn default_count(scene: &Scene) -> usize {
        let triangles = scene.triangle_count().max(1) as f64;
        // 1000 triangles → 2000, 64 000 and more → 9000, on a straight line in log₂.
        let steps = (triangles / 1000.0).log2().clamp(0.0, 6.0);
        (2000.0 + 7000.0 * steps / 6.0) as usize
    }
}

impl CarriedAnchor {
    /// Where it is at the pose that `surfaces` has.
    fn in_world(&self, surfaces: &Surfaces) -> Anchor {
        let [a, b, c] = surfaces.corners(self.instance as usize, self.triangle as usize);
        let mirrored = surfaces.world(self.instance as usize).matrix3.determinant() < 0.0;
        let turn = if self.front != mirrored { 1.0 } else { -1.0 };
        let normal = ((b - a).cross(c - a) * turn).normalize_or_zero();
        let (u, v) = self.place;
        let position = a + (b - a) * u + (c - a) * v + normal * self.offset;
        Anchor { position, normal, instance: self.instance }
    }
}

/// Where anchors are near a point: a grid of cells at least a kernel's radius wide over the box around the anchors.
pub struct AnchorGrid {
    points: Vec<Anchor>,
    /// Original index of each point.
    index: Vec<u32>,
    /// First point of each cell, and the end of the last: cells in x, then y, then z.
    first: Vec<u32>,
    low: Vec3A,
    size: [usize; 3],
    cell: f32,
    radius: f32,
}

/// Anchors that a kernel is expected to hold: enough to be smooth, few enough to stay local.
const ANCHORS_PER_KERNEL: f32 = 8.0;
/// Most cells along an axis: 8 MB of them at worst.
const MOST_CELLS: f32 = 128.0;

impl AnchorGrid {
    /// Sorts `anchors`, each standing for `area_share` m².
    pub fn new(anchors: &[Anchor], area_share: f32) -> Self {
        let radius = (ANCHORS_PER_KERNEL * area_share / std::f32::consts::PI).sqrt().max(f32::MIN_POSITIVE);
        let low = anchors.iter().fold(Vec3A::INFINITY, |low, anchor| low.min(anchor.position));
        let high = anchors.iter().fold(Vec3A::NEG_INFINITY, |high, anchor| high.max(anchor.position));
        let extent = if anchors.is_empty() { Vec3A::ZERO } else { high - low };
        let cell = radius.max(extent.max_element() / (MOST_CELLS - 1.0));
        let size = (extent / cell).to_array().map(|cells| cells as usize + 1);
        let mut grid = Self { points: Vec::new(), index: Vec::new(), first: Vec::new(), low, size, cell, radius };
        let mut order: Vec<(usize, u32)> =
            anchors.iter().zip(0..).map(|(anchor, i)| (grid.place(grid.cell_of(anchor.position)), i)).collect();
        order.sort_unstable();
        grid.first =
            (0..=size.iter().product()).map(|cell| order.partition_point(|&(place, _)| place < cell) as u32).collect();
        grid.points = order.iter().map(|&(_, i)| anchors[i as usize]).collect();
        grid.index = order.iter().map(|&(_, i)| i).collect();
        grid
    }

    /// How many anchors it holds.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether it holds none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
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

    /// Calls `give(anchor, weight)` for the anchors near `position` that face like `normal`; the weights sum to 1.
    /// Returns false if there is no anchor at all that may take anything.
    ///
    /// An Epanechnikov kernel over the anchors within the radius. Where it holds none that fits, as on a
    /// detail smaller than an anchor's share, the nearest that faces the same way takes all.
    pub fn splat(
        &self,
        position: Vec3A,
        normal: Vec3A,
        instance: Option<u32>,
        mut give: impl FnMut(usize, f32),
    ) -> bool {
        let mut near: [(u32, f32); 64] = [(0, 0.0); 64];
        let (mut count, mut sum) = (0, 0.0);
        let center = self.cell_of(position);
        let [xs, ys, zs] =
            std::array::from_fn(|axis| center[axis].saturating_sub(1)..=(center[axis] + 1).min(self.size[axis] - 1));
        for (z, y) in zs.flat_map(|z| ys.clone().map(move |y| (z, y))) {
            // The cells of a row lie behind each other, and so do their points.
            let row = self.first[self.place([*xs.start(), y, z])]..self.first[self.place([*xs.end(), y, z]) + 1];
            for p in row {
                let anchor = &self.points[p as usize];
                let d2 = anchor.position.distance_squared(position) / (self.radius * self.radius);
                // Half a right angle apart, or well off the plane: another wall, not this one.
                let same_wall = d2 < 1.0
                    && anchor.normal.dot(normal) > 0.7
                    && normal.dot(anchor.position - position).abs() < 0.3 * self.radius
                    && instance.is_none_or(|instance| instance == anchor.instance);
                if same_wall && count < near.len() {
                    near[count] = (p, 1.0 - d2);
                    sum += 1.0 - d2;
                    count += 1;
                }
            }
        }
        if sum > 0.0 {
            for &(p, weight) in &near[..count] {
                give(self.index[p as usize] as usize, weight / sum);
            }
            return true;
        }
        match self.nearest(position, normal, instance) {
            Some(p) => give(self.index[p] as usize, 1.0),
            None => return false,
        }
        true
    }

    /// The nearest anchor that faces to the same side, else the nearest at all: in cubes of cells that grow
    /// until what they hold is nearer than anything outside of them could be.
    fn nearest(&self, position: Vec3A, normal: Vec3A, instance: Option<u32>) -> Option<usize> {
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
                            let anchor = &self.points[p];
                            if instance.is_some_and(|instance| instance != anchor.instance) {
                                continue;
                            }
                            let d2 = anchor.position.distance_squared(position);
                            let away = usize::from(anchor.normal.dot(normal) <= 0.0);
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
        let anchors: Vec<Anchor> = (0..500)
            .map(|k| Anchor {
                position: random(k) * Vec3A::new(3.0, 1.0, 0.1),
                normal: random(1000 + k).normalize(),
                instance: (k % 3) as u32,
            })
            .collect();
        let grid = AnchorGrid::new(&anchors, 0.01);
        for k in 0..300 {
            let (position, normal) = (random(5000 + k) * 4.0, random(9000 + k).normalize());
            let instance = (k % 2 == 0).then_some((k % 3) as u32);
            let fits = |a: &&Anchor| instance.is_none_or(|i| i == a.instance) && a.normal.dot(normal) > 0.0;
            let expected = anchors
                .iter()
                .filter(fits)
                .map(|a| a.position.distance_squared(position))
                .min_by(f32::total_cmp)
                .unwrap();
            let found = grid.points[grid.nearest(position, normal, instance).unwrap()];
            assert!(fits(&&found));
            assert_eq!(found.position.distance_squared(position), expected);
        }
    }

    #[test]
    fn weights_sum_to_one_and_nothing_is_given_across_walls() {
        let anchors: Vec<Anchor> = (0..400)
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
        let grid = AnchorGrid::new(&anchors, 4.0 / 200.0);
        for k in 0..100 {
            let mut sum = 0.0;
            let at = random(777 + k) * Vec3A::new(0.9, 0.0, 0.9);
            assert!(grid.splat(at, Vec3A::Y, None, |anchor, weight| {
                assert!(anchor % 2 == 0, "the other side's anchor took light");
                sum += weight;
            }));
            assert!((sum - 1.0f32).abs() < 1e-5);
        }
        assert!(
            !AnchorGrid::new(&[], 1.0).splat(Vec3A::ZERO, Vec3A::Y, None, |_, _| unreachable!("there is no anchor"))
        );
    }
}
