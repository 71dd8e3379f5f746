//! Traversal of both levels: first the tree over the groups, then the tree of each group.

use super::found::Found;
use super::group::{Group, Met, Nearest};
use super::packet::{Entered, PACKET, Packet, PacketRay, Triangles, VisitTogether};
use super::ray::{Octant, Ray};
use super::reach::Reach;
use super::ties::{Rival, choose};
use super::tree::{Visit, VisitAny};
use super::{Accelerator, PlacedGroup};
use glam::Vec3A;
use lanes::{Kernel, Lanes};

impl Accelerator {
    /// Returns the only group if the scene has exactly one, in world space and without holes.
    #[inline(always)]
    fn sole_group(&self) -> Option<&Group> {
        match &self.groups[..] {
            [PlacedGroup { group, to_local: None, .. }] if group.cut_outs.is_none() => Some(group),
            _ => None,
        }
    }
}

/// Query for the first surface along a ray in a unit direction, from `origin` in the scaled world.
///
/// If `SHOWN` is true, the ray passes through the backs of single-sided surfaces.
pub(super) struct Closest<'a, const SHOWN: bool> {
    pub(super) scene: &'a Accelerator,
    pub(super) origin: Vec3A,
    pub(super) direction: Vec3A,
}

impl<const SHOWN: bool> Kernel for Closest<'_, SHOWN> {
    type Output = Found;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Found {
        let Self { scene, origin, direction } = self;
        let (ray, reach) = (Ray::new(origin, direction), Reach::from(origin));
        // Skip the top-level tree if the scene has a single group.
        if let Some(group) = scene.sole_group()
            && !SHOWN
        {
            let Nearest { met, contested, .. } =
                group.closest(lanes, &ray, Nearest::nothing(reach), (None, scene.sheets));
            return Found { met, place: 0, contested };
        }
        let mut visitor = ClosestGroup::<SHOWN> { scene, origin, direction, found: Found::NOTHING, reach };
        scene.top.walk(lanes, &ray, Met::NOTHING.t, &mut visitor);
        visitor.found
    }
}

struct ClosestGroup<'a, const SHOWN: bool> {
    scene: &'a Accelerator,
    origin: Vec3A,
    direction: Vec3A,
    found: Found,
    reach: Reach,
}

impl<const SHOWN: bool> Visit for ClosestGroup<'_, SHOWN> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, _: f32, _: f32) -> f32 {
        let place = content as usize;
        let PlacedGroup { group, instance, .. } = &self.scene.groups[place];
        let (origin, direction) = self.scene.groups[place].local(self.origin, self.direction);
        // Continue in local space with the hit that this group must beat.
        let (ray, to_beat) = (Ray::new(origin, direction), self.found.to_beat(place, self.reach));
        let nearest = if SHOWN {
            group.closest_where(lanes, &ray, to_beat, |leaf, lane, u, v| {
                let triangle = leaf.triangle(lane);
                !self.scene.is_back(triangle, place, leaf.corners(lane), self.direction)
                    && group.is_there(triangle, [u, v], *instance, self.scene.sheets)
            })
        } else {
            group.closest(lanes, &ray, to_beat, (*instance, self.scene.sheets))
        };
        self.found.update(place, &to_beat, &nearest);
        self.reach.of(self.found.met.t)
    }
}

/// Query that selects one of all hits within reach of the `nearest`, by the rule of [`choose`].
///
/// If `SHOWN` is true, the ray passes through the backs of single-sided surfaces.
pub(super) struct Settle<'a, const SHOWN: bool> {
    pub(super) scene: &'a Accelerator,
    pub(super) origin: Vec3A,
    pub(super) direction: Vec3A,
    pub(super) nearest: Found,
}

impl<const SHOWN: bool> Kernel for Settle<'_, SHOWN> {
    type Output = Found;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Found {
        let Self { scene, origin, direction, nearest } = self;
        // List all hits within reach of the nearest, and choose one of them.
        let limit = Reach::from(origin).of(nearest.met.t);
        let mut visitor = Rivals { scene, origin, direction, found: Vec::new() };
        scene.top.walk(lanes, &Ray::new(origin, direction), limit, &mut visitor);
        let mut rivals = visitor.found;
        if SHOWN {
            rivals.retain(|rival| !rival.is_back);
        }
        choose(nearest, origin, &rivals)
    }
}

