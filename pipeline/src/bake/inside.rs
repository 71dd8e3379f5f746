//! The point that a texel is lit at: not within something.

use crate::renderer::Visibility;
use crate::renderer::frame::Frame;
use render_core::{Atlas, ShadingPoint, Surfaces};

/// Distance of a back face from a point that is within something, at most \[texels\]. Texels farther in are read by no look-up
/// from outside.
const NEAR: f32 = 1.5;

/// Where texels may be lit.
pub(super) struct Places<'a> {
    pub atlas: &'a Atlas,
    /// Surfaces of the scene that the atlas is of.
    pub surfaces: &'a Surfaces<'a>,
    /// The scene that light goes through.
    pub frame: &'a Frame<'a>,
    pub visibility: &'a Visibility<'a>,
}

impl Places<'_> {
    /// A point of a texel that is not within something; none if all are.
    pub fn point_of(&self, texel: usize) -> Option<ShadingPoint> {
        for site in self.atlas.sites(texel, self.surfaces) {
            let normals = [site.shading_normal, site.geometric_normal];
            let point = ShadingPoint::off_surface(site.position, normals, self.frame.epsilon);
            if !self.is_inside(&point) {
                return Some(point);
            }
        }
        None
    }

    /// Whether a back face is near in any of a few directions.
    fn is_inside(&self, point: &ShadingPoint) -> bool {
        let reach = NEAR / self.atlas.texels_per_meter();
        self.visibility.felt(point).any(|(direction, met)| {
            met.is_some_and(|hit| hit.distance < reach && self.frame.surfaces.is_back(&hit, direction))
        })
    }
}
