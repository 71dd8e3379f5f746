//! Placement of charts in the atlas, and assignment of texels to triangles.

use super::cover::ChartRect;
use super::flatten::FlatMesh;
use super::nearest::Nearest;
use super::pack::packed;
use super::tiles::Marks;
use super::{Atlas, ChartTriangle, NONE, Sheet};
use glam::Vec2;

/// Maximum squared distance between a texel center on a triangle and the triangle \[square texels\]. Rounding may put
/// the center between two triangles.
const ON_CHART: f32 = 1e-6;

/// Builds the atlas of `meshes` at a `density` in texels per meter.
pub(super) fn laid_out(meshes: &[FlatMesh], density: f32) -> Atlas {
    // Create a rectangle for each side of a chart.
    let mut frames = Vec::new();
    for mesh in meshes {
        for _ in 0..mesh.sides {
            frames.extend(mesh.charts.iter().map(|chart| ChartRect::new(chart.size, density)));
        }
    }
    let places = packed(&frames);
    let Sheets { sheets, triangles, flat } = placed(meshes, &frames);

    // Mark the texels that samples may read.
    let mut marks = Marks::new(places.width, places.height);
    let charts = places.corners;
    for placed in flat.iter().map(|&index| &triangles[index as usize]) {
        let [left, top] = charts[placed.chart as usize];
        frames[placed.chart as usize].rows_of(placed.corners(), |y, first, last| {
            (first..=last).for_each(|x| marks.set(left + x, top + y));
        });
    }
    let tiles = marks.numbered();

    // Assign each texel to its nearest triangle; ties go to the first.
    let mut owners = vec![NONE; tiles.texels()];
    let mut nearest = vec![f32::INFINITY; tiles.texels()];
    for &index in &flat {
        let placed = &triangles[index as usize];
        let [left, top] = charts[placed.chart as usize];
        let corners = placed.corners();
        frames[placed.chart as usize].rows_of(corners, |y, first, last| {
            for x in first..=last {
                let texel = tiles.index(left + x, top + y).expect("it was marked") as usize;
                let distance2 = from_center(corners, x, y).distance2;
                if distance2 < nearest[texel] {
                    (owners[texel], nearest[texel]) = (index, distance2);
                }
            }
        });
    }

    // Count the texels with centers on a chart. The others only surround it.
    let covered = nearest.iter().filter(|&&distance2| distance2 <= ON_CHART).count() as u32;
    Atlas { texels_per_meter: density, covered, sheets, charts, triangles, tiles, owners }
}

/// Triangles of all sides, in the order of the sides.
#[derive(Default)]
struct Sheets {
    sheets: Vec<Sheet>,
    triangles: Vec<ChartTriangle>,
    /// Indices of the triangles with an area in their chart.
    flat: Vec<u32>,
}

fn placed(meshes: &[FlatMesh], frames: &[ChartRect]) -> Sheets {
    let (mut placed, mut charts) = (Sheets::default(), 0);
    for mesh in meshes {
        for side in 0..mesh.sides {
            // Index triangles as the mesh does. Triangles without a chart have no position in the atlas.
            let first = placed.triangles.len() as u32;
            placed.sheets.push(Sheet { instance: mesh.instance, back: side == 1, first, count: mesh.count });
            placed.triangles.resize((first + mesh.count) as usize, ChartTriangle::NOWHERE);
            // Each side has its own copy of every chart, in another rectangle.
            for chart in &mesh.charts {
                for triangle in &chart.triangles {
                    let corners = triangle.corners.map(|corner| frames[charts].place(corner).to_array());
                    let index = first + triangle.index;
                    placed.triangles[index as usize] = ChartTriangle { corners, chart: charts as u32 };
                    placed.flat.extend(triangle.has_area.then_some(index));
                }
                charts += 1;
            }
        }
    }
    placed
}

/// Returns the point of a triangle nearest to the center of a texel. Both are in the rectangle of the triangle's chart.
fn from_center(corners: [Vec2; 3], x: u32, y: u32) -> Nearest {
    Nearest::in_plane(corners, Vec2::new(x as f32 + 0.5, y as f32 + 0.5))
}
