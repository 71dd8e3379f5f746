//! From texels to points on surfaces, and back.

use super::nearest::Nearest;
use super::{Atlas, ChartTriangle};
use crate::accel::Hit;
use crate::{PixelSurface, Surface, Surfaces};
use glam::{Vec2, Vec3A};

/// A point on one side of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasPoint {
    /// Index into the scene's instances.
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// World space, meters.
    pub position: Vec3A,
    /// A normal of the triangle, of any length, that tells which side is meant.
    pub geometric_normal: Vec3A,
}

impl From<&PixelSurface> for AtlasPoint {
    fn from(pixel: &PixelSurface) -> Self {
        Self {
            instance: pixel.instance,
            triangle: pixel.triangle,
            position: pixel.position.into(),
            geometric_normal: pixel.geometric_normal.into(),
        }
    }
}

/// A surface point that a texel may stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelSite {
    /// Index into the scene's instances.
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// World space, meters.
    pub position: Vec3A,
    /// Unit normal of the triangle, on the texel's side.
    pub geometric_normal: Vec3A,
    /// Unit normal to shade with: smooth, and bent by the normal map, which is filtered over a texel.
    pub shading_normal: Vec3A,
}

impl TexelSite {
    /// The same point, to be looked up.
    #[must_use]
    pub fn point(&self) -> AtlasPoint {
        let &Self { instance, triangle, position, geometric_normal, .. } = self;
        AtlasPoint { instance, triangle, position, geometric_normal }
    }
}

/// Four texels around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelBlend {
    /// The upper left texel, its right neighbor, the two below them. A texel stands twice where the other would have no weight.
    pub texels: [u32; 4],
    /// Bilinear weights, 0…1; they sum to 1.
    pub weights: [f32; 4],
}

/// Points as near as this to the center of a texel count as there, in each direction: the edges of charts \[texels\].
const AT_CENTER: f32 = 1e-3;

/// Points of a texel, from its center \[texels\].
const LATTICE: [Vec2; 9] = {
    const THIRD: f32 = 1.0 / 3.0;
    [
        Vec2::ZERO,
        Vec2::new(-THIRD, -THIRD),
        Vec2::new(THIRD, THIRD),
        Vec2::new(THIRD, -THIRD),
        Vec2::new(-THIRD, THIRD),
        Vec2::new(-THIRD, 0.0),
        Vec2::new(THIRD, 0.0),
        Vec2::new(0.0, -THIRD),
        Vec2::new(0.0, THIRD),
    ]
};
/// Places nearer than this to a chart lie on it \[square texels\].
const ON_CHART: f32 = 1e-6;
/// Sites nearer than this to each other are one \[texels\].
const SAME_PLACE: f32 = 0.01;
/// Unless the cosine between their normals is less than this.
const SAME_NORMAL: f32 = 0.999;

impl Atlas {
    /// Surface points that a texel may stand for, one at least and ten at most.
    ///
    /// All sites are near to points of the texel, and lie on the triangles that are nearest to its center and to those of its neighbors.
    /// The first is near to the middle of the part of the texel that lies on the chart: on its edge, half of the texel lies beside
    /// it, and edges are in corners often. Others are near to the points of a 3×3 lattice, those on the chart before those beside it.
    ///
    /// `surfaces` are those of the scene that the atlas was made for, or that it was validated with.
    ///
    /// # Panics
    ///
    /// If `texel` is not below [`Atlas::len`].
    #[must_use]
    pub fn sites(&self, texel: usize, surfaces: &Surfaces) -> Vec<TexelSite> {
        // Triangles to choose from, without repeats.
        let mut owners = vec![self.owners[texel]];
        for neighbor in self.neighbors(texel).into_iter().flatten() {
            let owner = self.owners[neighbor as usize];
            if !owners.contains(&owner) {
                owners.push(owner);
            }
        }

        // The nearest point of the nearest triangle to a place.
        let (x, y) = self.place(texel);
        let [left, top] = self.charts[self.chart(texel) as usize];
        let center = Vec2::new(x.wrapping_sub(left) as f32 + 0.5, y.wrapping_sub(top) as f32 + 0.5);
        let nearest = |place: Vec2| {
            let of_owner = |&owner: &u32| (owner, Nearest::in_plane(self.triangles[owner as usize].corners(), place));
            owners.iter().map(of_owner).min_by(|a, b| a.1.distance2.total_cmp(&b.1.distance2))
        };

        // The middle of the points that lie on the chart, these points, and those beside it.
        let is_on_chart =
            |offset: &Vec2| nearest(center + *offset).is_some_and(|(_, nearest)| nearest.distance2 <= ON_CHART);
        let (on_chart, beside): (Vec<Vec2>, Vec<Vec2>) = LATTICE.into_iter().partition(is_on_chart);
        let middle = on_chart.iter().sum::<Vec2>() / (on_chart.len() as f32).max(1.0);
        let mut sites: Vec<TexelSite> = Vec::with_capacity(1 + LATTICE.len());
        for offset in std::iter::once(middle).chain(on_chart).chain(beside) {
            let found = nearest(center + offset);
            let Some(site) = found.and_then(|(owner, nearest)| self.site(owner, nearest, surfaces)) else { continue };
            if !sites.iter().any(|other| self.is_same(other, &site)) {
                sites.push(site);
            }
        }
        sites
    }

