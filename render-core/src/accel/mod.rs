//! Ray queries with a two-level bounding volume hierarchy over the triangles of the scene.
//!
//! Static geometry has one tree in world space. Each moving mesh, and each static mesh with many instances, has a tree
//! in its local space. All these trees are built once. Trees of deforming meshes are rebuilt each frame. Surfaces with
//! holes have separate trees. A small top-level tree over all other trees is rebuilt each frame.
//!
//! The crate `obvhs` builds binary trees. The module [`tree`] widens them to eight boxes per node. It traverses them
//! with single rays or with a [`packet`] of at most 64 rays.
//!
//! Internally, lengths are scaled by a power of two, so that the scene spans 64…128 units. Products of four lengths
//! then neither overflow nor underflow, regardless of the scene's unit.

mod cut_outs;
mod found;
mod geometry;
mod group;
mod packet;
mod panes;
mod query;
mod ray;
mod reach;
mod shaft;
mod sharing;
mod sheets;
mod ties;
mod tree;
mod triangles;

pub use geometry::Geometry;
pub use packet::PACKET;
pub use shaft::Shaft;
pub use sheets::{Layered, SheetHit};
pub(crate) use sheets::{RayCone, Shadows};

use crate::ranks::portable;
use cut_outs::Sheets;
use found::Found;
use glam::{Affine3A, BVec3A, DVec3, Vec3A};
use group::Group;
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::builder::build_bvh2};
use packet::PacketRay;
use query::{Blocked, Closest, Settle, Together};
use sheets::Views;
use std::{sync::Arc, time::Duration};
use ties::AllSides;
use tree::{Costs, Tree};
use triangles::Owner;

/// Intersection of a ray with a surface triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray \[m\].
    pub distance: f32,
    /// Index into [`crate::scene::Scene::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

portable!(Hit { distance, instance, triangle, u, v });

/// Acceleration structure for ray queries in the scene at a given time.
///
/// The hit of a ray is bit-identical whether the ray is traced alone or in a packet, with or without vector
/// instructions.
pub struct Accelerator {
    groups: Vec<PlacedGroup>,
    /// Top-level tree. The contents of its leaves are indices into `groups`.
    top: Tree,
    sides: Arc<AllSides>,
    /// Rule that determines whether sheets stop rays.
    sheets: Sheets,
    /// Accelerators of the scene's solid surfaces and of its sheets. `None` if the scene has no sheets.
    views: Option<Arc<Views>>,
    scale: f32,
    lanes: lanes::Choice,
}

impl std::fmt::Debug for Accelerator {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Accelerator").field("trees", &self.groups.len()).finish_non_exhaustive()
    }
}

/// Slack of the bounding boxes of groups, as a fraction of the largest coordinate.
const GROUP_SLACK: f32 = 1e-5;

#[derive(Clone)]
struct PlacedGroup {
    group: Arc<Group>,
    /// Instance represented by this group, or `None` if each triangle has its own instance.
    instance: Option<u32>,
    /// Transform from local space to the scaled world, or `None` for the identity. `to_local` is the inverse.
    to_world: Option<Affine3A>,
    to_local: Option<Affine3A>,
    bounds: Aabb,
}

impl PlacedGroup {
    /// Creates a group with triangles in the scaled world.
    fn in_world(group: Arc<Group>) -> Self {
        Self { bounds: group.bounds, instance: None, to_world: None, to_local: None, group }
    }

    /// Creates a group in the local space of a mesh, placed as `instance`. Returns `None` for a transform that flattens
    /// the mesh or is not finite.
    fn attached(group: Arc<Group>, instance: usize, to_world: Affine3A) -> Option<Self> {
        // Reject singular transforms, because they have no inverse.
        if to_world.matrix3.determinant() == 0.0 || !to_world.is_finite() {
            return None;
        }
        // Bound the group by the transformed corners of its box.
        let (min, max) = (group.bounds.min, group.bounds.max);
        let corner = |i: usize| Vec3A::select(BVec3A::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), min, max);
        let corners: [Vec3A; 8] = std::array::from_fn(|i| to_world.transform_point3a(corner(i)));
        let bounds = Aabb::from_points(&corners);
        let (instance, to_local) = (Some(instance as u32), Some(to_world.inverse()));
        Some(Self { group, instance, to_world: Some(to_world), to_local, bounds })
    }

    /// Transforms a ray to the group's local space. The direction is not normalized again, so distances along the ray
    /// are equal in both spaces.
    #[inline(always)]
    fn local(&self, origin: Vec3A, direction: Vec3A) -> (Vec3A, Vec3A) {
        match &self.to_local {
            None => (origin, direction),
            Some(m) => (m.transform_point3a(origin), m.transform_vector3a(direction)),
        }
    }
}

