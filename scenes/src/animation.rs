//! Movement: smooth paths through given points, and turning views.

use glam::{Mat3, Quat, Vec3};

/// How a glTF sampler interpolates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight between keys.
    Linear,
    /// Hermite between keys; each key holds in-tangent, value, out-tangent.
    CubicSpline,
}

/// The property that a channel moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// The node's translation.
    Translation,
    /// The node's rotation.
    Rotation,
}

/// Keys of one property of one node.
#[derive(Clone, Debug)]
pub struct Keys {
    /// The property that is moved.
    pub property: Property,
    /// How values between the keys follow.
    pub interpolation: Interpolation,
    /// Seconds, rising.
    pub times: Vec<f32>,
    /// Three or four numbers for each value, flat.
    pub values: Vec<f32>,
}

/// A path through points at given times, smooth (cubic Hermite with finite-difference tangents).
#[derive(Clone, Debug)]
pub struct Path {
    keys: Vec<(f32, Vec3)>,
    tangents: Vec<Vec3>,
}

impl Path {
    /// A path through the keys; it starts and ends with the speed of its first and last stretch.
    #[must_use]
    pub fn new(keys: &[(f32, Vec3)]) -> Self {
        Self::with_ends(keys, false)
    }

    /// A closed path: the last key equals the first, and the speed is continuous there.
    #[must_use]
    pub fn closed(keys: &[(f32, Vec3)]) -> Self {
        Self::with_ends(keys, true)
    }

    fn with_ends(keys: &[(f32, Vec3)], closed: bool) -> Self {
        let n = keys.len();
        let slope = |a: usize, b: usize| (keys[b].1 - keys[a].1) / (keys[b].0 - keys[a].0);
        let mut tangents: Vec<Vec3> = (0..n).map(|i| slope(i.saturating_sub(1), (i + 1).min(n - 1))).collect();
        if closed {
            let t = (slope(0, 1) + slope(n - 2, n - 1)) * 0.5;
            tangents[0] = t;
            tangents[n - 1] = t;
        }
        Self { keys: keys.to_vec(), tangents }
    }

    /// The position at a time, held before the first and after the last key.
    #[must_use]
    pub fn at(&self, time: f32) -> Vec3 {
        let last = self.keys.len() - 1;
        if time <= self.keys[0].0 {
            return self.keys[0].1;
        }
        if time >= self.keys[last].0 {
            return self.keys[last].1;
        }
        let i = self.keys.partition_point(|k| k.0 <= time) - 1;
        let (t0, p0) = self.keys[i];
        let (t1, p1) = self.keys[i + 1];
        let d = t1 - t0;
        let s = (time - t0) / d;
        let (s2, s3) = (s * s, s * s * s);
        p0 * (2.0 * s3 - 3.0 * s2 + 1.0)
            + self.tangents[i] * (d * (s3 - 2.0 * s2 + s))
            + p1 * (3.0 * s2 - 2.0 * s3)
            + self.tangents[i + 1] * (d * (s3 - s2))
    }

    /// The path as translation keys.
    #[must_use]
    pub fn translation(&self) -> Keys {
        let mut values = Vec::new();
        for ((_, p), t) in self.keys.iter().zip(&self.tangents) {
            for v in [*t, *p, *t] {
                values.extend(v.to_array());
            }
        }
        Keys {
            property: Property::Translation,
            interpolation: Interpolation::CubicSpline,
            times: self.keys.iter().map(|k| k.0).collect(),
            values,
        }
    }
}

/// Rotation keys from a function of time, `rate` keys a second over `duration` seconds.
pub fn rotation(duration: f32, rate: f32, f: impl Fn(f32) -> Quat) -> Keys {
    let n = (duration * rate).round() as usize;
    let mut values = Vec::new();
    let mut times = Vec::new();
    let mut previous = Quat::IDENTITY;
    for k in 0..=n {
        let time = duration * k as f32 / n as f32;
        let mut q = f(time).normalize();
        // Neighboring keys on one side of the sphere, or slerp takes the long way round.
        if q.dot(previous) < 0.0 {
            q = -q;
        }
        previous = q;
        times.push(time);
        values.extend(q.to_array());
    }
    Keys { property: Property::Rotation, interpolation: Interpolation::Linear, times, values }
}

/// The rotation of a glTF camera (looking along -z) that looks from `eye` at `target`.
#[must_use]
pub fn look_at(eye: Vec3, target: Vec3) -> Quat {
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize();
    Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back))
}
