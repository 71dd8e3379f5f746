//! Occluders between two small sets of points. They are collected once and tested against all rays between the sets.
//!
//! A shaft is the hull of the boxes around both sets (Haines & Wallace 1991). A shaft usually contains few or no
//! triangles, and rays between the sets are tested against these triangles only.
//!
//! In the bundled cornell scene, the frame around the lamp blocks a little light everywhere. Shafts of ten to thirty
//! triangles halve the time of direct light in this scene. It falls from 0.38 to 0.19 CPU s per frame of 512×512 pixels
//! (AMD Zen 5).
//!
//! # Differs from the paper
//!
//! The paper computes the exact sides of the hull; this module uses eight tangent planes around its axis. Any plane
//! with both sets on one side excludes everything on its other side. A triangle with both sets on one side of its own
//! plane is also excluded, at any distance. Shafts therefore exclude the walls of a convex room.

use super::group::Group;
use super::packet::{PACKET, ROWS};
use super::ray::{LEAST_COMPONENT, Octant};
use super::tree::{ChildKind, Stack, Tree};
use super::triangles::{Leaf, meet};
use super::{Accelerator, GROUP_SLACK};
use glam::{Affine3A, Vec3A};
use lanes::{Kernel, LANES, Lanes};
use obvhs::aabb::Aabb;
use std::f32::consts::TAU;

/// Number of planes around the axis of a shaft.
const AROUND: usize = 8;
/// Maximum number of leaves in a list. With more leaves, traversing the trees is faster than testing the list.
const MOST_BLOCKS: usize = 12;
/// Widening of a shaft for rounding errors, as a fraction of the largest coordinate. A ray deviates by a few units of
/// 2⁻²⁴.
const SLACK: f32 = 4e-6;

/// Triangles that may intersect segments between two sets of points.
pub struct Shaft {
    /// Leaves in the order of their groups.
    blocks: Vec<Listed>,
    /// Whether the list is unusable because it would be too long or contain surfaces with holes.
    crowded: bool,
}

impl std::fmt::Debug for Shaft {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Shaft")
            .field("blocks", &self.blocks.len())
            .field("crowded", &self.crowded)
            .finish_non_exhaustive()
    }
}

/// Triangles of one leaf that intersect a shaft.
#[derive(Clone, Copy)]
struct Listed {
    /// Index into [`Accelerator::groups`].
    place: usize,
    /// Content of the leaf, see [`Group::leaf`].
    content: u32,
    /// Mask of the leaf's triangles that intersect the shaft.
    lanes: u32,
}

impl Shaft {
    /// Returns whether no surface can lie between the two sets of points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty() && !self.crowded
    }
}

impl Accelerator {
    /// Returns the shaft between two nonempty sets of points. Points should be slightly off their surfaces.
    #[must_use]
    pub fn shaft(&self, from: &[Vec3A], to: &[Vec3A]) -> Shaft {
        let mut points = [from, to].map(|points| points.iter().map(|&point| point * self.scale).collect());
        self.lanes.run(Finding { scene: self, points: &mut points })
    }

    /// Returns the shaft between two sets of points that are usually unobstructed. Tests the boxes of the groups first.
    pub(crate) fn shaft_if_near(&self, from: &[Vec3A], to: &[Vec3A]) -> Shaft {
        // Bound all segments by a box around both sets.
        let (mut min, mut max) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for &point in from.iter().chain(to) {
            (min, max) = (min.min(point), max.max(point));
        }
        let (min, max) = (min * self.scale, max * self.scale);
        let slack = Vec3A::splat(GROUP_SLACK * min.abs().max(max.abs()).max_element());
        let (min, max) = (min - slack, max + slack);
        let is_near = |bounds: &Aabb| bounds.min.cmple(max).all() && bounds.max.cmpge(min).all();
        // Build the shaft only if the box of any group intersects this box.
        if self.groups.iter().any(|placed| is_near(&placed.bounds)) {
            self.shaft(from, to)
        } else {
            Shaft { blocks: Vec::new(), crowded: false }
        }
    }

