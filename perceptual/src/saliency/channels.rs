//! Center-surround differences (S3), and their sums at one level (S5), (S6).

use super::gabor::orientations;
use super::normalize::promote;
use super::pyramid::{CENTERS, DELTAS, Pyramid, enlarged, halved};
use plane::Plane;

/// Floor f of a channel, the smallest divisor M_max. It is the maximum of a single map with one outstanding location. A
/// channel of suppressed maps therefore stays suppressed. The floor is not in the paper.
const CHANNEL_FLOOR: f32 = 1.0;

/// Computes Σ_F of a feature according to (S3) to (S5). f is the floor of the feature's maps.
fn feature_map(feature: &Pyramid, f: f32) -> Plane<f32> {
    let mut sum = Plane::default();
    for c in CENTERS {
        // Start from the sum over finer centers, reduced to the level of this center.
        let Some(center) = feature.level(c) else { break };
        sum = if c == CENTERS[0] { Plane::filled(center.width(), center.height(), 0.0) } else { halved(&sum) };
        for delta in DELTAS {
            // Small pictures have no coarse surrounds.
            let Some(surround) = feature.level(c + delta) else { continue };
            let mut map = difference(center, surround, delta);
            promote(&mut map, f);
            add(&mut sum, &map);
        }
    }
    sum
}

/// Computes N(Ī), N(C̄) or N(Ū) of (S6): the promoted sum over `features`. f is the floor of their maps.
pub fn channel(features: &[Pyramid], f: f32) -> Plane<f32> {
    let mut sum = sum_of(features.iter().map(|feature| feature_map(feature, f)));
    promote(&mut sum, CHANNEL_FLOOR);
    sum
}

/// Computes N(Ō) of (S6). f is the floor of its maps. Each direction is first promoted separately.
pub fn orientation_channel(intensity: &Pyramid, f: f32) -> Plane<f32> {
    let directions = intensity.map(orientations);
    let mut sum = sum_of(directions.iter().map(|o| channel(std::slice::from_ref(o), f)));
    promote(&mut sum, CHANNEL_FLOOR);
    sum
}

/// Adds maps of the same size, sample by sample.
pub fn sum_of(maps: impl Iterator<Item = Plane<f32>>) -> Plane<f32> {
    let add_to = |mut sum, map| {
        add(&mut sum, &map);
        sum
    };
    maps.reduce(add_to).unwrap_or_default()
}

/// Computes |F_c − F_s| of (S3).
fn difference(center: &Plane<f32>, surround: &Plane<f32>, levels: usize) -> Plane<f32> {
    let mut map = enlarged(surround, levels, center.width(), center.height());
    for (map, &center) in map.samples_mut().iter_mut().zip(center.samples()) {
        *map = (center - *map).abs();
    }
    map
}

/// Adds `map` to `sum`, sample by sample.
fn add(sum: &mut Plane<f32>, map: &Plane<f32>) {
    for (sum, &value) in sum.samples_mut().iter_mut().zip(map.samples()) {
        *sum += value;
    }
}
