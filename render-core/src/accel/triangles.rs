//! Blocks of four triangles, and the intersection of rays with these triangles.

use super::ray::Ray;
use glam::Vec3A;
use lanes::{LANES, Lanes};

/// Number of triangles in a block.
pub(super) const BLOCK: usize = LANES / 2;

/// Index of a triangle in the scene: the instance and the triangle of its mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Owner {
    /// Index into [`crate::scene::Scene::instances`].
    pub(super) instance: u32,
    /// Index into the mesh's triangles.
    pub(super) triangle: u32,
}

/// Block of triangles with half the capacity of a leaf. Most leaves need only one block. Blocks of eight triangles
/// would double the memory that a ray loads.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct TriangleBlock {
    /// Coordinates by corner, axis and triangle. Empty slots contain NaN, which no ray hits.
    pub(super) corners: [[[f32; BLOCK]; 3]; 3],
    /// Index of each triangle in the group.
    pub(super) triangles: [u32; BLOCK],
}

impl TriangleBlock {
    pub(super) const EMPTY: Self = Self { corners: [[[f32::NAN; BLOCK]; 3]; 3], triangles: [u32::MAX >> 1; BLOCK] };

    pub(super) fn set(&mut self, lane: usize, triangle: u32, corners: [Vec3A; 3]) {
        for (column, corner) in self.corners.iter_mut().zip(corners) {
            for (axis, x) in corner.to_array().into_iter().enumerate() {
                column[axis][lane] = x;
            }
        }
        self.triangles[lane] = triangle;
    }

    /// Returns the corners of the triangle in slot `lane`.
    pub(super) fn corners(&self, lane: usize) -> [Vec3A; 3] {
        std::array::from_fn(|c| Vec3A::from_array(std::array::from_fn(|axis| self.corners[c][axis][lane])))
    }
}

/// Triangles of a leaf, in one or two blocks.
#[derive(Clone, Copy)]
pub(super) struct Leaf<'a> {
    low: &'a TriangleBlock,
    /// Second block, or the first one if the leaf has only one block.
    high: &'a TriangleBlock,
    /// Number of triangles, 1…8.
    pub(super) count: usize,
}

/// Intersections of eight rays with a triangle, or of one ray with eight triangles.
pub(super) struct Meeting<L: Lanes> {
    /// Distance, in lengths of the direction. NaN if the ray lies in the triangle's plane.
    pub(super) t: L::F,
    /// Barycentric weight of the second corner; `v` is the weight of the third corner.
    pub(super) u: L::F,
    pub(super) v: L::F,
    pub(super) inside: L::Mask,
}

/// Runs the watertight test of Woop, Benthin & Wald (2013): no ray passes between triangles that share an edge or a
/// corner.
///
/// `corners` are relative to the ray's origin, in the order of [`Ray::axes`]; `shear` is [`Ray::shear`].
///
/// ```text
/// A′ = (A_x − S_x A_z, A_y − S_y A_z)                        the ray becomes the origin of a plane
/// U = C′ × B′,  V = A′ × C′,  W = B′ × A′                    inside where all three have one sign
/// t = S_z (U A_z + V B_z + W C_z) / (U + V + W)
/// ```
///
/// # Differs from the paper
///
/// An edge function that rounds to 0 counts as either sign; the paper recomputes it in double precision. A ray may then
/// hit both adjacent triangles, but always hits at least one. A nonzero difference of products keeps its sign under
/// rounding.
#[inline(always)]
pub(super) fn meet<L: Lanes>(lanes: L, corners: [[L::F; 3]; 3], shear: [L::F; 3]) -> Option<Meeting<L>> {
    let [a, b, c] = corners;
    // Shear the corners, so that the ray runs along the z axis.
    let (a_x, a_y) = (slant(lanes, a[0], a[2], shear[0]), slant(lanes, a[1], a[2], shear[1]));
    let (b_x, b_y) = (slant(lanes, b[0], b[2], shear[0]), slant(lanes, b[1], b[2], shear[1]));
    let (c_x, c_y) = (slant(lanes, c[0], c[2], shear[0]), slant(lanes, c[1], c[2], shear[1]));
    // Compute the edge functions. The ray hits if all have the same sign.
    let u = lanes.sub(lanes.mul(c_x, b_y), lanes.mul(c_y, b_x));
    let v = lanes.sub(lanes.mul(a_x, c_y), lanes.mul(a_y, c_x));
    let w = lanes.sub(lanes.mul(b_x, a_y), lanes.mul(b_y, a_x));
    let zero = lanes.splat(0.0);
    let inside = lanes.or(lanes.le(zero, lanes.min(lanes.min(u, v), w)), lanes.le(lanes.max(lanes.max(u, v), w), zero));
    if lanes.bits(inside) == 0 {
        return None;
    }
    // Interpolate the distance with the normalized barycentric weights.
    let inverse = lanes.div(lanes.splat(1.0), lanes.add(lanes.add(u, v), w));
    let z = lanes.add(lanes.add(lanes.mul(u, a[2]), lanes.mul(v, b[2])), lanes.mul(w, c[2]));
    Some(Meeting {
        t: lanes.mul(lanes.mul(z, shear[2]), inverse),
        u: lanes.mul(v, inverse),
        v: lanes.mul(w, inverse),
        inside,
    })
}

