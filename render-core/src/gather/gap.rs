//! Light in gaps, such as between moldings, behind a shutter, or under a pot.
//!
//! Surfels contain a mean over their neighborhood. In a narrower gap, surfaces are darker than this mean. A ray that
//! ends at a nearby surface therefore continues:
//!
//! ```text
//! L(y) = ρ(y) · (Lₑ(z) + L(z))     if a cosine-distributed ray from y hits z close by, and no lamp is visible from y
//! L(y) = the surfels' radiance     otherwise
//! ```
//!
//! The surfels contain all light that reaches y from outside the gap. Light from inside the gap is computed by the ray.
//! In uniform radiance both expressions agree: ρ · (Lₑ + L) = L.

use super::{Gathered, Seen};
use crate::PosedScene;
use crate::light::Lamps;
use crate::sampling::cosine_hemisphere;
use glam::Vec2;

/// Maximum number of reflections that are followed in a gap.
pub(super) const MOST_REFLECTIONS: usize = 8;

/// Parameters of the search for gaps.
pub(super) struct Gaps {
    /// Distance below which surfaces are in the same gap \[m\].
    pub near: f32,
    /// Distance between ray origins and their surface \[m\].
    pub epsilon: f32,
    /// Lights that light surfels but that rays never or rarely hit.
    pub lamps: Lamps,
}

impl Gaps {
    /// Follows a ray that ended at `seen` out of its gap. Returns the end of the ray, with the remaining weight. Adds
    /// emission along the way to `found`.
    pub fn follow<'a>(
        &self,
        PosedScene { accelerator, surfaces }: PosedScene<'a>,
        mut seen: Seen<'a>,
        random: &mut impl Iterator<Item = f32>,
        found: &mut Gathered,
    ) -> Seen<'a> {
        for _ in 0..MOST_REFLECTIONS {
            // Stop outside a gap, and at the back of a surface, which reflects no light.
            let Seen { surface, distance, source } = &mut seen;
            if *distance >= self.near || surface.is_back() {
                break;
            }

            // Stop where a lamp is visible, because rays rarely hit lamps.
            let position = surface.position + surface.geometric_normal * self.epsilon;
            if self.lamps.are_seen(accelerator, position, surface.geometric_normal) {
                break;
            }

            // Draw a cosine-distributed direction. A ray that leaves the gap ends at the current surface.
            let mut next = || random.next().unwrap_or_default();
            let direction = cosine_hemisphere(surface.shading_normal().into(), Vec2::new(next(), next())).into();
            if surface.geometric_normal.dot(direction) <= 0.0 {
                break;
            }
            let Some(hit) = accelerator.closest(position, direction).filter(|hit| hit.distance < self.near) else {
                break;
            };

            // Continue from the next surface: L(y) = ρ(y) · (Lₑ(z) + L(z)).
            source.share *= surface.reflectance();
            let surface = surfaces.meet(&hit, direction, hit.distance);
            found.emit(&surface, source);
            (seen.surface, seen.distance) = (surface, hit.distance);
        }
        seen
    }
}
