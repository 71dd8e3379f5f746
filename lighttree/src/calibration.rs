//! Calibrated stopping: the ratio of bounds to thresholds, learned from measured errors. The method is not from any
//! paper.
//!
//! The bound of a lightcut holds for each of its clusters. The error of a pixel is the sum of the clusters' errors.
//! Errors add up where clusters are many and cancel where clusters are few, so the bound alone does not predict the
//! error. Therefore some pixels are *audited*: a second lightcut with a much finer threshold measures the error.
//!
//! ```text
//! a lightcut ends when no cluster's bound exceeds λ ΔY
//! r = |L − L_fine| / ΔY            error of an audited pixel; L, L_fine: luminance of the two lightcuts
//! λ ← λ · (AIM / q)^DAMPING        q: quantile of r, 95 % by default; step and λ are clamped
//! ```
//!
//! Each octave of ΔY / Y, the ratio of threshold to luminance, has its own λ. Lightcut size and error depend on this
//! ratio: at 2 % of the luminance lightcuts have hundreds of clusters, above one half they have about six. The first
//! audits of an octave may lower λ by any factor, because its initial value is a guess. A film begins at 2 %. Until the
//! first step of an octave, its λ is therefore at most the λ of the next finer octave.
//!
//! Audits are counted in integer buckets. Their sum does not depend on the order, so λ does not depend on the number of
//! threads.

use std::sync::atomic::{AtomicU32, Ordering};

/// Number of octaves of ΔY / Y.
const CLASSES: usize = 6;
const FIRST: f32 = 0.02;
/// Initial λ. With 0.4, lightcuts of `cornell` at 2 % leave one pixel in twenty outside its threshold.
const START: f32 = 0.4;
const LEAST: f32 = 1.0 / 16.0;
const MOST: f32 = 16.0;
/// Target for the quantile of the errors \[thresholds\]. The quantile of a few dozen numbers is uncertain by about a
/// tenth.
const AIM: f32 = 0.9;
/// Exponent of a step. With less than 1, λ follows an outlier of the quantile only partially.
const DAMPING: f32 = 0.7;
const LARGEST_STEP: f32 = 1.6;
/// Mean number of audits beyond the quantile that a step requires. For a quantile of 95 %, 2.4 require 48 audits.
const ENOUGH_BEYOND: f64 = 2.4;
/// Threshold of an audit's lightcut, relative to the pixel's threshold. The lightcut's own error is then below the
/// measurable tenth.
const FINE: f32 = 0.1;

/// Number of buckets of r: eighths of an octave from 2⁻⁸ to 2⁸. The end buckets include all values beyond.
const BUCKETS: usize = 128;
const BUCKETS_TO_AN_OCTAVE: f32 = 8.0;

/// λ of every class of thresholds, learned from frame to frame.
///
/// ```
/// use lighttree::{Audits, Calibration};
///
/// let mut calibration = Calibration::default();
/// let class = Calibration::class(0.1, 1.0); // thresholds of a tenth of the luminance
/// for _frame in 0..20 {
///     let audits = Audits::default();
///     for k in 0..100 {
///         // A lightcut that ends at λ thresholds errs by 0 … 3 λ. Measure real errors with `Calibration::fine`.
///         audits.note(class, 3.0 * calibration.lambda(class) * k as f32 / 100.0);
///     }
///     calibration.learn(&audits);
/// }
/// assert!((2.6..3.1).contains(&(0.9 / calibration.lambda(class))));
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Calibration {
    share: f64,
    lambdas: [f32; CLASSES],
    /// Whether the class has taken a step.
    learned: [bool; CLASSES],
    /// Counts of the audits since the last step.
    pending: [Counts; CLASSES],
}

/// Number of audits per bucket of the error.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(into = "Vec<u32>", try_from = "Vec<u32>")
)]
struct Counts([u32; BUCKETS]);

#[cfg(feature = "serde")]
impl From<Counts> for Vec<u32> {
    fn from(counts: Counts) -> Self {
        counts.0.to_vec()
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Vec<u32>> for Counts {
    type Error = String;

    fn try_from(counts: Vec<u32>) -> Result<Self, String> {
        counts.try_into().map(Self).map_err(|counts: Vec<u32>| format!("{} buckets", counts.len()))
    }
}

/// Errors measured by the audits of a frame. Threads may add errors concurrently.
#[derive(Debug)]
pub struct Audits([[AtomicU32; BUCKETS]; CLASSES]);

impl Default for Calibration {
    fn default() -> Self {
        Self::keeping(Self::DEFAULT_SHARE)
    }
}

impl Default for Audits {
    fn default() -> Self {
        Self(std::array::from_fn(|_| std::array::from_fn(|_| AtomicU32::new(0))))
    }
}

/// Summary of the audits of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Learned {
    /// The 95 % quantile of the errors \[thresholds\].
    pub error_p95: f64,
    /// Mean of λ over the audits.
    pub lambda: f64,
}

impl Audits {
    /// Records the error of an audit in this class \[thresholds\].
    pub fn note(&self, class: usize, ratio: f32) {
        self.0[class][bucket(ratio)].fetch_add(1, Ordering::Relaxed);
    }