    /// Tests segments within `shaft`, and returns the mask of hidden segments, like [`Accelerator::occluded_packet`].
    /// Each segment must connect the two sets for which the shaft was built. The ends `to` are given by axis. Ends of
    /// inactive segments may have any position, but a narrow spread is faster.
    #[must_use]
    pub fn occluded_packet_within(&self, shaft: &Shaft, from: Vec3A, to: &[[f32; PACKET]; 3], active: u64) -> u64 {
        if shaft.crowded {
            let to: [Vec3A; PACKET] = std::array::from_fn(|k| Vec3A::new(to[0][k], to[1][k], to[2][k]));
            return self.occluded_packet(from, &to, active);
        }
        self.lanes.run(Within { scene: self, blocks: &shaft.blocks, from, to, active })
    }
}

/// Query that tests the `active` segments from one point against a list of leaves. Outputs the mask of the segments
/// that hit a triangle.
struct Within<'a> {
    scene: &'a Accelerator,
    blocks: &'a [Listed],
    from: Vec3A,
    to: &'a [[f32; PACKET]; 3],
    active: u64,
}

impl Kernel for Within<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> u64 {
        let Self { scene, blocks, from, to, active } = self;
        let start = lanes.splat3(from.to_array());
        let scale = lanes.splat(scene.scale);
        // Mark the segments without a hit so far, eight per row.
        let mut free: [u32; ROWS] = std::array::from_fn(|row| (active >> (row * LANES)) as u32 & EVERY_LANE);
        for blocks in blocks.chunk_by(|a, b| a.place == b.place) {
            // Transform the segments to the local space of the group, with a mask for each main axis.
            let placed = &scene.groups[blocks[0].place];
            let origin = placed.local(from * scene.scale, Vec3A::X).0.to_array();
            let mut directions = [[scale; 3]; ROWS];
            let mut along = [[0u32; ROWS]; 3];
            for row in 0..ROWS {
                if free[row] == 0 {
                    continue;
                }
                let ends = [eight(lanes, &to[0], row), eight(lanes, &to[1], row), eight(lanes, &to[2], row)];
                let mut direction = lanes.mul3(lanes.sub3(ends, start), [scale; 3]);
                if let Some(to_local) = &placed.to_local {
                    direction = turned(lanes, to_local, direction);
                }
                directions[row] = direction;
                let main = main_axes(lanes, direction);
                for axis in 0..3 {
                    along[axis][row] = main[axis] & free[row];
                }
            }
            // Test the segments of each main axis, which the test maps to z. Nearly always, all segments have the same
            // main axis.
            for (main, alike) in along.iter().enumerate() {
                if alike.iter().any(|&bits| bits != 0) {
                    let slopes = Slopes::new(lanes, origin, &directions, alike, main);
                    for listed in blocks {
                        slopes.hold_against(lanes, &placed.group, listed, &mut free);
                    }
                }
            }
        }
        // Collect the segments without a hit from the rows.
        let left = free.iter().enumerate().fold(0, |left, (row, &bits)| left | u64::from(bits) << (row * LANES));
        active & !left
    }
}

const EVERY_LANE: u32 = (1 << LANES) - 1;

/// Segments with a common main axis, in the form that [`meet`] accepts.
struct Slopes<'a, L: Lanes> {
    axes: [usize; 3],
    /// Common origin, with coordinates in the order of `axes`.
    from: [f32; 3],
    /// Mask of the segments in each row that have the main axis of `axes`.
    alike: &'a [u32; ROWS],
    rows: [[L::F; 3]; ROWS],
    /// Minimum and maximum of both slopes over all segments.
    range: [[L::F; 2]; 2],
}

