//! Zones around the cameras of a film: distant surfaces have fewer anchors.
//!
//! If anchors are distributed evenly by area, a room in a plain of 200 m has only one anchor in fifty. Zones
//! increase this fraction:
//!
//! ```text
//! z(x) = 0 where d(x) < D,   ⌈log₂ (d(x) / D)⌉ elsewhere        zone of a point
//! A(x) = A · 8^z(x)           R(x) = R · √8^z(x)                 area share and kernel radius of a point
//!   d  distance to the nearest camera          D  distance within which surfaces are seen in detail
//! ```
//!
//! On a plain, each zone has half as many points as the previous zone, although its area is four times as large. If a
//! whole scene is seen in detail, it has one zone and its anchors are unchanged.

use crate::PosedScene;
use crate::gbuffer::CameraRay;
use crate::scene::View;
use glam::{Vec2, Vec3A};
use std::sync::Arc;

/// Ratio of D to the distance within which nine of ten camera rays end.
const BEYOND_SEEN: f32 = 1.5;
/// Fraction of the camera rays that end within the distance from which D is derived.
const SEEN: f32 = 0.9;
/// Number of camera rays along each side of a picture.
const SIDE: u16 = 24;
/// Index of the last zone, which begins at half a million times D.
const LAST: u32 = 20;
/// Minimum radius of a piece of surface that is subdivided between zones, as a fraction of the distance to the camera.
const NARROW: f32 = 0.05;

/// Zones around the cameras of a film. There is a single zone without cameras.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Zones {
    cameras: Arc<[Vec3A]>,
    /// Distance D within which surfaces are seen in detail \[m\].
    near: f32,
    /// Maximum distance between the first camera and any other camera \[m\].
    spread: f32,
}

/// Camera positions and visible distances of a film, from which [`Zones`] are computed.
#[derive(Clone, Debug, Default)]
pub struct ZoneSearch {
    cameras: Vec<Vec3A>,
    /// Lengths of the rays with a hit \[m\].
    distances: Vec<f32>,
}

/// Area represented by each point, by position.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Shares {
    /// A in zone 0 \[m²\].
    pub area: f32,
    zones: Zones,
}

impl ZoneSearch {
    /// Adds the camera of `view` and the distances of the visible surfaces.
    pub fn look(&mut self, scene: PosedScene, view: &View) {
        // Trace a coarse grid of camera rays, and keep the distances to visible surfaces.
        let (center, _) = view.ray(view.size() * 0.5);
        self.cameras.push(center);
        for y in 0..SIDE {
            for x in 0..SIDE {
                let at = (Vec2::new(x.into(), y.into()) + 0.5) / f32::from(SIDE);
                let (origin, direction) = view.ray(at * view.size());
                let hit = scene.accelerator.closest(origin, direction);
                let shown = hit.and_then(|hit| CameraRay { origin, direction }.shown(scene, hit, |_| 0.0));
                self.distances.extend(shown.map(|(hit, _)| hit.distance));
            }
        }
    }

    /// Returns the zones, or a single zone if no surface was visible.
    #[must_use]
    pub fn finish(mut self) -> Zones {
        // Derive D from the distance within which 9 of 10 camera rays end.
        self.distances.sort_unstable_by(f32::total_cmp);
        let seen = self.distances.get((self.distances.len() as f32 * SEEN) as usize);
        let Some(&seen) = seen else { return Zones::default() };
        let mut spread: f32 = 0.0;
        for camera in &self.cameras {
            spread = spread.max(camera.distance(self.cameras[0]));
        }
        Zones { cameras: self.cameras.into(), near: BEYOND_SEEN * seen, spread }
    }
}

impl Zones {
    /// Returns whether all points are in a single zone.
    pub(super) fn is_one(&self) -> bool {
        self.cameras.is_empty()
    }

    /// Returns √8^z in the zone z at `position`.
    #[inline]
    pub(super) fn scale(&self, position: Vec3A) -> f32 {
        if self.is_one() { 1.0 } else { scale_of(self.zone(self.distance(position))) }
    }

    /// Returns whether the ball spans several zones and is large enough to be subdivided.
    pub(super) fn part_ball(&self, center: Vec3A, radius: f32) -> bool {
        if self.is_one() {
            return false;
        }
        let distance = self.distance(center);
        radius > NARROW * distance && self.zone(distance - radius) != self.zone(distance + radius)
    }

    /// Maps a position to a space in which all zones have the kernel radius `radius` \[m\]. In this space, the kernels
    /// of different zones do not overlap.
    #[inline]
    pub(super) fn unfolded(&self, position: Vec3A, radius: f32) -> Vec3A {
        // Scale the space by the zone, then place zones side by side along x.
        let Some(&center) = self.cameras.first() else { return position };
        let zone = self.zone(self.distance(position));
        let apart = 2.0 * (self.near + self.spread) + 4.0 * radius;
        (position - center) / scale_of(zone) + Vec3A::X * (apart * zone as f32)
    }

    /// Returns the distance d from `position` to the nearest camera \[m\].
    fn distance(&self, position: Vec3A) -> f32 {
        let mut least = f32::INFINITY;
        for camera in self.cameras.iter() {
            least = least.min(camera.distance_squared(position));
        }
        least.sqrt()
    }

    /// Returns the zone z at a `distance` from the nearest camera \[m\].
    fn zone(&self, distance: f32) -> u32 {
        // Casts map negative values and NaN to 0.
        ((distance / self.near).log2().ceil() as u32).min(LAST)
    }
}

/// Returns √8^z for the zone z.
fn scale_of(zone: u32) -> f32 {
    8f32.powi(zone as i32).sqrt()
}

