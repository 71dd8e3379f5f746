//! Where things are that move, and where they were: what may have changed between a record and its lights.

use glam::{Affine3A, BVec3A, Vec3, Vec3A};
use render_core::GBuffer;
use render_core::scene::{DeformedMesh, Scene};
use std::sync::Arc;

/// Where an instance that moves is, and in what shape.
#[derive(Clone, PartialEq)]
pub(super) struct Place {
    world: Affine3A,
    /// The box around it in its own space.
    low: Vec3A,
    high: Vec3A,
    /// Its vertices, where these are bent.
    shape: Option<Arc<DeformedMesh>>,
}

/// The box around an instance that moves.
pub(super) struct Around {
    pub instance: u32,
    low: Vec3A,
    high: Vec3A,
}

/// Where the instances that move are in the picture `seen`; what keeps its shape keeps its box from `before`.
pub(super) fn places(scene: &Scene, moving: &[bool], seen: &GBuffer, before: &[Option<Place>]) -> Vec<Option<Place>> {
    let around = |positions: &[Vec3]| {
        let empty = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        positions.iter().fold(empty, |(low, high), &p| (low.min(p.into()), high.max(p.into())))
    };
    let place = |(index, &moves): (usize, &bool)| {
        let shape = seen.deformed.get(index).cloned().flatten();
        let known = before.get(index).and_then(Option::as_ref).map(|place| (place.low, place.high));
        let (low, high) = match (&shape, known) {
            (Some(shape), _) => around(&shape.positions),
            (None, Some(known)) => known,
            (None, None) => around(&scene.meshes[scene.instances[index].mesh].positions),
        };
        moves.then_some(Place { world: seen.world[index], low, high, shape })
    };
    moving.iter().enumerate().map(place).collect()
}

/// Around what is elsewhere, or otherwise, than before: at both places.
pub(super) fn swept(before: &[Option<Place>], now: &[Option<Place>]) -> Vec<Around> {
    let both = (0..)
        .zip(before.iter().zip(now))
        .filter_map(|(index, (then, now))| Some((index, [then.as_ref()?, now.as_ref()?])));
    both.filter(|(_, [then, now])| then != now).map(|(index, places)| Around::all(index, places)).collect()
}

/// Around all that moves, where it is now.
pub(super) fn standing(now: &[Option<Place>]) -> Vec<Around> {
    (0..).zip(now).filter_map(|(index, place)| Some(Around::all(index, [place.as_ref()?]))).collect()
}

impl Around {
    /// The box in the world around an instance at all of these places.
    fn all<const N: usize>(instance: u32, places: [&Place; N]) -> Self {
        let points = places.into_iter().flat_map(|Place { world, low, high, .. }| {
            let select = |i: u32| Vec3A::select(BVec3A::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), *low, *high);
            (0..8).map(move |i| world.transform_point3a(select(i)))
        });
        let empty = Self { instance, low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };
        points.fold(empty, |Self { low, high, .. }, p| Self { instance, low: low.min(p), high: high.max(p) })
    }

    /// Squared distance from a point to the box.
    pub fn distance2(&self, point: Vec3A) -> f32 {
        (self.low - point).max(point - self.high).max(Vec3A::ZERO).length_squared()
    }

    /// Whether the segment between two points touches the box (slabs).
    pub fn is_crossed(&self, from: Vec3A, to: Vec3A) -> bool {
        let way = to - from;
        let (a, b) = ((self.low - from) / way, (self.high - from) / way);
        // A segment in the plane of a face is 0/0 and may count either way: what stands there is no thicker than that plane.
        let (enter, leave) = (a.min(b), a.max(b));
        enter.max_element().max(0.0) <= leave.min_element().min(1.0)
    }
}
