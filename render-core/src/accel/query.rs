//! Rays through both levels: the tree over the groups, and in each the group's own.

use super::group::{Group, Met, NO_TRIANGLE};
use super::packet::{Entered, PACKET, Packet, PacketRay, Triangles, VisitTogether};
use super::ray::{Octant, Ray};
use super::tree::Visit;
use super::{Accelerator, Placed};
use glam::Vec3A;
use lanes::{Kernel, Lanes};

/// The triangle that a ray met, and its group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) met: Met,
    /// Place in [`Accelerator::groups`].
    pub(super) place: usize,
}

impl Found {
    pub(super) const NOTHING: Self = Self { met: Met::NOTHING, place: usize::MAX };

    /// The hit that group `place` must beat: of hits at one distance, the group that comes first wins.
    fn to_beat(self, place: usize) -> Met {
        Met { triangle: if place < self.place { NO_TRIANGLE } else { 0 }, ..self.met }
    }
}

impl Accelerator {
    /// The only group, where there is one, it stands in world space and has no holes.
    #[inline(always)]
    fn sole_group(&self) -> Option<&Group> {
        match &self.groups[..] {
            [Placed { group, to_local: None, .. }] if group.cut_outs.is_none() => Some(group),
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
        let ray = Ray::new(origin, direction);
        if let Some(group) = scene.sole_group() {
            return Found { met: group.closest(lanes, &ray, Met::NOTHING, None), place: 0 };
        }
        let mut visitor = ClosestGroup { scene, origin, direction, found: Found::NOTHING };
        scene.top.walk(lanes, &ray, Met::NOTHING.t, &mut visitor);
        visitor.found
    }
}

struct ClosestGroup<'a> {
    scene: &'a Accelerator,
    origin: Vec3A,
    direction: Vec3A,
    found: Found,
}

impl Visit for ClosestGroup<'_> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, _: f32, _: f32) -> f32 {
        let place = content as usize;
        let placed = &self.scene.groups[place];
        let (origin, direction) = placed.local(self.origin, self.direction);
        let to_beat = self.found.to_beat(place);
        let met = placed.group.closest(lanes, &Ray::new(origin, direction), to_beat, placed.instance);
        if met != to_beat {
            self.found = Found { met, place };
        }
        self.found.met.t
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
        let ray = Ray::new(origin, direction);
        if let Some(group) = scene.sole_group() {
            return group.blocks(lanes, &ray, limit, None);
        }
        let mut visitor = AnyGroup { scene, origin, direction, blocked: false };
        scene.top.walk(lanes, &ray, limit, &mut visitor);
        visitor.blocked
    }
}

struct AnyGroup<'a> {
    scene: &'a Accelerator,
    origin: Vec3A,
    direction: Vec3A,
    blocked: bool,
}

impl Visit for AnyGroup<'_> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, _: f32, limit: f32) -> f32 {
        let placed = &self.scene.groups[content as usize];
        let (origin, direction) = placed.local(self.origin, self.direction);
        self.blocked = placed.group.blocks(lanes, &Ray::new(origin, direction), limit, placed.instance);
        if self.blocked { -1.0 } else { limit }
    }
}

/// Fewer shadow rays than this go alone: to make a packet ready takes as long as some walks.
const WORTH_A_PACKET: usize = 8;

/// Rays from one `origin` in scaled world space, at most [`PACKET`].
///
/// `CLOSEST`: `found` (by [`PacketRay::index`]) becomes the first surface along each. Otherwise `found` is not used, and
/// the answer has the bits (by [`PacketRay::index`]) of the rays that meet a surface within their limits.
pub(super) struct Together<'a, const CLOSEST: bool> {
    pub(super) scene: &'a Accelerator,
    pub(super) origin: Vec3A,
    pub(super) rays: &'a [PacketRay],
    pub(super) found: &'a mut [Found],
}

impl<const CLOSEST: bool> Kernel for Together<'_, CLOSEST> {
    type Output = u64;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> u64 {
        let Self { scene, origin, rays, found } = self;
        let mut blocked = 0;
        let mut octants = Octants::of(rays);
        while let Some((octant, rays)) = octants.next() {
            if !CLOSEST && rays.len() < WORTH_A_PACKET {
                for &PacketRay { index, direction, limit, .. } in rays {
                    blocked |= u64::from(Blocked { scene, origin, direction, limit }.run(lanes)) << index;
                }
                continue;
            }
            let mut packet = Packet::new(lanes, origin, octant, rays);
            match scene.sole_group() {
                Some(group) => {
                    packet.walk(lanes, &group.tree, &mut Triangles::<CLOSEST>(group));
                    if CLOSEST {
                        for (k, ray) in rays.iter().enumerate() {
                            found[ray.index] = Found { met: packet.met(k), place: 0 };
                        }
                    }
                }
                None => packet.walk(lanes, &scene.top, &mut Groups::<CLOSEST> { scene, origin, rays, found }),
            }
            if !CLOSEST {
                for (k, ray) in rays.iter().enumerate() {
                    blocked |= u64::from(packet.met(k).t < 0.0) << ray.index;
                }
            }
        }
        blocked
    }
}

