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
/// (S8)  S'_t(x) = (1 − w) S_t(x) + w S'_(t−1)(x')        w = ½
///       S'_t(x) = 1        where neither x nor any of the 8 pixels around it has a match
///       S'_t(x) = S_t(x)   where x has none, but one of them has
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
    let then = known.matches().map(|index| before.samples().get(index as usize).copied());
    Plane::from_fn(size.0, size.1, |x, y| {
        let now = bounded(now.get(x, y), 0.0, 1.0);
        match then.get(x, y) {
            Some(then) => (1.0 - WEIGHT) * now + WEIGHT * bounded(then, 0.0, 1.0),
            None if is_new(&then, x, y) => UNCOVERED,
            None => now,
        }
    })
}

/// Whether no pixel around has a match: on the rim of a thing, one may be missing because the surface is thinner than a pixel.
fn is_new(then: &Plane<Option<f32>>, x: usize, y: usize) -> bool {
    let is_missing = |u: usize, v: usize| u >= then.width() || v >= then.height() || then.get(u, v).is_none();
    let beside = |at: usize| [at.wrapping_sub(1), at, at + 1];
    beside(y).into_iter().all(|v| beside(x).into_iter().all(|u| is_missing(u, v)))
}
