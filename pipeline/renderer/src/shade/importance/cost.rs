//! Cost map: predicted computation of indirect light, from the previous frame.
//!
//! ```text
//! C = c / max c        c  clusters of the lightcuts in a macroblock of the previous frame
//! ```
//! Lightcuts of records or pixels are large where light varies, and records are dense at fine geometry. The prediction
//! ignores motion, which is usually smaller than a macroblock.

use plane::Plane;
use render_core::MACROBLOCK;

/// Returns C of every pixel, 0…1. `sizes` contains the sizes of the lightcuts at each of `width` × `height` pixels.
pub(super) fn cost_map(sizes: &[f32], width: usize, height: usize) -> Plane<f32> {
    // Sum the clusters of each macroblock; those at the right and bottom may be incomplete.
    let columns = width.div_ceil(MACROBLOCK);
    let macroblock = |x: usize, y: usize| y / MACROBLOCK * columns + x / MACROBLOCK;
    let mut clusters = vec![0.0f32; columns * height.div_ceil(MACROBLOCK)];
    for (index, size) in sizes.iter().enumerate() {
        clusters[macroblock(index % width, index / width)] += size;
    }
    let most = clusters.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    Plane::from_fn(width, height, |x, y| clusters[macroblock(x, y)] / most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn macroblocks_have_their_share_of_the_largest() {
        // Two macroblocks in a row, the second one incomplete.
        let mut sizes = vec![0.0; 20 * 16];
        (sizes[3], sizes[20 * 15], sizes[19]) = (30.0, 50.0, 20.0);
        let map = cost_map(&sizes, 20, 16);
        assert_eq!((map.get(0, 0), map.get(15, 15), map.get(16, 8)), (1.0, 1.0, 0.25));
        assert!(cost_map(&[0.0; 4], 2, 2).samples().iter().all(|&cost| cost == 0.0));
    }
}