/// Returns a coordinate after the shear that aligns the ray with an axis.
#[inline(always)]
fn slant<L: Lanes>(lanes: L, x: L::F, z: L::F, slope: L::F) -> L::F {
    lanes.sub(x, lanes.mul(slope, z))
}

impl<'a> Leaf<'a> {
    /// Creates a leaf of `count` triangles, starting with the first of `blocks`.
    #[inline(always)]
    pub(super) fn new(blocks: &'a [TriangleBlock], count: usize) -> Self {
        let low = &blocks[0];
        Self { low, high: if count > BLOCK { &blocks[1] } else { low }, count }
    }

    /// Returns the block that contains a triangle, and the slot of the triangle in the block.
    #[inline(always)]
    pub(super) fn place(&self, lane: usize) -> (&'a TriangleBlock, usize) {
        (if lane < BLOCK { self.low } else { self.high }, lane % BLOCK)
    }

    /// Returns the index of the triangle in the group.
    #[inline(always)]
    pub(super) fn triangle(&self, lane: usize) -> u32 {
        let (block, lane) = self.place(lane);
        block.triangles[lane]
    }

    /// Intersects one ray with the leaf's triangles at distances from `near` to `limit`. Returns the intersections and
    /// the mask of the lanes with hits.
    #[inline(always)]
    pub(super) fn meet<L: Lanes>(&self, lanes: L, ray: &Ray, near: f32, limit: f32) -> Option<(u32, Meeting<L>)> {
        let axes = ray.axes;
        // Make corners relative to the ray's origin, in the order of its axes.
        let from = ray.origin.to_array();
        let from = lanes.splat3([from[axes[0]], from[axes[1]], from[axes[2]]]);
        let corners = [
            lanes.sub3(self.column(lanes, 0, axes), from),
            lanes.sub3(self.column(lanes, 1, axes), from),
            lanes.sub3(self.column(lanes, 2, axes), from),
        ];
        let mut meeting = meet(lanes, corners, lanes.splat3(ray.shear))?;
        // Keep hits in front of the origin, never nearer than the leaf's box.
        let ahead = lanes.and(meeting.inside, lanes.le(lanes.splat(0.0), meeting.t));
        meeting.t = lanes.max(meeting.t, lanes.splat(near));
        let bits = lanes.bits(lanes.and(ahead, lanes.le(meeting.t, lanes.splat(limit)))) & self.lanes();
        (bits != 0).then_some((bits, meeting))
    }

    /// Returns one corner of all triangles, with coordinates in the order of `axes`.
    #[inline(always)]
    pub(super) fn column<L: Lanes>(&self, lanes: L, corner: usize, [x, y, z]: [usize; 3]) -> [L::F; 3] {
        let (low, high) = (&self.low.corners[corner], &self.high.corners[corner]);
        [
            lanes.load_halves(&low[x], &high[x]),
            lanes.load_halves(&low[y], &high[y]),
            lanes.load_halves(&low[z], &high[z]),
        ]
    }

    /// Returns the mask of the lanes with triangles.
    #[inline(always)]
    pub(super) fn lanes(&self) -> u32 {
        (1 << self.count) - 1
    }

    /// Returns the corners of the triangle in slot `lane`.
    pub(super) fn corners(&self, lane: usize) -> [Vec3A; 3] {
        let (block, lane) = self.place(lane);
        block.corners(lane)
    }
}
