//! Normalization (S4): promotes maps with one outstanding location and suppresses maps with many similar locations.

use plane::Plane;

/// Number of local-maximum windows across a map, not from the paper. With windows of 3×3 samples every ripple would
/// count and lower m̄. A red item among 24 green items would then rank as low as 21st on 512×512 pixels.
const WINDOWS: usize = 8;
/// Smallest local maximum relative to M_max, not from the paper. It excludes rounding noise in flat areas.
const LEAST_MAXIMUM: f32 = 0.01;

/// Returns the largest value, or 0 if all values are negative.
pub fn largest_of(values: &[f32]) -> f32 {
    // Compute eight independent maxima, because sequential comparisons would wait for each other.
    let (groups, rest) = values.as_chunks::<8>();
    let mut largest = [0.0f32; 8];
    for group in groups {
        for (largest, &value) in largest.iter_mut().zip(group) {
            *largest = largest.max(value);
        }
    }
    largest.iter().chain(rest).copied().fold(0.0, f32::max)
}

/// Replaces a map M without negative values by N(M) = `M / max(M_max, f) · (1 − m̄ / M_max)²`.
pub fn promote(map: &mut Plane<f32>, f: f32) {
    let highest = largest_of(map.samples());
    if highest <= 0.0 {
        return;
    }
    let m = mean_of_others(&local_maxima(map, LEAST_MAXIMUM * highest), highest);
    let factor = (1.0 - m / highest).powi(2) / highest.max(f);
    map.samples_mut().iter_mut().for_each(|value| *value *= factor);
}

/// Returns m̄, the mean of `maxima` without one `highest` maximum. It is 0 if no other maximum exists.
fn mean_of_others(maxima: &[f32], highest: f32) -> f32 {
    let sum: f64 = maxima.iter().copied().map(f64::from).sum();
    match maxima.len() {
        0 | 1 => 0.0,
        count => ((sum - f64::from(highest)) / (count - 1) as f64) as f32,
    }
}

/// Returns the local maxima above `least`. A local maximum is the largest sample in the window around it, which is
/// clipped to the map. Of equal samples, only the first in raster order counts.
///
/// A tile of half a window is inside the window of each of its samples. Each tile therefore contains at most one local
/// maximum, and only its largest sample needs a window test.
fn local_maxima(map: &Plane<f32>, least: f32) -> Vec<f32> {
    let reach = [map.width(), map.height()].map(|side| (side / (2 * WINDOWS)).max(1));
    let tile = reach.map(|reach| reach + 1);
    let mut maxima = Vec::new();
    for top in (0..map.height()).step_by(tile[1]) {
        for left in (0..map.width()).step_by(tile[0]) {
            let candidate = largest(map, [left, top], tile);
            if candidate.value > least && is_largest(map, &candidate, reach) {
                maxima.push(candidate.value);
            }
        }
    }
    maxima
}

/// Value and position of a sample.
struct Candidate {
    x: usize,
    y: usize,
    value: f32,
}

/// Returns the largest sample of a tile. Of equal samples, it is the first in raster order.
fn largest(map: &Plane<f32>, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> Candidate {
    let mut found = Candidate { x: left, y: top, value: f32::NEG_INFINITY };
    for y in top..(top + height).min(map.height()) {
        for (x, &value) in map.row(y).iter().enumerate().skip(left).take(width) {
            if value > found.value {
                found = Candidate { x, y, value };
            }
        }
    }
    found
}

/// Returns whether the candidate is the largest sample of its window, and no earlier sample in raster order is equal.
fn is_largest(map: &Plane<f32>, candidate: &Candidate, [across, down]: [usize; 2]) -> bool {
    let &Candidate { x, y, value } = candidate;
    let columns = x.saturating_sub(across)..(x + across + 1).min(map.width());
    let rows = y.saturating_sub(down)..(y + down + 1).min(map.height());
    rows.into_iter().all(|row| {
        // Count the samples in this row before the candidate.
        let before = match row.cmp(&y) {
            std::cmp::Ordering::Less => columns.len(),
            std::cmp::Ordering::Equal => x - columns.start,
            std::cmp::Ordering::Greater => 0,
        };
        let (before, after) = map.row(row)[columns.clone()].split_at(before);
        // Of equal samples, only the first in raster order is a maximum.
        before.iter().all(|&other| other < value) && after.iter().all(|&other| other <= value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Returns the local maxima by comparing every sample with every sample of its window.
    fn by_definition(map: &Plane<f32>) -> Vec<f32> {
        let (width, height) = (map.width(), map.height());
        let reach = |side: usize| (side / 16).max(1);
        let is_maximum = |i: usize| {
            (0..width * height).filter(|&j| j != i).all(|j| {
                let inside =
                    (i % width).abs_diff(j % width) <= reach(width) && (i / width).abs_diff(j / width) <= reach(height);
                let (value, other) = (map.samples()[i], map.samples()[j]);
                !inside || other < value || other == value && j > i
            })
        };
        (0..width * height).filter(|&i| map.samples()[i] > 0.0 && is_maximum(i)).map(|i| map.samples()[i]).collect()
    }

    proptest! {
        #[test]
        fn saliency_maxima_are_those_of_the_definition(
            size in (1usize..70, 1usize..20), values in prop::collection::vec(0u8..8, 70 * 20),
        ) {
            let map = Plane::from_fn(size.0, size.1, |x, y| f32::from(values[y * size.0 + x]));
            let sorted = |mut maxima: Vec<f32>| {
                maxima.sort_by(f32::total_cmp);
                maxima
            };
            prop_assert_eq!(sorted(local_maxima(&map, 0.0)), sorted(by_definition(&map)));
        }
    }

    /// Returns a map with the given peaks; all other samples are zero.
    fn map(peaks: &[(usize, usize, f32)]) -> Plane<f32> {
        let mut map = Plane::filled(64, 64, 0.0);
        peaks.iter().for_each(|&(x, y, value)| map.set(x, y, value));
        map
    }

    #[test]
    fn saliency_promotes_one_peak_and_not_two() {
        let promoted = |peaks: &[(usize, usize, f32)], f| {
            let mut map = map(peaks);
            promote(&mut map, f);
            map.get(9, 9)
        };
        assert_eq!(promoted(&[(9, 9, 0.4)], 0.01), 1.0, "alone");
        assert_eq!(promoted(&[(9, 9, 0.4), (40, 50, 0.2)], 0.01), 0.25, "next to half as much");
        assert_eq!(promoted(&[(9, 9, 0.4), (40, 50, 0.4)], 0.01), 0.0, "beside as much");
        assert_eq!(promoted(&[(9, 9, 0.4), (10, 9, 0.4)], 0.01), 1.0, "a plateau is one maximum");
        assert_eq!(promoted(&[(9, 9, 0.004)], 0.016), 0.25, "below the floor");
        assert_eq!(promoted(&[], 0.01), 0.0);
    }
}
