//! Anchor lights: virtual point lights that never move over the surface they sit on.
//!
//! A fixed number is spread evenly by area over the surfaces that stand still, and a few over the
//! things that move. Photons give them their energy, frame by frame ([`crate::photon`]).

use crate::Units;
use crate::sampling::{Distribution, radical_inverse, triangle};
use crate::scene::Scene;
use crate::surface::Surfaces;
use glam::{Vec3, Vec3A};

/// A place that stands for the light its share of surface sends back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// A little off the surface; world space for anchors at rest, the instance's space for carried ones.
    pub position: Vec3A,
    /// Unit normal of the side it stands for, in the same space.
    pub normal: Vec3A,
    /// Index into [`Scene::instances`].
    pub instance: u32,
}

/// The anchors of a scene.
#[derive(Clone, Debug, Default)]
pub struct Anchors {
    /// On surfaces that never move: the lights of the tree.
    pub fixed: Vec<Anchor>,
    /// On surfaces that move, in the instance's own space.
    pub carried: Vec<Anchor>,
    /// Square metres that each fixed anchor stands for.
    pub area_share: f32,
    /// Square metres that each carried anchor stands for.
    pub carried_area_share: f32,
}

impl Anchors {
    /// Spreads `fixed` anchors over what stands still and `carried` over what moves.
    pub fn spread(scene: &Scene, surfaces: &Surfaces, units: &Units, fixed: usize, carried: usize) -> Self {
        let moving = scene.moving_nodes();
        let mut anchors = Anchors::default();
        for (wanted, on_moving) in [(fixed, false), (carried, true)] {
            let patches: Vec<(usize, usize, bool, f32)> = scene
                .instances
                .iter()
                .enumerate()
                .filter(|(_, instance)| moving[instance.node] == on_moving)
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
            let list: Vec<Anchor> = (0..wanted as u64)
                .map(|i| {
                    let (patch, _, _) = choice.pick((i as f64 + 0.5) / wanted as f64);
                    let (instance, t, front, _) = patches[patch];
                    let (u, v) = triangle(glam::Vec2::new(radical_inverse(2, i), radical_inverse(3, i)));
                    let [a, b, c] = surfaces.corners(instance, t);
                    let world = surfaces.world(instance);
                    let mirrored = world.matrix3.determinant() < 0.0;
                    let turn = if front != mirrored { 1.0 } else { -1.0 };
                    let normal = ((b - a).cross(c - a) * turn).normalize_or_zero();
                    let position = a + (b - a) * u + (c - a) * v + normal * units.epsilon;
                    Anchor { position, normal, instance: instance as u32 }
                })
                .collect();
            if on_moving {
                anchors.carried = list.iter().map(|anchor| anchor.to_local(surfaces)).collect();
                anchors.carried_area_share = share;
            } else {
                anchors.fixed = list;
                anchors.area_share = share;
            }
        }
        anchors
    }

    /// The carried anchors in world space at the pose that `surfaces` has.
    pub fn carried_in_world(&self, surfaces: &Surfaces) -> Vec<Anchor> {
        self.carried
            .iter()
            .map(|anchor| {
                let world = surfaces.world(anchor.instance as usize);
                Anchor {
                    position: world.transform_point3a(anchor.position),
                    normal: (crate::scene::normal_matrix(world) * anchor.normal).normalize_or_zero(),
                    ..*anchor
                }
            })
            .collect()
    }

    /// A sensible number of fixed anchors for a scene: 2000 for a box, 9000 for a building, as in [Herzog08], table 1.
    pub fn default_count(scene: &Scene) -> usize {
        let triangles = scene.triangle_count().max(1) as f64;
        // 1000 triangles → 2000, 64 000 and more → 9000, on a straight line in log₂.
        let steps = (triangles / 1000.0).log2().clamp(0.0, 6.0);
        (2000.0 + 7000.0 * steps / 6.0) as usize
    }
}

impl Anchor {
    fn to_local(self, surfaces: &Surfaces) -> Self {
        let world = surfaces.world(self.instance as usize);
        let local = world.inverse();
        let normal = (crate::scene::normal_matrix(&local) * self.normal).normalize_or_zero();
        Self { position: local.transform_point3a(self.position), normal, ..self }
    }
}

/// Where anchors are near a point: cells of one kernel radius in a table sorted by cell.
pub struct AnchorGrid {
    points: Vec<Anchor>,
    /// Original index of each point.
    index: Vec<u32>,
    /// Sorted (cell key, first point); a point's neighbours lie in 27 cells.
    cells: std::collections::HashMap<[i32; 3], (u32, u32)>,
    cell: f32,
    radius: f32,
}

/// Anchors that a kernel is expected to hold: enough to be smooth, few enough to stay local.
const ANCHORS_PER_KERNEL: f32 = 8.0;

impl AnchorGrid {
    /// Sorts `anchors`, each standing for `area_share` m².
    pub fn new(anchors: &[Anchor], area_share: f32) -> Self {
        let radius = (ANCHORS_PER_KERNEL * area_share / std::f32::consts::PI).sqrt().max(f32::MIN_POSITIVE);
        let cell = radius;
        let key = |anchor: &Anchor| cell_of(anchor.position, cell);
        let mut order: Vec<u32> = (0..anchors.len() as u32).collect();
        order.sort_by_key(|&i| (key(&anchors[i as usize]), i));
        let points: Vec<Anchor> = order.iter().map(|&i| anchors[i as usize]).collect();
        let mut cells = std::collections::HashMap::new();
        for (i, point) in points.iter().enumerate() {
            let range = cells.entry(key(point)).or_insert((i as u32, i as u32));
            range.1 = i as u32 + 1;
        }
        Self { points, index: order, cells, cell, radius }
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
        let center = cell_of(position, self.cell);
        for i in 0..27 {
            let cell = [
                center[0].saturating_add(i % 3 - 1),
                center[1].saturating_add(i / 3 % 3 - 1),
                center[2].saturating_add(i / 9 - 1),
            ];
            let Some(&(first, end)) = self.cells.get(&cell) else { continue };
            for p in first..end {
                let anchor = &self.points[p as usize];
                let d2 = anchor.position.distance_squared(position) / (self.radius * self.radius);
                // Half a right angle apart, or well off the plane: another wall, not this one.
                let same_wall = anchor.normal.dot(normal) > 0.7
                    && normal.dot(anchor.position - position).abs() < 0.3 * self.radius
                    && instance.is_none_or(|instance| instance == anchor.instance);
                if d2 < 1.0 && same_wall && count < near.len() {
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
        let fitting = |strict: bool| {
            self.points
                .iter()
                .enumerate()
                .filter(|(_, a)| instance.is_none_or(|instance| instance == a.instance))
                .filter(|(_, a)| !strict || a.normal.dot(normal) > 0.0)
                .map(|(p, a)| (p, a.position.distance_squared(position)))
                .min_by(|a, b| a.1.total_cmp(&b.1))
        };
        match fitting(true).or_else(|| fitting(false)) {
            Some((p, _)) => give(self.index[p] as usize, 1.0),
            None => return false,
        }
        true
    }
}

fn cell_of(position: Vec3A, cell: f32) -> [i32; 3] {
    (Vec3::from(position) / cell).floor().to_array().map(|c| c as i32)
}
