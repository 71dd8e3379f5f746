//! Instances in each pixel's area, found with separate rays. Mattes depend neither on light nor on outlines.

use super::{CameraRay, GBuffer, NOTHING, first_hits};
use crate::accel::{Hit, PACKET};
use crate::sampling::centered_sobol;
use crate::scene::View;
use crate::{PosedScene, Timed};
use glam::Vec2;
use rayon::prelude::*;

/// Fraction of a pixel that an instance covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceShare {
    /// Index into the scene's instances, or [`NOTHING`].
    pub instance: u32,
    /// Fraction of the pixel's area, 0…1; the fractions of a pixel sum to 1.
    pub share: f32,
}

/// Instances in each pixel of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstanceShares {
    /// End index of each pixel's entries, in raster order.
    ends: Vec<usize>,
    shares: Vec<InstanceShare>,
}

impl InstanceShares {
    /// Returns the instances of each pixel in raster order, sorted by index.
    pub fn pixels(&self) -> impl Iterator<Item = &[InstanceShare]> {
        let begins = std::iter::once(0).chain(self.ends.iter().copied());
        begins.zip(&self.ends).map(|(begin, &end)| &self.shares[begin..end])
    }

    /// Adds a pixel with these instances, one per ray.
    fn add(&mut self, mut instances: Vec<u32>) {
        let share = 1.0 / instances.len() as f32;
        instances.sort_unstable();
        for same in instances.chunk_by(|a, b| a == b) {
            self.shares.push(InstanceShare { instance: same[0], share: share * same.len() as f32 });
        }
        self.ends.push(self.shares.len());
    }

    /// Appends the pixels of the next row.
    fn extend(&mut self, row: Self) {
        let begin = self.shares.len();
        self.ends.extend(row.ends.iter().map(|end| begin + end));
        self.shares.extend(row.shares);
    }
}

impl GBuffer {
    /// Returns the instances that each pixel shows. `scene` is the scene of this G-buffer. At most 64 `rays` per pixel
    /// are spread over the pixel's area; a single ray passes through the center.
    pub fn instance_shares(&self, scene: PosedScene, rays: usize) -> Timed<InstanceShares> {
        Timed::of(|busy| {
            // Reuse the center's surface for a single ray.
            if rays <= 1 {
                let mut shares = InstanceShares::default();
                self.pixels.samples().iter().for_each(|pixel| shares.add(vec![pixel.instance]));
                return shares;
            }

            // Trace rows in parallel, and append them in order.
            let offsets: Vec<Vec2> = centered_sobol(rays.min(PACKET)).collect();
            let rows = (0..self.pixels.height()).into_par_iter();
            let rows: Vec<InstanceShares> =
                rows.map(|y| busy.measure(|| self.shares_of_row(scene, y, &offsets))).collect();
            let mut shares = InstanceShares::default();
            rows.into_iter().for_each(|row| shares.extend(row));
            shares
        })
    }

    /// Returns the instances of row `y`, with rays through `offsets` in each pixel.
    fn shares_of_row(&self, scene: PosedScene, y: usize, offsets: &[Vec2]) -> InstanceShares {
        let mut shares = InstanceShares::default();
        let columns: Vec<usize> = (0..self.pixels.width()).collect();
        let mut rays: Vec<CameraRay> = Vec::with_capacity(PACKET);
        for columns in columns.chunks(PACKET / offsets.len()) {
            // Fill a packet with the rays of several pixels.
            rays.clear();
            for &x in columns {
                let corner = Vec2::new(x as f32, y as f32);
                rays.extend(offsets.iter().map(|&offset| CameraRay::through(corner + offset, &self.view)));
            }

            // Count the instances pixel by pixel.
            let hits = first_hits(scene, &rays, &self.view);
            for (rays, hits) in rays.chunks(offsets.len()).zip(hits.chunks(offsets.len())) {
                shares.add(instances(scene, rays, hits, &self.view));
            }
        }
        shares
    }
}

/// Returns the instances that the rays of a pixel show, given their hits.
fn instances(scene: PosedScene, rays: &[CameraRay], hits: &[Option<Hit>], view: &View) -> Vec<u32> {
    let mut instances = Vec::with_capacity(rays.len());
    // Most rays of a pixel hit the same triangle, and all see the same side of it.
    let mut front: Option<Hit> = None;
    for (ray, hit) in rays.iter().zip(hits) {
        let Some(hit) = *hit else {
            instances.push(NOTHING);
            continue;
        };

        // Skip the test for a back if an earlier ray of the pixel found a front on this triangle.
        let is_same = |other: Hit| (other.instance, other.triangle) == (hit.instance, hit.triangle);
        if front.is_some_and(is_same) {
            instances.push(hit.instance);
            continue;
        }

        // Otherwise, find the first front behind a back.
        let distances = view.distances(ray.direction);
        let shown = ray.shown_within(distances, scene, hit, |_| 0.0).map(|(shown, _)| shown);
        instances.push(shown.map_or(NOTHING, |shown| shown.instance));
        if shown.is_some_and(is_same) {
            front = Some(hit);
        }
    }
    instances
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Mesh, Projection, Scene};
    use crate::{Geometry, Surfaces};
    use glam::{Affine3A, Vec3};

    /// Returns the coverage of a half-plane at x < `edge` meters, seen head-on through 8×4 pixels of 1 m.
    fn shares(edge: f32, rays: usize) -> InstanceShares {
        let positions = [[-99.0, -99.0], [edge, -99.0], [edge, 99.0], [-99.0, 99.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        let mesh = Mesh { positions: positions.into(), triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
        let scene = Scene::of_mesh(mesh, Material::default());
        let pose = scene.pose(0.0);
        let surfaces = Surfaces::new(&scene, &pose);
        let accelerator = Geometry::new(&scene).place(&pose);
        let posed = PosedScene::new(&accelerator, &surfaces);
        let world = Affine3A::from_translation(Vec3::new(0.0, 0.0, 5.0));
        let view = View::new(world, Projection::Orthographic { ymag: 2.0 }, 8, 4);
        GBuffer::trace(posed, &view, (8, 4)).value.instance_shares(posed, rays).value
    }

    #[test]
    fn shares_are_areas() {
        let (edge, rays) = (0.3, 16);
        let found = shares(edge, rays);
        assert_eq!(found.pixels().count(), 32);
        for (index, pixel) in found.pixels().enumerate() {
            let covered = (edge - ((index % 8) as f32 - 4.0)).clamp(0.0, 1.0);
            let own: f32 = pixel.iter().filter(|part| part.instance == 0).map(|part| part.share).sum();
            // Each column of 1/16 pixel contains one of sixteen points of the sequence.
            assert!((own - covered).abs() <= 1.0 / rays as f32, "{own} of {covered} at {index}");
            assert_eq!(pixel.iter().map(|part| part.share).sum::<f32>(), 1.0);
        }
    }

    #[test]
    fn a_single_ray_is_the_center() {
        for (index, pixel) in shares(0.3, 1).pixels().enumerate() {
            let instance = if index % 8 < 4 { 0 } else { NOTHING };
            assert_eq!(pixel, [InstanceShare { instance, share: 1.0 }]);
        }
    }
}