struct Rivals<'a> {
    scene: &'a Accelerator,
    origin: Vec3A,
    direction: Vec3A,
    found: Vec<Rival>,
}

impl Visit for Rivals<'_> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, _: f32, limit: f32) -> f32 {
        let place = content as usize;
        let PlacedGroup { group, instance, .. } = &self.scene.groups[place];
        let (origin, direction) = self.scene.groups[place].local(self.origin, self.direction);
        group.each_within(lanes, &Ray::new(origin, direction), limit, |leaf, lane, met| {
            if group.is_there(met.triangle, [met.u, met.v], *instance, self.scene.sheets) {
                self.found.push(self.scene.rival(met, place, leaf.corners(lane), self.direction));
            }
            limit
        });
        limit
    }
}

/// Query for any surface between `origin`, in the scaled world, and `limit` lengths of `direction`.
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
            return group.blocks(lanes, &ray, limit, (None, scene.sheets));
        }
        scene.top.stops(lanes, &ray, limit, &self)
    }
}

impl VisitAny for Blocked<'_> {
    #[inline(always)]
    fn stops<L: Lanes>(&self, lanes: L, content: u32) -> bool {
        let placed = &self.scene.groups[content as usize];
        let (origin, direction) = placed.local(self.origin, self.direction);
        let shown = (placed.instance, self.scene.sheets);
        placed.group.blocks(lanes, &Ray::new(origin, direction), self.limit, shown)
    }
}

/// Minimum number of shadow rays in a packet: setting up a packet takes as long as several single traversals.
const WORTH_A_PACKET: usize = 8;

/// Query with at most [`PACKET`] rays from one `origin` in the scaled world.
///
/// If `CLOSEST` is true, sets `found` (indexed by [`PacketRay::index`]) to the first surface along each ray. Otherwise
/// `found` is unused, and the result is the mask (by [`PacketRay::index`]) of the rays that hit a surface within their
/// limits.
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
        let reach = if CLOSEST { Reach::from(origin) } else { Reach::NONE };
        // Split the rays by octant, because the rays of a packet have one octant. Trace few shadow rays singly, which
        // is faster.
        let mut octants = Octants::of(rays);
        while let Some((octant, rays)) = octants.next() {
            if !CLOSEST && rays.len() < WORTH_A_PACKET {
                for &PacketRay { index, direction, limit, .. } in rays {
                    blocked |= u64::from(Blocked { scene, origin, direction, limit }.run(lanes)) << index;
                }
                continue;
            }
            let mut packet = Packet::new(lanes, origin, octant, rays, reach);
            // Trace the packet through the only group or through the top-level tree.
            match scene.sole_group() {
                Some(group) => {
                    packet.walk(lanes, &group.tree, &mut Triangles::<CLOSEST>(group));
                    if CLOSEST {
                        for (k, ray) in rays.iter().enumerate() {
                            let Nearest { met, contested, .. } = packet.nearest(k);
                            found[ray.index] = Found { met, place: 0, contested };
                        }
                    }
                }
                None => packet.walk(lanes, &scene.top, &mut Groups::<CLOSEST> { scene, origin, rays, found, reach }),
            }
            // Map the packet's order to the caller's indices.
            if !CLOSEST {
                for (k, ray) in rays.iter().enumerate() {
                    blocked |= u64::from(packet.is_blocked(k)) << ray.index;
                }
            }
        }
        blocked
    }
}

/// Visitor that traces the rays of a packet through each group with a box that they enter.
struct Groups<'a, const CLOSEST: bool> {
    scene: &'a Accelerator,
    origin: Vec3A,
    /// Rays in the packet's order.
    rays: &'a [PacketRay],
    found: &'a mut [Found],
    reach: Reach,
}

