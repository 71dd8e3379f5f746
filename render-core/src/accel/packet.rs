//! Traversal of a tree by a packet of up to 64 rays with a common origin.
//!
//! Eight rays form a row in one register. Interval arithmetic on the inverse directions first tests the eight boxes of
//! a node against the whole packet (Boulos, Wald & Shirley 2006). When the traversal reaches a box, the packet tests
//! its rows, starting with the first row inside the parent box (Wald, Boulos & Shirley 2007). Triangles are tested
//! against all rows that enter their leaf.

use super::group::{Group, Met, NO_TRIANGLE, Nearest};
use super::ray::{LEAST_COMPONENT, LENGTHENING, Octant};
use super::reach::Reach;
use super::tree::{ChildKind, Stack, Tree, farthest_first};
use super::triangles::{Meeting, meet};
use glam::Vec3A;
use lanes::{LANES, Lanes};

/// Maximum number of rays in a packet.
pub const PACKET: usize = 64;

pub(super) const ROWS: usize = PACKET / LANES;

/// Single ray of a packet.
#[derive(Clone, Copy)]
pub(super) struct PacketRay {
    /// Index of the ray in the caller's list.
    pub(super) index: usize,
    pub(super) direction: Vec3A,
    /// Maximum distance, in lengths of `direction`. At exactly this distance, only triangles with an index below
    /// `triangle` count.
    pub(super) limit: f32,
    pub(super) triangle: u32,
}

impl PacketRay {
    pub(super) const NONE: Self = Self { index: 0, direction: Vec3A::ZERO, limit: -1.0, triangle: 0 };

    /// Returns the hit that a single ray must beat for an identical result.
    #[inline(always)]
    pub(super) fn to_beat(self, reach: Reach) -> Nearest {
        let met = Met { t: self.limit, triangle: self.triangle, ..Met::NOTHING };
        Nearest { met, contested: false, reach }
    }
}

/// Row of eight rays.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
struct PacketRow {
    /// Inverse directions and shear of each ray, as in [`super::ray::Ray`].
    inverse_near: [[f32; LANES]; 3],
    inverse_far: [[f32; LANES]; 3],
    shear: [[f32; LANES]; 2],
    /// Maximum distance of each ray: the [`Reach`] of t. Negative for finished rays.
    reach: [f32; LANES],
    /// Distance of each ray's nearest hit so far, as in [`Met`].
    t: [f32; LANES],
    /// Index of each ray's nearest triangle, stored as bits.
    triangle: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
    /// Mask of the rays that hit another triangle within their reach.
    contested: u32,
}

/// Rays with a common origin and a common [`Octant`].
pub(super) struct Packet {
    origin: [f32; 3],
    axes: [usize; 3],
    near_plane: [usize; 3],
    rows: [PacketRow; ROWS],
    /// Number of rows that contain rays.
    used: usize,
    /// Minimum and maximum of 1 / component over all rays, for each axis. `far_range` contains the lengthened values.
    near_range: [[f32; 3]; 2],
    far_range: [[f32; 3]; 2],
    /// Maximum reach of any ray.
    farthest: f32,
    reach: Reach,
}

/// Visitor of the leaves in [`Packet::walk`].
pub(super) trait VisitTogether {
    /// Whether nearer boxes are visited first.
    const IN_ORDER: bool;

    fn leaf<L: Lanes>(&mut self, lanes: L, packet: &mut Packet, content: u32, entered: &Entered);
}

/// Visitor that finds the first triangle of a group along each ray. If `CLOSEST` is false, the limit of each ray that
/// hits a triangle becomes negative.
pub(super) struct Triangles<'a, const CLOSEST: bool>(pub(super) &'a Group);

impl<const CLOSEST: bool> VisitTogether for Triangles<'_, CLOSEST> {
    const IN_ORDER: bool = CLOSEST;

    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, packet: &mut Packet, content: u32, entered: &Entered) {
        if packet.meet_block::<L, CLOSEST>(lanes, self.0, content, entered) {
            packet.measure(lanes);
        }
    }
}

