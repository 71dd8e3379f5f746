//! Irradiance of dynamic objects for rays that end on them: a few points on each instance, lit once per frame.

use crate::frame::Frame;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use render_core::sampling::{Distribution, sobol_point, triangle};
use render_core::{Hit, Surface};
use std::collections::BTreeMap;

/// Maximum number of points on all instances together.
const MOST_POINTS: usize = 512;
/// Minimum and maximum number of points on an instance.
const POINTS_OF_AN_INSTANCE: (usize, usize) = (8, 64);
/// Squared distance that a normal in the opposite direction counts for, in squared radii of the instance.
const OPPOSITE: f32 = 4.0;

/// Point on an instance with its irradiance.
#[derive(Clone, Copy, Debug)]
struct LitPoint {
    position: Vec3A,
    normal: Vec3A,
    irradiance: Vec3,
}

/// Lit points of a frame, by instance.
#[derive(Debug, Default)]
pub(super) struct MoverPoints(BTreeMap<u32, Vec<LitPoint>>);

impl MoverPoints {
    /// Lights points on the moving `instances` of `frame`. `irradiance` returns the irradiance of a surface of an
    /// instance \[W·m⁻²\].
    pub fn light(frame: &Frame, instances: &[u32], irradiance: impl Fn(u32, &Surface) -> Vec3 + Sync) -> Self {
        let (least, most) = POINTS_OF_AN_INSTANCE;
        let count = (MOST_POINTS / instances.len().max(1)).clamp(least, most);
        let lit = |&instance: &u32| (instance, points(frame, instance, count, &irradiance));
        Self(instances.par_iter().map(lit).collect())
    }

    /// Returns the irradiance of the point on `instance` that is nearest in position and normal \[W·m⁻²\]. Returns `None`
    /// for an instance without points.
    pub fn nearest(&self, instance: u32, surface: &Surface) -> Option<Vec3> {
        let points = self.0.get(&instance)?;
        // Choose a radius for the comparison of normals from the extent of the points.
        let first = points.first()?;
        let extent2 = points.last().map_or(0.0, |last| last.position.distance_squared(first.position));
        let (mut best, mut least) = (first, f32::INFINITY);
        for point in points {
            let turned = 1.0 - point.normal.dot(surface.geometric_normal);
            let distance = point.position.distance_squared(surface.position) + OPPOSITE * extent2 * turned;
            if distance < least {
                (best, least) = (point, distance);
            }
        }
        Some(best.irradiance)
    }
}

/// Lights `count` points on an instance, evenly distributed over its area.
fn points(frame: &Frame, instance: u32, count: usize, irradiance: &impl Fn(u32, &Surface) -> Vec3) -> Vec<LitPoint> {
    // Weight the triangles by area.
    let surfaces = &frame.surfaces;
    let scene = surfaces.scene();
    let triangles = scene.meshes[scene.instances[instance as usize].mesh].triangles.len();
    let area_vector = |index: usize| {
        let [a, b, c] = surfaces.corners(instance as usize, index);
        (b - a).cross(c - a)
    };
    let areas = (0..triangles).map(|index| f64::from(area_vector(index).length()));
    let Some(distribution) = Distribution::new(areas) else { return Vec::new() };

    // Light both sides of each point: a ray may end on the back of a double-sided surface.
    let is_double_sided = surfaces.material(instance as usize).double_sided;
    let mut points = Vec::with_capacity(2 * count);
    for k in 0..count {
        let picked = distribution.pick((k as f64 + 0.5) / count as f64);
        let (u, v) = triangle(sobol_point(k as u64));
        let hit = Hit { distance: 0.0, instance, triangle: picked.index as u32, u, v };
        let outward = area_vector(picked.index).normalize_or_zero();
        for direction in [-outward, outward] {
            let surface = surfaces.at(&hit, direction, 0.0);
            if surface.front || is_double_sided {
                let (position, normal) = (surface.position, surface.geometric_normal);
                points.push(LitPoint { position, normal, irradiance: irradiance(instance, &surface) });
            }
        }
    }
    points
}
