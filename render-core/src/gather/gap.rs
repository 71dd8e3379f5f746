//! Light in gaps: between moldings, behind a shutter, under a pot.
//!
//! Surfels hold a mean over their neighborhood. In a gap that is narrower, surfaces are darker than the surfels say.
//! So a ray that ends close by goes on:
//!
//! ```text
//! L(y) = ρ(y) · (Lₑ(z) + L(z))     if a cosine-distributed ray from y meets z close by, and no lamp is seen from y
//! L(y) = that of the surfels       otherwise
//! ```
//!
//! Whatever comes to y from beyond the gap, the surfels know; what comes from within it is found anew. Where radiance is the
//! same everywhere, both are the same: ρ · (Lₑ + L) = L.

use super::{Gathered, Seen};
use crate::PosedScene;
use crate::light::Lamps;
use crate::sampling::cosine_hemisphere;
use glam::Vec2;

/// Reflections in a gap that are followed.
pub(super) const MOST_REFLECTIONS: usize = 8;

/// Criteria of a gap.
pub(super) struct Gaps {
    /// Surfaces nearer than this are in the same gap \[m\].
    pub near: f32,
    /// Rays start this far off their surface \[m\].
    pub epsilon: f32,
    /// Lights that surfels are lit by and rays do not meet, or hardly ever.
    pub lamps: Lamps,
}

impl Gaps {
    /// Follows a ray that ended at `seen` out of the gap that it is in: where it comes out, with what is left of its share.
    /// Glowing surfaces on the way are noted in `found`.
    pub fn follow<'a>(
        &self,
        PosedScene { accelerator, surfaces }: PosedScene<'a>,
        mut seen: Seen<'a>,
        random: &mut impl Iterator<Item = f32>,
        found: &mut Gathered,
    ) -> Seen<'a> {
        for _ in 0..MOST_REFLECTIONS {
            let Seen { surface, distance, source } = &mut seen;
            if *distance >= self.near || surface.is_back() {
                break;
            }
            let position = surface.position + surface.geometric_normal * self.epsilon;
            if self.lamps.are_seen(accelerator, position, surface.geometric_normal) {
                break;
            }
            let mut next = || random.next().unwrap_or_default();
            let direction = cosine_hemisphere(surface.shading_normal().into(), Vec2::new(next(), next())).into();
            if surface.geometric_normal.dot(direction) <= 0.0 {
                break;
            }
            let Some(hit) = accelerator.closest(position, direction).filter(|hit| hit.distance < self.near) else {
                break;
            };
            source.share *= surface.reflectance();
            let surface = surfaces.meet(&hit, direction, hit.distance);
            found.emit(&surface, source);
            (seen.surface, seen.distance) = (surface, hit.distance);
        }
        seen
    }
}
