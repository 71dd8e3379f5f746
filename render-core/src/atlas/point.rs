//! Conversion between texels and points on surfaces.

use super::nearest::Nearest;
use super::{Atlas, ChartTriangle};
use crate::accel::Hit;
use crate::{PixelSurface, Surface, Surfaces};
use glam::{Vec2, Vec3A};

/// Point on one side of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasPoint {
    /// Index into the scene's instances.
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Position in world space \[m\].
    pub position: Vec3A,
    /// Normal of the triangle on the side of the point, of any length.
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

/// Surface point that a texel may represent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelSite {
    /// Index into the scene's instances.
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Position in world space \[m\].
    pub position: Vec3A,
    /// Unit normal of the triangle, on the texel's side.
    pub geometric_normal: Vec3A,
    /// Unit shading normal: interpolated, and perturbed by the normal map, which is filtered over a texel.
    pub shading_normal: Vec3A,
}

impl TexelSite {
    /// Returns the point at which to sample the atlas.
    #[must_use]
    pub fn point(&self) -> AtlasPoint {
        let &Self { instance, triangle, position, geometric_normal, .. } = self;
        AtlasPoint { instance, triangle, position, geometric_normal }
    }
}

/// Four texels around a point, with bilinear weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelBlend {
    /// The upper left texel, the texel to its right, and the two texels below. An index is repeated if the other texel
    /// would have no weight.
    pub texels: [u32; 4],
    /// Bilinear weights, 0…1, which sum to 1.
    pub weights: [f32; 4],
}

/// Maximum distance from the center of a texel that counts as zero, on each axis \[texels\]. The edges of charts are at
/// texel centers.
const AT_CENTER: f32 = 1e-3;

/// Sample positions in a texel, relative to its center \[texels\].
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
/// Maximum squared distance between a position on a chart and the nearest point of the chart \[square texels\].
const ON_CHART: f32 = 1e-6;
/// Maximum distance between sites that count as one site \[texels\].
const SAME_PLACE: f32 = 0.01;
/// Minimum cosine of the angle between the normals of sites that count as one site.
const SAME_NORMAL: f32 = 0.999;

