//! The point that a texel is lit at: not within something.

use crate::Visibility;
use crate::frame::Frame;
use rayon::prelude::*;
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
    /// For each texel a point that is not within something; none if all are. Where that would leave a whole chart without any, its
    /// points are what they are: pieces of a scene that overlap are seen in spite of it.
    pub fn points(&self) -> Vec<Option<ShadingPoint>> {
        let texels = 0..self.atlas.len();
        let mut points: Vec<Option<ShadingPoint>> =
            texels.clone().into_par_iter().map(|texel| self.outside(texel).next()).collect();
        let mut has_point = vec![false; self.atlas.charts()];
        for texel in texels.clone() {
            has_point[self.atlas.chart(texel) as usize] |= points[texel].is_some();
        }
        for texel in texels {
            if !has_point[self.atlas.chart(texel) as usize] {
                points[texel] = self.sites(texel).next();
            }
        }
        points
    }

    /// At most `count` points of a texel beside that of [`Places::points`], none within something.
    pub fn others(&self, texel: usize, count: usize) -> impl Iterator<Item = ShadingPoint> {
        self.outside(texel).skip(1).take(count)
    }

    /// Points of a texel that are not within something.
    fn outside(&self, texel: usize) -> impl Iterator<Item = ShadingPoint> {
        self.sites(texel).filter(|point| !self.is_inside(point))
    }

    /// Points that a texel may be lit at.
    fn sites(&self, texel: usize) -> impl Iterator<Item = ShadingPoint> {
        self.atlas.sites(texel, self.surfaces).into_iter().map(|site| {
            let normals = [site.shading_normal, site.geometric_normal];
            ShadingPoint::off_surface(site.position, normals, self.frame.epsilon)
        })
    }

    /// Whether a back face is near in any of a few directions.
    fn is_inside(&self, point: &ShadingPoint) -> bool {
        let reach = NEAR / self.atlas.texels_per_meter();
        self.visibility.felt(point).any(|(direction, met)| {
            met.is_some_and(|hit| hit.distance < reach && self.frame.surfaces.is_back(&hit, direction))
        })
    }
}
