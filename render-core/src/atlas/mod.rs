//! A texture atlas of all surfaces that stand still: a place for light that is computed once.
//!
//! `flatten` cuts the surfaces into charts and lays these out flat. `density` finds the scale at which they take the wished
//! number of texels, and `pack` gives each chart a rectangle. A texel is in use if a look-up of some point of a chart reads it:
//! `cover` finds these, and `tiles` numbers them. `point` goes from a texel to surface points and back, and `fine` from a texel
//! of a finer picture of the atlas to a surface point.
//!
//! Of double-sided surfaces each side has charts of its own, since light differs between them. Others have a front alone.
//! Unlit surfaces have no charts.

mod cover;
mod density;
mod fine;
mod flatten;
mod layout;
mod nearest;
mod pack;
mod point;
mod tiles;
mod validate;

pub use fine::{FinePoint, FineTexels};
pub use flatten::AtlasError;
pub use point::{AtlasPoint, TexelBlend, TexelSite};

use crate::Surfaces;
use glam::Vec2;
use tiles::Tiles;

/// Index of what is not there.
const NONE: u32 = u32::MAX;

/// A place for each surface point that stands still, in texels.
///
/// Texels in use have the indices 0 … [`Atlas::len`] − 1, in an order that is fixed by the scene and the wished number.
/// Those of a chart touch no texel of another one: two unused texels at least lie between them, in rows, columns and
/// diagonals.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Atlas {
    texels_per_meter: f32,
    /// Texels whose centers lie on a chart.
    covered: u32,
    /// In the order of instances, fronts before backs.
    sheets: Vec<Sheet>,
    /// For each chart, column and row of its first texel.
    charts: Vec<[u32; 2]>,
    /// Those of the first sheet, of the second …
    triangles: Vec<ChartTriangle>,
    /// Which texels are in use.
    tiles: Tiles,
    /// For each texel in use the triangle of its chart that is nearest to its center: index into `triangles`.
    owners: Vec<u32>,
}

/// One side of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sheet {
    instance: u32,
    back: bool,
    /// Index of its first triangle into [`Atlas::triangles`].
    first: u32,
    /// How many triangles its mesh has.
    count: u32,
}

/// A triangle in its chart.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct ChartTriangle {
    /// Texels from the upper left corner of the chart's rectangle. Triangles without area lie in one point.
    corners: [[f32; 2]; 3],
    /// Index into [`Atlas::charts`], or [`NONE`] where no triangle beside this one has an area.
    chart: u32,
}

impl ChartTriangle {
    const NOWHERE: Self = Self { corners: [[0.0; 2]; 3], chart: NONE };

    fn corners(&self) -> [Vec2; 3] {
        self.corners.map(Vec2::from)
    }
}

impl Atlas {
    /// Makes an atlas of the instances of a scene that never move or bend, with about `texels` texels in use.
    ///
    /// The number is met within a few percent, unless the scene is so uneven that one chart would be more than 8192 texels
    /// long. `surfaces` may be of any time.
    ///
    /// # Errors
    ///
    /// If no lit surface stands still, if `texels` is too small for the number of charts or more than 2²⁶, or if surfaces
    /// cannot be laid out flat.
    pub fn new(surfaces: &Surfaces, texels: usize) -> Result<Self, AtlasError> {
        let meshes = flatten::standing(surfaces)?;
        let density = density::fitting(&meshes, texels)?;
        Ok(layout::laid_out(&meshes, density))
    }

    /// Texels in use.
    #[must_use]
    pub fn len(&self) -> usize {
        self.owners.len()
    }

    /// Whether no texel is in use, which no atlas made by [`Atlas::new`] is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.owners.is_empty()
    }

    /// Pieces of surface that lie in the atlas without a cut.
    #[must_use]
    pub fn charts(&self) -> usize {
        self.charts.len()
    }

    /// Squares of 16×16 texels that have a texel in use.
    #[must_use]
    pub fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Texels in use whose centers lie on a chart; the others lie around charts.
    #[must_use]
    pub fn covered(&self) -> usize {
        self.covered as usize
    }

    /// Density of texels on flat surfaces \[1/m\]; on bent ones it differs from place to place.
    #[must_use]
    pub fn texels_per_meter(&self) -> f32 {
        self.texels_per_meter
    }

    /// Width and height of the atlas, used or not \[texels\]; multiples of 16.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        self.tiles.size()
    }

    /// Column and row of a texel in use. Its center lies half a texel farther.
    ///
    /// # Panics
    ///
    /// If `texel` is not below [`Atlas::len`].
    #[must_use]
    pub fn place(&self, texel: usize) -> (u32, u32) {
        assert!(texel < self.len(), "texel {texel} of {}", self.len());
        self.tiles.place(texel as u32)
    }

    /// The texel in use in this column and row, if there is one.
    #[must_use]
    pub fn texel(&self, x: u32, y: u32) -> Option<u32> {
        self.tiles.index(x, y)
    }

    /// Index of the chart that a texel in use belongs to, below [`Atlas::charts`].
    ///
    /// # Panics
    ///
    /// If `texel` is not below [`Atlas::len`].
    #[must_use]
    pub fn chart(&self, texel: usize) -> u32 {
        self.triangles[self.owners[texel] as usize].chart
    }

    /// Texels in use of the same chart around one: the row above from left to right, its left and its right, the row below.
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

    /// Places of the corners of a triangle's front or back \[texels from the upper left corner of the atlas\]; `None` where it
    /// has none.
    #[must_use]
    pub fn triangle_places(&self, instance: u32, triangle: u32, front: bool) -> Option<[Vec2; 3]> {
        let placed = self.placed(instance, triangle, !front)?;
        let [left, top] = self.charts[placed.chart as usize];
        Some(placed.corners().map(|corner| corner + Vec2::new(left as f32, top as f32)))
    }

    /// One side of a triangle, if it has a chart.
    fn placed(&self, instance: u32, triangle: u32, back: bool) -> Option<&ChartTriangle> {
        let found = self.sheets.binary_search_by_key(&(instance, back), |sheet| (sheet.instance, sheet.back));
        let sheet = self.sheets[found.ok()?];
        let index = (triangle < sheet.count).then_some(sheet.first + triangle)?;
        Some(&self.triangles[index as usize]).filter(|placed| placed.chart != NONE)
    }
}
