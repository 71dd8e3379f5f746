//! How representatives are drawn: a race of the lights.
//!
//! Light k arrives at the time e_k / Y_k, where e_k is exponentially distributed, a function of seed and k alone, and
//! Y_k is the light's luminance. Of any set of lights each is the first with probability Y_k / ΣY, and which it is says
//! nothing about when: these are the paper's draws. The first of a cluster is the first of one of its children.
//!
//! Drawn like this, a representative depends on the lights of the cluster and not on the tree around it: it stays when
//! a tree is built anew, and changes with intensities only as much as it has to.

use crate::light::{Light, luminance};

/// Weight of dark lights \[W·sr⁻¹\]: among themselves they are drawn alike, and against any other they lose.
const DARK: f64 = 1e-300;
/// Keeps the numbers of the second race apart from those of the first.
const SECOND_RACE: u64 = 0x6a09_e667_f3bc_c908;

/// When each light arrives \[sr·W⁻¹\].
pub(crate) fn arrivals(seed: u64, lights: &[Light]) -> Vec<f64> {
    (0u64..).zip(lights).map(|(k, light)| arrival(seed, k, luminance(light.intensity))).collect()
}

fn arrival(seed: u64, light: u64, luminance: f32) -> f64 {
    -uniform(seed, light).ln() / f64::from(luminance).max(DARK)
}

/// A light's number in the [second race](crate::cut), of the halves of a cluster: the winner gets the shadow ray.
/// Exponentially distributed, and independent of [`arrivals`].
pub(crate) fn delay(seed: u64, light: u64) -> f32 {
    -uniform(seed ^ SECOND_RACE, light).ln() as f32
}

/// A number between 0 and 1, both excluded, that depends on seed and counter alone (the finalizer of SplitMix64).
pub(crate) fn uniform(seed: u64, counter: u64) -> f64 {
    let mut z = seed.wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}