/// Takes the rays of a packet through the groups whose boxes they enter.
struct Groups<'a, const CLOSEST: bool> {
    scene: &'a Accelerator,
    origin: Vec3A,
    /// As they stand in the packet.
    rays: &'a [PacketRay],
    found: &'a mut [Found],
}

impl<const CLOSEST: bool> VisitTogether for Groups<'_, CLOSEST> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, packet: &mut Packet, content: u32, entered: &Entered) {
        let place = content as usize;
        let placed = &self.scene.groups[place];
        if !CLOSEST && placed.to_local.is_none() && placed.group.cut_outs.is_none() {
            // The packet itself can go on; which group stopped a ray does not matter.
            packet.walk(lanes, &placed.group.tree, &mut Triangles::<false>(&placed.group));
            return;
        }
        let (mut local, mut count) = ([PacketRay::NONE; PACKET], 0);
        let mut bits = entered.rays();
        while bits != 0 {
            let index = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let ray = &self.rays[index];
            let direction = placed.local(self.origin, ray.direction).1;
            local[count] = if CLOSEST {
                let to_beat = self.found[ray.index].to_beat(place);
                PacketRay { index, direction, limit: to_beat.t, triangle: to_beat.triangle }
            } else {
                PacketRay { index, direction, ..*ray }
            };
            count += 1;
        }
        let origin = placed.local(self.origin, Vec3A::X).0;
        if placed.group.cut_outs.is_some() || !CLOSEST && count < WORTH_A_PACKET {
            // Each hit is tested whether it counts, and few rays are faster alone.
            for ray in &local[..count] {
                if let Some(met) = alone::<L, CLOSEST>(lanes, placed, origin, ray) {
                    packet.set_limit(ray.index, met.t);
                    if CLOSEST {
                        self.found[self.rays[ray.index].index] = Found { met, place };
                    }
                }
            }
            packet.measure(lanes);
            return;
        }
        let mut octants = Octants::of(&local[..count]);
        while let Some((octant, rays)) = octants.next() {
            let mut within = Packet::new(lanes, origin, octant, rays);
            within.walk(lanes, &placed.group.tree, &mut Triangles::<CLOSEST>(&placed.group));
            for (k, ray) in rays.iter().enumerate() {
                let met = within.met(k);
                if met.t < ray.limit || met.triangle != ray.triangle {
                    packet.set_limit(ray.index, met.t);
                    if CLOSEST {
                        self.found[self.rays[ray.index].index] = Found { met, place };
                    }
                }
            }
        }
        packet.measure(lanes);
    }
}

/// The triangle of a group that a ray of a packet meets when it goes alone: the same as in the packet.
#[inline(always)]
fn alone<L: Lanes, const CLOSEST: bool>(lanes: L, placed: &Placed, origin: Vec3A, ray: &PacketRay) -> Option<Met> {
    let Placed { group, instance, .. } = placed;
    let PacketRay { limit, triangle, .. } = *ray;
    let ray = Ray::new(origin, ray.direction);
    if CLOSEST {
        let to_beat = Met { t: limit, triangle, ..Met::NOTHING };
        let met = group.closest(lanes, &ray, to_beat, *instance);
        (met != to_beat).then_some(met)
    } else {
        group.blocks(lanes, &ray, limit, *instance).then_some(Met { t: -1.0, ..Met::NOTHING })
    }
}

/// Rays sorted by octant. Where they go to pixels all have the same, and are handed on as they are.
pub(super) struct Octants<'a> {
    all: &'a [PacketRay],
    /// Bits of the rays that are left.
    left: u64,
    octants: [Octant; PACKET],
    /// The rays that were taken from a mixed lot last.
    together: Vec<PacketRay>,
}

impl<'a> Octants<'a> {
    #[inline(always)]
    pub(super) fn of(rays: &'a [PacketRay]) -> Self {
        let mut octants = [Octant::default(); PACKET];
        for (octant, ray) in octants.iter_mut().zip(rays) {
            *octant = Octant::of(ray.direction);
        }
        let left = u64::MAX.checked_shr((PACKET - rays.len()) as u32).unwrap_or(0);
        Self { all: rays, left, octants, together: Vec::new() }
    }

    /// The rays that share an octant with the first that is left.
    #[inline(always)]
    pub(super) fn next(&mut self) -> Option<(Octant, &[PacketRay])> {
        if self.left == 0 {
            return None;
        }
        let octant = self.octants[self.left.trailing_zeros() as usize % PACKET];
        let alike =
            self.octants.iter().rev().fold(0, |bits, &other| bits << 1 | u64::from(other == octant)) & self.left;
        self.left &= !alike;
        if alike.count_ones() as usize == self.all.len() {
            return Some((octant, self.all));
        }
        self.together.clear();
        self.together.reserve(PACKET);
        let mut bits = alike;
        while bits != 0 {
            self.together.push(self.all[bits.trailing_zeros() as usize % PACKET]);
            bits &= bits - 1;
        }
        Some((octant, &self.together))
    }
}
