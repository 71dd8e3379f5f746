//! From texels to points on surfaces, and back.

use super::nearest::Nearest;
use super::{Atlas, Placed};
use crate::accel::Hit;
use crate::{PixelSurface, Surfaces};
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
    /// The upper left texel, its right neighbor, the two below them.
    pub texels: [u32; 4],
    /// Bilinear weights, 0…1; they sum to 1.
    pub weights: [f32; 4],
}

/// Where a texel is sampled, from its center \[texels\]: there first, then at the other points of a lattice.
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
/// Sites nearer than this to each other are one \[texels\].
const SAME_PLACE: f32 = 0.01;
/// Unless the cosine between their normals is less than this.
const SAME_NORMAL: f32 = 0.999;

impl Atlas {
    /// Surface points that a texel may stand for, one at least and nine at most.
    ///
    /// The first is the point of the chart that is nearest to the texel's center. Others are near to the points of a 3×3
    /// lattice of the texel, and lie on the triangles that are nearest to its center and to those of its neighbors.
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

        // The nearest point of the nearest triangle. For the center that is the first one.
        let (x, y) = self.place(texel);
        let [left, top] = self.charts[self.chart(texel) as usize];
        let center = Vec2::new(x.wrapping_sub(left) as f32 + 0.5, y.wrapping_sub(top) as f32 + 0.5);
        let mut sites: Vec<TexelSite> = Vec::with_capacity(LATTICE.len());
        for offset in LATTICE {
            let choice = if offset == Vec2::ZERO { &owners[..1] } else { &owners };
            let nearest = |&owner: &u32| {
                let corners = self.triangles[owner as usize].corners();
                (owner, Nearest::in_plane(corners, center + offset))
            };
            let found = choice.iter().map(nearest).min_by(|a, b| a.1.distance2.total_cmp(&b.1.distance2));
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
    fn blend(&self, placed: &Placed, nearest: Nearest) -> Option<TexelBlend> {
        // Centers of texels are at halves. The point is f right of and below the center of the upper left one.
        let place = nearest.mix(placed.corners()) - 0.5;
        let first = place.floor();
        let f = place - first;
        let [left, top] = self.charts[placed.chart as usize];
        let (x, y) = (left.checked_add(first.x as u32)?, top.checked_add(first.y as u32)?);

        let (right, below) = (x.checked_add(1)?, y.checked_add(1)?);
        let index = |x, y| self.tiles.index(x, y);
        Some(TexelBlend {
            texels: [index(x, y)?, index(right, y)?, index(x, below)?, index(right, below)?],
            weights: [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y],
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
