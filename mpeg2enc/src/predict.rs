//! Half-sample motion compensation (7.6.4), and the samples of one macroblock.

use crate::{
    Picture,
    kernel::{self, ReferenceBlock},
    vector::HalfSample,
};
use plane::Plane;

/// The six blocks of a macroblock in coding order: four luma blocks, Cb, Cr (6.1.3), each in raster order.
pub(crate) type MacroblockSamples = [[u8; 64]; 6];

/// Returns the plane of a block of a macroblock, and the position of the block's upper left sample in the plane.
#[cfg(test)]
fn place(frame: &Picture, block: usize, column: usize, row: usize) -> (&Plane<u8>, usize, usize) {
    match block {
        0..4 => (frame.luma(), 16 * column + 8 * (block & 1), 16 * row + 8 * (block >> 1)),
        4 => (frame.cb(), 8 * column, 8 * row),
        _ => (frame.cr(), 8 * column, 8 * row),
    }
}

/// Returns the samples of macroblock `(column, row)` of a frame extended to whole macroblocks.
pub(crate) fn samples(frame: &Picture, column: usize, row: usize) -> MacroblockSamples {
    let mut out = [[0; 64]; 6];
    predict(frame, column, row, HalfSample::ZERO, &mut out);
    out
}

/// Reference pictures: the earlier and the later picture in display order.
pub(crate) type References<'a> = [Option<&'a Picture>; 2];

/// Averages two predictions, rounding up (7.6.7.1).
pub(crate) fn mean(a: &MacroblockSamples, b: &MacroblockSamples, out: &mut MacroblockSamples) {
    kernel::mean(a.as_flattened(), b.as_flattened(), out.as_flattened_mut());
}

/// Predicts macroblock `(column, row)` from `reference` with `vector`.
///
/// The chroma vector is half of `vector`, rounded toward zero (7.6.3.7).
pub(crate) fn predict(reference: &Picture, column: usize, row: usize, vector: HalfSample, out: &mut MacroblockSamples) {
    let chroma = HalfSample { x: vector.x / 2, y: vector.y / 2 };
    let (x2, y2) = (32 * column as i32 + vector.x, 32 * row as i32 + vector.y);
    kernel::predict_blocks(&place_of(reference.luma(), x2, y2), out.first_chunk_mut().expect("six blocks"));
    let (x2, y2) = (16 * column as i32 + chroma.x, 16 * row as i32 + chroma.y);
    for (plane, out) in [reference.cb(), reference.cr()].into_iter().zip(&mut out[4..]) {
        let rows: &mut [[u8; 8]; 8] = out.as_chunks_mut().0.try_into().expect("8 rows");
        kernel::predict(&place_of(plane, x2, y2), rows);
    }
}

/// Returns the source of a prediction with its upper left sample at `(x2, y2)` in half samples.
///
/// The plane must contain the rectangle and the neighbors that half positions need.
#[inline]
pub(crate) fn place_of(plane: &Plane<u8>, x2: i32, y2: i32) -> ReferenceBlock<'_> {
    let first = (y2 >> 1) as usize * plane.width() + (x2 >> 1) as usize;
    let half = (x2 & 1 == 1, y2 & 1 == 1);
    ReferenceBlock { half, ..ReferenceBlock::whole(&plane.samples()[first..], plane.width()) }
}

/// Returns the sum of squared differences of each block.
pub(crate) fn squared_errors(a: &MacroblockSamples, b: &MacroblockSamples) -> [u32; 6] {
    kernel::squared_differences(a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictions_follow_the_definition() {
        let plane = |scale: usize| Plane::from_fn(32 * scale, 32 * scale, |x, y| ((x * 37) ^ (y * 91)) as u8);
        let chroma = [21, 99].map(|pattern| plane(1).map(|s| s ^ pattern));
        let [cb, cr] = chroma;
        let frame = Picture::new(plane(2), cb, cr).unwrap();
        for vector in [(0, 0), (5, 0), (0, 7), (-9, 3), (3, -10), (-1, -1), (6, 8)] {
            let vector = HalfSample { x: vector.0, y: vector.1 };
            let mut predicted = [[0; 64]; 6];
            predict(&frame, 1, 2, vector, &mut predicted);
            for (block, samples) in predicted.iter().enumerate() {
                let (plane, x, y) = place(&frame, block, 1, 2);
                let v = if block < 4 { vector } else { HalfSample { x: vector.x / 2, y: vector.y / 2 } };
                for (i, &sample) in samples.iter().enumerate() {
                    // Compute the mean of the four nearest samples; at whole positions two or four of them coincide.
                    let (x2, y2) = (2 * (x + i % 8) as i32 + v.x, 2 * (y + i / 8) as i32 + v.y);
                    let at = |x2: i32, y2: i32| u32::from(plane.get((x2 >> 1) as usize, (y2 >> 1) as usize));
                    let sum = at(x2, y2) + at(x2 + 1, y2) + at(x2, y2 + 1) + at(x2 + 1, y2 + 1);
                    assert_eq!(u32::from(sample), (sum + 2) / 4, "{vector:?} block {block} sample {i}");
                }
            }
        }
    }
}