impl<'a, L: Lanes> Slopes<'a, L> {
    /// Prepares the segments `alike` from `origin` with main axis `main`.
    #[inline(always)]
    fn new(lanes: L, origin: [f32; 3], directions: &[[L::F; 3]; ROWS], alike: &'a [u32; ROWS], main: usize) -> Self {
        let axes = Octant::axes_of(main);
        let mut rows = [[lanes.splat(0.0); 3]; ROWS];
        let mut range = [[lanes.splat(f32::INFINITY), lanes.splat(f32::NEG_INFINITY)]; 2];
        for row in 0..ROWS {
            if alike[row] == 0 {
                continue;
            }
            // Divide by the main component: the slopes are the shear of the triangle test.
            let direction = &directions[row];
            let along = lanes.div(lanes.splat(1.0), not_zero(lanes, direction[main]));
            let slopes = [lanes.mul(direction[axes[0]], along), lanes.mul(direction[axes[1]], along)];
            rows[row] = [slopes[0], slopes[1], along];
            for k in 0..2 {
                range[k] = [lanes.min(slopes[k], range[k][0]), lanes.max(slopes[k], range[k][1])];
            }
        }
        // Reduce the range of the slopes to one minimum and one maximum.
        for [low, high] in &mut range {
            *low = lanes.splat(lanes.store(*low).into_iter().fold(f32::INFINITY, f32::min));
            *high = lanes.splat(lanes.store(*high).into_iter().fold(f32::NEG_INFINITY, f32::max));
        }
        Self { axes, from: axes.map(|axis| origin[axis]), alike, rows, range }
    }

    /// Removes the segments that hit a listed triangle from `free`.
    #[inline(always)]
    fn hold_against(&self, lanes: L, group: &Group, listed: &Listed, free: &mut [u32; ROWS]) {
        let leaf = group.leaf(listed.content);
        // Skip triangles that lie to one side of all segments.
        let mut which = listed.lanes & !self.aside(lanes, &leaf);
        while which != 0 {
            let (block, k) = leaf.place(which.trailing_zeros() as usize % LANES);
            which &= which - 1;
            // Make corners relative to the origin, in the order of the axes.
            let mut corners = [[lanes.splat(0.0); 3]; 3];
            for (relative, corner) in corners.iter_mut().zip(&block.corners) {
                for axis in 0..3 {
                    relative[axis] = lanes.splat(corner[self.axes[axis]][k] - self.from[axis]);
                }
            }
            // Remove the segments that hit the triangle between their ends.
            for ((free, alike), row) in free.iter_mut().zip(self.alike).zip(&self.rows) {
                if alike & *free == 0 {
                    continue;
                }
                let Some(meeting) = meet(lanes, corners, *row) else { continue };
                let ahead = lanes.and(meeting.inside, lanes.le(lanes.splat(0.0), meeting.t));
                let met = lanes.bits(lanes.and(ahead, lanes.le(meeting.t, lanes.splat(1.0))));
                *free &= !(met & alike);
            }
        }
    }

    /// Returns the mask of the leaf's triangles that lie to one side of all segments. After the shear, a corner lies
    /// between its positions for the minimum and the maximum slope, even under rounding.
    #[inline(always)]
    fn aside(&self, lanes: L, leaf: &Leaf) -> u32 {
        let from = lanes.splat3(self.from);
        // Bound the corners after the shear by both extremes of each slope.
        let mut low = [lanes.splat(f32::INFINITY); 2];
        let mut high = [lanes.splat(f32::NEG_INFINITY); 2];
        for corner in 0..3 {
            let corner = lanes.sub3(leaf.column(lanes, corner, self.axes), from);
            for k in 0..2 {
                for slope in self.range[k] {
                    let place = lanes.sub(corner[k], lanes.mul(slope, corner[2]));
                    (low[k], high[k]) = (lanes.min(place, low[k]), lanes.max(place, high[k]));
                }
            }
        }
        // Select triangles on one side of zero in either coordinate.
        let zero = lanes.splat(0.0);
        let beyond = |k: usize| lanes.bits(lanes.lt(zero, low[k])) | lanes.bits(lanes.lt(high[k], zero));
        beyond(0) | beyond(1)
    }
}

