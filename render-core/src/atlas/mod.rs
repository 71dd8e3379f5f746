//! Texture atlas of all static surfaces, for baked light.
//!
//! The modules are steps in the construction and use of the atlas:
//!
//! - `weld` joins the copies of vertices.
//! - `flatten` unwraps the surfaces into flat charts.
//! - `planes` merges flat charts that continue each other, so that a wall is one chart.
//! - `density` finds the scale at which the charts use the requested number of texels.
//! - `pack` assigns a rectangle to each chart.
//! - `cover` finds the texels in use, which samples on a chart may read.
//! - `tiles` numbers the texels in use.
//! - `point` converts texels to surface points and back.
//! - `seams` finds the edges along which surfaces continue in another chart.
//! - `fine` converts texels of a finer image of the atlas to surface points.
//!
//! Each side of a double-sided surface has separate charts, because the light on the two sides differs. Single-sided
//! surfaces have charts for the front only. Unlit surfaces have no charts.

mod cover;
mod density;
mod estimate;
mod fine;
mod flatten;
mod layout;
mod near;
mod nearest;
mod pack;
mod planes;
mod point;
mod seams;
mod tiles;
mod validate;
mod weld;

pub use estimate::TexelEstimate;
pub use fine::{FinePoint, FineTexels};
pub use flatten::AtlasError;
pub use point::{AtlasPoint, TexelBlend, TexelSite};
pub use seams::{SeamPoint, SeamSide};

use crate::Surfaces;
use glam::Vec2;
use tiles::Tiles;

/// Minimum size of charts that are not narrow \[texels\]. The size of a chart on each axis is a whole number.
const NARROW: f32 = 1.5;

/// Index of an absent item.
const NONE: u32 = u32::MAX;

/// Texture atlas that maps each point of the static surfaces to a position in texels.
///
/// Texels in use have the indices 0 … [`Atlas::len`] − 1. The indices depend only on the scene and the requested
/// number. Along rows, columns and diagonals, at least two unused texels separate the texels of two charts.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Atlas {
    texels_per_meter: f32,
    /// Number of texels in use with centers on a chart.
    covered: u32,
    /// Sides of the instances, ordered by instance, with fronts before backs.
    sheets: Vec<Sheet>,
    /// Column and row of each chart's first texel.
    charts: Vec<[u32; 2]>,
    /// Triangles of all sheets, in the order of `sheets`.
    triangles: Vec<ChartTriangle>,
    /// Tiles with texels in use.
    tiles: Tiles,
    /// For each texel in use, the triangle of the chart nearest to the texel's center, as an index into `triangles`.
    owners: Vec<u32>,
}

/// Side of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sheet {
    instance: u32,
    back: bool,
    /// Index of the side's first triangle in [`Atlas::triangles`].
    first: u32,
    /// Number of triangles of the mesh.
    count: u32,
}

/// Triangle in its chart.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct ChartTriangle {
    /// Positions of the corners in texels, from the upper left corner of the chart's rectangle. The corners of
    /// triangles without area coincide.
    corners: [[f32; 2]; 3],
    /// Index into [`Atlas::charts`], or [`NONE`] if neither this triangle nor any triangle near it has an area.
    chart: u32,
}

impl ChartTriangle {
    const NOWHERE: Self = Self { corners: [[0.0; 2]; 3], chart: NONE };

    fn corners(&self) -> [Vec2; 3] {
        self.corners.map(Vec2::from)
    }
}

impl Atlas {
    /// Builds an atlas of all instances in a scene that never move or deform, with about `texels` texels in use.
    ///
    /// The number of texels in use is within a few percent of `texels`, unless a chart would be longer than 8192
    /// texels. `surfaces` may be at any time.
    ///
    /// # Errors
    ///
    /// If no lit surface is static, if `texels` is below the number of charts or above 2²⁶, or if surfaces cannot be
    /// flattened.
    pub fn new(surfaces: &Surfaces, texels: usize) -> Result<Self, AtlasError> {
        let meshes = flatten::standing(surfaces)?;
        let density = density::fitting(&meshes, texels)?;
        Ok(layout::laid_out(&meshes, density))
    }

    /// Builds an atlas like [`Atlas::new`], with a number of texels that follows from the scene.
    ///
    /// A texel is 1/120 of the diagonal of all static surfaces, or smaller: up to 1.5 times as many texels are used to
    /// have 90 % of the area in charts of two texels and more. The number is between 20 000 and 1 000 000, unless there
    /// are more charts.
    ///
    /// # Errors
    ///
    /// If no lit surface is static, or if surfaces cannot be flattened.
    pub fn automatic(surfaces: &Surfaces) -> Result<Self, AtlasError> {
        let meshes = flatten::standing(surfaces)?;
        let density = density::automatic(&meshes)?;
        Ok(layout::laid_out(&meshes, density))
    }

    /// Estimates the number of texels of [`Atlas::automatic`], and the fraction of them on instances for which `counts` is
    /// true. Takes much less time, because no surface is flattened.
    #[must_use]
    pub fn estimate(surfaces: &Surfaces, counts: &dyn Fn(usize) -> bool) -> TexelEstimate {
        estimate::estimated(surfaces, counts)
    }

