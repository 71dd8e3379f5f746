//! Rate of acknowledged pictures.

use std::collections::VecDeque;
use std::time::Duration;

/// Period over which the rate is measured.
const PERIOD: Duration = Duration::from_secs(1);
/// Maximum number of stored pictures.
const MOST: usize = 256;

/// Acknowledged pictures of the last second: time and bits.
#[derive(Clone, Debug, Default)]
pub(super) struct DeliveredBits(VecDeque<(Duration, u64)>);

impl DeliveredBits {
    /// Adds an acknowledged picture.
    pub fn add(&mut self, now: Duration, bits: u64) {
        self.0.push_back((now, bits));
        while self.0.len() > MOST || self.0.front().is_some_and(|(at, _)| now.saturating_sub(*at) > PERIOD) {
            self.0.pop_front();
        }
    }

    /// Returns the rate over the last second \[bits/s\].
    pub fn rate(&self, now: Duration) -> f64 {
        let is_recent = |at: Duration| now.saturating_sub(at) <= PERIOD;
        let bits: u64 = self.0.iter().filter(|(at, _)| is_recent(*at)).map(|(_, bits)| bits).sum();
        bits as f64 / PERIOD.as_secs_f64()
    }
}
