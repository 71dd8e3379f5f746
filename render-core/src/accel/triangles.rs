//! Triangles, eight to a block, and their meeting with rays.

use super::lanes::{LANES, Lanes};
use super::ray::Direction;
use glam::Vec3A;

/// The triangles of a leaf.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct Block {
    /// By corner, axis, triangle. Places without a triangle hold no numbers, which meet nothing.
    pub(super) corners: [[[f32; LANES]; 3]; 3],
    /// Which triangles of the group these are.
    pub(super) triangles: [u32; LANES],
}

impl Block {
    pub(super) const EMPTY: Self = Self { corners: [[[f32::NAN; LANES]; 3]; 3], triangles: [u32::MAX >> 1; LANES] };

    pub(super) fn set(&mut self, lane: usize, triangle: u32, corners: [Vec3A; 3]) {
        for (column, corner) in self.corners.iter_mut().zip(corners) {
            for (axis, x) in corner.to_array().into_iter().enumerate() {
                column[axis][lane] = x;
            }
        }
        self.triangles[lane] = triangle;
    }

    /// The corners of one of the triangles.
    pub(super) fn corners(&self, lane: usize) -> [Vec3A; 3] {
        std::array::from_fn(|c| Vec3A::from_array(std::array::from_fn(|axis| self.corners[c][axis][lane])))
    }
}

/// Where eight rays meet a triangle, or a ray eight triangles.
pub(super) struct Meeting<L: Lanes> {
    /// In lengths of the direction; NaN where the ray lies within the triangle's plane.
    pub(super) t: L::F,
    /// Barycentric weights of the second and third corner.
    pub(super) u: L::F,
    pub(super) v: L::F,
    pub(super) inside: L::Mask,
}

/// The watertight test of Woop, Benthin & Wald (2013): no ray slips between triangles that share an edge or a corner.
///
/// `corners` are relative to the ray's origin, in the order of [`Direction::axes`]; `shear` is [`Direction::shear`].
///
/// ```text
/// A′ = (A_x − S_x A_z, A_y − S_y A_z)                        the ray becomes the origin of a plane
/// U = C′ × B′,  V = A′ × C′,  W = B′ × A′                    inside where all three have one sign
/// t = S_z (U A_z + V B_z + W C_z) / (U + V + W)
/// ```
///
/// # Differs from the paper
///
/// An edge function that rounds to 0 counts as either sign instead of being computed again in double precision: two
/// triangles may both be hit then, but never neither, since a difference of products that is not 0 has the right sign.
#[inline(always)]
pub(super) fn meet<L: Lanes>(lanes: L, corners: [[L::F; 3]; 3], shear: [L::F; 3]) -> Option<Meeting<L>> {
    let [a, b, c] = corners;
    let (a_x, a_y) = (slant(lanes, a[0], a[2], shear[0]), slant(lanes, a[1], a[2], shear[1]));
    let (b_x, b_y) = (slant(lanes, b[0], b[2], shear[0]), slant(lanes, b[1], b[2], shear[1]));
    let (c_x, c_y) = (slant(lanes, c[0], c[2], shear[0]), slant(lanes, c[1], c[2], shear[1]));
    let u = lanes.sub(lanes.mul(c_x, b_y), lanes.mul(c_y, b_x));
    let v = lanes.sub(lanes.mul(a_x, c_y), lanes.mul(a_y, c_x));
    let w = lanes.sub(lanes.mul(b_x, a_y), lanes.mul(b_y, a_x));
    let zero = lanes.splat(0.0);
    let inside = lanes.or(lanes.le(zero, lanes.min(lanes.min(u, v), w)), lanes.le(lanes.max(lanes.max(u, v), w), zero));
    if lanes.bits(inside) == 0 {
        return None;
    }
    let inverse = lanes.div(lanes.splat(1.0), lanes.add(lanes.add(u, v), w));
    let z = lanes.add(lanes.add(lanes.mul(u, a[2]), lanes.mul(v, b[2])), lanes.mul(w, c[2]));
    Some(Meeting {
        t: lanes.mul(lanes.mul(z, shear[2]), inverse),
        u: lanes.mul(v, inverse),
        v: lanes.mul(w, inverse),
        inside,
    })
}

/// A coordinate after the shear that makes the ray an axis.
#[inline(always)]
fn slant<L: Lanes>(lanes: L, x: L::F, z: L::F, slope: L::F) -> L::F {
    lanes.sub(x, lanes.mul(slope, z))
}

impl Block {
    /// Where one ray meets the block's triangles, at no less than `near` and at most `limit`: bits of the lanes that hold.
    #[inline(always)]
    pub(super) fn meet<L: Lanes>(
        &self,
        lanes: L,
        origin: Vec3A,
        direction: &Direction,
        (near, limit): (f32, f32),
    ) -> Option<(u32, Meeting<L>)> {
        let [x, y, z] = direction.axes;
        let from = origin.to_array();
        let from = lanes.splat3([from[x], from[y], from[z]]);
        let [a, b, c] = &self.corners;
        let corners = [
            lanes.sub3(lanes.load3([&a[x], &a[y], &a[z]]), from),
            lanes.sub3(lanes.load3([&b[x], &b[y], &b[z]]), from),
            lanes.sub3(lanes.load3([&c[x], &c[y], &c[z]]), from),
        ];
        let mut meeting = meet(lanes, corners, lanes.splat3(direction.shear))?;
        let ahead = lanes.and(meeting.inside, lanes.le(lanes.splat(0.0), meeting.t));
        meeting.t = lanes.max(meeting.t, lanes.splat(near));
        let bits = lanes.bits(lanes.and(ahead, lanes.le(meeting.t, lanes.splat(limit))));
        (bits != 0).then_some((bits, meeting))
    }
}
