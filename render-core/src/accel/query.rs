//! Rays through both levels: the tree over the groups, and in each the group's own.

use super::group::{Group, Met, NO_TRIANGLE};
use super::lanes::{Kernel, Lanes};
use super::packet::{PACKET, Packet};
use super::ray::{Direction, Octant};
use super::{Accelerator, Placed};
use glam::Vec3A;

/// What a ray met, and in which group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) met: Met,
    /// Place in [`Accelerator::groups`].
    pub(super) place: usize,
}

impl Found {
    pub(super) const NOTHING: Self = Self { met: Met::NOTHING, place: usize::MAX };

    /// What group `place` must beat: of hits at one distance, the group that comes first wins.
    fn to_beat(&self, place: usize) -> Met {
        Met { triangle: if place < self.place { NO_TRIANGLE } else { 0 }, ..self.met }
    }
}

impl Accelerator {
    /// The only group, where there is one and it stands in world space.
    #[inline(always)]
    fn sole_group(&self) -> Option<&Group> {
        match &self.groups[..] {
            [Placed { group, to_local: None, .. }] => Some(group),
            _ => None,
        }
    }
}

/// The first surface along a ray, from `origin` in scaled world space.
pub(super) struct Closest<'a> {
    pub(super) scene: &'a Accelerator,
    pub(super) origin: Vec3A,
    pub(super) direction: Vec3A,
}

impl Kernel for Closest<'_> {
    type Output = Found;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Found {
        let Self { scene, origin, direction } = self;
        if let Some(group) = scene.sole_group() {
            let met = group.closest(lanes, origin, &Direction::new(direction), Met::NOTHING);
            return Found { met, place: 0 };
        }
        let mut found = Found::NOTHING;
        scene.top.walk(lanes, origin, &Direction::new(direction), found.met.t, |content, _, _| {
            let place = content as usize;
            let placed = &scene.groups[place];
            let (origin, direction) = placed.local(origin, direction);
            let to_beat = found.to_beat(place);
            let met = placed.group.closest(lanes, origin, &Direction::new(direction), to_beat);
            if met != to_beat {
                found = Found { met, place };
            }
            found.met.t
        });
        found
    }
}

/// Whether anything stands between `origin`, in scaled world space, and `limit` lengths of `direction`.
pub(super) struct Blocked<'a> {
    pub(super) scene: &'a Accelerator,
    pub(super) origin: Vec3A,
    pub(super) direction: Vec3A,
    pub(super) limit: f32,
}

impl Kernel for Blocked<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let Self { scene, origin, direction, limit } = self;
        if let Some(group) = scene.sole_group() {
            return group.blocks(lanes, origin, &Direction::new(direction), limit);
        }
        let mut blocked = false;
        scene.top.walk(lanes, origin, &Direction::new(direction), limit, |content, _, limit| {
            let placed = &scene.groups[content as usize];
            let (origin, direction) = placed.local(origin, direction);
            blocked = placed.group.blocks(lanes, origin, &Direction::new(direction), limit);
            if blocked { -1.0 } else { limit }
        });
        blocked
    }
}

/// A ray of a packet.
#[derive(Clone, Copy)]
pub(super) struct PacketRay {
    /// Which one it is for whoever asks.
    pub(super) index: usize,
    pub(super) direction: Vec3A,
    /// As far as it looks, and of triangles at just that distance only below this index.
    pub(super) limit: f32,
    pub(super) triangle: u32,
}

impl PacketRay {
    pub(super) const NONE: Self = Self { index: 0, direction: Vec3A::ZERO, limit: -1.0, triangle: 0 };
}

/// Rays from one `origin` in scaled world space, at most [`PACKET`].
///
/// `CLOSEST`: `found` (by [`PacketRay::index`]) becomes the first surface along each. Otherwise: any surface within
/// a ray's limit makes its `found.met.t` negative.
pub(super) struct Together<'a, const CLOSEST: bool> {
    pub(super) scene: &'a Accelerator,
    pub(super) origin: Vec3A,
    pub(super) rays: &'a [PacketRay],
    pub(super) found: &'a mut [Found],
}

