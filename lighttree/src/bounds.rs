//! Bounds of a cluster: the box of its positions, the cone of its axes, and the box relative to a receiver.

use glam::{DVec3, Vec3};

use crate::lanes::{Real, Vector3};

/// Cone of directions around a unit axis. It uses `f64`, so that thousands of unions do not widen the cone of a flat
/// wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    pub axis: DVec3,
    /// Half-angle of the cone \[rad\], 0 … π.
    pub half_angle: f64,
}

impl Cone {
    /// Cone of all directions.
    pub const SPHERE: Self = Self { axis: DVec3::Z, half_angle: std::f64::consts::PI };

    /// Returns the cone of a single direction.
    pub fn ray(axis: Vec3) -> Self {
        Self { axis: axis.as_dvec3().normalize(), half_angle: 0.0 }
    }

    /// Returns the smallest cone around two cones.
    pub fn union(self, other: Self) -> Self {
        let (wide, narrow) = if self.half_angle >= other.half_angle { (self, other) } else { (other, self) };
        // Measure the angle with `atan2`, which stays accurate for nearly parallel axes.
        let sine_axis = wide.axis.cross(narrow.axis);
        let between = sine_axis.length().atan2(wide.axis.dot(narrow.axis));
        // The wide cone may already include the narrow cone.
        if between + narrow.half_angle <= wide.half_angle {
            return wide;
        }
        // Otherwise, span both outer edges.
        let half_angle = 0.5 * (between + wide.half_angle + narrow.half_angle);
        if half_angle >= std::f64::consts::PI {
            return Self::SPHERE;
        }
        // Rotate the wide cone's axis towards the narrow cone's axis. Opposite axes may rotate around any normal.
        let turn = half_angle - wide.half_angle;
        let across = sine_axis.cross(wide.axis).try_normalize().unwrap_or_else(|| wide.axis.any_orthonormal_vector());
        let axis = wide.axis * turn.cos() + across * turn.sin();
        Self { axis: axis.normalize(), half_angle }
    }
}

/// Box of a cluster relative to a receiver. Upper bounds over all directions to the cluster are computed from it.
///
/// Lengths are in meters, relative to the receiver's position, along the world axes. For directional lights the box
/// contains the unit directions towards them, which gives the same cosine bounds. `F` is `f32` for one box,
/// [`Vec4`](glam::Vec4) for four.
#[derive(Clone, Copy, Debug)]
pub struct Region<F = f32> {
    low: Vector3<F>,
    high: Vector3<F>,
    nearest2: F,
    inverse_nearest: F,
}

impl<F: Real> Region<F> {
    /// Creates a box from `low` to `high`, relative to the receiver \[m\].
    #[inline(always)]
    pub fn new(low: Vector3<F>, high: Vector3<F>) -> Self {
        let nearest = low.max(-high).max(Vector3::splat(Vec3::ZERO));
        let nearest2 = nearest.dot(nearest);
        Self { low, high, nearest2, inverse_nearest: F::splat(1.0) / nearest2.sqrt() }
    }

    /// Corner of the box with the smallest coordinates, relative to the receiver \[m\].
    #[inline]
    pub fn low(&self) -> Vector3<F> {
        self.low
    }

    /// Corner of the box with the largest coordinates, relative to the receiver \[m\].
    #[inline]
    pub fn high(&self) -> Vector3<F> {
        self.high
    }

    /// Squared distance from the receiver to the box \[m²\]. It is zero inside the box.
    #[inline(always)]
    pub fn nearest_distance2(&self) -> F {
        self.nearest2
    }

    /// Returns the largest `axis · d` over the points d of the box \[m for a unit axis\].
    ///
    /// The result is computed from products of the corners. Products of center and half size would cancel if a huge box
    /// begins close to the receiver. A value that is rounded down would not be a bound.
    #[inline(always)]
    fn furthest_along(&self, axis: Vector3<F>) -> F {
        let corner = self.low.times(axis).max(self.high.times(axis));
        corner.x + corner.y + corner.z
    }

    /// Returns an upper bound of the cosine between a unit axis and the directions to the box, −1 … 1. It is 1 if the
    /// receiver is inside the box.
    #[inline(always)]
    pub fn max_cosine(&self, axis: Vector3<F>) -> F {
        let along = self.furthest_along(axis);
        let (_, inverse) = self.distance_to_divide_by(along);
        // If `along` and `nearest` are 0, then 0 · ∞ = NaN. `min` then returns 1, a valid bound.
        let cosine = (along * inverse).min(F::splat(1.0));
        cosine.max(F::splat(-1.0))
    }

    /// Returns an upper bound of the cosine like [`Region::max_cosine`], but 0 if the whole box is behind the plane of
    /// the axis.
    #[inline(always)]
    pub fn max_cosine_in_front(&self, axis: Vector3<F>) -> F {
        let along = self.furthest_along(axis);
        let cosine = (along * self.inverse_nearest).min(F::splat(1.0));
        F::select(F::splat(0.0).lt(along), cosine, F::splat(0.0))
    }

