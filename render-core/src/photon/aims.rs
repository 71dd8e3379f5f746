//! Guided reflection: photons far from the visible region aim at it.
//!
//! Photons reflected by the ground outside a room rarely hit its window, and each photon that hits it has the flux of
//! thousands. Camera paths find this connection from the other end. Light along an edge x → y of a camera path travels
//! from y to x, so photons at y aim at x:
//!
//! ```text
//! p(ω) = ½ cos θ / π + ½ / Ω    within the cone Ω around a ball that contains most x of the edges with nearby y
//! p(ω) = ½ cos θ / π            outside the cone
//! ```
//! The weight of a photon is the ratio of a cosine lobe to this density, `cos θ / π / p(ω)` ≤ 2. The expected light is
//! unchanged.

use crate::sampling::{cosine_hemisphere, frame};
use glam::{Vec2, Vec3, Vec3A};
use std::f32::consts::{PI, TAU};

/// Maximum number of edges in a leaf.
const LEAF: usize = 24;
/// Radius of a ball, in standard deviations of the positions in it.
const DEVIATIONS: f32 = 1.5;
/// Minimum distance of a target ball, in radii of the ball. A cosine lobe often hits nearer balls.
const FAR: f32 = 2.0;
/// Fraction of the photons that aim at a ball.
const AIMED: f32 = 0.5;

/// Edge of a camera path, in the direction of light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// Point y, where a photon is reflected.
    pub from: Vec3A,
    /// Point x, the destination of the photon.
    pub to: Vec3A,
    /// Luminance that the camera receives along this edge.
    pub light: f64,
}

/// Balls that photons aim at, in a k-d tree over the start points of edges.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Aims(Vec<AimNode>);

#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum AimNode {
    /// Split at coordinate `at` along `axis`. The lower half is the next node; `upper` is the index of the upper half.
    Halves { axis: usize, at: f32, upper: u32 },
    /// Ball that photons aim at.
    Leaf { center: Vec3A, radius: f32 },
}

/// Cone of directions that photons aim into.
#[derive(Clone, Copy, Debug)]
pub(super) struct AimCone {
    axis: Vec3A,
    /// 1 − cos of the half angle.
    height: f32,
}

impl Aims {
    /// Builds the tree from the `edges`.
    pub fn new(mut edges: Vec<Edge>) -> Self {
        let mut aims = Self::default();
        if !edges.is_empty() {
            aims.add(&mut edges);
        }
        aims
    }

    /// Adds the node of the `edges` and all its descendants.
    fn add(&mut self, edges: &mut [Edge]) {
        let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for edge in edges.iter() {
            (low, high) = (low.min(edge.from), high.max(edge.from));
        }
        let extent = (high - low).to_array();
        let axis = (1..3).fold(0, |widest, axis| if extent[axis] > extent[widest] { axis } else { widest });
        // Stop at small sets and at sets with a single start point.
        if edges.len() <= LEAF || extent[axis] <= 0.0 {
            return self.0.push(ball(edges));
        }

        // Split at the median of the widest axis. The lower half directly follows its parent.
        let half = edges.len() / 2;
        edges.select_nth_unstable_by(half, |a, b| a.from[axis].total_cmp(&b.from[axis]));
        let (at, number) = (edges[half].from[axis], self.0.len());
        let (lower, upper) = edges.split_at_mut(half);
        self.0.push(AimNode::Halves { axis, at, upper: 0 });
        self.add(lower);
        self.0[number] = AimNode::Halves { axis, at, upper: self.0.len() as u32 };
        self.add(upper);
    }

    /// Returns the cone that photons at `place` aim into, or `None` if a cosine lobe suffices.
    pub fn cone(&self, place: Vec3A) -> Option<AimCone> {
        let mut number = 0;
        loop {
            match *self.0.get(number)? {
                AimNode::Halves { axis, at, upper } => {
                    number = if place[axis] < at { number + 1 } else { upper as usize }
                }
                AimNode::Leaf { center, radius } => return AimCone::around(center - place, radius),
            }
        }
    }
}

/// Returns the ball around the end points of `edges`, from their mean and spread weighted by light.
fn ball(edges: &[Edge]) -> AimNode {
    let light: f64 = edges.iter().map(|edge| edge.light).sum();
    let mut center = Vec3A::ZERO;
    for edge in edges {
        center += edge.to * (edge.light / light) as f32;
    }
    let mut variance = 0.0;
    for edge in edges {
        variance += edge.to.distance_squared(center) * (edge.light / light) as f32;
    }
    AimNode::Leaf { center, radius: DEVIATIONS * variance.sqrt() }
}

