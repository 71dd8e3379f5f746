//! Pictures made macroblock by macroblock, on all threads.

use plane::Plane;
use rayon::prelude::*;
use render_core::{Busy, MACROBLOCK};
use std::ops::Range;

/// A picture whose macroblocks are `make(scratch, columns, rows)`, in raster order; adds the work to `busy`. `scratch`
/// makes memory for a thread.
pub(super) fn by_macroblock<S, T: Copy + Default + Send>(
    (width, height): (usize, usize),
    busy: &Busy,
    scratch: impl Fn() -> S + Sync + Send,
    make: impl Fn(&mut S, Range<usize>, Range<usize>) -> Vec<T> + Sync,
) -> Plane<T> {
    let across = width.div_ceil(MACROBLOCK);
    let area = |index: usize| {
        let (left, top) = (index % across * MACROBLOCK, index / across * MACROBLOCK);
        (left..width.min(left + MACROBLOCK), top..height.min(top + MACROBLOCK))
    };
    let blocks: Vec<Vec<T>> = (0..across * height.div_ceil(MACROBLOCK))
        .into_par_iter()
        .map_init(scratch, |scratch, index| {
            let (columns, rows) = area(index);
            busy.measure(|| make(scratch, columns, rows))
        })
        .collect();
    let mut picture = Plane::filled(width, height, T::default());
    for (index, pixels) in blocks.iter().enumerate() {
        let (columns, rows) = area(index);
        for (y, row) in rows.zip(pixels.chunks_exact(columns.len())) {
            picture.row_mut(y)[columns.clone()].copy_from_slice(row);
        }
    }
    picture
}

/// The places of a macroblock in raster order.
pub(super) fn places(columns: Range<usize>, rows: Range<usize>) -> impl Iterator<Item = (usize, usize)> {
    rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
}
