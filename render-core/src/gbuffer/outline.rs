//! Correction of outlines of bodies, at which a ray hits the near and the far side at the same edge.
//!
//! An edge of the outline joins a front-facing and a back-facing triangle. A ray through the edge hits both at the same
//! distance, and rounding decides which hit is first. For long, slanted triangles, distances that differ by less than
//! 1e-5 are ambiguous. A pixel that shows the far triangle would be lit from inside the body and appear as a black dot.
//! Slightly farther inward, the two triangles are separate.

use super::CameraRay;
use crate::PosedScene;
use crate::accel::Hit;
use crate::surface::Interaction;

/// Inward offset at which the two sides are separate \[pixels\]. Closer to the border, a back may be visible only
/// through rounding.
const INWARD: f32 = 0.1;

impl CameraRay {
    /// Returns the front that the ray should have hit instead of `hit`, the back at `met`, or `None` if there is no
    /// outline. `width` is the width of a pixel at the hit \[m\].
    pub(super) fn front_beside<'a>(
        self,
        scene: PosedScene<'a>,
        hit: &Hit,
        met: &Interaction,
        width: f32,
    ) -> Option<(Hit, Interaction<'a>)> {
        let Self { origin, direction } = self;
        let PosedScene { accelerator, surfaces } = scene;
        // Test each edge, given by its two ends and the opposite corner.
        let inward = INWARD * width;
        let [a, b, c] = surfaces.corners(hit.instance as usize, hit.triangle as usize);
        [[a, b, c], [b, c, a], [c, a, b]].into_iter().find_map(|[from, to, inner]| {
            // Find the direction across the edge as the ray sees it, towards the third corner.
            let across = direction.cross(to - from).try_normalize()?;
            let across = if across.dot(inner - from) < 0.0 { -across } else { across };
            // Skip edges that are too far from the hit.
            if across.dot(met.position - from) > inward {
                return None;
            }
            // Trace a parallel ray farther inward, which must hit the front of the same body.
            let hit = accelerator
                .closest(origin + across * inward, direction)
                .filter(|beside| beside.instance == hit.instance)?;
            let surface = surfaces.point(&hit, direction, width);
            surface.front.then_some((hit, surface))
        })
    }
}
