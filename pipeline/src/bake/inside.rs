//! The point that a texel is lit at: not within something.

use crate::renderer::frame::Frame;
use glam::{Vec3, Vec3A};
use render_core::sampling::{centered_sobol, concentric_disc, frame as axes};
use render_core::{Atlas, ShadingPoint, Surfaces, TexelSite};

/// Rays that feel whether a point is within something.
const FEELERS: usize = 16;
/// Distance of a back face from a point that is within something, at most \[texels\]. Farther in, no point that anyone sees
/// takes light from the texel.
const NEAR: f32 = 1.5;

/// A point of a texel that is not within something; none if all are.
pub(super) fn point_of(
    atlas: &Atlas,
    texel: usize,
    surfaces: &Surfaces,
    frame: &Frame,
    texel_side: f32,
) -> Option<ShadingPoint> {
    let candidates = atlas.sites(texel, surfaces).into_iter();
    let mut points = candidates.map(|site| receiver(&site, frame.epsilon));
    points.find(|point| !is_inside(point, frame, NEAR * texel_side))
}

/// The place of a site where rays start.
fn receiver(site: &TexelSite, epsilon: f32) -> ShadingPoint {
    let TexelSite { position, geometric_normal, shading_normal, .. } = *site;
    ShadingPoint { position: position + geometric_normal * epsilon, normal: shading_normal, geometric_normal }
}

/// Whether a back face is nearer than `reach` in any of a few directions.
fn is_inside(point: &ShadingPoint, frame: &Frame, reach: f32) -> bool {
    let normal = Vec3::from(point.geometric_normal);
    let (x, y) = axes(normal);
    for u in centered_sobol(FEELERS) {
        let p = concentric_disc(u);
        let up = (1.0 - p.length_squared()).max(0.0).sqrt();
        let direction = Vec3A::from(x * p.x + y * p.y + normal * up);
        let hit = frame.accelerator.closest(point.position, direction);
        if hit.is_some_and(|hit| hit.distance < reach && !frame.surfaces.is_front(&hit, direction)) {
            return true;
        }
    }
    false
}