    fn is_same(&self, one: &TexelSite, other: &TexelSite) -> bool {
        let apart = one.position.distance(other.position) * self.texels_per_meter;
        apart < SAME_PLACE && one.geometric_normal.dot(other.geometric_normal) > SAME_NORMAL
    }

    /// A point of a triangle of [`Atlas::triangles`] as a site.
    fn site(&self, index: u32, nearest: Nearest, surfaces: &Surfaces) -> Option<TexelSite> {
        let sheet = self.sheets[self.sheets.partition_point(|sheet| sheet.first <= index).checked_sub(1)?];
        let (instance, triangle) = (sheet.instance, index - sheet.first);

        // As a ray would meet it that comes straight onto this side, a texel wide.
        let outward = outward(surfaces, instance, triangle).try_normalize().unwrap_or(Vec3A::Y);
        let direction = if sheet.back { outward } else { -outward };
        let [_, u, v] = nearest.weights;
        let met =
            surfaces.meet(&Hit { distance: 0.0, instance, triangle, u, v }, direction, 1.0 / self.texels_per_meter);
        Some(TexelSite {
            instance,
            triangle,
            position: met.position,
            geometric_normal: met.geometric_normal,
            shading_normal: met.shading_normal(),
        })
    }

    /// The surface at one of a texel's [`sites`](Atlas::sites), as seen along its normal; textures are filtered over a texel.
    #[must_use]
    pub fn surface(&self, site: &TexelSite, surfaces: &Surfaces) -> Surface {
        let &TexelSite { instance, triangle, position, geometric_normal, .. } = site;
        let corners = surfaces.corners(instance as usize, triangle as usize);
        let [_, u, v] = Nearest::new(corners, position).weights;
        let hit = Hit { distance: 0.0, instance, triangle, u, v };
        surfaces.at(&hit, -geometric_normal, 1.0 / self.texels_per_meter)
    }

    /// The four texels around a point, and their weights: all are in use and belong to the point's chart.
    ///
    /// `None` for instances that move, for unlit surfaces and for backs of single-sided ones. A point that lies beside its
    /// triangle counts as the triangle's nearest one. Points of triangles thinner than a millionth of their instance count as
    /// one of its corners; `None` where there are only such triangles. `surfaces` as for [`Atlas::sites`].
    #[must_use]
    pub fn bilinear(&self, surfaces: &Surfaces, at: &AtlasPoint) -> Option<TexelBlend> {
        let is_known = surfaces.scene().instances.len() > at.instance as usize;
        let placed_on = |back| self.placed(at.instance, at.triangle, back).filter(|_| is_known);
        // The front is there if anything is.
        placed_on(false)?;
        let outward = outward(surfaces, at.instance, at.triangle);
        let placed = placed_on(at.geometric_normal.dot(outward) < 0.0)?;
        let corners = surfaces.corners(at.instance as usize, at.triangle as usize);
        self.blend(placed, Nearest::new(corners, at.position))
    }

    /// The look-up at a point of a triangle.
    pub(super) fn blend(&self, placed: &ChartTriangle, nearest: Nearest) -> Option<TexelBlend> {
        // Centers of texels are at halves. The point is f right of and below the center of the upper left one.
        let place = nearest.mix(placed.corners()) - 0.5;
        let first = (place + AT_CENTER).floor();
        let f = (place - first).max(Vec2::ZERO);
        let [left, top] = self.charts[placed.chart as usize];
        let (x, y) = (left.checked_add(first.x as u32)?, top.checked_add(first.y as u32)?);

        // At a center there may be no texel on the other side.
        let (right, f_x) = if f.x <= AT_CENTER { (x, 0.0) } else { (x.checked_add(1)?, f.x) };
        let (below, f_y) = if f.y <= AT_CENTER { (y, 0.0) } else { (y.checked_add(1)?, f.y) };
        let index = |x, y| self.tiles.index(x, y);
        Some(TexelBlend {
            texels: [index(x, y)?, index(right, y)?, index(x, below)?, index(right, below)?],
            weights: [(1.0 - f_x) * (1.0 - f_y), f_x * (1.0 - f_y), (1.0 - f_x) * f_y, f_x * f_y],
        })
    }
}

/// Normal of the side of a triangle that the file calls the front; its length is twice the area.
fn outward(surfaces: &Surfaces, instance: u32, triangle: u32) -> Vec3A {
    let [a, b, c] = surfaces.corners(instance as usize, triangle as usize);
    // A mirroring transform turns the corners round; the file's front stays the front.
    let mirrored = surfaces.world(instance as usize).matrix3.determinant() < 0.0;
    (b - a).cross(c - a) * if mirrored { -1.0 } else { 1.0 }
}
