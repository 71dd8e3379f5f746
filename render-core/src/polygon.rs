//! Irradiance from an unoccluded polygon of uniform emission, in closed form.

use glam::{Vec3, Vec3A};

/// Flat, convex piece of an emissive surface, with three or four corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Polygon {
    /// Corners in order around the border \[m\]. A triangle repeats its last corner.
    pub(crate) corners: [Vec3A; 4],
    /// Normal of the emitting side, a unit vector.
    pub(crate) normal: Vec3A,
    /// Whether the opposite side also emits.
    pub(crate) double_sided: bool,
    /// Emitted radiance of each emitting side \[W·m⁻²·sr⁻¹\].
    pub(crate) radiance: Vec3,
}

/// Maximum number of corners: four, and one more for each plane that clips a convex polygon.
const MOST_CORNERS: usize = 6;

impl Polygon {
    /// Returns the area of one side \[m²\].
    pub(crate) fn area(&self) -> f32 {
        let [a, b, c, d] = self.corners;
        // The area is half the length of the diagonals' cross product.
        (c - a).cross(d - b).length() / 2.0
    }

    /// Returns the irradiance at `position` \[W·m⁻²\] from the region of the polygon above the planes of the unit
    /// shading `normal` and of the unit `geometric_normal`.
    pub(crate) fn irradiance(&self, position: Vec3A, normal: Vec3A, geometric_normal: Vec3A) -> Vec3 {
        if !self.double_sided && self.normal.dot(position - self.corners[0]) <= 0.0 {
            return Vec3::ZERO;
        }
        // Clip at both horizons: the integral holds above the shading plane only.
        let mut corners = [Vec3A::ZERO; MOST_CORNERS];
        for (corner, own) in corners.iter_mut().zip(self.corners) {
            *corner = own - position;
        }
        let count = clip(&mut corners, 4, normal);
        let count = clip(&mut corners, count, geometric_normal);
        self.radiance * (projected_solid_angle(&corners[..count], normal))
    }
}

/// Returns ∫ cos θ dω over a polygon entirely above the horizon of the unit `normal` (Lambert 1760; Baum, Rushmeier &
/// Winget 1989, eq. 9):
///
/// ```text
/// ½ Σ Γᵢ · n·(vᵢ × vᵢ₊₁)/|vᵢ × vᵢ₊₁|       Γᵢ  angle between the directions to corners i and i + 1
/// ```
fn projected_solid_angle(corners: &[Vec3A], normal: Vec3A) -> f32 {
    let mut sum = 0.0;
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let across = a.cross(b);
        let sine = across.length();
        // Two corners in the same direction enclose no angle.
        if sine > 0.0 {
            sum += sine.atan2(a.dot(b)) * normal.dot(across) / sine;
        }
    }
    (sum / 2.0).abs()
}

