//! Spatial order of points: neighbors in the list are neighbors in space.

use glam::Vec3A;

/// Bits per axis: 2¹⁰ positions across the bounding box.
const BITS: u32 = 10;

/// Returns the indices of `points` along the Morton curve, with ties ordered by index. Strata of the list are then
/// compact regions of the surface, regardless of the order in the file.
pub(super) fn along_curve(points: &[Vec3A]) -> Vec<usize> {
    // Quantise the points to integer positions in their bounding box.
    let low = points.iter().copied().fold(Vec3A::INFINITY, Vec3A::min);
    let high = points.iter().copied().fold(Vec3A::NEG_INFINITY, Vec3A::max);
    let scale = ((1 << BITS) - 1) as f32 / (high - low).max_element().max(f32::MIN_POSITIVE);
    let place = |point: Vec3A| ((point - low) * scale).to_array().map(|x| x as u32);

    // Interleave the bits of the three axes.
    let key = |index: usize| {
        let axes = place(points[index]);
        let bits = (0..BITS).rev().flat_map(|bit| axes.map(|axis| axis >> bit & 1));
        bits.fold(0u32, |key, bit| key << 1 | bit)
    };
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by_cached_key(|&index| key(index));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbors_in_the_list_are_near() {
        // Build a grid in scrambled order: 7919 and 4096 are coprime.
        let points: Vec<Vec3A> = (0..4096).map(|i| i * 7919 % 4096).map(grid).collect();
        let order = along_curve(&points);
        let mean = order.windows(2).map(|pair| points[pair[0]].distance(points[pair[1]])).sum::<f32>() / 4095.0;
        assert!(mean < 2.0, "{mean} steps of the grid");
    }

    fn grid(i: usize) -> Vec3A {
        Vec3A::new((i % 16) as f32, (i / 16 % 16) as f32, (i / 256) as f32)
    }
}
