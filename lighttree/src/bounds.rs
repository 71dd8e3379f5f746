//! Bounds of a cluster: a box of positions, a cone of axes, and the box as a receiver sees it.

use glam::{DVec3, Vec3, Vec3A};

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
/// All lengths in metres, relative to the receiver's position, axes those of world space.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    low: Vec3A,
    high: Vec3A,
    nearest2: f32,
    inverse_nearest: f32,
}

impl Region {
    /// The box from `low` to `high`, given relative to the receiver.
    #[inline]
    pub fn new(low: Vec3A, high: Vec3A) -> Self {
        let nearest = low.max(-high).max(Vec3A::ZERO);
        let nearest2 = nearest.length_squared();
        Self { low, high, nearest2, inverse_nearest: 1.0 / nearest2.sqrt() }
    }

    /// Smallest corner, relative to the receiver.
    #[inline]
    pub fn low(&self) -> Vec3 {
        self.low.into()
    }

    /// Largest corner, relative to the receiver.
    #[inline]
    pub fn high(&self) -> Vec3 {
        self.high.into()
    }

    /// Squared distance from the receiver to the box, zero inside \[m²\].
    #[inline]
    pub fn nearest_distance2(&self) -> f32 {
        self.nearest2
    }

    /// Largest `axis · d` over the points d of the box \[m for a unit axis\].
    ///
    /// Summed from the corner's own products and not from centre and half size: those cancel when a huge box
    /// begins close to the receiver, and a bound that rounds downward there is none.
    #[inline]
    fn furthest_along(&self, axis: Vec3A) -> f32 {
        (self.low * axis).max(self.high * axis).element_sum()
    }

    /// Upper bound of the cosine between a unit axis and the directions to the box: −1 … 1, 1 for a receiver inside.
    #[inline]
    pub fn max_cosine(&self, axis: Vec3) -> f32 {
        let along = self.furthest_along(axis.into());
        if along >= 0.0 {
            // A point with along = 0 and nearest = 0 would give 0 · ∞; `min` then returns 1, which is safe.
            (along * self.inverse_nearest).min(1.0)
        } else {
            let furthest2 = self.low.abs().max(self.high.abs()).length_squared();
            (along / furthest2.sqrt()).max(-1.0)
        }
    }

    /// As [`Region::max_cosine`], but 0 where the whole box lies behind the plane of the axis.
    #[inline]
    pub fn max_cosine_in_front(&self, axis: Vec3) -> f32 {
        let along = self.furthest_along(axis.into());
        if along > 0.0 { (along * self.inverse_nearest).min(1.0) } else { 0.0 }
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
            let region = Region::new(low.into(), high.into());
            let cosine = axis.dot(point) / point.length();
            prop_assert!(region.max_cosine(axis) >= cosine - 1e-5);
            prop_assert!(region.max_cosine_in_front(axis) >= cosine.min(region.max_cosine_in_front(axis)) - 1e-5);
            prop_assert!(region.max_cosine_in_front(axis) >= region.max_cosine(axis));
        }
    }

    #[test]
    fn unions_of_one_axis_stay_sharp() {
        let axis = Vec3::new(0.3, -0.5, 0.8).normalize();
        let cone = (0..100_000).fold(Cone::ray(axis), |cone, _| cone.union(Cone::ray(axis)));
        assert!(cone.half_angle < 1e-6, "{cone:?}");
    }
}