/// Returns the eight values of row `row`.
#[inline(always)]
fn eight<L: Lanes>(lanes: L, numbers: &[f32; PACKET], row: usize) -> L::F {
    lanes.load(&numbers.as_chunks().0[row])
}

/// Returns a direction in a group's local space, with the operations of [`Affine3A::transform_vector3a`].
#[inline(always)]
fn turned<L: Lanes>(lanes: L, to_local: &Affine3A, [x, y, z]: [L::F; 3]) -> [L::F; 3] {
    let m = &to_local.matrix3;
    let along = |axis: Vec3A, x: L::F| lanes.mul3(lanes.splat3(axis.to_array()), [x; 3]);
    let (a, b, c) = (along(m.x_axis, x), along(m.y_axis, y), along(m.z_axis, z));
    [
        lanes.add(lanes.add(a[0], b[0]), c[0]),
        lanes.add(lanes.add(a[1], b[1]), c[1]),
        lanes.add(lanes.add(a[2], b[2]), c[2]),
    ]
}

/// Returns the masks of directions with main axis x, y and z, selected by the rule of [`Octant::of`].
#[inline(always)]
fn main_axes<L: Lanes>(lanes: L, direction: [L::F; 3]) -> [u32; 3] {
    let magnitude = |x: L::F| lanes.max(x, lanes.sub(lanes.splat(0.0), x));
    let [x, y, z] = [magnitude(direction[0]), magnitude(direction[1]), magnitude(direction[2])];
    let along_x = lanes.bits(lanes.and(lanes.le(y, x), lanes.le(z, x)));
    let along_y = lanes.bits(lanes.le(z, y)) & !along_x;
    [along_x, along_y, !(along_x | along_y) & EVERY_LANE]
}

/// Replaces tiny components before a division, by the rule of [`super::ray::Ray`].
#[inline(always)]
fn not_zero<L: Lanes>(lanes: L, x: L::F) -> L::F {
    let least =
        lanes.select(lanes.lt(x, lanes.splat(0.0)), lanes.splat(-LEAST_COMPONENT), lanes.splat(LEAST_COMPONENT));
    let magnitude = lanes.max(x, lanes.sub(lanes.splat(0.0), x));
    lanes.select(lanes.lt(magnitude, lanes.splat(LEAST_COMPONENT)), least, x)
}

/// Query that collects the triangles that intersect the shaft between two sets of points in the scaled world.
struct Finding<'a> {
    scene: &'a Accelerator,
    points: &'a mut [Vec<Vec3A>; 2],
}

impl Kernel for Finding<'_> {
    type Output = Shaft;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Shaft {
        let Self { scene, points } = self;
        let mut shaft = Shaft { blocks: Vec::new(), crowded: false };
        // Visit the groups that intersect the hull.
        let hull = Hull::around(points);
        let mut groups = Touched::new(&scene.top);
        while let Some(place) = groups.next(lanes, &hull) {
            let placed = &scene.groups[place as usize];
            // Transform the points to the group's local space, with a separate hull.
            let own = placed.to_local.as_ref().map(|to_local| {
                points.each_ref().map(|points| points.iter().map(|&p| to_local.transform_point3a(p)).collect())
            });
            let points: &[Vec<Vec3A>; 2] = own.as_ref().unwrap_or(points);
            let own_hull = own.as_ref().map(Hull::around);
            let hull = own_hull.as_ref().unwrap_or(&hull);
            // List the leaves that intersect the hull. Give up if the list is too long.
            let mut leaves = Touched::new(&placed.group.tree);
            while let Some(content) = leaves.next(lanes, hull) {
                let which = reaching(lanes, &placed.group, content, hull, points);
                if which != 0 {
                    shaft.blocks.push(Listed { place: place as usize, content, lanes: which });
                    shaft.crowded |= scene.may_pass(placed) || shaft.blocks.len() > MOST_BLOCKS;
                    if shaft.crowded {
                        return shaft;
                    }
                }
            }
        }
        shaft
    }
}

