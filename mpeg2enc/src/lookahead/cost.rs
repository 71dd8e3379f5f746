//! Costs of blocks in half-size pictures.

use crate::{
    kernel::{self, ReferenceBlock},
    motion::BlockPosition,
    predict::place_of,
    vector::HalfSample,
};
use plane::Plane;
use std::sync::Arc;

/// Width and height of a block in the half-size picture.
pub(super) const BLOCK: usize = 8;

/// Returns the sum of absolute differences between a block and the mean of two predictions, transformed or plain.
pub(super) fn mean_cost(
    source: &Plane<u8>,
    references: [&Plane<u8>; 2],
    block: BlockPosition,
    vectors: [HalfSample; 2],
    transformed: bool,
) -> u32 {
    let (x2, y2) = ((2 * BLOCK * block.column) as i32, (2 * BLOCK * block.row) as i32);
    let mut predicted = [[[0u8; BLOCK]; BLOCK]; 2];
    for s in 0..2 {
        let place = place_of(references[s], x2 + vectors[s].x, y2 + vectors[s].y);
        kernel::predict(&place, &mut predicted[s]);
    }
    let mut mean = [[0; BLOCK]; BLOCK];
    kernel::mean(predicted[0].as_flattened(), predicted[1].as_flattened(), mean.as_flattened_mut());
    difference(place_of(source, x2, y2), whole(&mean), transformed)
}

/// Returns the sum of absolute differences between two blocks, transformed or plain.
fn difference(source: ReferenceBlock, reference: ReferenceBlock, transformed: bool) -> u32 {
    if transformed {
        kernel::transformed_difference::<BLOCK>(source, reference)
    } else {
        kernel::absolute_difference::<BLOCK>(source, reference)
    }
}

/// Wraps a finished prediction as a reference block.
fn whole(block: &[[u8; BLOCK]; BLOCK]) -> ReferenceBlock<'_> {
    ReferenceBlock::whole(block.as_flattened(), BLOCK)
}

/// Returns, for each block, the sum of absolute differences from the block's mean. If `transformed` is set, the
/// differences are transformed first.
pub(super) fn intra_costs(half: &Plane<u8>, transformed: bool) -> Arc<[u32]> {
    let (columns, rows) = (half.width() / BLOCK, half.height() / BLOCK);
    (0..columns * rows)
        .map(|i| {
            let block = half.block(i % columns, i / columns);
            let sum: u32 = block.iter().map(|&sample| u32::from(sample)).sum();
            let mean = [[((sum + 32) / 64) as u8; BLOCK]; BLOCK];
            let source = ReferenceBlock::whole(&block, BLOCK);
            difference(source, whole(&mean), transformed)
        })
        .collect()
}

/// Averages 2×2 samples.
pub(super) fn halved(plane: &Plane<u8>) -> Plane<u8> {
    let (width, height) = (plane.width() / 2, plane.height() / 2);
    let mut half = Plane::filled(width, height, 0);
    for (y, row) in half.samples_mut().chunks_exact_mut(width).enumerate() {
        kernel::means_of_four(plane.row(2 * y), plane.row(2 * y + 1), row);
    }
    half
}