    /// Returns the number of texels at which half of the [narrow charts](Atlas::narrow_charts) are not narrow. Returns
    /// `None` without narrow charts, or if the number exceeds the limit of an atlas. Flattens all surfaces again.
    ///
    /// # Errors
    ///
    /// If the surfaces cannot be flattened.
    pub fn texels_for_half_as_narrow(&self, surfaces: &Surfaces) -> Result<Option<usize>, AtlasError> {
        let meshes = flatten::standing(surfaces)?;
        Ok(density::for_half_as_narrow(&meshes, self.texels_per_meter))
    }

    /// Returns the number of texels in use.
    #[must_use]
    pub fn len(&self) -> usize {
        self.owners.len()
    }

    /// Returns whether no texel is in use. This is never the case after [`Atlas::new`].
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.owners.is_empty()
    }

    /// Returns the number of charts. A chart is a contiguous piece of surface.
    #[must_use]
    pub fn charts(&self) -> usize {
        self.charts.len()
    }

    /// Returns the number of charts that are narrower than two texels, at which the light across the chart is linear.
    #[must_use]
    pub fn narrow_charts(&self) -> usize {
        // Find the bounding box of each chart's triangles.
        let mut boxes = vec![(Vec2::INFINITY, Vec2::NEG_INFINITY); self.charts.len()];
        for placed in self.triangles.iter().filter(|placed| placed.chart != NONE) {
            let (least, most) = &mut boxes[placed.chart as usize];
            for corner in placed.corners() {
                (*least, *most) = (least.min(corner), most.max(corner));
            }
        }
        boxes.iter().filter(|(least, most)| (*most - *least).min_element() < NARROW).count()
    }

    /// Returns the number of tiles (16×16 texels) that contain a texel in use.
    #[must_use]
    pub fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Returns the number of texels in use with centers on a chart. The other texels in use surround charts.
    #[must_use]
    pub fn covered(&self) -> usize {
        self.covered as usize
    }

    /// Returns the texel density on flat surfaces \[1/m\]. On curved surfaces, the density varies.
    #[must_use]
    pub fn texels_per_meter(&self) -> f32 {
        self.texels_per_meter
    }

    /// Returns the width and height of the atlas \[texels\], including unused texels. Both are multiples of 16.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        self.tiles.size()
    }

    /// Returns the column and row of a texel in use. The texel's center is half a texel farther on both axes.
    ///
    /// # Panics
    ///
    /// If `texel` is not below [`Atlas::len`].
    #[must_use]
    pub fn place(&self, texel: usize) -> (u32, u32) {
        assert!(texel < self.len(), "texel {texel} of {}", self.len());
        self.tiles.place(texel as u32)
    }

    /// Returns the index of the texel in this column and row, or `None` if the texel is not in use.
    #[must_use]
    pub fn texel(&self, x: u32, y: u32) -> Option<u32> {
        self.tiles.index(x, y)
    }

    /// Returns the index of the chart of a texel in use, below [`Atlas::charts`].
    ///
    /// # Panics
    ///
    /// If `texel` is not below [`Atlas::len`].
    #[must_use]
    pub fn chart(&self, texel: usize) -> u32 {
        self.triangles[self.owners[texel] as usize].chart
    }

    /// Returns the adjacent texels that are in use and on the same chart. The order is by rows: three above, left and
    /// right, three below.
    ///
    /// # Panics
    ///
    /// If `texel` is not below [`Atlas::len`].
    #[must_use]
    pub fn neighbors(&self, texel: usize) -> [Option<u32>; 8] {
        const AROUND: [(i32, i32); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        let ((x, y), chart) = (self.place(texel), self.chart(texel));
        AROUND.map(|(dx, dy)| {
            let index = self.tiles.index(x.checked_add_signed(dx)?, y.checked_add_signed(dy)?)?;
            (self.chart(index as usize) == chart).then_some(index)
        })
    }

    /// Returns the positions of a triangle's corners on its front or back, in texels from the upper left corner of the
    /// atlas. Returns `None` for a triangle without a chart.
    #[must_use]
    pub fn triangle_places(&self, instance: u32, triangle: u32, front: bool) -> Option<[Vec2; 3]> {
        let placed = self.placed(instance, triangle, !front)?;
        let [left, top] = self.charts[placed.chart as usize];
        Some(placed.corners().map(|corner| corner + Vec2::new(left as f32, top as f32)))
    }

    /// Returns one side of a triangle, or `None` if it has no chart.
    fn placed(&self, instance: u32, triangle: u32, back: bool) -> Option<&ChartTriangle> {
        let found = self.sheets.binary_search_by_key(&(instance, back), |sheet| (sheet.instance, sheet.back));
        let sheet = self.sheets[found.ok()?];
        let index = (triangle < sheet.count).then_some(sheet.first + triangle)?;
        Some(&self.triangles[index as usize]).filter(|placed| placed.chart != NONE)
    }
}