impl<const CLOSEST: bool> Kernel for Together<'_, CLOSEST> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { scene, origin, rays, found } = self;
        if let Some(group) = scene.sole_group() {
            through_group::<L, CLOSEST>(lanes, group, origin, rays, |ray, met| {
                found[ray.index] = Found { met, place: 0 }
            });
            return;
        }
        for_each_octant(rays, |octant, rays| {
            let mut packet = Packet::new(lanes, origin, octant, rays);
            packet.walk(lanes, &scene.top, |packet, content, entered| {
                let place = content as usize;
                let placed = &scene.groups[place];
                let (mut local, mut count) = ([PacketRay::NONE; PACKET], 0);
                let mut bits = entered.rays();
                while bits != 0 {
                    let index = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let to_beat = found[rays[index].index].to_beat(place);
                    let (limit, triangle) =
                        if CLOSEST { (to_beat.t, to_beat.triangle) } else { (rays[index].limit, NO_TRIANGLE) };
                    let direction = placed.local(origin, rays[index].direction).1;
                    local[count] = PacketRay { index, direction, limit, triangle };
                    count += 1;
                }
                let local_origin = placed.local(origin, Vec3A::X).0;
                through_group::<L, CLOSEST>(lanes, &placed.group, local_origin, &local[..count], |ray, met| {
                    found[rays[ray.index].index] = Found { met, place };
                    packet.set_limit(ray.index, met.t);
                });
                packet.measure(lanes);
            });
        });
    }
}

/// Takes the rays through one group; `changed` is given those that met something, and what.
#[inline(always)]
fn through_group<L: Lanes, const CLOSEST: bool>(
    lanes: L,
    group: &Group,
    origin: Vec3A,
    rays: &[PacketRay],
    mut changed: impl FnMut(&PacketRay, Met),
) {
    if group.cut_outs.is_some() {
        // Each hit has to be asked about: rays go one by one.
        for ray in rays {
            let direction = Direction::new(ray.direction);
            if CLOSEST {
                let to_beat = Met { t: ray.limit, triangle: ray.triangle, ..Met::NOTHING };
                let met = group.closest(lanes, origin, &direction, to_beat);
                if met != to_beat {
                    changed(ray, met);
                }
            } else if group.blocks(lanes, origin, &direction, ray.limit) {
                changed(ray, Met { t: -1.0, ..Met::NOTHING });
            }
        }
        return;
    }
    for_each_octant(rays, |octant, rays| {
        let mut packet = Packet::new(lanes, origin, octant, rays);
        if CLOSEST {
            packet.closest(lanes, group);
        } else {
            packet.block(lanes, group);
        }
        for (index, ray) in rays.iter().enumerate() {
            let met = packet.met(index);
            if met.t < ray.limit || met.triangle != ray.triangle {
                changed(ray, met);
            }
        }
    });
}

/// Gives `walk` the rays of each octant in turn.
#[inline(always)]
fn for_each_octant(rays: &[PacketRay], mut walk: impl FnMut(Octant, &[PacketRay])) {
    let Some(first) = rays.first() else { return };
    let octant = Octant::of(first.direction);
    if rays.iter().all(|ray| Octant::of(ray.direction) == octant) {
        walk(octant, rays);
        return;
    }
    let (mut rest, mut rest_count) = ([PacketRay::NONE; PACKET], rays.len());
    rest[..rest_count].copy_from_slice(rays);
    while rest_count > 0 {
        let octant = Octant::of(rest[0].direction);
        let (mut together, mut count, mut left) = ([PacketRay::NONE; PACKET], 0, 0);
        for k in 0..rest_count {
            let ray = rest[k];
            if Octant::of(ray.direction) == octant {
                together[count] = ray;
                count += 1;
            } else {
                rest[left] = ray;
                left += 1;
            }
        }
        rest_count = left;
        walk(octant, &together[..count]);
    }
}
