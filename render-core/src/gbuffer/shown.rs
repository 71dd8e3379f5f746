//! The surface that a ray from the camera shows.
//!
//! glTF's materials are single-sided unless they say otherwise: their backs are not shown (glTF 2.0, 3.9.6), so that one looks
//! into a room through its walls. Light meets them all the same: backs throw shadows and absorb.

use super::CameraRay;
use crate::PosedScene;
use crate::accel::Hit;
use crate::surface::Interaction;

/// Backs that a ray goes through; a ray that meets more ends at nothing.
const MOST_BACKS: usize = 256;
/// Where a ray goes on behind a back, as a share of the way there: beyond the rounding of the hit.
const BEHIND: f32 = 1e-5;
/// Least step beyond a back that is met at its very place \[m\]: doubled often enough, it becomes any.
const SMALLEST: f32 = 1e-12;

impl CameraRay {
    /// The surface that the ray shows whose first hit is `hit`: the first front, or the first back of a double-sided
    /// surface. `width` is that of a pixel at a hit, meters; 0 for sharp textures, and outlines as rays meet them.
    pub(crate) fn shown<'a>(
        self,
        scene: PosedScene<'a>,
        mut hit: Hit,
        width: impl Fn(&Hit) -> f32,
    ) -> Option<(Hit, Interaction<'a>)> {
        let Self { origin, direction } = self;
        let mut farther = 0.0;
        for _ in 0..MOST_BACKS {
            let width = width(&hit);
            let surface = scene.surfaces.point(&hit, direction, width);
            if surface.front {
                return Some((hit, surface));
            }
            let beside = self.front_beside(scene, &hit, &surface, width);
            if beside.is_some() || !surface.is_back() {
                return beside.or(Some((hit, surface)));
            }
            let behind = hit.distance * (1.0 + BEHIND) + farther;
            let next = scene.accelerator.closest(origin + direction * behind, direction)?;

            // A triangle is met once. One that is met again is so large or so close that rounding exceeds the step.
            let is_same = (next.instance, next.triangle) == (hit.instance, hit.triangle);
            let least = (f32::EPSILON * origin.abs().max_element()).max(BEHIND * hit.distance).max(SMALLEST);
            farther = if is_same { (2.0 * farther).max(least) } else { 0.0 };
            hit = Hit { distance: behind + next.distance, ..next };
        }
        None
    }
}