    /// Adds the audits of another region of the frame.
    pub fn add(&self, other: &Self) {
        for (sums, counts) in self.0.iter().zip(&other.0) {
            for (sum, count) in sums.iter().zip(counts) {
                sum.fetch_add(count.load(Ordering::Relaxed), Ordering::Relaxed);
            }
        }
    }

    /// Returns all counts, to send them to another process.
    #[must_use]
    pub fn numbers(&self) -> Vec<u32> {
        self.0.iter().flatten().map(|count| count.load(Ordering::Relaxed)).collect()
    }

    /// Adds the counts from [`numbers`](Self::numbers) of another process.
    pub fn add_numbers(&self, numbers: &[u32]) {
        for (sum, &count) in self.0.iter().flatten().zip(numbers) {
            sum.fetch_add(count, Ordering::Relaxed);
        }
    }

    fn counts(&self) -> [Counts; CLASSES] {
        self.0.each_ref().map(|class| Counts(class.each_ref().map(|count| count.load(Ordering::Relaxed))))
    }
}

impl Calibration {
    /// Recommended maximum size of a lightcut \[clusters\]. `atrium` at 2 % needs 800 clusters on average to keep 95 %
    /// of the pixels within their thresholds. The paper's maximum is 1000.
    pub const LARGEST_CUT: u32 = 8000;

    /// Default fraction of pixels within their thresholds.
    pub const DEFAULT_SHARE: f64 = 0.95;

    /// Creates a calibration that keeps this fraction of the pixels within their thresholds, 0.5…0.999. NaN is replaced
    /// by [`Calibration::DEFAULT_SHARE`]. Fractions near 1 need more audits.
    #[must_use]
    pub fn keeping(share: f64) -> Self {
        let share = if share.is_nan() { Self::DEFAULT_SHARE } else { share.clamp(0.5, 0.999) };
        let pending = std::array::from_fn(|_| Counts([0; BUCKETS]));
        Self { share, lambdas: [START; CLASSES], learned: [false; CLASSES], pending }
    }

    /// Returns the number of pixels to audit in each 16×16 macroblock: one for 95 %, more for larger fractions, at
    /// most 16.
    #[must_use]
    pub fn audits_per_macroblock(&self) -> usize {
        ((1.0 - Self::DEFAULT_SHARE) / (1.0 - self.share)).round().clamp(1.0, 16.0) as usize
    }

    /// Returns the class of a threshold, 0 to 5, from its ratio to the luminance.
    #[must_use]
    pub fn class(threshold: f32, luminance: f32) -> usize {
        // NaN and black pixels belong to the first class.
        let octaves = (threshold / luminance / FIRST).log2() + 0.5;
        if octaves.is_finite() { (octaves.max(0.0) as usize).min(CLASSES - 1) } else { 0 }
    }

    /// Returns the threshold of an audit's lightcut for a pixel with this `threshold`.
    #[must_use]
    pub fn fine(threshold: f32) -> f32 {
        FINE * threshold
    }

    /// Returns λ for the thresholds of a class.
    ///
    /// # Panics
    ///
    /// If `class` is 6 or more.
    #[must_use]
    pub fn lambda(&self, class: usize) -> f32 {
        self.lambdas[class]
    }

    /// Learns from the audits of a frame and returns their summary. Returns `None` without audits.
    pub fn learn(&mut self, audits: &Audits) -> Option<Learned> {
        let counts = audits.counts();
        let mut all = Counts([0; BUCKETS]);
        let mut lambdas = 0.0;
        // Require enough audits that `ENOUGH_BEYOND` of them are expected beyond the quantile.
        let enough = ENOUGH_BEYOND / (1.0 - self.share);
        for (class, found) in counts.iter().enumerate() {
            let (lambda, pending) = (&mut self.lambdas[class], &mut self.pending[class]);
            // Weight λ of each class by its audits, for the mean in the summary.
            all.add(found);
            lambdas += f64::from(*lambda) * f64::from(found.total());
            pending.add(found);
            // Step as soon as enough audits are beyond the quantile.
            if f64::from(pending.total()) >= enough {
                let wanted = AIM / pending.quantile(self.share);
                let damped = wanted.powf(DAMPING).clamp(1.0 / LARGEST_STEP, LARGEST_STEP);
                // The first step must not raise λ, because a film that begins in the dark shows no errors.
                let step = if self.learned[class] { damped } else { damped.min(wanted) };
                *lambda = (*lambda * step).clamp(LEAST, MOST);
                *pending = Counts([0; BUCKETS]);
                self.learned[class] = true;
            }
            // Limit a class without a step to the λ of the next finer class.
            if class > 0 && !self.learned[class] {
                self.lambdas[class] = self.lambdas[class].min(self.lambdas[class - 1]);
            }
        }
        let count = all.total();
        (count > 0).then(|| Learned { error_p95: all.quantile(0.95).into(), lambda: lambdas / f64::from(count) })
    }
}

impl Counts {
    fn add(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, count)| *sum += count);
    }

    fn total(&self) -> u32 {
        self.0.iter().sum()
    }

    /// Returns the quantile of the errors, which is the upper end of the quantile's bucket.
    fn quantile(&self, share: f64) -> f32 {
        let wanted = (f64::from(self.total()) * share).ceil() as u32;
        let mut sum = 0;
        let last = self.0.iter().position(|&count| {
            sum += count;
            sum >= wanted
        });
        upper_end(last.unwrap_or(BUCKETS - 1))
    }
}