impl From<f32> for Shares {
    /// Creates equal area shares everywhere.
    fn from(area: f32) -> Self {
        Self { area, zones: Zones::default() }
    }
}

impl Shares {
    /// Creates area shares of `area` \[m²\] in zone 0 of the `zones`.
    pub fn new(area: f32, zones: &Zones) -> Self {
        Self { area, zones: zones.clone() }
    }

    /// Returns the area share A(x) at position x \[m²\].
    #[inline]
    pub fn at(&self, position: Vec3A) -> f32 {
        let scale = self.zones.scale(position);
        self.area * scale * scale
    }

    pub fn zones(&self) -> &Zones {
        &self.zones
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anchor::AnchorSpread;
    use crate::anchor::{Anchors, Patches};
    use crate::ranks::Alone;
    use crate::scene::{Material, Mesh, Scene};
    use crate::surface::Surfaces;
    use crate::{Geometry, Units};
    use glam::Vec3;
    use std::f64::consts::PI;

    const NEAR: f32 = 10.0;
    const REACH: f32 = 100.0;

    fn zones(cameras: &[Vec3A]) -> Zones {
        Zones { cameras: cameras.into(), near: NEAR, spread: cameras[0].distance(cameras[cameras.len() - 1]) }
    }

    /// Returns a square plain of 200 m.
    fn plain() -> Scene {
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
        let positions = corners.map(|[x, z]| Vec3::new(x, 0.0, z) * REACH).into();
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
        Scene::of_mesh(mesh, Material::default())
    }

    #[test]
    fn shares_grow_eightfold_at_each_doubling_of_the_distance() {
        let shares = Shares::new(0.5, &zones(&[Vec3A::ZERO, Vec3A::X * 1000.0]));
        for (distance, share) in [(0.0, 0.5), (9.9, 0.5), (10.1, 4.0), (19.9, 4.0), (20.1, 32.0), (990.1, 0.5)] {
            assert!((shares.at(Vec3A::X * distance) / share - 1.0).abs() < 1e-5, "{distance} m");
        }
        assert_eq!(Shares::from(0.5).at(Vec3A::X * 1e9), 0.5);
        assert!(shares.at(Vec3A::NAN).is_finite() && shares.at(Vec3A::INFINITY).is_finite());
    }

    /// Rings within a plain have a weighted area of π D² (1 + 3/8 + 3/16 + …).
    #[test]
    fn the_area_of_a_plain_is_that_of_its_rings() {
        let scene = plain();
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        let found = Patches::of(&surfaces, false, &zones(&[Vec3A::ZERO])).unwrap().area();
        // Beyond 80 m, the rest of the square is in zone 4, because its corners are closer than 160 m.
        let (near, reach) = (f64::from(NEAR), f64::from(REACH));
        let rings = PI * near * near * (1.0 + 3.0 / 8.0 + 3.0 / 16.0 + 3.0 / 32.0);
        let corners = (4.0 * reach * reach - PI * 64.0 * near * near) / 4096.0;
        assert!((f64::from(found) / (rings + corners) - 1.0).abs() < 0.01, "{found} instead of {}", rings + corners);
    }

    /// Returns the placement of `fixed` anchors in `zones` by this process.
    fn spread(zones: &Zones, fixed: usize) -> AnchorSpread<'_> {
        AnchorSpread { zones, fixed, dynamic: 0, ranks: &Alone }
    }

    /// The anchors of each ring represent the ring's whole area.
    #[test]
    fn anchors_of_each_ring_stand_for_its_area() {
        let scene = plain();
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        let zones = zones(&[Vec3A::Y]);
        let anchors =
            Anchors::spread_exposed(&surfaces, &Geometry::new(&scene), &Units::of(&scene), &spread(&zones, 20_000));
        let shares = anchors.shares();
        for zone in 0..3 {
            let [inner, outer] =
                [if zone == 0 { 0.0 } else { NEAR * f32::from(1u8 << (zone - 1)) }, NEAR * f32::from(1u8 << zone)];
            let is_within = |position: Vec3A| (inner..outer).contains(&(position - Vec3A::Y).length());
            let places = anchors.fixed.iter().map(|anchor| anchor.position).filter(|&position| is_within(position));
            let stood_for: f32 = places.map(|position| shares.at(position)).sum();
            let area = std::f32::consts::PI * (outer * outer - 1.0 - (inner * inner - 1.0).max(0.0));
            assert!((stood_for / area - 1.0).abs() < 0.05, "zone {zone}: {stood_for} of {area} m²");
        }
    }

    /// A kernel in a zone within the plain contains some points, and its weights sum to 1.
    #[test]
    fn places_of_all_zones_have_neighbors() {
        let scene = plain();
        let surfaces = Surfaces::new(&scene, &scene.pose(0.0));
        let zones = zones(&[Vec3A::Y]);
        let anchors =
            Anchors::spread_exposed(&surfaces, &Geometry::new(&scene), &Units::of(&scene), &spread(&zones, 5000));
        let grid = super::super::Grid::new(&anchors.fixed, &[], anchors.shares());
        for step in 1..25 {
            let position = Vec3A::new(3.0 * step as f32, 1e-4, 2.0);
            let spot = super::super::Spot { position, normal: Vec3A::Y, instance: 0, only_own: false, came: None };
            let (mut count, mut sum) = (0, 0.0);
            assert!(grid.splat(&spot, None, |_, weight| {
                count += 1;
                sum += weight;
            }));
            assert!((sum - 1.0f32).abs() < 1e-4);
            assert!((3..=20).contains(&count), "{position}: {count} neighbors");
        }
    }
}