impl Accelerator {
    /// Builds the top-level tree over `groups`. Internal lengths are `scale` times the lengths in meters.
    fn new(groups: Vec<PlacedGroup>, sides: Arc<AllSides>, scale: f32) -> Self {
        let views = Views::of(&groups, |groups, sheets| Self::of_groups(groups, sides.clone(), sheets, scale));
        Self { views: views.map(Arc::new), ..Self::of_groups(groups, sides, Sheets::ByChance, scale) }
    }

    fn of_groups(groups: Vec<PlacedGroup>, sides: Arc<AllSides>, sheets: Sheets, scale: f32) -> Self {
        // Add slack to the boxes. A box entry is computed in world space and a triangle hit in local space, so rounding
        // can swap the order of the two.
        let boxes: Vec<Aabb> = groups
            .iter()
            .map(|PlacedGroup { bounds: Aabb { min, max }, .. }| {
                let slack = Vec3A::splat(GROUP_SLACK * min.abs().max(max.abs()).max_element());
                Aabb { min: *min - slack, max: *max + slack }
            })
            .collect();
        let binary = build_bvh2(
            &boxes,
            BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::fastest_build() },
            &mut Duration::default(),
        );
        let top = Tree::new(&binary, &Costs { leaf: 4.0, primitive: 0.0, most: 1 }, |places| places[0]);
        Self { groups, top, sides, sheets, views: None, scale, lanes: lanes::Choice::best() }
    }

    /// Returns the first surface along the ray from `origin` in the unit direction `direction`.
    ///
    /// Among surfaces at distances that differ only by rounding, fronts win, then emissive surfaces, then the first
    /// surface in the file.
    #[must_use]
    pub fn closest(&self, origin: Vec3A, direction: Vec3A) -> Option<Hit> {
        let origin = origin * self.scale;
        let found = self.lanes.run(Closest::<false> { scene: self, origin, direction });
        self.hit(self.settled::<false>(origin, direction, found))
    }

    /// Returns the first surface as [`Accelerator::closest`] does, but passes through the backs of single-sided
    /// surfaces.
    pub(crate) fn closest_shown(&self, origin: Vec3A, direction: Vec3A) -> Option<Hit> {
        let origin = origin * self.scale;
        let found = self.lanes.run(Closest::<true> { scene: self, origin, direction });
        self.hit(self.settled::<true>(origin, direction, found))
    }

    /// Resolves a contested hit: selects one of the hits at about the distance of `found`. `origin` is in the scaled
    /// world.
    #[inline]
    fn settled<const SHOWN: bool>(&self, origin: Vec3A, direction: Vec3A, found: Found) -> Found {
        if found.contested { self.settle::<SHOWN>(origin, direction, found) } else { found }
    }

    /// Resolves one contested hit. This code is a separate function because few hits are contested.
    #[cold]
    #[inline(never)]
    fn settle<const SHOWN: bool>(&self, origin: Vec3A, direction: Vec3A, nearest: Found) -> Found {
        self.lanes.run(Settle::<SHOWN> { scene: self, origin, direction, nearest })
    }

    /// Stores the result of [`Accelerator::closest`] for each of the unit `directions` at the same index in `hits`.
    /// Traces [`PACKET`] rays at a time, which is much faster if adjacent directions are similar.
    pub fn closest_packet(&self, origin: Vec3A, directions: &[Vec3A], hits: &mut [Option<Hit>]) {
        assert_eq!(directions.len(), hits.len(), "a place for the hit of each direction");
        for (directions, hits) in directions.chunks(PACKET).zip(hits.chunks_mut(PACKET)) {
            // Start each ray without a hit.
            let mut rays = [PacketRay::NONE; PACKET];
            for (index, (ray, &direction)) in rays.iter_mut().zip(directions).enumerate() {
                let Found { met, .. } = Found::NOTHING;
                *ray = PacketRay { index, direction, limit: met.t, triangle: met.triangle };
            }
            // Trace the packet, then settle each contested hit with a single ray.
            let mut found = [Found::NOTHING; PACKET];
            let (origin, rays) = (origin * self.scale, &rays[..directions.len()]);
            self.lanes.run(Together::<true> { scene: self, origin, rays, found: &mut found });
            for ((hit, &direction), found) in hits.iter_mut().zip(directions).zip(found) {
                *hit = self.hit(self.settled::<false>(origin, direction, found));
            }
        }
    }

    /// Returns whether a surface lies between `from` and `to`. Both ends should be slightly off their surfaces.
    #[inline]
    #[must_use]
    pub fn occluded(&self, from: Vec3A, to: Vec3A) -> bool {
        let direction = (to - from) * self.scale;
        self.lanes.run(Blocked { scene: self, origin: from * self.scale, direction, limit: 1.0 })
    }

    /// Tests the segments from one point to at most [`PACKET`] others, with the result of [`Accelerator::occluded`] for
    /// each. Bit i of the returned mask is set if `to[i]` is hidden. Segments with a bit of 0 in `active` are not
    /// traced and count as visible.
    ///
    /// All segments must have one end in common: either a light or a lit point.
    #[must_use]
    pub fn occluded_packet(&self, from: Vec3A, to: &[Vec3A], active: u64) -> u64 {
        assert!(to.len() <= PACKET, "{} segments in a packet of at most {PACKET}", to.len());
        // Pack only the active segments; `index` maps results to the mask.
        let (mut rays, mut count) = ([PacketRay::NONE; PACKET], 0);
        for (index, &end) in to.iter().enumerate() {
            if active >> index & 1 == 1 {
                let triangle = group::NO_TRIANGLE;
                rays[count] = PacketRay { index, direction: (end - from) * self.scale, limit: 1.0, triangle };
                count += 1;
            }
        }
        let origin = from * self.scale;
        self.lanes.run(Together::<false> { scene: self, origin, rays: &rays[..count], found: &mut [] })
    }

    /// Returns whether a surface lies at any distance from `from` in the unit direction `direction`.
    #[inline]
    #[must_use]
    pub fn occluded_towards(&self, from: Vec3A, direction: Vec3A) -> bool {
        self.lanes.run(Blocked { scene: self, origin: from * self.scale, direction, limit: f32::MAX })
    }

    /// Returns an accelerator of the scene without vector instructions, as a reference for tests and measurements.
    #[must_use]
    pub fn without_vector_instructions(mut self) -> Self {
        self.lanes = lanes::Choice::SCALAR;
        self
    }

    #[inline]
    fn hit(&self, Found { met, place, .. }: Found) -> Option<Hit> {
        met.is_something().then(|| {
            let placed = &self.groups[place];
            let Owner { instance, triangle } = placed.group.owner(met.triangle, placed.instance);
            Hit { distance: met.t / self.scale, instance, triangle, u: met.u, v: met.v }
        })
    }

    /// Returns the closest hit by testing every triangle in double precision, as a reference for tests of
    /// [`Accelerator::closest`].
    pub fn closest_by_exhaustion(&self, origin: Vec3A, direction: Vec3A) -> Option<Hit> {
        let mut best: Option<(f64, Hit)> = None;
        for placed in &self.groups {
            // Transform the ray to the group's local space, which preserves distances along it.
            let (origin, direction) = placed.local(origin * self.scale, direction);
            let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
            for block in &placed.group.blocks {
                for (lane, &index) in
                    block.triangles.iter().enumerate().filter(|(_, index)| **index != group::NO_TRIANGLE)
                {
                    let Some((t, u, v)) = meet_exactly(origin, direction, block.corners(lane).map(Vec3A::as_dvec3))
                    else {
                        continue;
                    };
                    let owner = placed.group.owner(index, placed.instance);
                    if best.is_none_or(|(nearest, _)| t < nearest)
                        && placed.group.is_there(index, [u as f32, v as f32], placed.instance, self.sheets)
                    {
                        let Owner { instance, triangle } = owner;
                        let distance = (t / f64::from(self.scale)) as f32;
                        best = Some((t, Hit { distance, instance, triangle, u: u as f32, v: v as f32 }));
                    }
                }
            }
        }
        best.map(|(_, hit)| hit)
    }
}

/// Returns the distance and the barycentric weights of the second and third corner, by the test of Möller & Trumbore
/// (1997).
fn meet_exactly(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, f64, f64)> {
    let (e1, e2, to) = (b - a, c - a, origin - a);
    let (p, q) = (direction.cross(e2), to.cross(e1));
    let determinant = e1.dot(p);
    let (u, v, t) = (to.dot(p) / determinant, direction.dot(q) / determinant, e2.dot(q) / determinant);
    (determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some((t, u, v))
}
