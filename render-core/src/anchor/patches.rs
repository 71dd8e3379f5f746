//! Surfaces over which anchors and surfels are distributed by area.

use super::grid::kernel_radius;
use super::zones::Zones;
use super::{DynamicAnchor, PLACEMENT};
use crate::Units;
use crate::sampling::{hash, owen_sobol_point, triangle};
use crate::scene::Instance;
use crate::surface::Surfaces;
use glam::{Vec2, Vec3A};
use std::collections::HashMap;

/// Maximum number of points in a cube with edges as long as the kernel's radius. A wall has three points in this cube;
/// the densest foliage of the tested scenes has a few tens.
const CROWD: usize = 256;

/// All reflecting sides of the static or of the moving triangles. They are enumerated rather than stored, because a
/// small mesh may have many instances.
pub(super) struct Patches<'a> {
    surfaces: &'a Surfaces<'a>,
    on_moving: bool,
    zones: Zones,
    /// Total area \[m²\], above 0. Farther zones have less weight.
    area: f64,
}

/// Side of a triangle, or of a piece of a triangle.
struct Patch {
    /// Number of preceding patches.
    number: usize,
    instance: usize,
    triangle: usize,
    front: bool,
    piece: Piece,
    /// Area \[m²\]. Farther zones have less weight.
    area: f64,
}

/// Piece of a triangle: at each corner of the piece, the barycentric weights of the triangle's second and third corner.
type Piece = [Vec2; 3];

/// Piece that covers a whole triangle.
const WHOLE: Piece = [Vec2::ZERO, Vec2::X, Vec2::Y];

/// Maximum number of times that a triangle is subdivided.
const MOST_HALVINGS: u32 = 12;

impl<'a> Patches<'a> {
    /// Enumerates the patches. Returns `None` if their total area is zero.
    pub fn of(surfaces: &'a Surfaces<'a>, on_moving: bool, zones: &Zones) -> Option<Self> {
        let mut patches = Self { surfaces, on_moving, zones: zones.clone(), area: 0.0 };
        let mut area = 0.0;
        patches.for_each(|patch| area += patch.area);
        patches.area = area;
        (area > 0.0).then_some(patches)
    }

    /// Calls `visit` with each patch.
    fn for_each(&self, mut visit: impl FnMut(Patch)) {
        let scene = self.surfaces.scene();
        let moving = self.surfaces.moving();
        let mut number = 0;
        for (instance, Instance { mesh, .. }) in scene.instances.iter().enumerate() {
            if moving[instance] != self.on_moving {
                continue;
            }
            // Add both sides of a double-sided surface, each with its own anchors. Skip unlit surfaces, which reflect
            // nothing.
            let mesh = &scene.meshes[*mesh];
            let material = &scene.materials[mesh.material];
            let sides: &[bool] = match (material.unlit, material.double_sided) {
                (true, _) => &[],
                (false, false) => &[true],
                (false, true) => &[true, false],
            };

            // Weight each side by its area: |(b − a) × (c − a)| / 2.
            for triangle in 0..mesh.triangles.len() {
                let [a, b, c] = self.surfaces.corners(instance, triangle);
                let area = f64::from((b - a).cross(c - a).length() / 2.0);
                let area = if area.is_finite() { area } else { 0.0 };
                for &front in sides {
                    self.pieces([a, b, c], WHOLE, MOST_HALVINGS, &mut |piece, share| {
                        visit(Patch { number, instance, triangle, front, piece, area: area * share });
                        number += 1;
                    });
                }
            }
        }
    }

    /// Subdivides the `piece` of a triangle with these `corners` at the borders of zones. Calls `visit` with each
    /// resulting piece and its weighted fraction of the triangle's area.
    fn pieces(&self, corners: [Vec3A; 3], piece: Piece, halvings: u32, visit: &mut impl FnMut(Piece, f64)) {
        // Keep a piece whole if its bounding sphere is small or within one zone.
        let [a, b, c] = corners;
        let center = (a + b + c) / 3.0;
        let radius = corners.map(|corner| corner.distance(center)).into_iter().fold(0.0, f32::max);
        let is_cut = self.zones.part_ball(center, radius) && halvings > 0 && radius.is_finite();
        if !is_cut {
            // Weight by the point density: in zone z, it is 1 / 8^z of the density in zone 0.
            let scale = f64::from(self.zones.scale(center));
            visit(piece, 0.25f64.powi((MOST_HALVINGS - halvings) as i32) / (scale * scale));
            return;
        }

        // Create four pieces: three at the corners, and one between the middles of the edges.
        let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        let [p, q, r] = piece;
        let [pq, qr, rp] = [(p + q) / 2.0, (q + r) / 2.0, (r + p) / 2.0];
        self.pieces([a, ab, ca], [p, pq, rp], halvings - 1, visit);
        self.pieces([ab, b, bc], [pq, q, qr], halvings - 1, visit);
        self.pieces([ca, bc, c], [rp, qr, r], halvings - 1, visit);
        self.pieces([ab, bc, ca], [pq, qr, rp], halvings - 1, visit);
    }