fn bucket(ratio: f32) -> usize {
    // 0/0 = NaN counts as no error, infinity counts as the largest error.
    if ratio.is_nan() {
        return 0;
    }
    let place = BUCKETS_TO_AN_OCTAVE * ratio.log2() + BUCKETS as f32 / 2.0;
    (place.max(0.0) as usize).min(BUCKETS - 1)
}

fn upper_end(bucket: usize) -> f32 {
    ((bucket as f32 + 1.0 - BUCKETS as f32 / 2.0) / BUCKETS_TO_AN_OCTAVE).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Audits and learns one frame. Audit `k` of `count` has the error `error(k, λ)` in class 2.
    fn frame(calibration: &mut Calibration, count: u32, error: impl Fn(u32, f32) -> f32) -> Option<Learned> {
        let audits = Audits::default();
        (0..count).for_each(|k| audits.note(2, error(k, calibration.lambda(2))));
        calibration.learn(&audits)
    }

    /// Returns errors that are uniform between 0 and `scale` times λ. Their 95 % quantile gives the expected λ.
    fn even(scale: f32) -> impl Fn(u32, f32) -> f32 {
        move |k, lambda| (k as f32 + 0.5) / 200.0 * scale * lambda
    }

    #[test]
    fn the_quantile_comes_to_lie_at_the_threshold() {
        for scale in [0.2, 1.0, 5.0] {
            let mut calibration = Calibration::default();
            for _ in 0..40 {
                frame(&mut calibration, 200, even(scale));
            }
            let expected = AIM / (0.95 * scale);
            let ratio = calibration.lambda(2) / expected;
            assert!((0.9..1.1).contains(&ratio), "scale {scale}: {ratio}");
            assert_eq!(calibration.lambda(1), START, "finer classes have learned nothing");
            assert!(
                calibration.lambda(3) <= calibration.lambda(2),
                "coarser ones neither, but what is too far for others"
            );
        }
    }

    /// The initial λ falls in one frame of audits. It rises step by step, because a film that begins in the dark shows
    /// no errors.
    #[test]
    fn the_first_audits_are_followed_down_at_once() {
        for scale in [5.0, 20.0] {
            let mut calibration = Calibration::default();
            frame(&mut calibration, 200, even(scale));
            let ratio = calibration.lambda(2) * 0.95 * scale / AIM;
            assert!((0.9..1.1).contains(&ratio) || calibration.lambda(2) == LEAST, "scale {scale}: {ratio}");
            assert_eq!(calibration.lambda(5), calibration.lambda(2));
        }
        let mut calibration = Calibration::default();
        frame(&mut calibration, 200, |_, _| f32::NAN);
        assert!(calibration.lambda(2) <= START * LARGEST_STEP * 1.001);
        assert_eq!(calibration.lambda(3), START);
    }

    #[test]
    fn other_shares_come_to_lie_there_too() {
        for share in [0.5, 0.9, 0.99] {
            let mut calibration = Calibration::keeping(share);
            assert_eq!(calibration.audits_per_macroblock(), if share == 0.99 { 5 } else { 1 });
            for _ in 0..80 {
                frame(&mut calibration, 200, even(1.0));
            }
            let ratio = calibration.lambda(2) * share as f32 / AIM;
            assert!((0.9..1.1).contains(&ratio), "{share}: {ratio}");
        }
    }

    /// A light is switched every frame. Then follow a flash of 10⁶ and the original light.
    #[test]
    fn the_loop_stays_in_its_bounds_and_returns() {
        let mut calibration = Calibration::default();
        for _ in 0..40 {
            frame(&mut calibration, 200, even(1.0));
        }
        let settled = calibration.lambda(2);
        let (mut least, mut most) = (f32::MAX, 0.0f32);
        for n in 0..100 {
            frame(&mut calibration, 200, even(if n % 2 == 0 { 0.5 } else { 2.0 }));
            if n > 20 {
                least = least.min(calibration.lambda(2));
                most = most.max(calibration.lambda(2));
            }
        }
        assert!(most / least <= LARGEST_STEP * 1.01, "no more than a step: {least}…{most}");
        frame(&mut calibration, 200, even(1e6));
        frame(&mut calibration, 200, |_, _| f32::INFINITY);
        frame(&mut calibration, 200, |_, _| f32::NAN);
        assert!((LEAST..=MOST).contains(&calibration.lambda(2)));
        let back = (1..=10).find(|_| {
            frame(&mut calibration, 200, even(1.0));
            (0.8..1.25).contains(&(calibration.lambda(2) / settled))
        });
        assert!(back.is_some(), "λ {} was {settled} before", calibration.lambda(2));
        for _ in 0..1000 {
            frame(&mut calibration, 200, |_, _| 0.0);
        }
        assert_eq!(calibration.lambda(2), MOST);
        for _ in 0..1000 {
            frame(&mut calibration, 200, |_, _| 1e30);
        }
        assert_eq!(calibration.lambda(2), LEAST);
    }

    /// Errors are proportional to λ^`power`. In each frame log λ moves by DAMPING · power of its distance from the
    /// target, and errors are quantised to eighths of an octave. λ therefore ends in a cycle of at most DAMPING/8
    /// octaves, divided by the relative reduction per frame.
    ///
    /// This holds for powers up to 2/DAMPING = 2.86. For larger powers, λ oscillates by at most a step per frame.
    #[test]
    fn ten_thousand_still_frames_end_in_a_small_cycle() {
        for (power, scale) in [(0.5, 1.0), (1.0, 0.3), (1.0, 1.0), (1.0, 4.0), (2.0, 1.0), (2.5, 1.0)] {
            let mut calibration = Calibration::default();
            let error = |k: u32, lambda: f32| (k as f32 + 0.5) / 200.0 * scale * lambda.powf(power);
            let lambdas: Vec<f32> = (0..10_000)
                .map(|_| {
                    frame(&mut calibration, 200, error);
                    calibration.lambda(2)
                })
                .collect();
            let aim = (AIM / (0.95 * scale)).powf(1.0 / power);
            let distance = |lambda: f32| (lambda / aim).log2().abs();
            let kept = (1.0 - DAMPING * power).abs();
            let width = DAMPING / BUCKETS_TO_AN_OCTAVE / (1.0 - kept);
            let last = &lambdas[9000..];
            let (least, most) = last.iter().fold((f32::MAX, 0.0f32), |(least, most), &k| (least.min(k), most.max(k)));
            let cycle = (most / least).log2();
            assert!(cycle <= width * 1.001, "power {power}, scale {scale}: {cycle} octaves, {width} are allowed");
            assert!(
                distance(least).max(distance(most)) <= 0.3,
                "power {power}, scale {scale}: {least}…{most} for {aim}"
            );
            // Each frame multiplies the distance by `kept`, or reduces it by a whole step if that is less.
            let frames =
                (distance(START) / LARGEST_STEP.log2() + (0.05f32.ln() / kept.max(0.01).ln())).ceil() as usize + 8;
            let settled = lambdas.iter().position(|&lambda| distance(lambda) <= 0.3).unwrap();
            assert!(
                settled <= frames,
                "power {power}, scale {scale}: settled after {settled} frames, {frames} predicted"
            );
            println!("error ~ λ^{power} · {scale}: settled after {settled} frames, a cycle of {cycle:.3} octaves");
        }
        // For larger powers λ oscillates, but by at most a step per frame and within its limits.
        let mut calibration = Calibration::default();
        let mut before = calibration.lambda(2);
        for _ in 0..1000 {
            frame(&mut calibration, 200, |k, lambda| (k as f32 + 0.5) / 200.0 * lambda.powi(6));
            let step = calibration.lambda(2) / before;
            assert!((1.0 / LARGEST_STEP / 1.001..=LARGEST_STEP * 1.001).contains(&step), "{step}");
            before = calibration.lambda(2);
            assert!((LEAST..=MOST).contains(&before));
        }
    }

    #[test]
    fn classes_are_octaves() {
        assert_eq!(Calibration::class(0.02, 1.0), 0);
        assert_eq!(Calibration::class(0.04, 1.0), 1);
        assert_eq!(Calibration::class(1.6, 10.0), 3);
        assert_eq!(Calibration::class(7.0, 1.0), CLASSES - 1);
        for (threshold, luminance) in [(0.0, 1.0), (1.0, 0.0), (0.0, 0.0), (f32::NAN, 1.0), (1e-30, 1e30)] {
            assert_eq!(Calibration::class(threshold, luminance), 0);
        }
    }
}
