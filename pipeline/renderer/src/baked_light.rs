//! Baked light of a film: constant, or interpolated between key times.
//!
//! ```text
//! E(t) = (1 − w) E_k + w E_(k+1)        w = (t − t_k) / (t_(k+1) − t_k)        t_k ≤ t ≤ t_(k+1)
//! ```
//! Before the first key and after the last one, the light is constant, as animations are.

use crate::texels::BakedTexels;
use std::sync::Arc;

/// Light of a scene's static surfaces at one or more times.
#[derive(Clone, Debug, PartialEq)]
pub struct BakedLight {
    /// Key times \[s\], ascending.
    times: Vec<f32>,
    /// Light at each key time.
    keys: Vec<Arc<BakedTexels>>,
}

impl BakedLight {
    /// Creates the light that is `keys` at `times` \[s\]. `None` unless times are finite and ascending, and all keys
    /// have equal texels.
    #[must_use]
    pub fn new(times: Vec<f32>, keys: Vec<Arc<BakedTexels>>) -> Option<Self> {
        let first = keys.first()?;
        let are_equal = keys.iter().all(|key| {
            let [own, other] = [first, key].map(|key| [key.indirect.len(), key.direct.len(), key.is_reliable.len()]);
            own == other && key.normals.has_texels_of(&first.normals)
        });
        let are_ascending = times.iter().all(|time| time.is_finite()) && times.is_sorted_by(|a, b| a < b);
        (are_equal && are_ascending && times.len() == keys.len()).then_some(Self { times, keys })
    }

    /// Returns the key times \[s\], ascending.
    #[must_use]
    pub fn times(&self) -> &[f32] {
        &self.times
    }

    /// Returns whether the light is the same at all times.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.keys.len() == 1
    }

    /// Returns the light at each key time.
    #[must_use]
    pub fn keys(&self) -> &[Arc<BakedTexels>] {
        &self.keys
    }

    /// Returns the light at a `time` \[s\].
    #[must_use]
    pub fn at(&self, time: f32) -> Arc<BakedTexels> {
        // Find the keys before and after.
        let next = self.times.partition_point(|&key| key <= time);
        if next == 0 || next == self.times.len() {
            return self.keys[next.saturating_sub(1)].clone();
        }
        let (begin, end) = (self.times[next - 1], self.times[next]);
        let weight = (time - begin) / (end - begin);
        if weight == 0.0 {
            return self.keys[next - 1].clone();
        }
        Arc::new(self.keys[next - 1].mixed(&self.keys[next], weight))
    }
}

impl From<Arc<BakedTexels>> for BakedLight {
    fn from(texels: Arc<BakedTexels>) -> Self {
        Self { times: vec![0.0], keys: vec![texels] }
    }
}
