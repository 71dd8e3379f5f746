//! Bounds of a cluster: a box of positions, a cone of axes, and the box as a receiver sees it.

use glam::{DVec3, Vec3};

use crate::lanes::{Real, Vector3};

/// A cone of directions around a unit axis. Built in `f64`: thousands of unions in a row may not widen a flat wall's cone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    pub axis: DVec3,
    /// 0 … π.
    pub half_angle: f64,
}

impl Cone {
    /// All directions.
    pub const SPHERE: Self = Self { axis: DVec3::Z, half_angle: std::f64::consts::PI };

    /// One direction.
    pub fn ray(axis: Vec3) -> Self {
        Self { axis: axis.as_dvec3().normalize(), half_angle: 0.0 }
    }

    /// The smallest cone around two.
    pub fn union(self, other: Self) -> Self {
        let (wide, narrow) = if self.half_angle >= other.half_angle { (self, other) } else { (other, self) };
        let sine_axis = wide.axis.cross(narrow.axis);
        let between = sine_axis.length().atan2(wide.axis.dot(narrow.axis));
        if between + narrow.half_angle <= wide.half_angle {
            return wide;
        }
        let half_angle = 0.5 * (between + wide.half_angle + narrow.half_angle);
        if half_angle >= std::f64::consts::PI {
            return Self::SPHERE;
        }
        // Turn the wide cone's axis towards the narrow one's; opposite axes may turn around any normal.
        let turn = half_angle - wide.half_angle;
        let across = sine_axis.cross(wide.axis).try_normalize().unwrap_or_else(|| wide.axis.any_orthonormal_vector());
        let axis = wide.axis * turn.cos() + across * turn.sin();
        Self { axis: axis.normalize(), half_angle }
    }
}

/// The box of a cluster seen from a receiver: what upper bounds over "all directions towards the cluster" are made of.
///
/// All lengths in meters, relative to the receiver's position, axes those of world space. For directional lights it is
/// a box of the unit directions towards them, which says the same about cosines.
/// `F` is `f32` for one box, [`Vec4`](glam::Vec4) for four.
#[derive(Clone, Copy, Debug)]
pub struct Region<F = f32> {
    low: Vector3<F>,
    high: Vector3<F>,
    nearest2: F,
    inverse_nearest: F,
}

impl<F: Real> Region<F> {
    /// The box from `low` to `high`, given relative to the receiver.
    #[inline(always)]
    pub fn new(low: Vector3<F>, high: Vector3<F>) -> Self {
        let nearest = low.max(-high).max(Vector3::splat(Vec3::ZERO));
        let nearest2 = nearest.dot(nearest);
        Self { low, high, nearest2, inverse_nearest: F::splat(1.0) / nearest2.sqrt() }
    }

    /// Smallest corner, relative to the receiver.
    #[inline]
    pub fn low(&self) -> Vector3<F> {
        self.low
    }

    /// Largest corner, relative to the receiver.
    #[inline]
    pub fn high(&self) -> Vector3<F> {
        self.high
    }

    /// Squared distance from the receiver to the box, zero inside \[m²\].
    #[inline(always)]
    pub fn nearest_distance2(&self) -> F {
        self.nearest2
    }

    /// Largest `axis · d` over the points d of the box \[m for a unit axis\].
    ///
    /// Summed from the corner's own products and not from center and half size: those cancel when a huge box
    /// begins close to the receiver, and a bound that rounds downward there is none.
    #[inline(always)]
    fn furthest_along(&self, axis: Vector3<F>) -> F {
        let corner = self.low.times(axis).max(self.high.times(axis));
        corner.x + corner.y + corner.z
    }

    /// Upper bound of the cosine between a unit axis and the directions to the box: −1 … 1, 1 for a receiver inside.
    #[inline(always)]
    pub fn max_cosine(&self, axis: Vector3<F>) -> F {
        let along = self.furthest_along(axis);
        let (_, inverse) = self.distance_to_divide_by(along);
        // A point with along = 0 and nearest = 0 gives 0 · ∞, no number; `min` then returns 1, which is safe.
        let cosine = (along * inverse).min(F::splat(1.0));
        cosine.max(F::splat(-1.0))
    }

    /// As [`Region::max_cosine`], but 0 where the whole box lies behind the plane of the axis.
    #[inline(always)]
    pub fn max_cosine_in_front(&self, axis: Vector3<F>) -> F {
        let along = self.furthest_along(axis);
        let cosine = (along * self.inverse_nearest).min(F::splat(1.0));
        F::select(F::splat(0.0).lt(along), cosine, F::splat(0.0))
    }

    /// Upper bound of the cosine between any axis in a cone and the directions to the box, 0 where all are behind.
    ///
    /// ```text
    /// φ  smallest angle between the cone's axis and those directions
    /// β  half-angle of the cone             cos(max(0, φ − β))
    /// ```
    #[inline(always)]
    pub fn max_cosine_of_cone(&self, cone: &DirectionCone<F>) -> F {
        let along = self.furthest_along(cone.axis);
        let (distance2, inverse) = self.distance_to_divide_by(along);
        // The sine times the distance; roots and quotient do not wait for each other.
        let across = (distance2 - along * along).max(F::splat(0.0)).sqrt();
        let turned = ((along * cone.cosine + across * cone.sine) * inverse).max(F::splat(0.0));
        // Inside the box 0 · ∞ may give no number, and no number is not less.
        F::select((along * inverse).lt(cone.cosine), turned.min(F::splat(1.0)), F::splat(1.0))
    }

    /// Squared distance, and one over it without the square, that make of a largest scalar product a largest cosine: the
    /// nearest point's where that is positive, the furthest corner's where it is not.
    #[inline(always)]
    fn distance_to_divide_by(&self, along: F) -> (F, F) {
        let furthest = self.high.max(-self.low);
        let furthest2 = furthest.dot(furthest);
        let behind = along.lt(F::splat(0.0));
        let inverse_furthest = F::splat(1.0) / furthest2.sqrt();
        (F::select(behind, furthest2, self.nearest2), F::select(behind, inverse_furthest, self.inverse_nearest))
    }
}

/// A cone of directions as bounds read it: unit axis, cosine and sine of its half-angle. All directions: cosine −1.
#[derive(Clone, Copy, Debug)]
pub struct DirectionCone<F = f32> {
    /// Unit axis.
    pub axis: Vector3<F>,
    /// Cosine of the half-angle.
    pub cosine: F,
    /// Sine of the half-angle.
    pub sine: F,
}

impl DirectionCone {
    /// A cone that holds all the given unit directions; all directions if there is none.
    pub fn around(directions: impl Iterator<Item = Vec3>) -> Self {
        let cone = directions.map(Cone::ray).reduce(Cone::union).unwrap_or(Cone::SPHERE);
        let (sine, cosine) = cone.half_angle.sin_cos();
        Self { axis: cone.axis.as_vec3().into(), cosine: cosine as f32, sine: sine.max(0.0) as f32 }
    }

    /// The same cone everywhere.
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
