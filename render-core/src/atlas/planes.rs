//! Merging of flat charts that continue each other: a wall of several charts has one grid of texels.
//!
//! `uvunwrap` joins triangles along edges that exactly two triangles share. Vertices in the middle of an edge, edges of
//! three triangles and hard edges end its charts, also within a plane.

use super::near::{PointGrid, run_along};
use super::weld::WeldedMesh;
use glam::{DVec2, DVec3};
use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};

/// Minimum cosine of the angle between normals in one plane: 1°.
const PARALLEL: f64 = 0.999_85;
/// Maximum distance from a plane to its points, as a fraction of the mesh's length.
const THICKNESS: f64 = 1e-4;
/// Maximum distance between edges at one place, as a fraction of the mesh's length.
const TOLERANCE: f64 = 1e-5;
/// Number of grid cubes along the mesh's length.
const CELLS: f64 = 64.0;
/// Maximum number of charts that are merged into one. Overlaps are searched in all pairs.
const MOST_CHARTS: usize = 4096;
/// Number of edge directions that are tried as an axis of a merged chart.
const AXES: usize = 16;

/// Triangle in a chart.
#[derive(Clone)]
pub(super) struct Laid {
    /// Index into the mesh's triangles.
    pub index: u32,
    /// Positions of the corners in the chart \[m\].
    pub corners: [DVec2; 3],
}

impl Laid {
    /// Returns whether the triangle has an area in its chart.
    pub fn has_area(&self) -> bool {
        self.corners[0] != self.corners[1] || self.corners[1] != self.corners[2]
    }
}

/// Plane of a flat chart.
#[derive(Clone, Copy)]
struct Plane {
    /// Unit normal.
    normal: DVec3,
    /// Distance from the origin along the normal \[m\].
    offset: f64,
    /// Area of the chart \[m²\].
    area: f64,
}

/// Edge at the border of a chart.
struct Border {
    chart: u32,
    ends: [DVec3; 2],
}

/// Merges flat charts with a common edge and a common plane. The order of the result depends on the charts only.
pub(super) fn merged(mesh: &WeldedMesh, charts: Vec<Vec<Laid>>) -> Vec<Vec<Laid>> {
    let merge = Merge { mesh, planes: charts.iter().map(|chart| plane(mesh, chart)).collect(), charts: &charts };
    let neighbors = merge.neighbors();

    // Grow regions from the largest chart in the order of areas.
    let mut order: Vec<usize> = (0..charts.len()).filter(|&chart| merge.planes[chart].is_some()).collect();
    let area = |chart: usize| merge.planes[chart].map_or(0.0, |plane| plane.area);
    order.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
    let mut is_taken = vec![false; charts.len()];
    let mut regions: Vec<Option<Vec<usize>>> = vec![None; charts.len()];
    for seed in order {
        if !is_taken[seed] {
            regions[seed] = Some(merge.region(seed, &neighbors, &mut is_taken));
        }
    }

    // Lay out regions of several charts in their planes. All other charts remain as they are.
    let mut found = Vec::with_capacity(charts.len());
    for (chart, region) in regions.iter().enumerate() {
        match region {
            Some(region) if region.len() > 1 => found.push(merge.laid(region)),
            Some(_) => found.push(charts[chart].clone()),
            None if merge.planes[chart].is_none() => found.push(charts[chart].clone()),
            None => {}
        }
    }
    found
}

/// Charts of a mesh, with the planes of flat charts.
struct Merge<'a> {
    mesh: &'a WeldedMesh,
    charts: &'a [Vec<Laid>],
    planes: Vec<Option<Plane>>,
}

/// Returns the plane of a flat chart.
fn plane(mesh: &WeldedMesh, chart: &[Laid]) -> Option<Plane> {
    let normal_of = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
    let corners: Vec<[DVec3; 3]> = chart.iter().filter(|t| t.has_area()).map(|t| mesh.corners(t.index)).collect();
    let sum: DVec3 = corners.iter().map(|&corners| normal_of(corners)).sum();
    let normal = sum.try_normalize()?;
    let offset = corners.first()?[0].dot(normal);
    let plane = Plane { normal, offset, area: sum.length() / 2.0 };
    let is_in = |&corners: &[DVec3; 3]| {
        let of_triangle = normal_of(corners);
        of_triangle.dot(normal) >= PARALLEL * of_triangle.length() && plane.has(mesh, &corners)
    };
    corners.iter().all(is_in).then_some(plane)
}