impl Atlas {
    /// Returns the surface points that a texel may represent, 1 to 10.
    ///
    /// All sites are near points of the texel. They are on the triangles nearest to the texel's center or to the
    /// centers of adjacent texels. The first site is near the middle of the texel's area on the chart: half of a texel
    /// at the edge of a chart is outside, and edges often lie in corners of a room. The other sites are near the points
    /// of a 3×3 lattice, with points on the chart first.
    ///
    /// `surfaces` must belong to the scene for which the atlas was made or validated.
    ///
    /// # Panics
    ///
    /// If `texel` is not below [`Atlas::len`].
    #[must_use]
    pub fn sites(&self, texel: usize, surfaces: &Surfaces) -> Vec<TexelSite> {
        // List the candidate triangles without repetitions.
        let mut owners = vec![self.owners[texel]];
        for neighbor in self.neighbors(texel).into_iter().flatten() {
            let owner = self.owners[neighbor as usize];
            if !owners.contains(&owner) {
                owners.push(owner);
            }
        }

        // Find the point nearest to a position over all candidate triangles.
        let (x, y) = self.place(texel);
        let [left, top] = self.charts[self.chart(texel) as usize];
        let center = Vec2::new(x.wrapping_sub(left) as f32 + 0.5, y.wrapping_sub(top) as f32 + 0.5);
        let nearest = |place: Vec2| {
            let of_owner = |&owner: &u32| (owner, Nearest::in_plane(self.triangles[owner as usize].corners(), place));
            owners.iter().map(of_owner).min_by(|a, b| a.1.distance2.total_cmp(&b.1.distance2))
        };

        // Return the middle of the lattice points on the chart first, then these points, then the points outside the
        // chart.
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

    /// Returns a site at a point of the triangle with this `index` in [`Atlas::triangles`].
    pub(super) fn site(&self, index: u32, nearest: Nearest, surfaces: &Surfaces) -> Option<TexelSite> {
        let sheet = self.sheets[self.sheets.partition_point(|sheet| sheet.first <= index).checked_sub(1)?];
        let (instance, triangle) = (sheet.instance, index - sheet.first);

        // Create the site as the hit of a ray perpendicular to this side, one texel wide.
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

    /// Returns the surface at one of a texel's [`sites`](Atlas::sites), viewed along the site's normal. Textures are
    /// filtered over a texel.
    #[must_use]
    pub fn surface(&self, site: &TexelSite, surfaces: &Surfaces) -> Surface {
        let &TexelSite { instance, triangle, position, geometric_normal, .. } = site;
        let corners = surfaces.corners(instance as usize, triangle as usize);
        let [_, u, v] = Nearest::new(corners, position).weights;
        let hit = Hit { distance: 0.0, instance, triangle, u, v };
        surfaces.at(&hit, -geometric_normal, 1.0 / self.texels_per_meter)
    }

    /// Returns the four texels around a point, with their weights. All four are in use and belong to the point's chart.
    ///
    /// Returns `None` for moving instances, unlit surfaces and backs of single-sided surfaces. A point outside its
    /// triangle is replaced by the nearest point of the triangle. A point of a triangle thinner than a millionth of its
    /// instance is replaced by a corner of the triangle. Returns `None` if no triangle near such a
    /// point has an area. `surfaces` must belong to the scene for which the atlas was made or validated.
    #[must_use]
    pub fn bilinear(&self, surfaces: &Surfaces, at: &AtlasPoint) -> Option<TexelBlend> {
        let is_known = surfaces.scene().instances.len() > at.instance as usize;
        let placed_on = |back| self.placed(at.instance, at.triangle, back).filter(|_| is_known);
        // Return early if the front has no chart, because the back has none then either.
        placed_on(false)?;
        let outward = outward(surfaces, at.instance, at.triangle);
        let placed = placed_on(at.geometric_normal.dot(outward) < 0.0)?;
        // Find the nearest point of the triangle in world space, and its position in the atlas.
        let corners = surfaces.corners(at.instance as usize, at.triangle as usize);
        self.blend(placed, Nearest::new(corners, at.position))
    }

    /// Returns the bilinear sample at a point of a triangle.
    pub(super) fn blend(&self, placed: &ChartTriangle, nearest: Nearest) -> Option<TexelBlend> {
        // Subtract 0.5, because texel centers are at half-integers. The point is f right of and below the center of the
        // upper left texel.
        let place = nearest.mix(placed.corners()) - 0.5;
        let first = (place + AT_CENTER).floor();
        let f = (place - first).max(Vec2::ZERO);
        let [left, top] = self.charts[placed.chart as usize];
        let (x, y) = (left.checked_add(first.x as u32)?, top.checked_add(first.y as u32)?);

        // Repeat the texel if the point is at its center, because the next texel may not exist.
        let (right, f_x) = if f.x <= AT_CENTER { (x, 0.0) } else { (x.checked_add(1)?, f.x) };
        let (below, f_y) = if f.y <= AT_CENTER { (y, 0.0) } else { (y.checked_add(1)?, f.y) };
        let index = |x, y| self.tiles.index(x, y);
        Some(TexelBlend {
            texels: [index(x, y)?, index(right, y)?, index(x, below)?, index(right, below)?],
            weights: [(1.0 - f_x) * (1.0 - f_y), f_x * (1.0 - f_y), (1.0 - f_x) * f_y, f_x * f_y],
        })
    }
}

/// Returns the normal of a triangle's front as defined in the file. The length of the normal is twice the triangle's
/// area.
pub(super) fn outward(surfaces: &Surfaces, instance: u32, triangle: u32) -> Vec3A {
    let [a, b, c] = surfaces.corners(instance as usize, triangle as usize);
    // Reverse the normal under a mirroring transform, which reverses the order of corners but keeps the front.
    let mirrored = surfaces.world(instance as usize).matrix3.determinant() < 0.0;
    (b - a).cross(c - a) * if mirrored { -1.0 } else { 1.0 }
}