    /// Returns an upper bound of the cosine between any axis in a cone and the directions to the box, cos(max(0, φ −
    /// β)). It is 0 if all directions are behind the axes.
    ///
    /// ```text
    /// φ  smallest angle between the cone's axis and those directions
    /// β  half-angle of the cone             cos(max(0, φ − β))
    /// ```
    #[inline(always)]
    pub fn max_cosine_of_cone(&self, cone: &DirectionCone<F>) -> F {
        let along = self.furthest_along(cone.axis);
        let (distance2, inverse) = self.distance_to_divide_by(along);
        // Compute the sine times the distance. The square roots and the quotient are independent of each other.
        let across = (distance2 - along * along).max(F::splat(0.0)).sqrt();
        let turned = ((along * cone.cosine + across * cone.sine) * inverse).max(F::splat(0.0));
        // Inside the box, 0 · ∞ may give NaN. The comparison with NaN is false and selects 1.
        F::select((along * inverse).lt(cone.cosine), turned.min(F::splat(1.0)), F::splat(1.0))
    }

    /// Returns the squared distance and the inverse distance that convert the largest scalar product to the largest
    /// cosine. They belong to the nearest point of the box if `along` is positive, otherwise to the furthest corner.
    #[inline(always)]
    fn distance_to_divide_by(&self, along: F) -> (F, F) {
        let furthest = self.high.max(-self.low);
        let furthest2 = furthest.dot(furthest);
        let behind = along.lt(F::splat(0.0));
        let inverse_furthest = F::splat(1.0) / furthest2.sqrt();
        (F::select(behind, furthest2, self.nearest2), F::select(behind, inverse_furthest, self.inverse_nearest))
    }
}

/// Cone of directions for bounds: unit axis, and cosine and sine of the half-angle. A cosine of −1 means all
/// directions.
#[derive(Clone, Copy, Debug)]
pub struct DirectionCone<F = f32> {
    /// Unit axis of the cone.
    pub axis: Vector3<F>,
    /// Cosine of the cone's half-angle.
    pub cosine: F,
    /// Sine of the cone's half-angle.
    pub sine: F,
}

impl DirectionCone {
    /// Returns a cone that contains all given unit directions, or all directions if `directions` is empty.
    pub fn around(directions: impl Iterator<Item = Vec3>) -> Self {
        let cone = directions.map(Cone::ray).reduce(Cone::union).unwrap_or(Cone::SPHERE);
        let (sine, cosine) = cone.half_angle.sin_cos();
        Self { axis: cone.axis.as_vec3().into(), cosine: cosine as f32, sine: sine.max(0.0) as f32 }
    }

    /// Returns the cone repeated in every lane.
    #[inline(always)]
    #[must_use]
    pub fn splat<F: Real>(&self) -> DirectionCone<F> {
        DirectionCone {
            axis: Vector3::splat(self.axis.into()),
            cosine: F::splat(self.cosine),
            sine: F::splat(self.sine),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = Vec3> {
        (-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn union_holds_both_and_is_tight(a in vector(), b in vector(), wide in 0.0..3.0f64, narrow in 0.0..3.0f64) {
            prop_assume!(a.length() > 0.1 && b.length() > 0.1);
            let a = Cone { half_angle: wide, ..Cone::ray(a) };
            let b = Cone { half_angle: narrow, ..Cone::ray(b) };
            let both = a.union(b);
            let furthest = |c: Cone| both.axis.angle_between(c.axis) + c.half_angle;
            let needed = furthest(a).max(furthest(b)).min(std::f64::consts::PI);
            prop_assert!(both.half_angle >= needed - 1e-7, "{both:?} around {a:?} {b:?}");
            prop_assert!(both.half_angle <= needed + 1e-7, "{both:?} around {a:?} {b:?}");
        }

        #[test]
        fn cosine_of_any_point_is_bounded(
            corner in vector(), size in vector(), share in vector(), axis in vector(), scale in -3..3i32,
        ) {
            prop_assume!(axis.length() > 0.1);
            let axis = axis.normalize();
            let low = corner;
            let high = corner + size.abs() * 10f32.powi(scale);
            let point = low + (high - low) * (share * 0.5 + 0.5);
            prop_assume!(point.length() > 1e-6);
            let region = Region::<f32>::new(low.into(), high.into());
            let cosine = axis.dot(point) / point.length();
            prop_assert!(region.max_cosine(axis.into()) >= cosine - 1e-5);
            prop_assert!(region.max_cosine_in_front(axis.into()) >= cosine.min(region.max_cosine_in_front(axis.into())) - 1e-5);
            prop_assert!(region.max_cosine_in_front(axis.into()) >= region.max_cosine(axis.into()));
        }
    }

    #[test]
    fn unions_of_one_axis_stay_sharp() {
        let axis = Vec3::new(0.3, -0.5, 0.8).normalize();
        let cone = (0..100_000).fold(Cone::ray(axis), |cone, _| cone.union(Cone::ray(axis)));
        assert!(cone.half_angle < 1e-6, "{cone:?}");
    }
}