impl Plane {
    /// Returns whether points are in the plane.
    fn has(&self, mesh: &WeldedMesh, points: &[DVec3]) -> bool {
        points.iter().all(|point| (point.dot(self.normal) - self.offset).abs() <= THICKNESS * mesh.length)
    }

    /// Returns the position of a point along two perpendicular axes of the plane. `along` is the first axis.
    fn project(&self, along: DVec3, point: DVec3) -> DVec2 {
        DVec2::new(point.dot(along), point.dot(self.normal.cross(along)))
    }
}

impl Merge<'_> {
    /// Returns the flat charts next to each flat chart: their borders run along each other in opposite directions.
    fn neighbors(&self) -> Vec<BTreeSet<u32>> {
        // Enter the borders of flat charts in a grid.
        let borders = self.borders();
        let reach = TOLERANCE * self.mesh.length;
        let mut grid = PointGrid::new(self.mesh.length / CELLS);
        for (k, border) in borders.iter().enumerate() {
            grid.add_line(k as u32, border.ends, reach);
        }

        // Two edges along each other have the end of one on the other.
        let mut neighbors = vec![BTreeSet::new(); self.charts.len()];
        for border in &borders {
            for end in border.ends {
                for &other in grid.around(end, reach) {
                    let other = &borders[other as usize];
                    if other.chart != border.chart && run_along(border.ends, other.ends, reach) {
                        neighbors[border.chart as usize].insert(other.chart);
                        neighbors[other.chart as usize].insert(border.chart);
                    }
                }
            }
        }
        neighbors
    }

    /// Returns the edges of flat charts that belong to one triangle of their chart.
    fn borders(&self) -> Vec<Border> {
        let mut borders = Vec::new();
        for (chart, triangles) in self.charts.iter().enumerate().filter(|(chart, _)| self.planes[*chart].is_some()) {
            let mut edges = Vec::new();
            for triangle in triangles.iter().filter(|triangle| triangle.has_area()) {
                let [a, b, c] = self.places(triangle.index);
                edges.extend([[a, b], [b, c], [c, a]]);
            }
            let inner: HashSet<[u32; 2]> = edges.iter().copied().collect();
            for [a, b] in edges {
                if !inner.contains(&[b, a]) {
                    borders.push(Border { chart: chart as u32, ends: [self.mesh.at(a), self.mesh.at(b)] });
                }
            }
        }
        borders
    }

    /// Returns the corners of a triangle, as the first vertices at their positions.
    fn places(&self, triangle: u32) -> [u32; 3] {
        self.mesh.triangles[triangle as usize].map(|vertex| self.mesh.firsts[vertex as usize])
    }

    /// Returns the charts that continue `seed` in its plane without overlap, and marks them as taken.
    fn region(&self, seed: usize, neighbors: &[BTreeSet<u32>], is_taken: &mut [bool]) -> Vec<usize> {
        let mut region = vec![seed];
        let Some(plane) = self.planes[seed] else { return region };
        let axis = plane.normal.any_orthonormal_vector();
        let flat = |chart: usize| FlatPiece::new(self, chart, |point| plane.project(axis, point));
        is_taken[seed] = true;

        // Visit neighbors in the order of their distance from the seed in charts.
        let (mut pieces, mut waiting) = (vec![flat(seed)], VecDeque::from([seed]));
        while let Some(chart) = waiting.pop_front() {
            for next in neighbors[chart].iter().map(|&next| next as usize) {
                if is_taken[next] || region.len() >= MOST_CHARTS || !self.is_in(&plane, next) {
                    continue;
                }
                let piece = flat(next);
                if pieces.iter().any(|other| other.overlaps(&piece, TOLERANCE * self.mesh.length)) {
                    continue;
                }
                is_taken[next] = true;
                region.push(next);
                pieces.push(piece);
                waiting.push_back(next);
            }
        }
        region
    }

    /// Returns whether a flat chart is in a plane, on the same side.
    fn is_in(&self, plane: &Plane, chart: usize) -> bool {
        let is_parallel = self.planes[chart].is_some_and(|own| own.normal.dot(plane.normal) >= PARALLEL);
        let mut triangles = self.charts[chart].iter().filter(|triangle| triangle.has_area());
        is_parallel && triangles.all(|triangle| plane.has(self.mesh, &self.mesh.corners(triangle.index)))
    }

    /// Lays out the triangles of a region in its plane, with an axis along an edge.
    fn laid(&self, region: &[usize]) -> Vec<Laid> {
        let triangles: Vec<&Laid> = region.iter().flat_map(|&chart| &self.charts[chart]).collect();
        let Some(plane) = self.planes[region[0]] else { return Vec::new() };
        let axis = self.axis(&plane, &triangles);

        // Triangles without area coincide with a corner of another triangle.
        let mut places: HashMap<u32, DVec2> = HashMap::new();
        for triangle in triangles.iter().filter(|triangle| triangle.has_area()) {
            for vertex in self.places(triangle.index) {
                places.insert(vertex, plane.project(axis, self.mesh.at(vertex)));
            }
        }
        let somewhere = plane.project(axis, self.mesh.corners(triangles[0].index)[0]);
        let mut laid = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            let vertices = self.places(triangle.index);
            let corners = if triangle.has_area() {
                vertices.map(|vertex| places[&vertex])
            } else {
                [vertices.iter().find_map(|vertex| places.get(vertex)).copied().unwrap_or(somewhere); 3]
            };
            laid.push(Laid { index: triangle.index, corners });
        }
        laid
    }

    /// Returns the direction of a long edge for which the chart's rectangle is smallest.
    fn axis(&self, plane: &Plane, triangles: &[&Laid]) -> DVec3 {
        // List the directions in the plane, starting with the longest edges.
        let mut edges = Vec::new();
        for triangle in triangles.iter().filter(|triangle| triangle.has_area()) {
            let [a, b, c] = self.mesh.corners(triangle.index);
            edges.extend([b - a, c - b, a - c]);
        }
        edges.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
        let mut axes: Vec<DVec3> = Vec::new();
        for edge in edges {
            let Some(axis) = edge.reject_from_normalized(plane.normal).try_normalize() else { continue };
            if axes.len() < AXES && axes.iter().all(|other| other.dot(axis).abs() < PARALLEL) {
                axes.push(axis);
            }
        }

        // Compare the areas of the bounding boxes.
        let area = |axis: DVec3| {
            let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            for corner in triangles.iter().flat_map(|triangle| self.mesh.corners(triangle.index)) {
                let place = plane.project(axis, corner);
                (least, most) = (least.min(place), most.max(place));
            }
            (most - least).element_product()
        };
        let smallest = axes.into_iter().map(|axis| (area(axis), axis)).min_by(|a, b| a.0.total_cmp(&b.0));
        smallest.map_or_else(|| plane.normal.any_orthonormal_vector(), |(_, axis)| axis)
    }
}