/// Returns the mask of a leaf's triangles that intersect the hull and have points of the sets on both sides of their
/// plane.
#[inline(always)]
fn reaching<L: Lanes>(lanes: L, group: &Group, content: u32, hull: &Hull, points: &[Vec<Vec3A>; 2]) -> u32 {
    let leaf = group.leaf(content);
    let mut remaining = hull.triangles(lanes, &leaf);
    let mut which = 0;
    while remaining != 0 {
        let lane = remaining.trailing_zeros() as usize % LANES;
        remaining &= remaining - 1;
        which |= u32::from(!is_beside(leaf.corners(lane), points, hull.slack)) << lane;
    }
    which
}

/// Returns whether all `points` lie on one side of the triangle's plane.
#[inline(always)]
fn is_beside([a, b, c]: [Vec3A; 3], points: &[Vec<Vec3A>; 2], slack: f32) -> bool {
    let Some(normal) = (b - a).cross(c - a).try_normalize() else { return false };
    // Measure the heights of all points above the plane.
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for &point in points.iter().flatten() {
        let height = normal.dot(point - a);
        (low, high) = (low.min(height), high.max(height));
    }
    low > slack || high < -slack
}

/// Traversal of the leaves with boxes that intersect a hull.
struct Touched<'a> {
    tree: &'a Tree,
    stack: Stack<u32>,
    /// Number of entries of the stack.
    top: usize,
    /// Node, and the mask of its unvisited children.
    at: (usize, u32),
}

impl<'a> Touched<'a> {
    fn new(tree: &'a Tree) -> Self {
        let (mut stack, mut top) = (Stack::new(), 0);
        stack.push(&mut top, 0);
        Self { tree, stack, top, at: (0, 0) }
    }

    /// Returns the content of the next leaf that intersects the hull.
    #[inline(always)]
    fn next<L: Lanes>(&mut self, lanes: L, hull: &Hull) -> Option<u32> {
        loop {
            let (node, children) = self.at;
            // Visit the next node once all children of this node are visited.
            if children == 0 {
                let node = self.stack.pop(&mut self.top)? as usize;
                self.at = (node, hull.boxes(lanes, &self.tree.nodes[node].planes));
                continue;
            }
            self.at.1 = children & (children - 1);
            match self.tree.nodes[node].children[children.trailing_zeros() as usize % LANES].kind() {
                ChildKind::Node(index) => self.stack.push(&mut self.top, index as u32),
                ChildKind::Leaf(content) => return Some(content),
            }
        }
    }
}

/// Half-space n · x ≤ h.
#[derive(Clone, Copy, Default)]
struct HalfSpace {
    n: [f32; 3],
    h: f32,
}

/// Half-spaces that each contain two sets of points, and therefore all segments between the sets.
struct Hull {
    low: Vec3A,
    high: Vec3A,
    sides: [HalfSpace; AROUND],
    slack: f32,
}

/// Box around a set of points.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3A,
    high: Vec3A,
}

impl Bounds {
    fn of(points: &[Vec3A]) -> Self {
        let empty = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };
        points.iter().fold(empty, |Self { low, high }, &p| Self { low: low.min(p), high: high.max(p) })
    }

    /// Returns the corner of the box that lies farthest in direction `n`.
    #[inline(always)]
    fn farthest(&self, n: Vec3A) -> Vec3A {
        Vec3A::select(n.cmpge(Vec3A::ZERO), self.high, self.low)
    }
}

