//! Texels that bilinear samples on a triangle may read.
//!
//! A sample reads the four texels with centers around its position. A sample may therefore read a texel if the triangle
//! intersects a square around the texel's center with sides of two texels.

use glam::Vec2;

/// Enlargement of the squares on each side \[texels\]. It far exceeds the rounding errors of positions.
const SLACK: f32 = 1.0 / 64.0;

/// Extent of a chart with one column or row on that axis \[texels\]. All its points are at the center of the texel for
/// bilinear samples, but remain different points.
const LINE: f32 = 5e-4;

/// Rectangle of texels for a chart.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChartRect {
    pub columns: u32,
    pub rows: u32,
    /// Number of texels per meter on each axis.
    density: Vec2,
    /// Position of the chart's corner in the rectangle \[texels\].
    start: Vec2,
}

impl ChartRect {
    /// Returns the rectangle for a chart of `size` \[m\] at a `density` \[texels/m\].
    ///
    /// On each axis, a chart of width w is stretched until its edges are at texel centers. Lengths are in texels at the
    /// given density:
    ///
    /// ```text
    /// n = ⌊w + ½⌋ + 1                 one column for a chart narrower than half a texel
    /// density' = (n − 1) / w          two thirds to twice the density, or almost 0 for one column
    /// ```
    ///
    /// Every texel of a rectangular chart then has its center on the chart. Without stretching, a chart would need one
    /// more column, and most charts of `nave` are narrower than a texel.
    pub fn new(size: Vec2, density: f32) -> Self {
        let steps = (size * density + 0.5).floor();
        // Center a single column or row on its texel, so that the texel's sites are in the middle of a narrow chart.
        let is_line = steps.cmplt(Vec2::ONE);
        let extent = Vec2::select(is_line, Vec2::splat(LINE), steps);
        Self {
            columns: steps.x as u32 + 1,
            rows: steps.y as u32 + 1,
            density: extent / size.max(Vec2::splat(f32::MIN_POSITIVE)),
            start: Vec2::select(is_line, Vec2::splat(0.5 - LINE / 2.0), Vec2::splat(0.5)),
        }
    }

    /// Returns whether the chart is narrower than two texels after stretching.
    pub fn is_narrow(&self) -> bool {
        self.columns.min(self.rows) <= 2
    }

    /// Returns the position of a point of the chart, in texels from the corner of the rectangle.
    pub fn place(&self, point: Vec2) -> Vec2 {
        point * self.density + self.start
    }

    /// Calls `row(y, first, last)` for each row of texels that samples of a triangle may read.
    pub fn rows_of(&self, corners: [Vec2; 3], mut row: impl FnMut(u32, u32, u32)) {
        let [a, b, c] = corners;
        let (first, last) = texels(a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y), self.rows);
        for y in first..=last {
            let (low, high) = (y as f32 - 0.5 - SLACK, y as f32 + 1.5 + SLACK);
            if let Some((left, right)) = extent(corners, low, high) {
                let (first, last) = texels(left, right, self.columns);
                row(y, first, last);
            }
        }
    }
}

/// Returns the indices of the first and last texel along an axis with squares that overlap the interval from `low` to
/// `high`. The axis has `count` texels.
fn texels(low: f32, high: f32, count: u32) -> (u32, u32) {
    let last = count - 1;
    let first = (low - 1.5 - SLACK).ceil().max(0.0) as u32;
    (first.min(last), ((high + 0.5 + SLACK).floor().max(0.0) as u32).min(last))
}

/// Returns the minimum and maximum x of a triangle between y = `low` and `high`, or `None` if the triangle is outside.
pub(super) fn extent(corners: [Vec2; 3], low: f32, high: f32) -> Option<(f32, f32)> {
    let mut extent = (f32::INFINITY, f32::NEG_INFINITY);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        // Skip edges outside the interval.
        if a.y.max(b.y) < low || a.y.min(b.y) > high {
            continue;
        }
        // Clip the edge to the interval.
        let way = b - a;
        let at = |y: f32| if way.y == 0.0 { 0.0 } else { ((y - a.y) / way.y).clamp(0.0, 1.0) };
        let (mut from, mut to) = (at(low), at(high));
        if way.y == 0.0 {
            (from, to) = (0.0, 1.0);
        }
        for x in [a.x + way.x * from, a.x + way.x * to] {
            extent = (extent.0.min(x), extent.1.max(x));
        }
    }
    (extent.0 <= extent.1).then_some(extent)
}

/// Bit per texel of a rectangle. The memory is reused for all charts.
#[derive(Default)]
pub(super) struct Bits(Vec<u64>);

impl Bits {
    /// Returns the number of texels of `frame` that samples of the `triangles` may read.
    pub fn count(&mut self, frame: &ChartRect, triangles: impl Iterator<Item = [Vec2; 3]>) -> usize {
        // Allocate one bit per texel, with rows padded to whole words.
        let words = frame.columns.div_ceil(64) as usize;
        self.0.clear();
        self.0.resize(words * frame.rows as usize, 0);
        for corners in triangles {
            frame.rows_of(corners, |y, first, last| {
                let row = &mut self.0[words * y as usize..][..words];
                for word in first / 64..=last / 64 {
                    // Set the bits from `first` to `last` in this word.
                    let from = first.max(word * 64) - word * 64;
                    let to = last.min(word * 64 + 63) - word * 64;
                    row[word as usize] |= u64::MAX << from & u64::MAX >> (63 - to);
                }
            });
        }
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }
}