/// Chart in the plane of its region.
struct FlatPiece {
    least: DVec2,
    most: DVec2,
    triangles: Vec<[DVec2; 3]>,
}

impl FlatPiece {
    fn new(merge: &Merge, chart: usize, project: impl Fn(DVec3) -> DVec2) -> Self {
        let mut piece = Self { least: DVec2::INFINITY, most: DVec2::NEG_INFINITY, triangles: Vec::new() };
        for triangle in merge.charts[chart].iter().filter(|triangle| triangle.has_area()) {
            let corners = merge.mesh.corners(triangle.index).map(&project);
            for corner in corners {
                (piece.least, piece.most) = (piece.least.min(corner), piece.most.max(corner));
            }
            piece.triangles.push(corners);
        }
        piece
    }

    /// Returns whether two triangles of the pieces overlap by more than `slack` \[m\].
    fn overlaps(&self, other: &Self, slack: f64) -> bool {
        let is_apart = |least: DVec2, most: DVec2| {
            (self.most - slack).cmplt(least).any() || (self.least + slack).cmpgt(most).any()
        };
        if is_apart(other.least, other.most) {
            return false;
        }
        let mut near = self.triangles.iter();
        near.any(|one| other.triangles.iter().any(|two| !are_apart(one, two, slack)))
    }
}

