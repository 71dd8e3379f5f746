//! Dynamic objects, and the directions in which they are visible.

use crate::shade::movement::{MovingBox, Sphere};
use glam::{Vec2, Vec3A};
use render_core::ShadingPoint;
use render_core::sampling::frame;
use std::f32::consts::{PI, TAU};

/// Minimum number of directions in a cone.
pub(super) const LEAST_DIRECTIONS: usize = 4;
/// Maximum rounding error of a cosine. The directions of a cone must have a density.
const ON_EDGE: f32 = 1e-5;
/// Distance from the center of a sphere, in radii, within which all directions are sampled.
const NEAR: f32 = 1.02;
/// Number of spheres that are compared in pairs. More spheres are merged with the next one in order first.
const MOST_COMPARED: usize = 64;
/// Maximum number of cones; nearby objects share a cone.
pub(super) const MOST_CONES: usize = 6;
/// Minimum fraction of the hemisphere, weighted by cosine, that objects must cover to change the light.
pub(super) const LEAST_COVER: f32 = 0.002;

/// Number of directions of an estimate: around the objects, and in the hemisphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Directions {
    /// Number of directions around the objects.
    pub around: usize,
    /// Number of directions in the hemisphere.
    pub hemisphere: usize,
    /// Number of reflections between changed surfaces.
    pub follows: usize,
    /// Offset of the points from which directions are made, 0…1 on each axis.
    pub shift: Vec2,
}

/// Dynamic objects of a frame.
#[derive(Debug, Default)]
pub(super) struct Movers {
    pub spheres: Vec<Sphere>,
}

impl Movers {
    /// Bounds the objects in the boxes `standing` by a few spheres.
    pub fn new(standing: &[MovingBox]) -> Self {
        let mut spheres: Vec<Sphere> = standing.iter().map(|thing| thing.sphere()).collect();
        // Merge the closest spheres until few are left.
        while spheres.len() > MOST_COMPARED {
            spheres = spheres.chunks(2).map(|pair| pair[0].with(pair.last().unwrap_or(&pair[0]))).collect();
        }
        while spheres.len() > MOST_CONES {
            let (one, other) = closest(&spheres);
            let merged = spheres[one].with(&spheres[other]);
            spheres.swap_remove(other);
            spheres[one] = merged;
        }
        Self { spheres }
    }

    /// Returns the fraction of the hemisphere over `receiver` that the objects cover, weighted by cosine.
    pub fn cover(&self, receiver: &ShadingPoint) -> f32 {
        self.cones(receiver).map(|(_, cover)| cover).sum()
    }

    /// Returns the directions in which objects are visible from `receiver`, each with the fraction of the hemisphere that
    /// it covers.
    pub fn cones(&self, receiver: &ShadingPoint) -> impl Iterator<Item = (Cone, f32)> {
        self.spheres.iter().filter_map(move |sphere| cone(sphere, receiver))
    }
}

/// Directions around a sphere.
pub(super) enum Cone {
    /// All directions above the receiver, cosine-distributed.
    Hemisphere,
    /// Directions within an angle of the axis, uniformly distributed.
    Around { axis: Vec3A, cosine: f32 },
}

impl Cone {
    /// Returns the density of a direction \[sr⁻¹\].
    pub fn density(&self, direction: Vec3A, normal: Vec3A) -> f32 {
        match *self {
            Self::Hemisphere => direction.dot(normal).max(0.0) / PI,
            Self::Around { axis, cosine } if direction.dot(axis) >= cosine - ON_EDGE => 1.0 / (TAU * (1.0 - cosine)),
            Self::Around { .. } => 0.0,
        }
    }

    /// Returns the direction at a point of the unit square.
    pub fn direction(&self, u: Vec2, normal: Vec3A) -> Vec3A {
        let (axis, z) = match *self {
            Self::Hemisphere => (normal, (1.0 - u.x).sqrt()),
            Self::Around { axis, cosine } => (axis, 1.0 - u.x * (1.0 - cosine)),
        };
        let (x, y) = frame(axis.into());
        let ((sine, turned), radius) = ((TAU * u.y).sin_cos(), (1.0 - z * z).max(0.0).sqrt());
        Vec3A::from(x * (turned * radius) + y * (sine * radius)) + axis * z
    }
}

