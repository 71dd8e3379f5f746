//! What a ray meets: two levels of bounding volumes over the triangles of the scene.
//!
//! Everything that never moves is one tree in world space, built once; every moving instance has a tree of its own in its
//! local space, built once too; what bends is built for each frame, and surfaces with holes stand apart. Over these stands a small tree that is rebuilt for each frame.
//! Inside, lengths are scaled by a power of two so that the scene spans 64…128 units: `obvhs` culls
//! boxes nearer than 1e-4, whatever the unit.

mod cut_outs;
mod geometry;

pub use geometry::Geometry;

use geometry::Group;
use glam::{Affine3A, Vec3A};
use obvhs::{
    aabb::Aabb,
    bvh2::Bvh2,
    ray::{Ray, RayHit},
};
use std::sync::Arc;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Metres along the ray.
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

/// The scene at one time, ready for rays.
pub struct Accelerator {
    groups: Vec<Placed>,
    top: Bvh2,
    scale: f32,
}

/// With this many groups or fewer, testing each box in turn beats walking a tree of them.
const FEW_GROUPS: usize = 8;

struct Placed {
    group: Arc<Group>,
    /// Local from scaled world; `None` for the identity.
    to_local: Option<Affine3A>,
    bounds: Aabb,
}

/// A triangle that a ray met, before its barycentrics are known.
struct Found {
    t: f32,
    place: usize,
    triangle: usize,
    local: Ray,
}

/// The part of an [`Accelerator`] that a bundle of rays can reach.
pub struct Packet<'a> {
    accelerator: &'a Accelerator,
    /// `None` when too many remain for testing each in turn.
    groups: Option<Vec<usize>>,
}

/// A ray, its direction without negative zeros: `obvhs` takes the sign of a component once from its inverse and once from
/// itself, these disagree on −0, and the ray misses every box. Views along an axis have such rays.
#[inline]
fn new_ray(origin: Vec3A, direction: Vec3A, tmin: f32, tmax: f32) -> Ray {
    Ray::new(origin, direction + Vec3A::ZERO, tmin, tmax)
}

impl Packet<'_> {
    /// As [`Accelerator::closest`], for a ray of the packet.
    #[inline]
    pub fn closest(&self, origin: Vec3A, direction: Vec3A) -> Option<Hit> {
        match &self.groups {
            None => self.accelerator.closest(origin, direction),
            Some(groups) => {
                let ray = new_ray(origin * self.accelerator.scale, direction, 0.0, f32::INFINITY);
                self.accelerator.closest_among(ray, groups.iter().copied())
            }
        }
    }
}

impl Placed {
    #[inline]
    fn local(&self, ray: &Ray) -> Ray {
        match &self.to_local {
            None => *ray,
            // The direction keeps its length, so that distances mean the same in both spaces.
            Some(m) => {
                new_ray(m.transform_point3a(ray.origin), m.transform_vector3a(ray.direction), ray.tmin, ray.tmax)
            }
        }
    }

    #[inline]
    fn closest(&self, ray: &Ray) -> Option<(f32, usize, Ray)> {
        let local = self.local(ray);
        let mut hit = RayHit::none();
        let group = &*self.group;
        let found = match &group.cut_outs {
            None => group.bvh.ray_traverse(local, &mut hit, |r, i| group.triangles[i].intersect(r)),
            Some(cut_outs) => group.bvh.ray_traverse(local, &mut hit, |r, i| group.intersect(cut_outs, r, i)),
        };
        found.then_some((hit.t, hit.primitive_id as usize, local))
    }

    #[inline]
    fn blocks(&self, ray: &Ray) -> bool {
        let group = &*self.group;
        !match &group.cut_outs {
            None => group.bvh.ray_traverse_miss(self.local(ray), |r, i| group.triangles[i].intersect(r)),
            Some(cut_outs) => group.bvh.ray_traverse_miss(self.local(ray), |r, i| group.intersect(cut_outs, r, i)),
        }
    }
}

impl Accelerator {
    /// The first surface along the ray from `origin` in the unit `direction`.
    pub fn closest(&self, origin: Vec3A, direction: Vec3A) -> Option<Hit> {
        let ray = new_ray(origin * self.scale, direction, 0.0, f32::INFINITY);
        if self.groups.len() <= FEW_GROUPS {
            return self.closest_among(ray, 0..self.groups.len());
        }
        let mut best: Option<Found> = None;
        self.top.ray_traverse(ray, &mut RayHit::none(), |r, slot| {
            let place = self.top.primitive_indices[slot] as usize;
            match self.groups[place].closest(r) {
                Some((t, triangle, local)) if t < r.tmax => {
                    best = Some(Found { t, place, triangle, local });
                    t
                }
                _ => f32::INFINITY,
            }
        });
        best.map(|found| self.hit(found))
    }

