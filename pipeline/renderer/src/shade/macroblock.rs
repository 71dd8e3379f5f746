//! Computation of frames by macroblock, on all threads and ranks.

use plane::Plane;
use render_core::ranks::{Assignment, Portable, Ranks, share_each};
use render_core::{MACROBLOCK, Timed};
use std::ops::Range;

/// Computes a frame from its macroblocks. `make(scratch, columns, rows)` returns the pixels of a macroblock in raster
/// order. `scratch` creates the memory of a thread. The `ranks` share the macroblocks in a fixed order.
pub(super) fn by_macroblock<S, T: Copy + Default + Send + Portable>(
    ranks: &dyn Ranks,
    width: usize,
    height: usize,
    scratch: impl Fn() -> S + Sync + Send,
    make: impl Fn(&mut S, Range<usize>, Range<usize>) -> Vec<T> + Sync,
) -> Timed<Plane<T>> {
    let across = width.div_ceil(MACROBLOCK);
    let area = |index: usize| {
        let (left, top) = (index % across * MACROBLOCK, index / across * MACROBLOCK);
        (left..width.min(left + MACROBLOCK), top..height.min(top + MACROBLOCK))
    };
    let block = |scratch: &mut S, index: usize| {
        let (columns, rows) = area(index);
        make(scratch, columns, rows)
    };
    // Assign macroblocks by diagonals: a rank with its own columns might get all pixels of one dark wall.
    let assignment = |index: usize| Assignment::InOrder((index % across + index / across) as u32);
    let assignments: Vec<Assignment> = (0..across * height.div_ceil(MACROBLOCK)).map(assignment).collect();

    // Copy the macroblocks into the frame.
    share_each(ranks, &assignments, 1, scratch, block).map(|blocks: Vec<Vec<T>>| {
        let mut picture = Plane::filled(width, height, T::default());
        for (index, pixels) in blocks.iter().enumerate() {
            let (columns, rows) = area(index);
            for (y, row) in rows.zip(pixels.chunks_exact(columns.len())) {
                picture.row_mut(y)[columns.clone()].copy_from_slice(row);
            }
        }
        picture
    })
}

/// Returns the positions (x, y) of a macroblock's pixels in raster order.
pub(super) fn places(columns: Range<usize>, rows: Range<usize>) -> impl Iterator<Item = (usize, usize)> {
    rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
}
