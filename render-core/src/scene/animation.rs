//! Keyframes and their interpolation (glTF 2.0, appendix C).

use super::Transform;
use crate::steps;
use glam::{Quat, Vec3};
use std::ops::{Add, Mul};

/// Interpolation between two keys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interpolation {
    /// Value of the earlier key.
    Step,
    /// Linear interpolation; for rotations, along the great arc.
    Linear,
    /// Hermite spline. Each key has an in-tangent, a value and an out-tangent.
    CubicSpline,
}

/// Animated property and the values of all keys (three values per key for splines).
#[derive(Clone, Debug)]
pub enum Track {
    /// Translations of the node \[m\].
    Translation(Vec<Vec3>),
    /// Rotations of the node as unit quaternions.
    Rotation(Vec<Quat>),
    /// Scale factors of the node along the axes.
    Scale(Vec<Vec3>),
    /// Weights of the morph targets. Each key lists the weights of all targets.
    Weights(Vec<f32>),
}

/// Animation of one property of one node.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Index into the scene's nodes.
    pub node: usize,
    /// Times of the keys \[s\], in ascending order; never empty.
    pub times: Vec<f32>,
    /// Values of the keys.
    pub track: Track,
    /// Interpolation between the keys.
    pub interpolation: Interpolation,
}

impl Track {
    /// Returns the weights of all keys, or an empty list for other tracks.
    pub(super) fn weights(&self) -> &[f32] {
        match self {
            Self::Weights(keys) => keys,
            _ => &[],
        }
    }
}

impl Channel {
    /// Writes the value at `time` into `transform`. Before the first key and after the last key, the value is constant.
    pub fn apply(&self, time: f32, transform: &mut Transform) {
        match &self.track {
            Track::Translation(keys) => transform.translation = self.value(time, |k| keys[k]),
            Track::Scale(keys) => transform.scale = self.value(time, |k| keys[k]),
            Track::Rotation(keys) => transform.rotation = self.rotation(keys, time),
            Track::Weights(_) => {}
        }
    }

    /// Writes the morph weights at `time` into `weights`, if the channel animates weights.
    pub fn apply_weights(&self, time: f32, weights: &mut [f32]) {
        let Track::Weights(keys) = &self.track else { return };
        let count = weights.len();
        steps::count(count);
        for (target, weight) in weights.iter_mut().enumerate() {
            *weight = self.value(time, |k| keys[k * count + target]);
        }
    }

    /// Returns whether any two keys differ.
    #[must_use]
    pub fn changes(&self) -> bool {
        let several = self.times.len() > 1;
        steps::count(self.times.len());
        // Cubic splines may change even between equal keys, because of their tangents.
        let spline = self.interpolation == Interpolation::CubicSpline;
        several
            && (spline
                || match &self.track {
                    Track::Translation(keys) | Track::Scale(keys) => keys.iter().any(|key| *key != keys[0]),
                    Track::Rotation(keys) => keys.iter().any(|key| *key != keys[0]),
                    Track::Weights(keys) => {
                        let count = keys.len() / self.times.len();
                        (count..keys.len()).any(|k| keys[k] != keys[k - count])
                    }
                })
    }

    /// Removes all keys of morph weights except the first, so that the weights are constant.
    pub(super) fn keep_first(&mut self) {
        let Track::Weights(keys) = &mut self.track else { return };
        let count =
            keys.len() / (self.times.len() * if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 });
        // The value of a spline's key follows its in-tangent.
        if self.interpolation == Interpolation::CubicSpline {
            keys.drain(..count);
        }
        keys.truncate(count);
        self.times.truncate(1);
        self.interpolation = Interpolation::Step;
    }

    fn stride(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    /// Returns the index of the key before `time`, the interval to the next key \[s\], and the fraction of that
    /// interval, 0…1.
    fn segment(&self, time: f32) -> (usize, f32, f32) {
        // Keep the first or last value constant outside the keys.
        let after = self.times.partition_point(|&key| key <= time);
        if after == 0 || after == self.times.len() {
            return (after.saturating_sub(1), 0.0, 0.0);
        }
        // Two keys may have the same time, so avoid a division by zero.
        let length = self.times[after] - self.times[after - 1];
        (after - 1, length, if length > 0.0 { (time - self.times[after - 1]) / length } else { 0.0 })
    }

    /// Returns the value at `time` of a quantity that is interpolated component by component, given its keys.
    fn value<T>(&self, time: f32, keys: impl Fn(usize) -> T) -> T
    where
        T: Mul<f32, Output = T> + Add<Output = T>,
    {
        let (key, length, t) = self.segment(time);
        match self.interpolation {
            _ if t == 0.0 => keys(key * self.stride() + self.stride() / 2),
            Interpolation::Step => keys(key),
            Interpolation::Linear => keys(key) * (1.0 - t) + keys(key + 1) * t,
            Interpolation::CubicSpline => {
                let [a, b, c, d] = hermite(t, length);
                let k = 3 * key;
                keys(k + 1) * a + keys(k + 2) * b + keys(k + 4) * c + keys(k + 3) * d
            }
        }
    }

    fn rotation(&self, keys: &[Quat], time: f32) -> Quat {
        let (key, length, t) = self.segment(time);
        let value = match self.interpolation {
            _ if t == 0.0 => keys[key * self.stride() + self.stride() / 2],
            Interpolation::Step => keys[key],
            // slerp follows the shorter arc, regardless of the signs of the two quaternions.
            Interpolation::Linear => keys[key].slerp(keys[key + 1], t),
            Interpolation::CubicSpline => {
                let [a, b, c, d] = hermite(t, length);
                let k = 3 * key;
                keys[k + 1] * a + keys[k + 2] * b + keys[k + 4] * c + keys[k + 3] * d
            }
        };
        // Normalize the quaternion, because splines leave the unit sphere.
        if value.length_squared() > 0.0 { value.normalize() } else { Quat::IDENTITY }
    }
}

