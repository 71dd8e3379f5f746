//! Pictures made macroblock by macroblock, on all threads.

use glam::Vec3;
use plane::Plane;
use rayon::prelude::*;
use render_core::{Busy, MACROBLOCK};

/// A picture whose pixels are `make(scratch, x, y)`; adds the work to `busy`. `scratch` makes memory for a thread.
pub(super) fn by_macroblock<S>(
    width: usize,
    height: usize,
    busy: &Busy,
    scratch: impl Fn() -> S + Sync + Send,
    make: impl Fn(&mut S, usize, usize) -> Vec3 + Sync,
) -> Plane<Vec3> {
    let across = width.div_ceil(MACROBLOCK);
    let area = |index: usize| {
        let (left, top) = (index % across * MACROBLOCK, index / across * MACROBLOCK);
        (left..width.min(left + MACROBLOCK), top..height.min(top + MACROBLOCK))
    };
    let blocks: Vec<Vec<Vec3>> = (0..across * height.div_ceil(MACROBLOCK))
        .into_par_iter()
        .map_init(scratch, |scratch, index| {
            let (columns, rows) = area(index);
            let places = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            busy.measure(|| places.map(|(x, y)| make(scratch, x, y)).collect())
        })
        .collect();
    let mut picture = Plane::filled(width, height, Vec3::ZERO);
    for (index, pixels) in blocks.iter().enumerate() {
        let (columns, rows) = area(index);
        for (y, row) in rows.zip(pixels.chunks_exact(columns.len())) {
            picture.row_mut(y)[columns.clone()].copy_from_slice(row);
        }
    }
    picture
}
