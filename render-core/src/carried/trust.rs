//! How far estimated errors of carried light can be trusted, by what audits find.
//!
//! The estimate comes from the samples around a pixel, and knows nothing of light that changes between them. It is also far too
//! high where light only might change. So audits are kept by the share of the tolerance that was estimated, and
//!
//! ```text
//! m_k = mean of (|L − L_lit| / tolerance)²      of the audits whose estimate is in bucket k
//! carried is up to the first bucket with m_k > allowed
//! ```
//!
//! Audits go on beyond that limit, so that it can rise again. Estimates of several tolerances are carried where audits find
//! that they are too high.

/// Octaves of the estimate by the tolerance that are told apart, and how many of them are above 1.
const BUCKETS: usize = 11;
const ABOVE: usize = 3;
/// Largest estimate that audits are kept of, in tolerances.
pub(super) const LARGEST: f32 = (1 << ABOVE) as f32;
/// Square of an error that counts at most: one outlier of a hundred audits may close a bucket, one of a thousand may not.
const MOST: f32 = 64.0;
/// Audits of a bucket that say something.
const ENOUGH: f32 = 32.0;
/// Factor on the weight of an audit from one frame to the next: half of it is left after seven frames.
const MEMORY: f32 = 0.9;
/// Buckets that are carried before audits say something: estimates up to a quarter of the tolerance.
const FIRST: usize = BUCKETS - ABOVE - 2;

/// Audits of the light of one kind.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Trust {
    /// Weights of the audits, and sums of the weighted squares.
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
    /// Largest estimate that is carried, in tolerances: [`LARGEST`] at most. `allowed` is the mean square of the errors, in
    /// squares of the tolerance, up to which light of a bucket is carried.
    pub fn limit(&self, allowed: f32) -> f32 {
        let is_bad = |found: &Audited| found.weight >= ENOUGH && found.squares > allowed * found.weight;
        // Up to the first that fails, and no farther than audits reach.
        let good = self.found.iter().position(is_bad).unwrap_or(BUCKETS);
        let known = self.found.iter().rposition(|found| found.weight >= ENOUGH).map_or(0, |last| last + 1);
        let buckets = good.min(known.max(FIRST));
        if buckets == 0 { 0.0 } else { upper_end(buckets - 1) }
    }

    /// A frame has passed.
    pub fn forget(&mut self) {
        for Audited { weight, squares } in &mut self.found {
            (*weight, *squares) = (MEMORY * *weight, MEMORY * *squares);
        }
    }

    /// Takes in an audit: estimate and error, as shares of the tolerance.
    pub fn note(&mut self, estimate: f32, error: f32) {
        let Audited { weight, squares } = &mut self.found[bucket(estimate)];
        let square = (error * error).min(MOST);
        // 0/0 is no error.
        *squares += if square.is_nan() { 0.0 } else { square };
        *weight += 1.0;
    }
}

/// The bucket of an estimate up to [`LARGEST`].
fn bucket(estimate: f32) -> usize {
    let place = (BUCKETS - ABOVE) as f32 + estimate.log2().ceil() - 1.0;
    // NaN, 0/0, counts as none.
    (place.max(0.0) as usize).min(BUCKETS - 1)
}

fn upper_end(bucket: usize) -> f32 {
    (bucket as f32 + 1.0 - (BUCKETS - ABOVE) as f32).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Allowed in these tests.
    const QUARTER: f32 = 0.25;

    /// A film of 40 frames, 275 audits each, spread over all estimates; `error(estimate, k)` is what audit k finds.
    fn limit_after(error: impl Fn(f32, usize) -> f32) -> f32 {
        let mut trust = Trust::default();
        for _ in 0..40 {
            trust.forget();
            for k in 0..275 {
                // Evenly by octaves, from 8 to 1/256.
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
        // The mean square over an octave up to x is 0.54 x²: at 0.25 for x = 0.68.
        assert_eq!(limit_after(|estimate, _| estimate), 0.5);
        assert_eq!(limit_after(|estimate, _| 4.0 * estimate), 0.125);
        assert_eq!(limit_after(|estimate, _| estimate / 8.0), 4.0, "estimates that are too high");
        assert_eq!(limit_after(|_, _| 1.0), 0.0);
    }

    #[test]
    fn few_large_errors_close_a_bucket_and_none_open_it_again() {
        // Four of a hundred, by five tolerances: a mean square of 1.
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
