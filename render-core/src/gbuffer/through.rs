//! Surfaces seen through clear thin walls, such as window panes. Their motion is the motion of the picture.
//!
//! Light passes a thin wall in a straight line. A moving camera therefore moves the surfaces behind a pane as if the
//! pane were missing. A pixel's pane remains its first surface, at which light is computed.

use super::{CameraRay, GBuffer, PixelSurface};
use crate::accel::Hit;
use crate::clear::straight;
use crate::ranks::portable;
use crate::{PosedScene, luminance};
use glam::{Vec3, Vec3A};

/// Maximum number of walls in front of a surface.
const MOST_WALLS: usize = 8;
/// Minimum fraction of light that passes all walls. Below it, reflections may dominate: a pane of glass reflects less up
/// to 65° from its normal.
const LEAST_PASSED: f32 = 0.25;

/// Surface that a pixel shows through panes.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenThrough {
    /// Index of the pixel in raster order.
    pub(super) index: u32,
    /// First surface behind all panes, or the sky.
    pub(super) surface: PixelSurface,
}

portable!(SeenThrough { index, surface });

impl GBuffer {
    /// Returns the surface at which the motion of a pixel is measured, given the pixel's index in raster order: the
    /// surface behind all panes.
    pub(super) fn moving(&self, pixel: usize) -> PixelSurface {
        let place = self.through.binary_search_by_key(&pixel, |seen| seen.index as usize);
        place.map_or_else(|_| self.pixels.samples()[pixel], |place| self.through[place].surface)
    }
}

/// Returns the first hit of a camera ray behind all panes, as a ray from the last pane, or `None` if no pane is in
/// front. The hit is `None` for the sky. `first` is the ray's visible surface.
pub(super) fn behind_panes(
    first: &PixelSurface,
    ray: CameraRay,
    scene: PosedScene,
) -> Option<(CameraRay, Option<Hit>)> {
    let PosedScene { accelerator, surfaces } = scene;
    if !surfaces.may_be_clear(first.instance) {
        return None;
    }
    let (direction, mut origin) = (ray.direction, ray.origin);
    let mut hit = surfaces.hit_at(first.instance, first.triangle, first.position.into(), origin);
    let mut passed = Vec3::ONE;
    for wall in 0..MOST_WALLS {
        // End at the first surface that is not a pane.
        let surface = surfaces.may_be_clear(hit.instance).then(|| surfaces.at_indirect(&hit, direction, 0.0));
        let transmittance = surface.as_ref().map_or(Vec3::ZERO, |surface| straight(surface, direction));
        let Some(surface) = surface.filter(|_| transmittance != Vec3::ZERO) else {
            return (wall > 0).then_some((CameraRay { origin, direction }, Some(hit)));
        };
        passed *= transmittance;
        if luminance(passed) < LEAST_PASSED {
            return None;
        }

        // Continue behind the pane.
        origin = surface.position - surface.geometric_normal * offset(surface.position, ray.origin);
        let Some(next) = accelerator.closest_shown(origin, direction) else {
            return Some((CameraRay { origin, direction }, None));
        };
        hit = next;
    }
    None
}

/// Returns the offset of a ray from a surface \[m\]: rounding errors of coordinates grow with them.
fn offset(position: Vec3A, viewer: Vec3A) -> f32 {
    1e-5 * position.abs().max_element().max(position.distance(viewer))
}
