//! Shading points of texels, chosen outside of geometry.

use crate::Visibility;
use crate::frame::Frame;
use rayon::prelude::*;
use render_core::{Atlas, ShadingPoint, Surfaces};

/// Maximum distance of a back face from a point inside geometry \[texels\]. Samples from outside read no texels farther
/// inside.
const NEAR: f32 = 1.5;

/// Maximum width of a reliable texel, as a fraction of the harmonic mean distance of its surroundings.
const WIDEST: f32 = 0.5;

/// The atlas, and the scene that lights the atlas's texels.
pub(super) struct Places<'a> {
    pub atlas: &'a Atlas,
    /// Surfaces of the scene of the atlas.
    pub surfaces: &'a Surfaces<'a>,
    /// Scene with the geometry that reflects and blocks light.
    pub frame: &'a Frame<'a>,
    pub visibility: &'a Visibility<'a>,
}

impl Places<'_> {
    /// Returns a shading point outside of geometry for each texel, `None` for a texel without one. If a whole
    /// chart lacks outer points, inner points are used: overlapping geometry can still be visible. Also returns whether
    /// each texel is reliable: its point is outside of geometry and far enough from its surroundings.
    pub fn points(&self) -> (Vec<Option<ShadingPoint>>, Vec<bool>) {
        let texels = 0..self.atlas.len();
        let mut points: Vec<Option<ShadingPoint>> =
            texels.clone().into_par_iter().map(|texel| self.outside(texel).next()).collect();
        let is_reliable = |point: &Option<ShadingPoint>| point.is_some_and(|point| self.is_resolved(&point));
        let is_reliable = points.par_iter().map(is_reliable).collect();
        // Find the charts that have a point outside of geometry.
        let mut has_point = vec![false; self.atlas.charts()];
        for texel in texels.clone() {
            has_point[self.atlas.chart(texel) as usize] |= points[texel].is_some();
        }
        for texel in texels {
            if !has_point[self.atlas.chart(texel) as usize] {
                points[texel] = self.sites(texel).next();
            }
        }
        (points, is_reliable)
    }

    /// Returns at most `count` further points of a texel outside of geometry, without the texel's point from
    /// [`Places::points`].
    pub fn others(&self, texel: usize, count: usize) -> impl Iterator<Item = ShadingPoint> {
        self.outside(texel).skip(1).take(count)
    }

    /// Returns the candidate points of a texel that are outside of geometry.
    fn outside(&self, texel: usize) -> impl Iterator<Item = ShadingPoint> {
        self.sites(texel).filter(|point| !self.is_inside(point))
    }

    /// Returns the candidate points of a texel.
    fn sites(&self, texel: usize) -> impl Iterator<Item = ShadingPoint> {
        self.atlas.sites(texel, self.surfaces).into_iter().map(|site| {
            let normals = [site.shading_normal, site.geometric_normal];
            ShadingPoint::off_surface(site.position, normals, self.frame.epsilon)
        })
    }

    /// Returns whether texels resolve the light at a point: they are narrow compared with the harmonic mean distance of
    /// the surroundings, on which the gradient of indirect light depends \[Ward88\].
    fn is_resolved(&self, point: &ShadingPoint) -> bool {
        let (mut inverse_distances, mut count) = (0.0, 0.0f32);
        for (_, met) in self.visibility.felt(point) {
            inverse_distances += met.map_or(0.0, |hit| 1.0 / hit.distance);
            count += 1.0;
        }
        inverse_distances <= WIDEST * count * self.atlas.texels_per_meter()
    }

    /// Returns whether a back face is near the point in any of a few directions.
    fn is_inside(&self, point: &ShadingPoint) -> bool {
        let reach = NEAR / self.atlas.texels_per_meter();
        self.visibility.felt(point).any(|(direction, met)| {
            met.is_some_and(|hit| hit.distance < reach && self.frame.surfaces.is_back(&hit, direction))
        })
    }
}