impl<const CLOSEST: bool> VisitTogether for Groups<'_, CLOSEST> {
    const IN_ORDER: bool = CLOSEST;

    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, packet: &mut Packet, content: u32, entered: &Entered) {
        let place = content as usize;
        let placed = &self.scene.groups[place];
        if !CLOSEST && placed.to_local.is_none() && !self.scene.may_pass(placed) {
            // Traverse this group with the packet itself. The result is only whether each ray is blocked, so no group
            // is stored.
            packet.walk(lanes, &placed.group.tree, &mut Triangles::<false>(&placed.group));
            return;
        }
        // Transform the rays that enter to the group's local space.
        let (mut local, mut count) = ([PacketRay::NONE; PACKET], 0);
        let mut bits = entered.rays();
        while bits != 0 {
            let index = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let ray = &self.rays[index];
            let direction = placed.local(self.origin, ray.direction).1;
            // Limit each ray by its nearest hit so far.
            local[count] = if CLOSEST {
                let Nearest { met, .. } = self.found[ray.index].to_beat(place, self.reach);
                PacketRay { index, direction, limit: met.t, triangle: met.triangle }
            } else {
                PacketRay { index, direction, ..*ray }
            };
            count += 1;
        }
        let origin = placed.local(self.origin, Vec3A::X).0;
        if self.scene.may_pass(placed) || !CLOSEST && count < WORTH_A_PACKET {
            // Trace single rays if each hit must be tested for holes, or if few rays enter.
            let shown = (placed.instance, self.scene.sheets);
            for local in &local[..count] {
                let ray = Ray::new(origin, local.direction);
                if CLOSEST {
                    let nearest = placed.group.closest(lanes, &ray, local.to_beat(self.reach), shown);
                    self.take(packet, place, local, &nearest);
                } else if placed.group.blocks(lanes, &ray, local.limit, shown) {
                    packet.set_limit(local.index, -1.0);
                }
            }
            packet.measure(lanes);
            return;
        }
        // Form new packets, because transformed rays may have different octants.
        let mut octants = Octants::of(&local[..count]);
        while let Some((octant, rays)) = octants.next() {
            let mut within = Packet::new(lanes, origin, octant, rays, self.reach);
            within.walk(lanes, &placed.group.tree, &mut Triangles::<CLOSEST>(&placed.group));
            for (k, local) in rays.iter().enumerate() {
                if CLOSEST {
                    self.take(packet, place, local, &within.nearest(k));
                } else if within.is_blocked(k) {
                    packet.set_limit(local.index, -1.0);
                }
            }
        }
        packet.measure(lanes);
    }
}

impl<const CLOSEST: bool> Groups<'_, CLOSEST> {
    /// Stores the result of a ray of `packet` in group `place`. `local` is the ray in the group's local space.
    #[inline(always)]
    fn take(&mut self, packet: &mut Packet, place: usize, local: &PacketRay, nearest: &Nearest) {
        let found = &mut self.found[self.rays[local.index].index];
        if found.update(place, &local.to_beat(self.reach), nearest) {
            packet.set_limit(local.index, nearest.met.t);
        }
    }
}

/// Rays sorted by octant. Camera rays mostly share one octant and are returned without a copy.
pub(super) struct Octants<'a> {
    all: &'a [PacketRay],
    /// Mask of the remaining rays.
    left: u64,
    octants: [Octant; PACKET],
    /// Copies of the rays that the last call returned. Used only if the octants are mixed.
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

    /// Returns the rays in the octant of the first remaining ray.
    #[inline(always)]
    pub(super) fn next(&mut self) -> Option<(Octant, &[PacketRay])> {
        if self.left == 0 {
            return None;
        }
        // Select all remaining rays in the octant of the first.
        let octant = self.octants[self.left.trailing_zeros() as usize % PACKET];
        let alike =
            self.octants.iter().rev().fold(0, |bits, &other| bits << 1 | u64::from(other == octant)) & self.left;
        self.left &= !alike;
        // Return the caller's list without a copy if all rays share the octant.
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
