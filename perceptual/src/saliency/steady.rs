//! Temporally stable saliency, blended from frame to frame along the motion.

use crate::bounded;
use plane::{Correspondence, Plane};

/// Weight w of the past. It equals the weight of thresholds in \[Herzog08, §5.2\].
const WEIGHT: f32 = 0.5;
/// Saliency of disoccluded areas. New objects attract the eye, and no previous saliency exists.
const UNCOVERED: f32 = 1.0;

/// Blends the saliency of this frame with the saliency of the previous frame:
///
/// ```text
/// (S8)  S'_t(x) = (1 − w) S_t(x) + w S'_(t−1)(x')        w = ½
///       S'_t(x) = 1        if neither x nor any of the 8 pixels around it has a match, inside of the picture
///       S'_t(x) = S_t(x)   for other pixels without a match
/// ```
///
/// Pixels without a match that are connected to the picture's border are no new objects: the camera has turned to them.
///
/// `now` is S_t, 0…1. `before` is S'_(t−1) from this function, or S for the first frame. `known` contains the match x'
/// of every pixel. An index outside `before` is not a match. Values are clamped to 0…1. NaN becomes 0.
///
/// # Panics
/// If `now` and `known` have different sizes.
#[must_use]
pub fn steady_saliency(now: &Plane<f32>, before: &Plane<f32>, known: &Correspondence) -> Plane<f32> {
    let size = (known.width(), known.height());
    assert_eq!((now.width(), now.height()), size, "every pixel needs its match");
    let then = known.matches().map(|index| before.samples().get(index as usize).copied());
    let entered = connected_to_border(&then);
    Plane::from_fn(size.0, size.1, |x, y| {
        let now = bounded(now.get(x, y), 0.0, 1.0);
        match then.get(x, y) {
            Some(then) => (1.0 - WEIGHT) * now + WEIGHT * bounded(then, 0.0, 1.0),
            None if !entered.get(x, y) && is_new(&then, x, y) => UNCOVERED,
            None => now,
        }
    })
}

/// Returns the pixels without a match that are connected to the border by such pixels.
fn connected_to_border(then: &Plane<Option<f32>>) -> Plane<bool> {
    let (width, height) = (then.width(), then.height());
    let mut found = Plane::filled(width, height, false);
    // Start at the border, and follow the neighbors in each direction.
    let columns = (0..width).flat_map(|x| [(x, 0), (x, height - 1)]);
    let rows = (0..height).flat_map(|y| [(0, y), (width - 1, y)]);
    let mut open: Vec<(usize, usize)> = columns.chain(rows).collect();
    while let Some((x, y)) = open.pop() {
        if x >= width || y >= height || found.get(x, y) || then.get(x, y).is_some() {
            continue;
        }
        found.set(x, y, true);
        open.extend([(x + 1, y), (x.wrapping_sub(1), y), (x, y + 1), (x, y.wrapping_sub(1))]);
    }
    found
}

/// Returns whether no pixel in the 3×3 neighborhood has a match. On the rim of an object a single match may be missing,
/// where the surface is thinner than a pixel.
fn is_new(then: &Plane<Option<f32>>, x: usize, y: usize) -> bool {
    let is_missing = |u: usize, v: usize| u >= then.width() || v >= then.height() || then.get(u, v).is_none();
    let beside = |at: usize| [at.wrapping_sub(1), at, at + 1];
    beside(y).into_iter().all(|v| beside(x).into_iter().all(|u| is_missing(u, v)))
}
