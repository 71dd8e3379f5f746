//! Motion of instances and changes of lights between frames, which may change the light on surfaces.

use crate::frame::Frame;
use glam::{Affine3A, BVec3A, Vec3, Vec3A};
use render_core::scene::{DeformedMesh, Material};
use render_core::{GBuffer, Surfaces, luminance};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Pose, shape and material of a moving instance.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct InstancePose {
    world: Affine3A,
    /// Lower corner of the instance's bounding box in object space.
    low: Vec3A,
    /// Upper corner of the instance's bounding box in object space.
    high: Vec3A,
    /// Vertices of the instance if it deforms.
    shape: Option<Arc<DeformedMesh>>,
    /// Material of the instance if any material in the scene is animated.
    material: Option<Material>,
}

/// World-space bounding box of a moving instance.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct MovingBox {
    pub instance: u32,
    low: Vec3A,
    high: Vec3A,
}

/// Bounding sphere of objects.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    pub center: Vec3A,
    pub radius: f32,
}

/// Motion of all instances since the previous frame.
#[derive(Debug)]
pub(super) struct Movement {
    /// Poses of the moving instances; `None` for a static instance.
    pub places: Vec<Option<InstancePose>>,
    /// Boxes around old and new poses of each instance that has moved since the previous frame; empty in the first
    /// frame.
    pub swept: Vec<MovingBox>,
    /// Whether any pose has changed; true in the first frame.
    pub is_any: bool,
}

impl Movement {
    /// Computes the motion to `frame` from `before`, the poses in the previous frame.
    pub fn to(frame: &Frame, before: &[Option<InstancePose>]) -> Self {
        let places = places(&frame.surfaces, &frame.seen, before);
        Self { swept: swept(before, &places), is_any: before != places, places }
    }

    /// Returns the boxes around the current poses of all moving instances.
    pub fn standing(&self) -> Vec<MovingBox> {
        let mut standing = Vec::new();
        for (index, place) in (0..).zip(&self.places) {
            if let Some(place) = place {
                standing.push(MovingBox::all(index, [place]));
            }
        }
        standing
    }
}

/// Returns the poses of the moving instances in the frame `seen`. Rigid instances keep the bounding boxes from
/// `before`.
fn places(surfaces: &Surfaces, seen: &GBuffer, before: &[Option<InstancePose>]) -> Vec<Option<InstancePose>> {
    let scene = surfaces.scene();
    let around = |positions: &[Vec3]| {
        let empty = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        positions.iter().fold(empty, |(low, high), &p| (low.min(p.into()), high.max(p.into())))
    };
    let mut poses = Vec::new();
    for (index, &moves) in surfaces.moving().iter().enumerate() {
        if !moves {
            poses.push(None);
            continue;
        }

        // Keep the known box of a rigid instance: its vertices are constant in object space.
        let shape = seen.deformed.get(index).cloned().flatten();
        let known = before.get(index).and_then(Option::as_ref).map(|place| (place.low, place.high));
        let (low, high) = match (&shape, known) {
            (Some(shape), _) => around(&shape.positions),
            (None, Some(known)) => known,
            (None, None) => around(&scene.meshes[scene.instances[index].mesh].positions),
        };

        // Keep materials only for comparison with the next frame, in scenes that animate them.
        let material = (!scene.material_channels.is_empty()).then(|| surfaces.material(index).clone());
        poses.push(Some(InstancePose { world: seen.world[index], low, high, shape, material }));
    }
    poses
}

/// Returns boxes around the old and new poses of all instances with a changed pose, shape or material.
fn swept(before: &[Option<InstancePose>], now: &[Option<InstancePose>]) -> Vec<MovingBox> {
    let mut swept = Vec::new();
    for (index, (then, now)) in (0..).zip(before.iter().zip(now)) {
        if let (Some(then), Some(now)) = (then, now)
            && then != now
        {
            swept.push(MovingBox::all(index, [then, now]));
        }
    }
    swept
}

/// Returns the intensities of a frame's lights.
pub(super) fn intensities(frame: &Frame) -> Vec<Vec3> {
    frame.tree.lights().iter().map(|light| light.intensity).collect()
}

/// Returns the change of the lights' intensities, as a fraction of all light; infinite if the numbers of lights differ.
pub(super) fn change_of_light(before: &[Vec3], now: &[Vec3]) -> f32 {
    if before.len() != now.len() {
        return f32::INFINITY;
    }
    let (mut change, mut sum) = (0.0, 0.0);
    for (then, now) in before.iter().zip(now) {
        change += luminance((*now - *then).abs());
        sum += luminance(*now);
    }
    if change > 0.0 { change / sum } else { 0.0 }
}

impl MovingBox {
    /// Returns the box between two corners.
    #[cfg(test)]
    pub fn around(instance: u32, low: Vec3A, high: Vec3A) -> Self {
        Self { instance, low, high }
    }

