//! Coincident surfaces: selection among hits at distances that differ only by rounding.
//!
//! A ray hits sheets in one plane, back to back or on top of each other, at distances that differ by rounding errors.
//! The nearest sheet would vary from ray to ray. A traversal therefore detects another surface close behind the nearest
//! hit, which is rare. Only then, a second traversal lists all hits near this distance. A rule independent of their
//! order selects one:
//!
//! ```text
//! (t − t₁) ≤ τ m (1/cos θ + 1/cos θ₁)        criterion for a hit that coincides with the nearest, t₁
//!   m   largest coordinate of the ray's origin and both triangles        θ   angle between ray and normal
//! ```
//!
//! 1. Among surfaces in one plane, fronts and double-sided surfaces win over backs of single-sided surfaces. Next,
//!    emissive surfaces win, so that a lamp in the plane of a ceiling is visible. Finally, the lower indices of
//!    instance and triangle win: the first in the file.
//! 2. If the selected surface is a back, a front at an angle to it wins. This is the near side of a body along its
//!    outline.

use super::found::Found;
use super::group::Met;
use super::triangles::Owner;
use super::{Accelerator, PlacedGroup};
use crate::scene::{Pose, Scene};
use glam::Vec3A;

/// τ: eight rounding errors of the corners, the origin and the terms of a distance.
const ROUNDINGS: f32 = 8.0 * f32::EPSILON / 2.0;
/// Minimum cosine of the angle between normals of triangles in one plane. The angle is 0.26°.
const PARALLEL: f32 = 1.0 - 1e-5;

/// Properties of the sides of an instance.
#[derive(Clone, Copy, Debug)]
struct Sides {
    double_sided: bool,
    glows: bool,
    /// Whether the transform of the instance reverses the orientation of triangles.
    mirrored: bool,
}

/// Sides of all instances. A moving instance may be mirrored at some times only.
#[derive(Clone, Debug)]
pub(super) struct AllSides(Vec<Sides>);

impl AllSides {
    pub(super) fn new(scene: &Scene, pose: &Pose) -> Self {
        let materials = scene.extreme_materials();
        let sides = scene.instances.iter().enumerate().map(|(index, instance)| {
            let material = &materials[scene.meshes[instance.mesh].material];
            let mirrored = scene.instance_world(pose, index).matrix3.determinant() < 0.0;
            Sides { double_sided: material.double_sided, glows: material.emits(), mirrored }
        });
        Self(sides.collect())
    }

    /// Returns a code that is equal for instances with equal sides.
    pub(super) fn code(&self, instance: u32) -> u32 {
        let Sides { double_sided, glows, mirrored } = self.0[instance as usize];
        [double_sided, glows, mirrored].into_iter().fold(0, |code, bit| code << 1 | u32::from(bit))
    }
}

/// Candidate for the visible hit, at about the distance of the nearest hit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rival {
    pub(super) found: Found,
    owner: Owner,
    /// Unit normal in world space, towards the front as defined in the file.
    normal: Vec3A,
    /// Cosine of the angle between normal and ray, 0…1.
    cosine: f32,
    /// Largest coordinate in the computation of the hit's distance.
    largest: f32,
    pub(super) is_back: bool,
    glows: bool,
}

impl Rival {
    /// Returns the sort key of a hit among hits in one plane. The hit with the least key is visible.
    fn rank(&self) -> (bool, bool, u32, u32) {
        (self.is_back, !self.glows, self.owner.instance, self.owner.triangle)
    }
}

impl Accelerator {
    /// Returns the rival for a hit of group `place`. `corners` are in the local space of the group.
    pub(super) fn rival(&self, met: Met, place: usize, corners: [Vec3A; 3], direction: Vec3A) -> Rival {
        let placed = &self.groups[place];
        let owner = placed.group.owner(met.triangle, placed.instance);
        let [a, b, c] = placed.world_corners(corners);
        let Sides { double_sided, glows, mirrored } = self.sides.0[owner.instance as usize];
        let mirrored = placed.to_world.map_or(mirrored, |m| m.matrix3.determinant() < 0.0);

        // Compute the normal with the arithmetic of `Interaction`, so that both select the same side.
        let area_vector = (b - a).cross(c - a);
        let normal = (area_vector * if mirrored { -1.0 } else { 1.0 }).try_normalize().unwrap_or(-direction);
        let towards = normal.dot(direction);
        // Bound the rounding error of the distance by the largest coordinate.
        let moved = placed.to_world.map_or(Vec3A::ZERO, |m| m.translation.abs());
        let largest = a.abs().max(b.abs()).max(c.abs()).max(moved).max_element();
        let found = Found { met, place, contested: false };
        Rival { found, owner, normal, cosine: towards.abs(), largest, is_back: towards > 0.0 && !double_sided, glows }
    }

    /// Returns whether a ray in the unit direction `direction` hits the back of a single-sided triangle. `corners` are
    /// in the local space of the group.
    pub(super) fn is_back(&self, triangle: u32, place: usize, corners: [Vec3A; 3], direction: Vec3A) -> bool {
        let met = Met { triangle, ..Met::NOTHING };
        self.rival(met, place, corners, direction).is_back
    }
}

impl PlacedGroup {
    /// Returns the corners in the scaled world, bit-identical to the scaled [`crate::Surfaces::corners`].
    pub(super) fn world_corners(&self, corners: [Vec3A; 3]) -> [Vec3A; 3] {
        match &self.to_world {
            None => corners,
            Some(m) => corners.map(|corner| m.transform_point3a(corner)),
        }
    }
}

/// Selects one of the `rivals`, which include `nearest`. `origin` is the ray's origin.
pub(super) fn choose(nearest: Found, origin: Vec3A, rivals: &[Rival]) -> Found {
    // Find the nearest hit among the rivals.
    let is_nearest =
        |rival: &&Rival| (rival.found.place, rival.found.met.triangle) == (nearest.place, nearest.met.triangle);
    let Some(&first) = rivals.iter().find(is_nearest) else { return nearest };
    let origin = origin.abs().max_element();
    // Accept hits at distances that differ from the nearest only by rounding.
    let as_near = |rival: &&Rival| {
        let slant = rival.cosine.recip() + first.cosine.recip();
        rival.found.met.t - nearest.met.t <= ROUNDINGS * origin.max(rival.largest).max(first.largest) * slant
    };
    let parallel = |rival: &&Rival| rival.normal.dot(first.normal).abs() >= PARALLEL;

    // Merge the pieces of a split triangle by keeping the nearest piece.
    let nearer = |a: &&Rival, b: &&Rival| a.found.met.t.total_cmp(&b.found.met.t);
    let in_plane = rivals.iter().filter(as_near).filter(parallel);
    let seen = in_plane.min_by(|a, b| a.rank().cmp(&b.rank()).then(nearer(a, b))).unwrap_or(&first);
    // Prefer a front at an angle to a selected back.
    let front = || {
        let fronts = rivals.iter().filter(|rival| !rival.is_back).filter(as_near);
        fronts.min_by(|a, b| nearer(a, b).then(a.rank().cmp(&b.rank())))
    };
    let seen = if seen.is_back { front().unwrap_or(seen) } else { seen };
    if is_nearest(&seen) { nearest } else { seen.found }
}
