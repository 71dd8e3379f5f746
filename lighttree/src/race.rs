//! Draw of representatives by a race between the lights.
//!
//! Light k arrives at the time e_k / Y_k. e_k is exponentially distributed and depends only on the seed and k. Y_k is
//! the light's luminance. In any set of lights, light k arrives first with probability Y_k / ΣY, independent of the
//! arrival time. The paper draws representatives with the same probability. The first light of a cluster is the first
//! light of one of its children.
//!
//! A representative therefore depends only on the lights of the cluster, not on the rest of the tree. It stays the same
//! when a tree is rebuilt, and changes with intensities only as often as necessary.

use crate::light::{Light, luminance};

/// Luminance that replaces zero for dark lights \[W·sr⁻¹\]. Dark lights are drawn with equal probability among
/// themselves and lose to any other light.
const DARK: f64 = 1e-300;
/// Constant that separates the random numbers of the second race from the first race.
const SECOND_RACE: u64 = 0x6a09_e667_f3bc_c908;

/// Returns the arrival time of each light \[sr·W⁻¹\].
pub(crate) fn arrivals(seed: u64, lights: &[Light]) -> Vec<f64> {
    (0u64..).zip(lights).map(|(k, light)| arrival(seed, k, luminance(light.intensity))).collect()
}

fn arrival(seed: u64, light: u64, luminance: f32) -> f64 {
    -uniform(seed, light).ln() / f64::from(luminance).max(DARK)
}

/// Returns a light's random number in the [second race](crate::cut), between the halves of a cluster. The shadow ray is
/// traced to the winner. The number is exponentially distributed and independent of [`arrivals`].
pub(crate) fn delay(seed: u64, light: u64) -> f32 {
    -uniform(seed ^ SECOND_RACE, light).ln() as f32
}

/// Returns a number in the open interval (0, 1) that depends only on the seed and a counter (the finalizer of
/// SplitMix64).
pub(crate) fn uniform(seed: u64, counter: u64) -> f64 {
    let mut z = seed.wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}