/// Returns the weights of value, out-tangent, next value and next in-tangent.
fn hermite(t: f32, length: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [2.0 * t3 - 3.0 * t2 + 1.0, length * (t3 - 2.0 * t2 + t), 3.0 * t2 - 2.0 * t3, length * (t3 - t2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(interpolation: Interpolation, track: Track) -> Channel {
        Channel { node: 0, times: vec![1.0, 3.0], track, interpolation }
    }

    fn at(channel: &Channel, time: f32) -> Transform {
        let mut transform = Transform { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };
        channel.apply(time, &mut transform);
        transform
    }

    #[test]
    fn linear_step_and_ends() {
        let keys = || Track::Translation(vec![Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0)]);
        let linear = channel(Interpolation::Linear, keys());
        assert_eq!(at(&linear, 0.0).translation.x, 0.0);
        assert_eq!(at(&linear, 1.5).translation.x, 1.0);
        assert_eq!(at(&linear, 9.0).translation.x, 4.0);
        assert_eq!(at(&channel(Interpolation::Step, keys()), 2.9).translation.x, 0.0);
        assert!(linear.changes());
    }

    #[test]
    fn a_spline_follows_its_cubic() {
        // As a Hermite segment on 1…3, the spline must reproduce the cubic x(t) = t³.
        let x = |t: f32| Vec3::new(t * t * t, 0.0, 0.0);
        let slope = |t: f32| Vec3::new(3.0 * t * t, 0.0, 0.0);
        let keys = vec![slope(1.0), x(1.0), slope(1.0), slope(3.0), x(3.0), slope(3.0)];
        let spline = channel(Interpolation::CubicSpline, Track::Translation(keys));
        for t in [1.0f32, 1.3, 2.0, 2.9, 3.0] {
            assert!((at(&spline, t).translation.x - t * t * t).abs() < 1e-4);
        }
    }

    #[test]
    fn weights_follow_their_targets_through_all_interpolations() {
        let at = |interpolation, keys: Vec<f32>, time| {
            let mut weights = [9.0; 2];
            channel(interpolation, Track::Weights(keys)).apply_weights(time, &mut weights);
            weights
        };
        assert_eq!(at(Interpolation::Linear, vec![0.0, 1.0, 1.0, 0.0], 1.5), [0.25, 0.75]);
        assert_eq!(at(Interpolation::Step, vec![0.0, 1.0, 1.0, 0.0], 2.9), [0.0, 1.0]);
        assert_eq!(at(Interpolation::Step, vec![0.0, 1.0, 1.0, 0.0], 3.0), [1.0, 0.0]);
        // List in-tangents, values and out-tangents of both targets. The first target is t², the second is the constant 5.
        let keys = vec![2.0, 0.0, 1.0, 5.0, 2.0, 0.0, 6.0, 0.0, 9.0, 5.0, 6.0, 0.0];
        let [square, constant] = at(Interpolation::CubicSpline, keys, 2.5);
        assert!((square - 6.25).abs() < 1e-5 && (constant - 5.0).abs() < 1e-5, "{square} {constant}");
    }

    #[test]
    fn rotations_take_the_short_arc() {
        let quarter = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let track = Track::Rotation(vec![Quat::IDENTITY, -quarter]);
        let half = at(&channel(Interpolation::Linear, track), 2.0).rotation;
        assert!(half.dot(Quat::from_rotation_y(std::f32::consts::FRAC_PI_4)).abs() > 0.99999);
    }
}