impl AimCone {
    /// Returns the cone around a ball with its center at the end of `way`, or `None` for a near ball.
    fn around(way: Vec3A, radius: f32) -> Option<Self> {
        let distance = way.length();
        let is_far = distance.is_finite() && radius > 0.0 && distance > FAR * radius;
        // Compute sin θ = radius / distance and 1 − cos θ = sin² θ / (1 + cos θ), which does not round to 0.
        let sine2 = (radius / distance).powi(2);
        is_far.then(|| Self { axis: way / distance, height: sine2 / (1.0 + (1.0 - sine2).sqrt()) })
    }

    /// Draws the direction and the weight of a photon that leaves along `normal`. `which` and `point` are numbers in
    /// 0…1.
    pub fn draw(&self, normal: Vec3, which: f32, point: Vec2) -> (Vec3, f32) {
        // Draw from the mixture ½ cos θ / π + ½ / Ω.
        let is_aimed = which < AIMED;
        let direction = if is_aimed { self.within(point) } else { cosine_hemisphere(normal, point) };

        // Compute both densities for the drawn direction, regardless of the lobe that produced it.
        let even = normal.dot(direction).max(0.0) / PI;
        let is_inside = is_aimed || self.axis.dot(direction.into()) >= 1.0 - self.height;
        let aimed = if is_inside { 1.0 / (TAU * self.height) } else { 0.0 };
        let density = (1.0 - AIMED) * even + AIMED * aimed;
        (direction, if even > 0.0 { even / density } else { 0.0 })
    }

    /// Returns a uniformly distributed direction in the cone.
    fn within(&self, point: Vec2) -> Vec3 {
        // Draw 1 − cos θ uniformly, with sin² θ = (1 − cos θ)(1 + cos θ).
        let low = point.x * self.height;
        let sine = (low * (2.0 - low)).max(0.0).sqrt();
        let (s, c) = (TAU * point.y).sin_cos();
        let (x, y) = frame(self.axis.into());
        (x * (sine * c) + y * (sine * s) + Vec3::from(self.axis) * (1.0 - low)).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash_unit;

    /// Returns the aims for edges from a ground of 100 m to a room of 2 m in its middle.
    fn aims() -> Aims {
        let edge = |k| {
            let u = |d| hash_unit(1, k, d) * 2.0 - 1.0;
            let (from, to) = (Vec3A::new(u(0), 0.0, u(1)) * 50.0, Vec3A::new(u(2), u(3) + 1.0, u(4)));
            Edge { from, to, light: 1.0 + f64::from(u(5)) }
        };
        Aims::new((0..5000).map(edge).collect())
    }

    /// Tests moments of a cosine lobe: ∫ cos θ / π dω is 1, the mean of cos θ is 2/3 and the mean of cos² θ is 1/2. The
    /// moments do not depend on the aim, for any target, even below the horizon.
    #[test]
    fn aim_leaves_the_mean_as_it_is() {
        let normal = Vec3::Y;
        for way in [Vec3A::new(10.0, 1.0, 0.0), Vec3A::new(0.0, 3.0, 0.1), Vec3A::new(9.0, -0.5, 3.0)] {
            let cone = AimCone::around(way, 1.0).unwrap();
            let count = 400_000;
            let mut moments = [0.0f64; 3];
            for k in 0..count {
                let point = Vec2::new(hash_unit(2, k, 0), hash_unit(2, k, 1));
                let (direction, weight) = cone.draw(normal, hash_unit(2, k, 2), point);
                assert!((0.0..=2.0001).contains(&weight), "{weight}");
                for (power, moment) in moments.iter_mut().enumerate() {
                    *moment += f64::from(weight * direction.y.max(0.0).powi(power as i32)) / count as f64;
                }
            }
            for (found, expected) in moments.into_iter().zip([1.0, 2.0 / 3.0, 0.5]) {
                assert!((found - expected).abs() < 0.005, "{way}: {found} instead of {expected}");
            }
        }
    }

    #[test]
    fn photons_far_away_aim_at_the_room() {
        let aims = aims();
        for place in [Vec3A::new(40.0, 0.0, -30.0), Vec3A::new(-20.0, 0.0, 5.0), Vec3A::X * 1000.0] {
            let cone = aims.cone(place).expect("far enough");
            // Require that about half of the directions pass within 4 m of the middle of the room.
            let passes = |k| {
                let (direction, _) = cone.draw(Vec3::Y, hash_unit(3, k, 2), Vec2::new(hash_unit(3, k, 0), 0.3));
                let way = Vec3A::Y - place;
                way.reject_from(direction.into()).length() < 4.0
            };
            let count = (0..1000).filter(|&k| passes(k)).count();
            assert!((400..700).contains(&count), "{place}: {count}");
        }
        assert!(aims.cone(Vec3A::ZERO).is_none(), "an even lobe does within the room");
        assert!(Aims::default().cone(Vec3A::ZERO).is_none());
    }
}
