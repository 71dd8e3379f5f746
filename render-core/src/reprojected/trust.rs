//! Reliability of the estimated errors of reprojected light, measured by audits.
//!
//! The estimate is based on the samples around a pixel and ignores changes of light between the samples. The estimate
//! is far too high if light might change but does not. Audit results are therefore stored in buckets by the ratio of
//! estimate to tolerance:
//!
//! ```text
//! m_k = mean of (|L − L_lit| / tolerance)²      over the audits with an estimate in bucket k
//! light is reused below the first bucket with m_k > allowed
//! ```
//!
//! Audits continue beyond this limit, so that the limit can rise again. Estimates of several tolerances are accepted if
//! audits show that these estimates are too high.

/// Number of buckets. Each bucket covers one octave of the ratio of estimate to tolerance.
const BUCKETS: usize = 11;
/// Number of buckets for estimates above the tolerance.
const ABOVE: usize = 3;
/// Maximum estimate with audit statistics, in tolerances.
pub(super) const LARGEST: f32 = (1 << ABOVE) as f32;
/// Maximum square of an error, in squares of the tolerance. One outlier in a hundred audits may close a bucket, but not
/// one in a thousand.
const MOST: f32 = 64.0;
/// Minimum total weight of a bucket's audits for a decision.
const ENOUGH: f32 = 32.0;
/// Factor on the weight of an audit per frame. Half of the weight remains after seven frames.
const MEMORY: f32 = 0.9;
/// Number of open buckets before the first audits. These contain estimates up to a quarter of the tolerance.
const FIRST: usize = BUCKETS - ABOVE - 2;

/// Audit statistics by bucket.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Trust {
    /// Weights and weighted squared errors of the audits, by bucket.
    found: [Audited; BUCKETS],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Audited {
    weight: f32,
    squares: f32,
}

impl Default for Trust {
    fn default() -> Self {
        Self { found: [Audited::default(); BUCKETS] }
    }
}

impl Trust {
    /// Returns the maximum estimate that is accepted, in tolerances, at most [`LARGEST`]. `allowed` is the maximum mean
    /// square error of a bucket, in squares of the tolerance.
    pub fn limit(&self, allowed: f32) -> f32 {
        let is_bad = |found: &Audited| found.weight >= ENOUGH && found.squares > allowed * found.weight;
        // Accept the buckets below the first bucket that fails, up to the last bucket with enough audits.
        let good = self.found.iter().position(is_bad).unwrap_or(BUCKETS);
        let known = self.found.iter().rposition(|found| found.weight >= ENOUGH).map_or(0, |last| last + 1);
        let buckets = good.min(known.max(FIRST));
        if buckets == 0 { 0.0 } else { upper_end(buckets - 1) }
    }

    /// Reduces the weights after a frame.
    pub fn forget(&mut self) {
        for Audited { weight, squares } in &mut self.found {
            (*weight, *squares) = (MEMORY * *weight, MEMORY * *squares);
        }
    }

    /// Adds an audit with this `estimate` and `error`, both relative to the tolerance.
    pub fn note(&mut self, estimate: f32, error: f32) {
        let Audited { weight, squares } = &mut self.found[bucket(estimate)];
        let square = (error * error).min(MOST);
        // Count 0/0 as no error.
        *squares += if square.is_nan() { 0.0 } else { square };
        *weight += 1.0;
    }
}

/// Returns the bucket of an `estimate` up to [`LARGEST`].
fn bucket(estimate: f32) -> usize {
    let place = (BUCKETS - ABOVE) as f32 + estimate.log2().ceil() - 1.0;
    // Put NaN (0/0) in bucket 0.
    (place.max(0.0) as usize).min(BUCKETS - 1)
}

fn upper_end(bucket: usize) -> f32 {
    (bucket as f32 + 1.0 - (BUCKETS - ABOVE) as f32).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean square error that these tests allow.
    const QUARTER: f32 = 0.25;

    /// Returns the limit after a film of 40 frames with 275 audits each, over all estimates. `error(estimate, k)` is
    /// the error in audit k.
    fn limit_after(error: impl Fn(f32, usize) -> f32) -> f32 {
        let mut trust = Trust::default();
        for _ in 0..40 {
            trust.forget();
            for k in 0..275 {
                // Space the estimates evenly in octaves, from 8 to 1/256.
                let estimate = LARGEST * (-11.0 * (k as f32 + 0.5) / 275.0).exp2();
                trust.note(estimate, error(estimate, k));
            }
        }
        trust.limit(QUARTER)
    }

    #[test]
    fn light_is_carried_up_to_the_estimates_that_hold() {
        assert_eq!(Trust::default().limit(QUARTER), 0.25, "before the first audit");
        assert_eq!(limit_after(|_, _| 0.0), 8.0);
        // The mean square over an octave up to x is 0.54 x², which is 0.25 for x = 0.68.
        assert_eq!(limit_after(|estimate, _| estimate), 0.5);
        assert_eq!(limit_after(|estimate, _| 4.0 * estimate), 0.125);
        assert_eq!(limit_after(|estimate, _| estimate / 8.0), 4.0, "estimates that are too high");
        assert_eq!(limit_after(|_, _| 1.0), 0.0);
    }

    #[test]
    fn few_large_errors_close_a_bucket_and_none_open_it_again() {
        // Four in a hundred audits have errors of five tolerances, which is a mean square of 1.
        let outliers = |estimate: f32, k: usize| if estimate > 0.125 && k.is_multiple_of(25) { 5.0 } else { 0.0 };
        assert_eq!(limit_after(outliers), 0.125);
        let mut trust = Trust::default();
        (0..200).for_each(|_| trust.note(0.9, 10.0));
        assert_eq!(trust.limit(QUARTER), 0.5);
        assert_eq!(trust.limit(MOST), 1.0, "no farther than audits reach");
        for _ in 0..80 {
            trust.forget();
            (0..20).for_each(|_| trust.note(0.9, 0.1));
        }
        assert_eq!(trust.limit(QUARTER), 1.0);
    }

    #[test]
    fn errors_without_bounds_leave_numbers() {
        let mut trust = Trust::default();
        for error in [f32::NAN, f32::INFINITY, 1e30, 0.0] {
            (0..100).for_each(|_| trust.note(f32::NAN, error));
        }
        assert_eq!(trust.limit(QUARTER), 0.0);
        let fresh = Trust::default();
        assert_eq!([0.0, 0.5, 0.51, 1.0, 8.0].map(bucket), [0, 6, 7, 7, BUCKETS - 1]);
        assert!(fresh.found.iter().all(|found| found.weight == 0.0));
    }
}