/// Returns whether an edge of one of two triangles separates them, up to `slack` \[m\].
fn are_apart(one: &[DVec2; 3], two: &[DVec2; 3], slack: f64) -> bool {
    let separates = |edges: &[DVec2; 3], points: &[DVec2; 3]| {
        (0..3).any(|k| {
            let [a, b, c] = [0, 1, 2].map(|corner| edges[(k + corner) % 3]);
            let across = (b - a).perp().normalize_or_zero();
            let outward = if across.dot(c - a) > 0.0 { -across } else { across };
            points.iter().all(|&point| (point - a).dot(outward) >= -slack)
        })
    };
    separates(one, two) || separates(two, one)
}

#[cfg(test)]
mod tests {
    use crate::scene::{Material, Mesh, Scene};
    use crate::{Atlas, Surfaces};
    use glam::{Vec3, vec3};

    /// Returns a mesh of rectangles, each with vertices of its own. A rectangle has a corner and two sides.
    fn rectangles(rectangles: &[[Vec3; 3]]) -> Mesh {
        let mut mesh = Mesh::default();
        for &[corner, x, y] in rectangles {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([corner, corner + x, corner + x + y, corner + y]);
            mesh.normals.extend([x.cross(y).normalize(); 4]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        mesh
    }

    /// A wall around a window: eight rectangles of different sizes, whose vertices are in the middle of other edges.
    fn wall() -> Vec<[Vec3; 3]> {
        let part = |x, y, width, height| [vec3(x, y, 0.0), Vec3::X * width, Vec3::Y * height];
        vec![
            part(0.0, 0.0, 1.0, 0.5),
            part(1.0, 0.0, 2.0, 0.25),
            part(1.0, 0.25, 2.0, 0.75),
            part(0.0, 0.5, 1.0, 1.5),
            part(2.0, 1.0, 1.0, 1.0),
            part(0.0, 2.0, 3.0, 0.5),
        ]
    }

    fn with_atlas(parts: &[[Vec3; 3]], test: impl Fn(&Surfaces, &Atlas)) {
        let scene = Scene::of_mesh(rectangles(parts), Material::default());
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        test(&surfaces, &Atlas::new(&surfaces, 2000).expect("a wall"));
    }

    /// The wall has one chart, in which positions are the positions on the wall up to one scale per axis.
    #[test]
    fn a_wall_of_several_rectangles_is_one_chart() {
        with_atlas(&wall(), |surfaces, atlas| {
            assert_eq!(atlas.charts(), 1);
            let places = |triangle| atlas.triangle_places(0, triangle, true).unwrap();
            let (first, last) = (places(0), places(10));
            let [a, _, c] = surfaces.corners(0, 0);
            let [from, _, to] = surfaces.corners(0, 10);
            // The corners of the wall fix the scales. Charts are at most as high as wide.
            let (whole, meters) = (last[2] - first[0], Vec3::from(to - a));
            let (part, other) = (first[2] - first[0], last[0] - first[0]);
            for (found, wanted) in [(part, Vec3::from(c - a)), (other, Vec3::from(from - a))] {
                assert!((found.x / whole.x - wanted.x / meters.x).abs() < 1e-4, "{found} for {wanted}");
                assert!((found.y / whole.y - wanted.y / meters.y).abs() < 1e-4, "{found} for {wanted}");
            }
        });
    }

    /// Rectangles next to a wall are separate if they are at an angle, behind it, on top of it, or face the other way.
    #[test]
    fn other_planes_and_overlaps_are_separate_charts() {
        let beside = |corner, x: Vec3, y| [wall(), vec![[corner, x, y]]].concat();
        let edge = vec3(3.0, 0.0, 0.0);
        let parts = [
            beside(edge, vec3(0.0, 0.0, -1.0), Vec3::Y),
            beside(edge - Vec3::Z * 0.01, Vec3::X, Vec3::Y),
            beside(vec3(0.0, 0.0, 0.0), Vec3::X, Vec3::Y),
            beside(edge + Vec3::X, -Vec3::X, Vec3::Y),
            beside(edge + Vec3::X * 0.01, Vec3::X, Vec3::Y),
        ];
        for parts in parts {
            with_atlas(&parts, |_, atlas| assert_eq!(atlas.charts(), 2));
        }
        with_atlas(&beside(edge, Vec3::X, Vec3::Y), |_, atlas| assert_eq!(atlas.charts(), 1));
    }
}