/// Rays that enter the box of a leaf: the distances to the box (∞ for rays that miss it) and the mask of rows with
/// hits.
pub(super) struct Entered {
    near: [[f32; LANES]; ROWS],
    rows: u32,
}

impl Entered {
    /// Returns the mask of the rays that enter the box.
    pub(super) fn rays(&self) -> u64 {
        (0..ROWS).filter(|row| self.rows >> row & 1 == 1).fold(0, |bits, row| {
            (0..LANES)
                .fold(bits, |bits, lane| bits | u64::from(self.near[row][lane] < f32::INFINITY) << (row * LANES + lane))
        })
    }
}

impl Packet {
    /// Builds a packet of 1 to [`PACKET`] rays with directions in one octant.
    #[inline(always)]
    pub(super) fn new<L: Lanes>(lanes: L, origin: Vec3A, octant: Octant, rays: &[PacketRay], reach: Reach) -> Self {
        let row = PacketRow {
            inverse_near: [[0.0; LANES]; 3],
            inverse_far: [[0.0; LANES]; 3],
            shear: [[0.0; LANES]; 2],
            reach: [-1.0; LANES],
            t: [-1.0; LANES],
            triangle: [f32::from_bits(NO_TRIANGLE); LANES],
            u: [0.0; LANES],
            v: [0.0; LANES],
            contested: 0,
        };
        let mut packet = Self {
            origin: origin.to_array(),
            axes: octant.axes(),
            near_plane: octant.near_planes(),
            rows: [row; ROWS],
            used: rays.len().div_ceil(LANES),
            near_range: [[0.0; 3]; 2],
            far_range: [[0.0; 3]; 2],
            farthest: reach.of(rays.iter().fold(-1.0, |farthest: f32, ray| farthest.max(ray.limit))),
            reach,
        };
        // Initialize all limits as negative, so rows without rays never enter a box.
        let mut range = [[lanes.splat(f32::INFINITY), lanes.splat(f32::NEG_INFINITY)]; 3];
        for (row, rays) in packet.rows.iter_mut().zip(rays.chunks(LANES)) {
            // Fill unused lanes with the direction of the row's first ray.
            let mut components = rays[0].direction.to_array().map(|x| [x; LANES]);
            for (lane, ray) in rays.iter().enumerate() {
                for (column, x) in components.iter_mut().zip(ray.direction.to_array()) {
                    column[lane] = x;
                }
                row.t[lane] = ray.limit;
                row.triangle[lane] = f32::from_bits(ray.triangle);
            }
            row.reach = if reach.is_none() { row.t } else { lanes.store(reach.of_eight(lanes, lanes.load(&row.t))) };
            // Invert the directions; replace tiny components, as for single rays.
            for (axis, [low, high]) in range.iter_mut().enumerate() {
                let least = if octant.goes_down(axis) { -LEAST_COMPONENT } else { LEAST_COMPONENT };
                let x = lanes.load(&components[axis]);
                let size = lanes.max(x, lanes.sub(lanes.splat(0.0), x));
                let small = lanes.lt(size, lanes.splat(LEAST_COMPONENT));
                let inverse = lanes.div(lanes.splat(1.0), lanes.select(small, lanes.splat(least), x));
                row.inverse_near[axis] = lanes.store(inverse);
                row.inverse_far[axis] = lanes.store(lanes.mul(inverse, lanes.splat(LENGTHENING)));
                (*low, *high) = (lanes.min(inverse, *low), lanes.max(inverse, *high));
            }
            // Compute the shear of the watertight triangle test.
            let along = lanes.load(&row.inverse_near[packet.axes[2]]);
            for k in 0..2 {
                row.shear[k] = lanes.store(lanes.mul(lanes.load(&components[packet.axes[k]]), along));
            }
        }
        // Bound the inverse directions of all rays, for the interval test of boxes.
        for (axis, [low, high]) in range.into_iter().enumerate() {
            let low = lanes.store(low).into_iter().fold(f32::INFINITY, f32::min);
            let high = lanes.store(high).into_iter().fold(f32::NEG_INFINITY, f32::max);
            (packet.near_range[0][axis], packet.near_range[1][axis]) = (low, high);
            // Lengthen the bounds of the range. Rounding is monotonic, so no lengthened inverse lies outside the new
            // bounds.
            (packet.far_range[0][axis], packet.far_range[1][axis]) = (low * LENGTHENING, high * LENGTHENING);
        }
        packet
    }

