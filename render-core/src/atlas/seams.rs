//! Seams: edges along which a smooth surface continues in another chart, or elsewhere in the same chart.

use super::near::{PointGrid, run_along};
use super::nearest::Nearest;
use super::point::{TexelBlend, TexelSite, outward};
use super::{Atlas, ChartTriangle, NONE, Sheet};
use crate::Surfaces;
use glam::{DVec3, Vec3A};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashSet};

/// Maximum distance between the two edges of a seam, as a fraction of the scene's length.
const TOLERANCE: f64 = 1e-5;
/// Minimum and maximum length of the scene, in cubes of the grid of edges.
const CELLS: [f64; 2] = [16.0, 1024.0];
/// Number of points on a seam per texel of its length.
const POINTS_PER_TEXEL: f64 = 2.0;
/// Maximum number of points on an edge.
const MOST_POINTS: f64 = 32768.0;
/// Minimum cosine of the angle between the normals on both sides of a seam: 15°.
const SMOOTH: f32 = 0.966;
/// Minimum cosine of the angle between two triangles of a smooth surface, whose shading normals agree: 60°.
const BENT: f32 = 0.5;

/// Point on a seam.
#[derive(Clone, Copy, Debug)]
pub struct SeamPoint {
    /// The two sides of the seam at this point.
    pub sides: [SeamSide; 2],
    /// Length of the seam that this point represents \[texels\], at most ½.
    pub length: f32,
}

/// One side of a seam.
#[derive(Clone, Copy, Debug)]
pub struct SeamSide {
    /// Point on the surface.
    pub site: TexelSite,
    /// Unit vector on the triangle, perpendicular to the seam and away from it.
    pub inward: Vec3A,
    /// Texels at the point.
    pub blend: TexelBlend,
}

/// Edge of a triangle at the border of its chart.
struct Border {
    /// Index of the triangle in the atlas.
    triangle: u32,
    /// Ends of the edge \[m\]. The triangle is to the left, seen from the front of this side.
    ends: [DVec3; 2],
    /// Unit normal of the triangle, on this side.
    normal: Vec3A,
}

impl Atlas {
    /// Returns points on all seams of smooth surfaces, in an order that depends on the scene only.
    ///
    /// At a point on a seam, triangles of two charts have the same edge and face the same way. Either the triangles or
    /// the shading normals are parallel within 15°. `surfaces` must belong to the scene for which the atlas was made or
    /// validated.
    #[must_use]
    pub fn seams(&self, surfaces: &Surfaces) -> Vec<SeamPoint> {
        let borders = self.borders(surfaces);
        let pairs: Vec<[u32; 2]> = adjacent(&borders).into_iter().collect();
        let points =
            |[one, other]: [u32; 2]| self.points_between(surfaces, [&borders[one as usize], &borders[other as usize]]);
        pairs.into_par_iter().map(points).collect::<Vec<_>>().concat()
    }

    /// Returns the edges at borders of charts. Their triangles are in the order of the atlas.
    fn borders(&self, surfaces: &Surfaces) -> Vec<Border> {
        // Within a chart, adjacent triangles have the same corners in opposite order.
        let edges = |placed: &ChartTriangle| {
            let [a, b, c] = placed.corners.map(|corner| corner.map(f32::to_bits));
            [[a, b], [b, c], [c, a]].map(|edge| (placed.chart, edge))
        };
        let placed = self.triangles.iter().filter(|placed| has_area(placed));
        let known: HashSet<(u32, [[u32; 2]; 2])> = placed.flat_map(edges).collect();

        let mut borders = Vec::new();
        for sheet in &self.sheets {
            for triangle in 0..sheet.count {
                let index = sheet.first + triangle;
                let placed = &self.triangles[index as usize];
                let Some(normal) = front(surfaces, sheet, triangle).filter(|_| has_area(placed)) else { continue };
                let corners =
                    surfaces.corners(sheet.instance as usize, triangle as usize).map(|corner| corner.as_dvec3());
                let turns_left = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(normal.as_dvec3()) > 0.0;
                for (k, (chart, [a, b])) in edges(placed).into_iter().enumerate() {
                    let [from, to] = [corners[k], corners[(k + 1) % 3]];
                    if !known.contains(&(chart, [b, a])) {
                        let ends = if turns_left { [from, to] } else { [to, from] };
                        borders.push(Border { triangle: index, ends, normal });
                    }
                }
            }
        }
        borders
    }