    /// Rays that lie between four corner rays from one origin, given in order around the border: what the whole
    /// packet misses is ruled out once. Parallel rays rule out nothing.
    pub fn packet(&self, corners: [(Vec3A, Vec3A); 4]) -> Packet<'_> {
        let origin = corners[0].0;
        if corners.iter().any(|(other, _)| *other != origin) {
            return Packet { accelerator: self, groups: None };
        }
        let middle: Vec3A = corners.iter().map(|(_, direction)| *direction).sum();
        let sides: [Vec3A; 4] = std::array::from_fn(|i| {
            let inward = corners[i].1.cross(corners[(i + 1) % 4].1);
            if inward.dot(middle) < 0.0 { -inward } else { inward }
        });
        let origin = origin * self.scale;
        let inside = |place: &usize| {
            let Aabb { min, max } = self.groups[*place].bounds;
            sides.iter().all(|side| {
                // The corner of the box that lies farthest inward.
                let corner = Vec3A::select(side.cmpge(Vec3A::ZERO), max, min);
                side.dot(corner - origin) >= -1e-4 * (corner - origin).length() * side.length()
            })
        };
        let groups: Vec<usize> = (0..self.groups.len()).filter(inside).collect();
        Packet { accelerator: self, groups: (groups.len() <= FEW_GROUPS).then_some(groups) }
    }

    fn closest_among(&self, mut ray: Ray, places: impl IntoIterator<Item = usize>) -> Option<Hit> {
        let mut best: Option<Found> = None;
        for place in places {
            let placed = &self.groups[place];
            if placed.bounds.intersect_ray(&ray) < ray.tmax
                && let Some((t, triangle, local)) = placed.closest(&ray)
            {
                best = Some(Found { t, place, triangle, local });
                ray.tmax = t;
            }
        }
        best.map(|found| self.hit(found))
    }

    fn hit(&self, Found { t, place, triangle, local }: Found) -> Hit {
        let group = &self.groups[place].group;
        let uv = group.triangles[triangle].compute_barycentric(&local);
        let (instance, index) = group.owners[triangle];
        Hit { distance: t / self.scale, instance, triangle: index, u: uv.x, v: uv.y }
    }

    /// Whether anything stands between `from` and `to`. Both ends should be a little off their surfaces.
    #[inline]
    pub fn occluded(&self, from: Vec3A, to: Vec3A) -> bool {
        let way = (to - from) * self.scale;
        let length = way.length();
        if length <= 0.0 {
            return false;
        }
        self.blocked(&new_ray(from * self.scale, way / length, 0.0, length))
    }

    /// Whether anything stands in the unit `direction` from `from`, however far.
    #[inline]
    pub fn occluded_towards(&self, from: Vec3A, direction: Vec3A) -> bool {
        self.blocked(&new_ray(from * self.scale, direction, 0.0, f32::INFINITY))
    }

    #[inline]
    fn blocked(&self, ray: &Ray) -> bool {
        if self.groups.len() <= FEW_GROUPS {
            return self.groups.iter().any(|placed| placed.bounds.intersect_ray(ray) < ray.tmax && placed.blocks(ray));
        }
        !self.top.ray_traverse_miss(*ray, |r, slot| {
            if self.groups[self.top.primitive_indices[slot] as usize].blocks(r) { 0.0 } else { f32::INFINITY }
        })
    }

    /// Every triangle in turn: what [`Accelerator::closest`] is tested against.
    pub fn closest_by_exhaustion(&self, origin: Vec3A, direction: Vec3A) -> Option<Hit> {
        let ray = new_ray(origin * self.scale, direction, 0.0, f32::INFINITY);
        let mut best: Option<Hit> = None;
        for placed in &self.groups {
            let local = placed.local(&ray);
            for (i, triangle) in placed.group.triangles.iter().enumerate() {
                let t = match &placed.group.cut_outs {
                    None => triangle.intersect(&local),
                    Some(cut_outs) => placed.group.intersect(cut_outs, &local, i),
                };
                if t < ray.tmax && best.is_none_or(|hit| t / self.scale < hit.distance) {
                    let uv = triangle.compute_barycentric(&local);
                    let (instance, index) = placed.group.owners[i];
                    best = Some(Hit { distance: t / self.scale, instance, triangle: index, u: uv.x, v: uv.y });
                }
            }
        }
        best
    }
}
