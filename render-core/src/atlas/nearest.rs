//! Point of a triangle nearest to a given point.

use glam::{Vec2, Vec3A};

/// Point of a triangle nearest to a query point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearest {
    /// Barycentric weights of the corners, which sum to 1.
    pub weights: [f32; 3],
    /// Squared distance within the triangle's plane. It is exactly 0 if the query point projects into the triangle.
    pub distance2: f32,
}

impl Nearest {
    /// Finds the nearest point. The triangle may be degenerate: a point or a line.
    pub fn new(corners: [Vec3A; 3], point: Vec3A) -> Self {
        // Use fractions of the signed area along the normal as weights. All are nonnegative if the point projects into
        // the triangle.
        let [a, b, c] = corners.map(|corner| corner - point);
        let normal = (b - a).cross(c - a);
        let shares = [b.cross(c), c.cross(a), a.cross(b)].map(|area| area.dot(normal));
        let whole: f32 = shares.iter().sum();
        if whole > f32::MIN_POSITIVE && shares.iter().all(|&share| share >= 0.0) {
            return Self { weights: shares.map(|share| share / whole), distance2: 0.0 };
        }

        // Otherwise, find the nearest point on an edge, or the mean if several edges are equally near. A triangle
        // degenerated to a line then yields an inner point rather than an end.
        let (corners, mut nearest) = ([a, b, c], Self { weights: [1.0, 0.0, 0.0], distance2: f32::INFINITY });
        let mut count = 0.0;
        for k in 0..3 {
            // The point p + t (q − p) nearest to the origin has t = −p · (q − p) / |q − p|², clamped to 0…1.
            let (p, q) = (corners[k], corners[(k + 1) % 3]);
            let way = q - p;
            let t = (-p.dot(way) / way.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            let distance2 = (p + way * t).length_squared();
            if distance2 > nearest.distance2 {
                continue;
            }
            if distance2 < nearest.distance2 {
                (nearest, count) = (Self { weights: [0.0; 3], distance2 }, 0.0);
            }
            nearest.weights[k] += 1.0 - t;
            nearest.weights[(k + 1) % 3] += t;
            count += 1.0;
        }
        nearest.weights = nearest.weights.map(|weight| weight / f32::max(count, 1.0));
        nearest
    }

    /// Finds the nearest point in the plane.
    pub fn in_plane(corners: [Vec2; 3], point: Vec2) -> Self {
        Self::new(corners.map(|corner| corner.extend(0.0).into()), point.extend(0.0).into())
    }

    /// Returns the mean of values at the corners, weighted by the barycentric weights.
    pub fn mix<T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>>(&self, [a, b, c]: [T; 3]) -> T {
        a * self.weights[0] + b * self.weights[1] + c * self.weights[2]
    }
}