    /// Returns the seam points on two edges along each other.
    fn points_between(&self, surfaces: &Surfaces, borders: [&Border; 2]) -> Vec<SeamPoint> {
        // Find the interval on both edges.
        let [a, b] = borders[0].ends;
        let Some(along) = (b - a).try_normalize() else { return Vec::new() };
        let [from, to, whole] = [borders[1].ends[1], borders[1].ends[0], b].map(|end| (end - a).dot(along));
        let (from, to) = (from.max(0.0), to.min(whole));
        let texels = (to - from) * f64::from(self.texels_per_meter);
        let count = (texels * POINTS_PER_TEXEL).ceil().clamp(1.0, MOST_POINTS);

        // Keep the points with smooth normals at which the sides read different texels.
        let mut points = Vec::new();
        for k in 0..count as u32 {
            let place = a + along * (from + (to - from) * (f64::from(k) + 0.5) / count);
            let side = |border: &Border| self.side(surfaces, border, place.as_vec3a(), along.as_vec3a());
            let [Some(one), Some(other)] = borders.map(side) else { continue };
            let of_triangles = one.site.geometric_normal.dot(other.site.geometric_normal);
            let is_smooth = of_triangles >= SMOOTH || one.site.shading_normal.dot(other.site.shading_normal) >= SMOOTH;
            if is_smooth && one.blend != other.blend {
                points.push(SeamPoint { sides: [one, other], length: (texels / count) as f32 });
            }
        }
        points
    }

    /// Returns the side of a seam at a place on a border.
    fn side(&self, surfaces: &Surfaces, border: &Border, place: Vec3A, along: Vec3A) -> Option<SeamSide> {
        let sheet = self.sheets[self.sheets.partition_point(|sheet| sheet.first <= border.triangle).checked_sub(1)?];
        let corners = surfaces.corners(sheet.instance as usize, (border.triangle - sheet.first) as usize);
        let nearest = Nearest::new(corners, place);
        let blend = self.blend(&self.triangles[border.triangle as usize], nearest)?;
        let site = self.site(border.triangle, nearest, surfaces)?;

        // Point inward: to the third corner of the triangle.
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let inward = (middle - place).reject_from(along).try_normalize()?;
        Some(SeamSide { site, inward, blend })
    }
}

fn has_area(placed: &ChartTriangle) -> bool {
    placed.chart != NONE && (placed.corners[0] != placed.corners[1] || placed.corners[1] != placed.corners[2])
}

/// Returns the unit normal of a triangle on the side of its sheet, `None` for a triangle without area.
fn front(surfaces: &Surfaces, sheet: &Sheet, triangle: u32) -> Option<Vec3A> {
    let outward = outward(surfaces, sheet.instance, triangle).try_normalize()?;
    Some(if sheet.back { -outward } else { outward })
}

/// Returns the pairs of borders that run along each other in opposite directions and face the same way.
fn adjacent(borders: &[Border]) -> BTreeSet<[u32; 2]> {
    // Choose cubes about as large as an edge.
    let (mut low, mut high, mut lengths) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0);
    for [a, b] in borders.iter().map(|border| border.ends) {
        (low, high, lengths) = (low.min(a).min(b), high.max(a).max(b), lengths + a.distance(b));
    }
    let length = (high - low).max_element().clamp(1e-30, 1e30);
    let reach = TOLERANCE * length;
    let side = (2.0 * lengths / borders.len() as f64).clamp(length / CELLS[1], length / CELLS[0]);
    let mut grid = PointGrid::new(side);
    for (k, border) in borders.iter().enumerate() {
        grid.add_line(k as u32, border.ends, reach);
    }

    // Of two edges along each other, one has an end on the other.
    let mut pairs = BTreeSet::new();
    for (k, border) in borders.iter().enumerate() {
        for end in border.ends {
            for &other in grid.around(end, reach).filter(|&&other| other != k as u32) {
                let found = &borders[other as usize];
                if found.normal.dot(border.normal) >= BENT && run_along(border.ends, found.ends, reach) {
                    pairs.insert([other.min(k as u32), other.max(k as u32)]);
                }
            }
        }
    }
    pairs
}
