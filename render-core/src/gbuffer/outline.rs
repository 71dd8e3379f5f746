//! The outline of bodies, where a ray meets the near and the far side at one edge.
//!
//! An edge of the outline joins a triangle that faces the viewer to one that does not. A ray that meets the edge meets both
//! equally far away, and rounding says which is first; of long triangles seen at a slant it says so within 1e-5 of the way.
//! A pixel that took the far one would be lit from within the body: a black dot. A little farther in the two are apart.

use super::CameraRay;
use crate::PosedScene;
use crate::accel::Hit;
use crate::surface::Interaction;

/// How far in the two sides are taken to be apart, in pixels; nearer to its border a back may be seen by rounding alone.
const INWARD: f32 = 0.1;

impl CameraRay {
    /// The front that the ray should have met in place of `hit`, which is the back of `met`; `None` where that is no outline.
    /// `width` is that of a pixel there, meters.
    pub(super) fn front_beside<'a>(
        self,
        scene: PosedScene<'a>,
        hit: &Hit,
        met: &Interaction,
        width: f32,
    ) -> Option<(Hit, Interaction<'a>)> {
        let Self { origin, direction } = self;
        let PosedScene { accelerator, surfaces } = scene;
        let inward = INWARD * width;
        let [a, b, c] = surfaces.corners(hit.instance as usize, hit.triangle as usize);
        [[a, b, c], [b, c, a], [c, a, b]].into_iter().find_map(|[from, to, inner]| {
            // Across the edge as the ray sees it, towards the third corner.
            let across = direction.cross(to - from).try_normalize()?;
            let across = if across.dot(inner - from) < 0.0 { -across } else { across };
            if across.dot(met.position - from) > inward {
                return None;
            }
            let hit = accelerator
                .closest(origin + across * inward, direction)
                .filter(|beside| beside.instance == hit.instance)?;
            let surface = surfaces.point(&hit, direction, width);
            surface.front.then_some((hit, surface))
        })
    }
}