    /// Sets the limit of ray `index`. The caller must call [`Self::measure`] afterwards.
    pub(super) fn set_limit(&mut self, index: usize, t: f32) {
        let row = &mut self.rows[index / LANES];
        row.reach[index % LANES] = if t < 0.0 { t } else { self.reach.of(t) };
        row.t[index % LANES] = t;
    }

    /// Updates the reach of the longest ray.
    #[inline(always)]
    pub(super) fn measure<L: Lanes>(&mut self, lanes: L) {
        let mut farthest = lanes.splat(-1.0);
        for row in &self.rows[..self.used] {
            farthest = lanes.max(lanes.load(&row.reach), farthest);
        }
        self.farthest = lanes.store(farthest).into_iter().fold(-1.0, f32::max);
    }

    /// Returns the nearest hit of ray `index`.
    pub(super) fn nearest(&self, index: usize) -> Nearest {
        let (row, lane) = (&self.rows[index / LANES], index % LANES);
        let met = Met { t: row.t[lane], triangle: row.triangle[lane].to_bits(), u: row.u[lane], v: row.v[lane] };
        Nearest { met, contested: row.contested >> lane & 1 == 1, reach: self.reach }
    }

    /// Returns whether ray `index` is blocked, in a packet in which any hit suffices.
    pub(super) fn is_blocked(&self, index: usize) -> bool {
        self.rows[index / LANES].reach[index % LANES] < 0.0
    }