impl Hull {
    /// Builds the hull of both sets of points.
    ///
    /// A plane that touches both boxes has n = u + t d. Here d is the axis between their centers and u is perpendicular
    /// to d. The farthest corners a and b of the two boxes lie in the plane:
    ///
    /// ```text
    /// n · a = n · b        t = u · (a − b) / d · (b − a)
    /// ```
    /// Since a and b depend on t, two fixed-point iterations are made. They suffice, because any n defines a valid
    /// plane.
    fn around(points: &[Vec<Vec3A>; 2]) -> Self {
        // Bound both sets by boxes.
        let [from, to] = points.each_ref().map(|points| Bounds::of(points));
        let (low, high) = (from.low.min(to.low), from.high.max(to.high));
        let slack = SLACK * low.abs().max(high.abs()).max_element();
        // Tilt a plane in each direction around the axis until it touches both boxes.
        let between = (to.low + to.high) - (from.low + from.high);
        let d = between.try_normalize().unwrap_or(Vec3A::X);
        let (x, y) = d.any_orthonormal_pair();
        let mut sides = [HalfSpace::default(); AROUND];
        for (k, side) in sides.iter_mut().enumerate() {
            let (sine, cosine) = (TAU * k as f32 / AROUND as f32).sin_cos();
            let u = x * cosine + y * sine;
            let mut n = u;
            for _ in 0..2 {
                let way = to.farthest(n) - from.farthest(n);
                let along = d.dot(way);
                if along > 0.0 {
                    n = u - d * (u.dot(way) / along);
                }
            }
            // Move the plane outward, so that it contains both boxes despite rounding.
            let h = n.dot(from.farthest(n)).max(n.dot(to.farthest(n)));
            *side = HalfSpace { n: n.to_array(), h: h + slack * n.length() };
        }
        Self { low: low - slack, high: high + slack, sides, slack }
    }

    /// Returns the mask of the boxes in a [`super::tree::WideNode`] that intersect the hull. Bits of empty slots are 0.
    #[inline(always)]
    fn boxes<L: Lanes>(&self, lanes: L, planes: &[[f32; LANES]; 6]) -> u32 {
        let mut inside = lanes.le(lanes.splat(0.0), lanes.splat(0.0));
        for axis in 0..3 {
            inside = lanes.and(inside, lanes.le(lanes.load(&planes[axis]), lanes.splat(self.high[axis])));
            inside = lanes.and(inside, lanes.le(lanes.splat(self.low[axis]), lanes.load(&planes[axis + 3])));
        }
        for HalfSpace { n, h } in &self.sides {
            // Select the box corner deepest inside the half-space.
            let corner = std::array::from_fn::<usize, 3, _>(|axis| if n[axis] > 0.0 { axis } else { axis + 3 });
            let corner = lanes.load3([&planes[corner[0]], &planes[corner[1]], &planes[corner[2]]]);
            inside = lanes.and(inside, lanes.le(height(lanes, *n, corner), lanes.splat(*h)));
        }
        lanes.bits(inside)
    }

    /// Returns the mask of the triangles that may intersect the hull. Bits of triangles that do not intersect it may be
    /// set.
    #[inline(always)]
    fn triangles<L: Lanes>(&self, lanes: L, leaf: &Leaf) -> u32 {
        let mut inside = lanes.le(lanes.splat(0.0), lanes.splat(0.0));
        // Compare the box around each triangle with the box around the hull.
        let axes = [0, 1, 2];
        let (a, b, c) = (leaf.column(lanes, 0, axes), leaf.column(lanes, 1, axes), leaf.column(lanes, 2, axes));
        let (least, most) = (lanes.min3(lanes.min3(a, b), c), lanes.max3(lanes.max3(a, b), c));
        for axis in 0..3 {
            inside = lanes.and(inside, lanes.le(least[axis], lanes.splat(self.high[axis])));
            inside = lanes.and(inside, lanes.le(lanes.splat(self.low[axis]), most[axis]));
        }
        // Exclude triangles with all corners outside a half-space.
        for HalfSpace { n, h } in &self.sides {
            let least = lanes.min(height(lanes, *n, a), height(lanes, *n, b));
            let least = lanes.min(least, height(lanes, *n, c));
            inside = lanes.and(inside, lanes.le(least, lanes.splat(*h)));
        }
        lanes.bits(inside) & leaf.lanes()
    }
}

/// Returns n · x.
#[inline(always)]
fn height<L: Lanes>(lanes: L, n: [f32; 3], x: [L::F; 3]) -> L::F {
    let [x, y, z] = lanes.mul3(lanes.splat3(n), x);
    lanes.add(lanes.add(x, y), z)
}