    /// Returns the total area \[m²\]. Farther zones have less weight.
    pub fn area(&self) -> f32 {
        self.area as f32
    }

    /// Distributes `count` points evenly by area. Returns fewer points if sheets are so close together that their
    /// points would be too dense.
    pub fn spread(&self, count: usize, units: &Units) -> Vec<DynamicAnchor> {
        let mut points = Vec::with_capacity(count);
        // Step regularly through the cumulative area. The points of a patch are then consecutive, and one pass
        // suffices.
        let step = |i: usize| (i as f64 + 0.5) / count as f64 * self.area;
        let (mut sum, mut last) = (0.0, None);
        self.for_each(|patch| {
            sum += patch.area;
            let first = points.len();
            while points.len() < count && step(points.len()) < sum {
                points.push(patch.point(points.len() - first, count, units));
            }
            if patch.area > 0.0 {
                last = Some((patch, first));
            }
        });
        // Assign steps rounded up to the total area to the last patch.
        if let Some((patch, first)) = last {
            while points.len() < count {
                points.push(patch.point(points.len() - first, count, units));
            }
        }

        // Drop the excess points of crowded cells, which would slow down every search nearby.
        let radius = kernel_radius(self.area() / count.max(1) as f32);
        let places: Vec<Vec3A> = points.iter().map(|point| point.in_world(self.surfaces).position).collect();
        let mut is_in_crowd = crowded(&places, radius).into_iter();
        points.retain(|_| is_in_crowd.next() == Some(false));
        points
    }
}

/// Returns, for each of the `places`, whether `CROWD` (256) earlier places are in the same cell. Cells are as wide as
/// the kernel's `radius`. Searches visit all points of a cell, so the number of points per cell is limited. The
/// remaining points receive the light of all places.
fn crowded(places: &[Vec3A], radius: f32) -> Vec<bool> {
    let mut counts: HashMap<[i64; 3], usize> = HashMap::new();
    let mut is_crowded = Vec::with_capacity(places.len());
    for place in places {
        let count = counts.entry((*place / radius).floor().to_array().map(|x| x as i64)).or_default();
        *count += 1;
        is_crowded.push(*count > CROWD);
    }
    is_crowded
}

impl Patch {
    /// Returns the point with index `within` on the patch. All patches together have `count` points.
    fn point(&self, within: usize, count: usize, units: &Units) -> DynamicAnchor {
        // Use one sequence per patch, because a common sequence would correlate positions with patch numbers. With one
        // point per side, all front sides would have a point in the same half of their triangles.
        let key = hash(count as u64, self.number as u64, PLACEMENT);
        let (u, v) = triangle(owen_sobol_point(within as u32, key));
        let [p, q, r] = self.piece;
        let at = p + (q - p) * u + (r - p) * v;
        DynamicAnchor {
            instance: self.instance as u32,
            triangle: self.triangle as u32,
            barycentric: (at.x, at.y),
            front: self.front,
            offset: units.epsilon,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Distribution;
    use crate::scene::{Material, Mesh, Scene};
    use glam::Vec3;

    /// Returns `copies` of two triangles. The second triangle is four times as large as the first.
    fn pile(copies: usize) -> Scene {
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [3.0, 0.0], [5.0, 0.0], [3.0, 2.0]];
        let mesh = Mesh {
            positions: corners.map(|[x, y]| Vec3::new(x, y, 0.0)).into(),
            triangles: [[0, 1, 2], [3, 4, 5]].repeat(copies),
            ..Mesh::default()
        };
        Scene::of_mesh(mesh, Material { double_sided: true, ..Material::default() })
    }

    #[test]
    fn one_walk_picks_as_a_table_of_areas_does() {
        let scene = pile(3);
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        let patches = Patches::of(&surfaces, false, &Zones::default()).unwrap();
        let table = Distribution::new([0.5, 0.5, 2.0, 2.0].repeat(3)).unwrap();
        for count in [1, 7, 100] {
            let points = patches.spread(count, &Units::of(&scene));
            assert_eq!(points.len(), count);
            for (i, point) in points.iter().enumerate() {
                let patch = table.pick((i as f64 + 0.5) / count as f64).index;
                assert_eq!(
                    (point.triangle as usize, point.front),
                    (patch / 2, patch.is_multiple_of(2)),
                    "{i} of {count}"
                );
            }
        }
    }

    #[test]
    fn points_on_many_sheets_in_one_place_are_no_crowd() {
        // Test sheets within a few cells: each cell contains a limited number of points for any number of sheets.
        for copies in [1000, 4000] {
            let scene = pile(copies);
            let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
            let patches = Patches::of(&surfaces, false, &Zones::default()).unwrap();
            let points = patches.spread(10_000, &Units::of(&scene));
            let radius = kernel_radius(patches.area() / 10_000.0);
            let places: Vec<Vec3A> = points.iter().map(|point| point.in_world(&surfaces).position).collect();
            let first = places.iter().filter(|place| place.distance(places[0]) < radius).count();
            assert!((100..=8 * CROWD).contains(&first), "{copies}: {first}");
        }
    }
}