    /// Returns the world-space box around an instance in all given poses.
    fn all<const N: usize>(instance: u32, places: [&InstancePose; N]) -> Self {
        let mut all = Self { instance, low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };
        for InstancePose { world, low, high, .. } in places {
            // Enclose the eight corners of the object-space box.
            for i in 0u32..8 {
                let corner = Vec3A::select(BVec3A::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), *low, *high);
                let p = world.transform_point3a(corner);
                (all.low, all.high) = (all.low.min(p), all.high.max(p));
            }
        }
        all
    }

    /// Encloses another box, too.
    pub fn extend(&mut self, other: &Self) {
        (self.low, self.high) = (self.low.min(other.low), self.high.max(other.high));
    }

    /// Returns the sphere around the box.
    pub fn sphere(&self) -> Sphere {
        Sphere { center: 0.5 * (self.low + self.high), radius: 0.5 * (self.high - self.low).length() }
    }

    /// Returns the squared distance from a point to the box \[m²\].
    pub fn distance2(&self, point: Vec3A) -> f32 {
        (self.low - point).max(point - self.high).max(Vec3A::ZERO).length_squared()
    }

    /// Returns the distance from a point to the farthest corner of the box \[m\].
    pub fn farthest(&self, point: Vec3A) -> f32 {
        (point - self.low).abs().max((self.high - point).abs()).length()
    }

    /// Returns whether the segment between two points touches the box.
    pub fn is_crossed(&self, from: Vec3A, to: Vec3A) -> bool {
        self.is_between(from, to, to)
    }

    /// Returns the box enlarged by `margin` on all sides \[m\].
    pub fn grown(&self, margin: f32) -> Self {
        Self { low: self.low - margin, high: self.high + margin, ..*self }
    }

    /// Returns whether a segment from a point to any point of the box `low`…`high` touches this box.
    ///
    /// With p as the point, the segments fill the box p + t (low − p) … p + t (high − p) at the fraction t of their
    /// length. Along each axis, that box overlaps this box in an interval of t (slab test).
    pub fn is_between(&self, point: Vec3A, low: Vec3A, high: Vec3A) -> bool {
        // Solve t (high − p) ≥ self.low − p and t (low − p) ≤ self.high − p for t, per axis.
        let (mut enter, mut leave) = (0f32, 1f32);
        for axis in 0..3 {
            let p = point[axis];
            for (way, to) in [(high[axis] - p, self.low[axis] - p), (p - low[axis], p - self.high[axis])] {
                // Solve t · way ≥ to.
                if way > 0.0 {
                    enter = enter.max(to / way);
                } else if way < 0.0 {
                    leave = leave.min(to / way);
                } else if to > 0.0 {
                    return false;
                }
            }
        }
        enter <= leave
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::sampling::hash;

    /// Returns a pseudorandom number in −1…1.
    fn number(index: u64, dimension: u64) -> f32 {
        (hash(7, index, dimension) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn point(index: u64, dimension: u64) -> Vec3A {
        Vec3A::from_array([0, 1, 2].map(|axis| number(index, 3 * dimension + axis)))
    }

    /// Compares the test with 1000 steps along the segments. Overlaps must be found; nearly all other results must
    /// agree.
    #[test]
    fn boxes_between_a_point_and_a_box_are_found() {
        let mut agree = 0;
        for k in 0..500 {
            let boxed = |dimension: u64| {
                let (center, half) = (2.0 * point(k, dimension), 0.3 * point(k, dimension + 1).abs());
                (center - half, center + half)
            };
            let ((low, high), from, to) = (boxed(0), 2.0 * point(k, 2), boxed(3));
            let thing = MovingBox { instance: 0, low, high };
            let touches = (0..=1000).any(|step| {
                let t = step as f32 / 1000.0;
                let (near, far) = (from.lerp(to.0, t), from.lerp(to.1, t));
                near.cmple(high).all() && far.cmpge(low).all()
            });
            let found = thing.is_between(from, to.0, to.1);
            assert!(found || !touches, "case {k}");
            agree += usize::from(found == touches);
        }
        assert!(agree > 495, "{agree}");
    }

    #[test]
    fn a_segment_in_the_plane_of_a_face_ends() {
        let thing = MovingBox { instance: 0, low: Vec3A::ZERO, high: Vec3A::ONE };
        assert!(thing.is_crossed(Vec3A::new(-1.0, 0.5, 0.0), Vec3A::new(2.0, 0.5, 0.0)));
        assert!(!thing.is_crossed(Vec3A::new(-1.0, 0.5, -0.1), Vec3A::new(2.0, 0.5, -0.1)));
        assert!(!thing.is_crossed(Vec3A::new(-1.0, 0.5, 0.5), Vec3A::new(-0.1, 0.5, 0.5)));
    }
}
