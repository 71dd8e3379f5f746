//! Saliency that does not flicker: blended from frame to frame along the motion.

use crate::bounded;
use plane::{Correspondence, Plane};

/// w, the weight of the past: that of thresholds in \[Herzog08, §5.2\].
const WEIGHT: f32 = 0.5;
/// Saliency of what was not seen before: new things attract the eye, and nothing is known of them yet.
const UNCOVERED: f32 = 1.0;

/// Saliency of this frame, blended with that of the frame before:
///
/// ```text
/// (S8)  S'_t(x) = (1 − w) S_t(x) + w S'_(t−1)(x')        w = ½;  1 where x has no match
/// ```
///
/// `now` is S_t, 0…1; `before` is S'_(t−1), as this function returned it, or S itself for the first frame. `known` holds
/// the match x' of every pixel; indices outside of `before` count as no match. Values are taken into 0…1, and NaN counts as 0.
///
/// # Panics
/// If `now` and `known` differ in size.
#[must_use]
pub fn steady_saliency(now: &Plane<f32>, before: &Plane<f32>, known: &Correspondence) -> Plane<f32> {
    let size = (known.width(), known.height());
    assert_eq!((now.width(), now.height()), size, "every pixel needs its match");
    let mut steady = now.clone();
    for (s, &index) in steady.samples_mut().iter_mut().zip(known.matches().samples()) {
        *s = match before.samples().get(index as usize) {
            Some(&before) => (1.0 - WEIGHT) * bounded(*s, 0.0, 1.0) + WEIGHT * bounded(before, 0.0, 1.0),
            None => UNCOVERED,
        };
    }
    steady
}
