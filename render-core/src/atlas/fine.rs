//! Finer image of the atlas: the nearest chart point for each texel of the image.

use super::cover::extent;
use super::nearest::Nearest;
use super::point::TexelBlend;
use super::{Atlas, NONE};
use crate::accel::Hit;
use glam::Vec2;
use rayon::prelude::*;

/// Maximum distance between a texel with a point and its chart \[fine texels\]. Bilinear samples reach at most one
/// texel.
const REACH: f32 = 4.0;
/// Number of rows that are filled in one task.
const BAND: usize = 32;

/// Image of the whole atlas at a higher density.
#[derive(Clone, Debug)]
pub struct FineTexels<'a> {
    atlas: &'a Atlas,
    scale: f32,
    width: u32,
    height: u32,
    /// For each texel, the triangle nearest to the texel's center, as an index into the atlas's triangles, or [`NONE`].
    owners: Vec<u32>,
}

/// Chart point that a fine texel represents.
#[derive(Clone, Copy, Debug)]
pub struct FinePoint {
    /// Triangle and barycentric weights of the point. The distance of the hit is 0.
    pub hit: Hit,
    /// Atlas texels around the point, with their bilinear weights.
    pub blend: TexelBlend,
}

/// Triangle in the fine image.
struct DrawnTriangle {
    index: u32,
    /// Positions of the corners \[fine texels\].
    corners: [Vec2; 3],
}

impl Atlas {
    /// Returns an image of the atlas with `scale` ≥ 1 texels per atlas texel along both sides.
    ///
    /// # Panics
    ///
    /// If `scale` is less than 1, because charts would not stay separate.
    #[must_use]
    pub fn fine(&self, scale: f32) -> FineTexels<'_> {
        assert!(scale >= 1.0, "{scale} texels to a texel");
        let (columns, rows) = self.size();
        let side = |texels: u32| ((texels as f32 * scale).ceil() as u32).max(1);
        let (width, height) = (side(columns), side(rows));

        // Add each triangle to the bands of rows that it may be near.
        let mut bands: Vec<Vec<DrawnTriangle>> = Vec::new();
        bands.resize_with((height as usize).div_ceil(BAND), Vec::new);
        for (index, placed) in self.triangles.iter().enumerate().filter(|(_, placed)| placed.chart != NONE) {
            let [left, top] = self.charts[placed.chart as usize];
            let corners = placed.corners().map(|corner| (corner + Vec2::new(left as f32, top as f32)) * scale);
            let (low, high) = corners
                .iter()
                .fold((f32::INFINITY, 0.0f32), |(low, high), corner| (low.min(corner.y), high.max(corner.y)));
            let band = |y: f32| (y.max(0.0) as usize / BAND).min(bands.len() - 1);
            let (first, last) = (band(low - REACH - 1.0), band(high + REACH + 1.0));
            // Skip triangles with NaN coordinates, which are in no band.
            for band in bands.get_mut(first..=last).into_iter().flatten() {
                band.push(DrawnTriangle { index: index as u32, corners });
            }
        }

        // Fill the bands in parallel. Among triangles at equal distances, the first wins.
        let mut owners = vec![NONE; width as usize * height as usize];
        owners.par_chunks_mut(BAND * width as usize).zip(bands).enumerate().for_each(|(band, (owners, triangles))| {
            fill(owners, (band * BAND) as u32, width, &triangles);
        });
        FineTexels { atlas: self, scale, width, height, owners }
    }
}

/// Finds the owners of the texels in a band of rows. `top` is the first row.
fn fill(owners: &mut [u32], top: u32, width: u32, triangles: &[DrawnTriangle]) {
    let mut nearest = vec![REACH * REACH; owners.len()];
    for DrawnTriangle { index, corners } in triangles {
        for (row, (owners, nearest)) in
            owners.chunks_mut(width as usize).zip(nearest.chunks_mut(width as usize)).enumerate()
        {
            // Visit the texels of a row within REACH of the triangle.
            let y = (top + row as u32) as f32 + 0.5;
            let Some((left, right)) = extent(*corners, y - REACH, y + REACH) else { continue };
            let first = (left - REACH).max(0.0) as usize;
            let last = ((right + REACH) as usize).min(width as usize - 1);
            for x in first..=last {
                let distance2 = Nearest::in_plane(*corners, Vec2::new(x as f32 + 0.5, y)).distance2;
                // Ties keep the first triangle, so the result does not depend on bands.
                if distance2 < nearest[x] {
                    (owners[x], nearest[x]) = (*index, distance2);
                }
            }
        }
    }
}

