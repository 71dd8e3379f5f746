//! Animation: smooth paths through given points, and rotations over time.

use glam::{Mat3, Quat, Vec3};

/// Interpolation mode of a glTF sampler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Linear interpolation between keys.
    Linear,
    /// Cubic Hermite interpolation between keys. Each key contains in-tangent, value and out-tangent.
    CubicSpline,
}

/// Animated property of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Translation of the node.
    Translation,
    /// Rotation of the node.
    Rotation,
}

/// Keys of one property of one node.
#[derive(Clone, Debug)]
pub struct Keys {
    /// Animated property.
    pub property: Property,
    /// Interpolation between the keys.
    pub interpolation: Interpolation,
    /// Times of the keys in ascending order \[s\].
    pub times: Vec<f32>,
    /// Values of the keys as a flat list, three or four numbers per key.
    pub values: Vec<f32>,
}

/// A smooth path through points at given times, with cubic Hermite interpolation and finite-difference tangents.
#[derive(Clone, Debug)]
pub struct Path {
    keys: Vec<(f32, Vec3)>,
    tangents: Vec<Vec3>,
}

impl Path {
    /// Creates a path through the keys. The speeds at its ends are the mean speeds of the first and last segments.
    #[must_use]
    pub fn new(keys: &[(f32, Vec3)]) -> Self {
        Self::with_ends(keys, false)
    }

    /// Creates a closed path through the keys. The last key must equal the first. The speed is continuous at this key.
    #[must_use]
    pub fn closed(keys: &[(f32, Vec3)]) -> Self {
        Self::with_ends(keys, true)
    }

    fn with_ends(keys: &[(f32, Vec3)], closed: bool) -> Self {
        let n = keys.len();
        let slope = |a: usize, b: usize| (keys[b].1 - keys[a].1) / (keys[b].0 - keys[a].0);
        let mut tangents: Vec<Vec3> = (0..n).map(|i| slope(i.saturating_sub(1), (i + 1).min(n - 1))).collect();
        // A closed path has the mean slope of both ends, so that the motion repeats smoothly.
        if closed {
            let t = (slope(0, 1) + slope(n - 2, n - 1)) * 0.5;
            tangents[0] = t;
            tangents[n - 1] = t;
        }
        Self { keys: keys.to_vec(), tangents }
    }

    /// Returns the position at a time \[s\], which is clamped to the first and last key.
    #[must_use]
    pub fn at(&self, time: f32) -> Vec3 {
        let last = self.keys.len() - 1;
        if time <= self.keys[0].0 {
            return self.keys[0].1;
        }
        if time >= self.keys[last].0 {
            return self.keys[last].1;
        }
        // Evaluate the cubic Hermite spline between two keys, as glTF players do.
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

    /// Converts the path to translation keys.
    #[must_use]
    pub fn translation(&self) -> Keys {
        let mut values = Vec::new();
        for ((_, p), t) in self.keys.iter().zip(&self.tangents) {
            // glTF requires an in-tangent, a value and an out-tangent per key.
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

/// Builds rotation keys from a function of time \[s\]: `rate` keys per second over `duration` seconds.
pub fn rotation(duration: f32, rate: f32, f: impl Fn(f32) -> Quat) -> Keys {
    let n = (duration * rate).round() as usize;
    let mut values = Vec::new();
    let mut times = Vec::new();
    let mut previous = Quat::IDENTITY;
    for k in 0..=n {
        let time = duration * k as f32 / n as f32;
        let mut q = f(time).normalize();
        // Keep consecutive quaternions in one hemisphere, so that slerp takes the short arc.
        if q.dot(previous) < 0.0 {
            q = -q;
        }
        previous = q;
        times.push(time);
        values.extend(q.to_array());
    }
    Keys { property: Property::Rotation, interpolation: Interpolation::Linear, times, values }
}

/// Returns the rotation of a camera at `eye` that looks at `target`. glTF cameras look along -z.
#[must_use]
pub fn look_at(eye: Vec3, target: Vec3) -> Quat {
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize();
    Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back))
}