/// Clips a polygon to the half-space above the plane through the origin (Sutherland & Hodgman 1974). Returns the number
/// of corners.
fn clip(corners: &mut [Vec3A; MOST_CORNERS], count: usize, normal: Vec3A) -> usize {
    // Keep a polygon above the plane unchanged, which is the usual case.
    if corners[..count].iter().all(|corner| normal.dot(*corner) >= 0.0) {
        return count;
    }
    let (before, mut kept) = (*corners, 0);
    for i in 0..count {
        let (a, b) = (before[i], before[(i + 1) % count]);
        let (height_a, height_b) = (normal.dot(a), normal.dot(b));
        let mut keep = |corner| {
            // Rounding may make a sliver concave. The area of a sliver is negligible, so surplus corners are dropped.
            if kept < MOST_CORNERS {
                corners[kept] = corner;
                kept += 1;
            }
        };
        // Keep corners above the plane, and add the intersections of edges with the plane.
        if height_a >= 0.0 {
            keep(a);
        }
        if (height_a >= 0.0) != (height_b >= 0.0) {
            keep(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash_unit;

    /// Returns the reference irradiance, computed with the midpoint rule in double precision.
    fn by_sum(polygon: &Polygon, position: Vec3A, normal: Vec3A, geometric_normal: Vec3A) -> f64 {
        let steps = 400;
        let [a, b, _, d] = polygon.corners.map(|corner| corner.as_dvec3());
        let (p, n, g) = (position.as_dvec3(), normal.as_dvec3(), geometric_normal.as_dvec3());
        let share = (b - a).cross(d - a).length() / f64::from(steps * steps);
        let mut sum = 0.0;
        for i in 0..steps * steps {
            let (u, v) = (f64::from(i % steps) + 0.5, f64::from(i / steps) + 0.5);
            let way = a + (b - a) * (u / f64::from(steps)) + (d - a) * (v / f64::from(steps)) - p;
            let light = -polygon.normal.as_dvec3().dot(way);
            let light = if polygon.double_sided { light.abs() } else { light.max(0.0) };
            if g.dot(way) > 0.0 {
                sum += n.dot(way).max(0.0) * light / way.length_squared().powi(2) * share;
            }
        }
        sum
    }

    #[test]
    fn the_closed_form_is_the_integral() {
        let random =
            |key, d: u64| Vec3A::from_array(std::array::from_fn(|k| hash_unit(3, key, 3 * d + k as u64) * 2.0 - 1.0));
        let mut lit = 0;
        for key in 0..40u64 {
            let (a, e, f) = (random(key, 0), random(key, 1), random(key, 2));
            let polygon = Polygon {
                corners: [a, a + e, a + e + f, a + f],
                normal: e.cross(f).normalize(),
                double_sided: key % 3 == 0,
                radiance: Vec3::ONE,
            };
            let position = random(key, 3) * 2.0;
            // Stay away from the polygon itself, because nearby the sum needs more points.
            let clearance = polygon.normal.dot(position - a).abs();
            if clearance < 0.2 {
                continue;
            }
            let normal = random(key, 4).normalize();
            let geometric_normal = (normal + random(key, 5) * 0.5).normalize();
            let expected = by_sum(&polygon, position, normal, geometric_normal);
            let found = f64::from(polygon.irradiance(position, normal, geometric_normal).x);
            assert!((found - expected).abs() < 2e-3 * expected + 2e-4, "{key}: {found} instead of {expected}");
            lit += usize::from(expected > 1e-3);
        }
        assert!(lit > 8, "only {lit} were lit: too few for a test");
    }

    #[test]
    fn a_triangle_is_half_of_its_square() {
        let (a, b, c, d) = (
            Vec3A::new(-1.0, 2.0, -1.0),
            Vec3A::new(1.0, 2.0, -1.0),
            Vec3A::new(1.0, 2.0, 1.0),
            Vec3A::new(-1.0, 2.0, 1.0),
        );
        let polygon = |corners| Polygon { corners, normal: -Vec3A::Y, double_sided: false, radiance: Vec3::ONE };
        let at = |corners| polygon(corners).irradiance(Vec3A::ZERO, Vec3A::Y, Vec3A::Y).x;
        assert!((at([a, b, c, c]) + at([a, c, d, d]) - at([a, b, c, d])).abs() < 1e-6);
        assert!((at([a, b, c, c]) / at([a, b, c, d]) - 0.5).abs() < 1e-6);
    }

    #[test]
    fn at_contact_half_of_all_directions_shine() {
        // Test at the maximum size of scenes and below.
        for far in [1e6, 1e9] {
            let polygon = Polygon {
                corners: [
                    Vec3A::new(-far, 1e-3, -far),
                    Vec3A::new(far, 1e-3, -far),
                    Vec3A::new(far, 1e-3, far),
                    Vec3A::new(-far, 1e-3, far),
                ],
                normal: -Vec3A::Y,
                double_sided: false,
                radiance: Vec3::ONE,
            };
            let found = polygon.irradiance(Vec3A::ZERO, Vec3A::Y, Vec3A::Y).x;
            assert!((found / std::f32::consts::PI - 1.0).abs() < 1e-5, "{found} is not π, at {far}");
            assert!((polygon.area() / (4.0 * far * far) - 1.0).abs() < 1e-6, "{far}");
        }
    }
}