/// Returns the directions in which a sphere is visible from `receiver`, and the fraction of the hemisphere that the
/// sphere covers. Returns `None` for a sphere below the horizon.
fn cone(sphere: &Sphere, receiver: &ShadingPoint) -> Option<(Cone, f32)> {
    let way = sphere.center - receiver.position;
    let distance = way.length();
    if distance <= NEAR * sphere.radius {
        return Some((Cone::Hemisphere, 1.0));
    }
    let (axis, sine) = (way / distance, sphere.radius / distance);
    // Count the cosine of the sphere's highest point: an object on the ground is half below the horizon.
    let highest = (receiver.normal.dot(axis) + sine).min(1.0);
    (highest > 0.0).then(|| (Cone::Around { axis, cosine: (1.0 - sine * sine).sqrt() }, sine * sine * highest))
}

impl Sphere {
    /// Returns the smallest sphere around this and another sphere.
    fn with(&self, other: &Self) -> Self {
        let way = other.center - self.center;
        let distance = way.length();
        if distance + other.radius <= self.radius {
            return *self;
        }
        if distance + self.radius <= other.radius {
            return *other;
        }
        let radius = 0.5 * (distance + self.radius + other.radius);
        Self { center: self.center + way * ((radius - self.radius) / distance), radius }
    }
}

/// Returns the indices of the two spheres whose common sphere is smallest; the first index is smaller.
fn closest(spheres: &[Sphere]) -> (usize, usize) {
    let (mut best, mut least) = ((0, 1), f32::INFINITY);
    for (one, sphere) in spheres.iter().enumerate() {
        for (other, second) in spheres.iter().enumerate().skip(one + 1) {
            let radius = sphere.with(second).radius;
            if radius < least {
                (best, least) = ((one, other), radius);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::sampling::hash_unit;

    /// The directions of a cone have the stated density: their mean of 1/p is the solid angle of the cone.
    #[test]
    fn directions_have_their_density() {
        let normal = Vec3A::new(0.6, 0.0, 0.8);
        let axis = Vec3A::new(0.0, 0.6, 0.8);
        for (cone, solid_angle) in
            [(Cone::Around { axis, cosine: 0.9 }, TAU * 0.1), (Cone::Around { axis, cosine: 0.5 }, TAU * 0.5)]
        {
            for k in 0..1000 {
                // Include directions on the edge of the cone.
                let u = Vec2::new(if k < 500 { 1.0 - f32::EPSILON } else { hash_unit(k, 0, 1) }, hash_unit(k, 0, 2));
                let direction = cone.direction(u, normal);
                assert!((direction.length() - 1.0).abs() < 1e-5, "{direction}");
                assert!((cone.density(direction, normal) * solid_angle - 1.0).abs() < 1e-4);
            }
        }
        // The hemisphere's density is proportional to the cosine, so that the mean of cos/p is π.
        let mut sum = 0.0;
        for k in 0..1000 {
            let u = Vec2::new(hash_unit(k, 1, 1), hash_unit(k, 1, 2));
            let direction = Cone::Hemisphere.direction(u, normal);
            sum += direction.dot(normal) / Cone::Hemisphere.density(direction, normal);
        }
        assert!((sum / 1000.0 / PI - 1.0).abs() < 1e-3, "{sum}");
    }

    #[test]
    fn a_common_sphere_contains_both() {
        for k in 0..100 {
            let sphere = |d: u64| Sphere {
                center: Vec3A::new(hash_unit(k, d, 0), hash_unit(k, d, 1), hash_unit(k, d, 2)),
                radius: hash_unit(k, d, 3),
            };
            let (one, other) = (sphere(0), sphere(1));
            let both = one.with(&other);
            for part in [one, other] {
                assert!(both.center.distance(part.center) + part.radius <= both.radius * 1.0001, "case {k}");
            }
        }
    }
}
