//! Planes of the church's walls, and their windows.

use super::{AISLE, BAY, BAYS, NAVE, apse_corners};
use crate::arches::{Opening, Plane};
use glam::{Vec3, vec3};

/// Returns the wall of the nave on one side, seen from the nave. Positions along the wall increase from the left.
pub(super) fn nave_wall(side: f32) -> Plane {
    let out = vec3(-side, 0.0, 0.0);
    Plane { origin: vec3(side * NAVE, 0.0, 0.0), along: Vec3::Y.cross(out), out }
}

/// Returns the outer wall of one aisle.
pub(super) fn aisle_wall(side: f32) -> Plane {
    Plane { origin: vec3(side * AISLE, 0.0, 0.0), ..nave_wall(side) }
}

/// Returns one wall of the apse, with positions from 0 to `NAVE`.
pub(super) fn apse_wall(i: usize) -> Plane {
    let (a, b) = (apse_corners()[i], apse_corners()[i + 1]);
    let along = vec3(b.x - a.x, 0.0, b.y - a.y).normalize();
    Plane { origin: vec3(a.x, 0.0, a.y), along, out: along.cross(Vec3::Y) }
}

/// Returns the position along a wall at the distance `d` from the west end \[m\]. Positions increase in opposite
/// directions on the two sides.
pub(super) fn along(plane: &Plane, d: f32) -> f32 {
    -d * plane.along.z
}

/// Returns the interval between two distances from the west end, in ascending positions along the wall.
pub(super) fn stretch(plane: &Plane, a: f32, b: f32) -> [f32; 2] {
    let (a, b) = (along(plane, a), along(plane, b));
    [a.min(b), a.max(b)]
}

/// Sorts openings along their wall, as [`wall`] requires.
pub(super) fn sorted(mut openings: Vec<Opening>) -> Vec<Opening> {
    openings.sort_by(|a, b| a.center.total_cmp(&b.center));
    openings
}

/// Returns the clerestory windows of one side, including the chancel's window.
pub(super) fn clerestory_windows(plane: &Plane) -> Vec<Opening> {
    let one = |i: usize| Opening {
        center: along(plane, BAY * (i as f32 + 0.5)),
        half: 1.3,
        sill: 8.95,
        spring: 11.2,
        point: 0.8,
    };
    sorted((0..=BAYS).map(one).collect())
}

/// Returns the windows of one aisle.
pub(super) fn aisle_windows(plane: &Plane) -> Vec<Opening> {
    let one = |i: usize| Opening {
        center: along(plane, BAY * (i as f32 + 0.5)),
        half: 1.1,
        sill: 1.95,
        spring: 4.0,
        point: 0.8,
    };
    sorted((0..BAYS).map(one).collect())
}

/// Returns the window of each apse wall.
pub(super) fn apse_window() -> Opening {
    Opening { center: NAVE / 2.0, half: 1.25, sill: 3.2, spring: 9.3, point: 0.8 }
}