impl FineTexels<'_> {
    /// Returns the number of texels in a row.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Returns the width of a fine texel on flat surfaces \[m\].
    #[must_use]
    pub fn texel_width(&self) -> f32 {
        1.0 / (self.atlas.texels_per_meter * self.scale)
    }

    /// Returns the texture coordinates of a position in the atlas, see [`Atlas::triangle_places`]. The coordinates are
    /// 0 at the image's left and upper edges, and 1 at the right and lower edges.
    #[must_use]
    pub fn uv(&self, place: Vec2) -> Vec2 {
        place * self.scale / Vec2::new(self.width as f32, self.height as f32)
    }

    /// Returns the chart point nearest to the center of a texel. Returns `None` if this point is more than four texels
    /// away, or if the texel is outside the image.
    #[must_use]
    pub fn point(&self, x: u32, y: u32) -> Option<FinePoint> {
        // Find the triangle of the texel, and convert the center of the texel to chart coordinates.
        let place = (x < self.width).then_some(y as usize * self.width as usize + x as usize)?;
        let owner = *self.owners.get(place).filter(|owner| **owner != NONE)?;
        let placed = &self.atlas.triangles[owner as usize];
        let [left, top] = self.atlas.charts[placed.chart as usize];
        let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / self.scale - Vec2::new(left as f32, top as f32);
        let nearest = Nearest::in_plane(placed.corners(), center);

        // Convert the triangle to an instance and a triangle of the instance's mesh.
        let before = self.atlas.sheets.partition_point(|sheet| sheet.first <= owner);
        let sheet = self.atlas.sheets[before.checked_sub(1)?];
        let [_, u, v] = nearest.weights;
        let hit = Hit { distance: 0.0, instance: sheet.instance, triangle: owner - sheet.first, u, v };
        Some(FinePoint { hit, blend: self.atlas.blend(placed, nearest)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surfaces;
    use crate::scene::{Material, Mesh, Scene};
    use glam::Vec3;

    /// Returns a scene with two separate double-sided squares.
    fn squares() -> Scene {
        let mut mesh = Mesh::default();
        for (corner, size) in [(Vec3::ZERO, 1.0), (Vec3::Z, 0.37)] {
            let first = mesh.positions.len() as u32;
            let [x, y] = [Vec3::X, Vec3::Y].map(|axis| axis * size);
            mesh.positions.extend([corner, corner + x, corner + x + y, corner + y]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        Scene::of_mesh(mesh, Material { double_sided: true, ..Material::default() })
    }

    /// Every texel that bilinear samples in a triangle read represents a point of the triangle's chart. Texels within
    /// the chart represent the sampled position itself.
    #[test]
    fn look_ups_stay_in_their_charts() {
        let scene = squares();
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        let atlas = Atlas::new(&surfaces, 500).unwrap();
        for scale in [1.0, 1.7, 6.0] {
            let fine = atlas.fine(scale);
            for (triangle, front) in (0..4).flat_map(|triangle| [(triangle, true), (triangle, false)]) {
                let corners = atlas.triangle_places(0, triangle, front).unwrap();
                for step in 0..=400 {
                    let (u, v) = (step as f32 / 400.0, (step as f32 * 0.618).fract() * (1.0 - step as f32 / 400.0));
                    let place = corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
                    let pixels = fine.uv(place) * Vec2::new(fine.width as f32, fine.height as f32) - 0.5;
                    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                        let (x, y) = (pixels.x.floor() + dx, pixels.y.floor() + dy);
                        let point = fine.point(x as u32, y as u32).expect("a texel that look-ups read");
                        assert_eq!(point.hit.triangle / 2, triangle / 2, "scale {scale}: another square");
                        let found = surfaces.corners(0, point.hit.triangle as usize);
                        let [a, b, c] = found;
                        let found = a + (b - a) * point.hit.u + (c - a) * point.hit.v;
                        let [a, b, c] = surfaces.corners(0, triangle as usize);
                        let wanted = a + (b - a) * u + (c - a) * v;
                        let texels = found.distance(wanted) / fine.texel_width();
                        assert!(texels < 1.5, "scale {scale}: {texels} texels off");
                        // Check that the other side has a different position in the atlas.
                        let first = atlas.place(point.blend.texels[0] as usize);
                        let apart = (Vec2::new(first.0 as f32, first.1 as f32) - place).abs().max_element();
                        assert!(apart < 2.0 + 1.5 / scale, "scale {scale}: texel {first:?} for {place}");
                    }
                }
            }
        }
    }

    #[test]
    fn far_from_charts_nothing_is_shown() {
        let scene = squares();
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        let atlas = Atlas::new(&surfaces, 500).unwrap();
        let fine = atlas.fine(8.0);
        assert!(fine.point(fine.width() - 1, fine.height() - 1).is_none());
        assert!(fine.point(fine.width(), 0).is_none() && fine.point(0, fine.height()).is_none());
    }
}