    /// Visits each leaf with a box that any ray enters.
    #[inline(always)]
    pub(super) fn walk<L: Lanes, V: VisitTogether>(&mut self, lanes: L, tree: &Tree, visitor: &mut V) {
        let origin = lanes.splat3(self.origin);
        let (near_low, near_high) = (lanes.splat3(self.near_range[0]), lanes.splat3(self.near_range[1]));
        let (far_low, far_high) = (lanes.splat3(self.far_range[0]), lanes.splat3(self.far_range[1]));
        let mut entered = Entered { near: [[f32::INFINITY; LANES]; ROWS], rows: 0 };
        // Create a stack of boxes, each with its distance, its node and lane, and the rows that may enter it.
        let (mut stack, mut top) = (Stack::<(u32, u32, u32)>::new(), 0);
        let (mut at, mut rows) = (0, (1u32 << self.used) - 1);
        loop {
            // Bound the packet: no ray enters earlier than `near`, and no ray leaves later than `far`.
            let (near, far) = tree.nodes[at].slabs(lanes, self.near_plane);
            let (near, far) = (lanes.sub3(near, origin), lanes.sub3(far, origin));
            let near = lanes.min3(lanes.mul3(near, near_low), lanes.mul3(near, near_high));
            let far = lanes.max3(lanes.mul3(far, far_low), lanes.mul3(far, far_high));
            let near = lanes.greatest(near, lanes.splat(0.0));
            let far = lanes.least(far, lanes.splat(self.farthest));
            let bits = lanes.bits(lanes.le(near, far));
            // Push the boxes that the packet may enter, nearest on top if the order matters.
            if !V::IN_ORDER {
                let (mut bits, near) = (bits, lanes.store(near));
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize & (LANES - 1);
                    bits &= bits - 1;
                    stack.push(&mut top, (near[lane].to_bits(), (at * LANES + lane) as u32, rows));
                }
            } else if bits != 0 {
                let (keys, count) = farthest_first(bits, &lanes.store(near));
                for key in &keys[..count] {
                    stack.push(&mut top, ((key >> 32) as u32, (at * LANES) as u32 | *key as u32, rows));
                }
            }
            // Pop boxes until a ray enters an inner node.
            (at, rows) = loop {
                let Some((near, place, candidates)) = stack.pop(&mut top) else { return };
                if f32::from_bits(near) > self.farthest {
                    continue;
                }
                // Test rows only against boxes that the packet may enter.
                let (node, lane) = (&tree.nodes[place as usize / LANES], place as usize % LANES);
                let [x, y, z] = self.near_plane;
                let [from_x, from_y, from_z] = self.origin;
                let near = lanes.splat3([
                    node.planes[x][lane] - from_x,
                    node.planes[y][lane] - from_y,
                    node.planes[z][lane] - from_z,
                ]);
                let far = lanes.splat3([
                    node.planes[(x + 3) % 6][lane] - from_x,
                    node.planes[(y + 3) % 6][lane] - from_y,
                    node.planes[(z + 3) % 6][lane] - from_z,
                ]);
                match node.children[lane].kind() {
                    // Descend with the first row that enters the node and all later rows.
                    ChildKind::Node(index) => {
                        let mut remaining = candidates;
                        while remaining != 0 {
                            let row = remaining.trailing_zeros() as usize % ROWS;
                            if lanes.bits(self.rows[row].enters(lanes, near, far).0) != 0 {
                                break;
                            }
                            remaining &= remaining - 1;
                        }
                        if remaining != 0 {
                            break (index, remaining);
                        }
                    }
                    // Collect all rows that enter the leaf before the visitor tests triangles.
                    ChildKind::Leaf(content) => {
                        entered.rows = 0;
                        let mut remaining = candidates;
                        while remaining != 0 {
                            let row = remaining.trailing_zeros() as usize % ROWS;
                            remaining &= remaining - 1;
                            let (mask, near) = self.rows[row].enters(lanes, near, far);
                            if lanes.bits(mask) != 0 {
                                entered.rows |= 1 << row;
                                entered.near[row] = lanes.store(lanes.select(mask, near, lanes.splat(f32::INFINITY)));
                            }
                        }
                        if entered.rows != 0 {
                            visitor.leaf(lanes, self, content, &entered);
                        }
                    }
                }
            };
        }
    }

    /// Tests the triangles of a leaf against the rays that entered its box. Returns whether the limit of any ray
    /// changed.
    #[inline(always)]
    pub(super) fn meet_block<L: Lanes, const CLOSEST: bool>(
        &mut self,
        lanes: L,
        group: &Group,
        content: u32,
        entered: &Entered,
    ) -> bool {
        let leaf = group.leaf(content);
        let along = self.axes[2];
        let mut changed = false;
        for k in 0..leaf.count {
            let (block, k) = leaf.place(k);
            // Make corners relative to the common origin, in the order of the axes.
            let [x, y, z] = self.axes;
            let [a, b, c] = &block.corners;
            let from = [self.origin[x], self.origin[y], self.origin[z]];
            let corners = [
                lanes.splat3([a[x][k] - from[0], a[y][k] - from[1], a[z][k] - from[2]]),
                lanes.splat3([b[x][k] - from[0], b[y][k] - from[1], b[z][k] - from[2]]),
                lanes.splat3([c[x][k] - from[0], c[y][k] - from[1], c[z][k] - from[2]]),
            ];
            let triangle = lanes.splat(f32::from_bits(block.triangles[k]));
            // Test the triangle against each row that enters the leaf.
            let mut rows = entered.rows;
            while rows != 0 {
                let index = rows.trailing_zeros() as usize % ROWS;
                rows &= rows - 1;
                let row = &mut self.rows[index];
                let shear =
                    [lanes.load(&row.shear[0]), lanes.load(&row.shear[1]), lanes.load(&row.inverse_near[along])];
                let Some(mut meeting) = meet(lanes, corners, shear) else { continue };
                // Keep hits in front of the origin, never nearer than the leaf's box.
                let ahead = lanes.and(meeting.inside, lanes.le(lanes.splat(0.0), meeting.t));
                meeting.t = lanes.max(meeting.t, lanes.load(&entered.near[index]));
                let met = lanes.and(ahead, lanes.le(meeting.t, lanes.load(&row.reach)));
                if lanes.bits(met) == 0 {
                    continue;
                }
                // Shorten the rays that hit. Finish them if any hit suffices.
                if CLOSEST {
                    changed |= row.take(lanes, Meeting { inside: met, ..meeting }, triangle, self.reach);
                } else {
                    row.reach = lanes.store(lanes.select(met, lanes.splat(-1.0), lanes.load(&row.reach)));
                    changed = true;
                }
            }
        }
        changed
    }
}

