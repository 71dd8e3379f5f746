//! Clusters during a build, and the cost of a union of two clusters.

use glam::Vec3A;

use crate::bounds::Cone;
use crate::light::{Emission, Light};

/// Constants of the cost of one build.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Metric {
    /// Term added to α² \[m²\].
    pub coincidence2: f32,
    /// Factor of the orientation term, c² \[m²\].
    pub orientation2: f32,
}

/// Type of the lights in a cluster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Omni,
    Oriented,
    Mixed,
}

/// A cluster that is not merged yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cluster {
    pub low: Vec3A,
    pub high: Vec3A,
    /// Axis of the cone, for oriented clusters.
    pub axis: Vec3A,
    /// Axis of one light of the cluster. It stays fixed, while each merge rotates the cone's axis.
    pub member_axis: Vec3A,
    pub luminance: f32,
    /// Cosine and sine of half the cone's half-angle. Sums of these angles stay below 3π/4, where their signs are
    /// unambiguous.
    pub half_cosine: f32,
    pub half_sine: f32,
    pub id: u32,
    pub kind: Kind,
}

impl Cluster {
    pub fn leaf(id: u32, light: &Light, luminance: f32) -> Self {
        let (kind, axis, position) = match light.emission {
            Emission::Omni => (Kind::Omni, Vec3A::Z, light.position.into()),
            Emission::Cosine(axis) => (Kind::Oriented, axis.into(), light.position.into()),
            // The position is a point of the unit sphere.
            Emission::Directional(travel) => (Kind::Omni, Vec3A::Z, (-travel).into()),
        };
        Self {
            low: position,
            high: position,
            axis,
            member_axis: axis,
            luminance,
            half_cosine: 1.0,
            half_sine: 0.0,
            id,
            kind,
        }
    }

    pub fn leaf_cone(&self) -> Cone {
        if self.kind == Kind::Oriented { Cone::ray(self.axis.into()) } else { Cone::SPHERE }
    }

    /// Returns the union of two clusters. `cone` is the union of both cones.
    pub fn merged(&self, other: &Self, id: u32, cone: Cone) -> Self {
        let (half_sine, half_cosine) = (0.5 * cone.half_angle).sin_cos();
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            axis: cone.axis.as_vec3().into(),
            member_axis: self.member_axis,
            luminance: self.luminance + other.luminance,
            half_cosine: half_cosine as f32,
            half_sine: half_sine as f32,
            id,
            kind: if self.kind == other.kind { self.kind } else { Kind::Mixed },
        }
    }

    /// Returns the cost of the union of two clusters.
    #[inline]
    pub fn cost(&self, other: &Self, metric: &Metric) -> f32 {
        let diagonal2 = (self.high.max(other.high) - self.low.min(other.low)).length_squared();
        (self.luminance + other.luminance) * (metric.coincidence2 + diagonal2 + self.turn_cost(other, metric))
    }

    /// Returns the orientation term of the cost: c² (1 − cos β)².
    #[inline]
    fn turn_cost(&self, other: &Self, metric: &Metric) -> f32 {
        let spread = match (self.kind, other.kind) {
            (Kind::Omni, Kind::Omni) => return 0.0,
            (Kind::Oriented, Kind::Oriented) => {
                let cosine = union_cosine(self, self.axis.dot(other.axis), other.half_cosine, other.half_sine);
                1.0 - cosine.min(other.cone_cosine())
            }
            _ => 2.0,
        };
        metric.orientation2 * spread * spread
    }

    #[inline]
    fn cone_cosine(&self) -> f32 {
        1.0 - 2.0 * self.half_sine * self.half_sine
    }
}

/// Returns the cosine of the half-angle β of the smallest cone around `a`'s cone and another cone. `cos_between` is the
/// cosine of the angle θ between their axes. `half_cosine` and `half_sine` belong to half of the other cone's
/// half-angle β_b. The result is at most the cosine of `a`'s own half-angle β_a.
///
/// β = max(β_a, (β_a + β_b + θ)/2). Addition theorems make this fast, because it is computed for every compared pair.
/// The caller handles the case that β_b is larger.
#[inline]
pub(super) fn union_cosine(a: &Cluster, cos_between: f32, half_cosine: f32, half_sine: f32) -> f32 {
    let cos_half_between = (0.5 + 0.5 * cos_between).max(0.0).sqrt();
    let sin_half_between = (0.5 - 0.5 * cos_between).max(0.0).sqrt();
    let (cos, sin) = add_angles((a.half_cosine, a.half_sine), (half_cosine, half_sine));
    let (cos, sin) = add_angles((cos, sin), (cos_half_between, sin_half_between));
    if sin < 0.0 { -1.0 } else { cos.min(a.cone_cosine()) }
}

#[inline]
fn add_angles(a: (f32, f32), b: (f32, f32)) -> (f32, f32) {
    (a.0 * b.0 - a.1 * b.1, a.1 * b.0 + a.0 * b.1)
}