impl PacketRow {
    /// Returns the mask of the rays that enter a box before their limits, and the distances of these rays to the box.
    /// The arithmetic is identical to [`Tree::walk`].
    #[inline(always)]
    fn enters<L: Lanes>(&self, lanes: L, to_near: [L::F; 3], to_far: [L::F; 3]) -> (L::Mask, L::F) {
        let [near_x, near_y, near_z] = &self.inverse_near;
        let [far_x, far_y, far_z] = &self.inverse_far;
        let entry = lanes.greatest(lanes.mul3(to_near, lanes.load3([near_x, near_y, near_z])), lanes.splat(0.0));
        let exit = lanes.least(lanes.mul3(to_far, lanes.load3([far_x, far_y, far_z])), lanes.load(&self.reach));
        (lanes.le(entry, exit), entry)
    }

    /// Updates the nearest hits of eight rays, by the rule of [`Nearest::take`]. `met.inside` is the mask of rays that
    /// hit `triangle` within their reach. Returns whether the triangle is now the nearest hit of any ray.
    #[inline(always)]
    fn take<L: Lanes>(&mut self, lanes: L, met: Meeting<L>, triangle: L::F, reach: Reach) -> bool {
        // Compare distances, and break ties by the lower index.
        let Meeting { t, u, v, inside: met } = met;
        let (limit, best) = (lanes.load(&self.t), lanes.load(&self.triangle));
        let tie = lanes.and(lanes.eq(t, limit), lanes.lt_bits(triangle, best));
        let nearer = lanes.and(met, lanes.or(lanes.lt(t, limit), tie));
        let new_reach = reach.of_eight(lanes, t);
        let (nearer_bits, mut close) = (lanes.bits(nearer), lanes.bits(lanes.and(met, lanes.le(limit, new_reach))));

        // Exclude pieces of one split triangle, which do not contest each other.
        let (mut left, mut same) = (close, 0);
        while left != 0 {
            let lane = left.trailing_zeros() as usize & (LANES - 1);
            left &= left - 1;
            same |= u32::from(self.triangle[lane].to_bits() == lanes.store(triangle)[lane].to_bits()) << lane;
        }
        // Clear the marks of rays with a nearer hit, and mark the new contested hits.
        close &= !same;
        self.contested = self.contested & !(nearer_bits & !same) | close;
        if nearer_bits == 0 {
            return false;
        }
        // Store the new hits of the rays with a nearer triangle.
        self.reach = lanes.store(lanes.select(nearer, new_reach, lanes.load(&self.reach)));
        self.t = lanes.store(lanes.select(nearer, t, limit));
        self.triangle = lanes.store(lanes.select(nearer, triangle, best));
        self.u = lanes.store(lanes.select(nearer, u, lanes.load(&self.u)));
        self.v = lanes.store(lanes.select(nearer, v, lanes.load(&self.v)));
        true
    }
}
