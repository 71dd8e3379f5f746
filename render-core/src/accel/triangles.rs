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
    let [a, b, c] =
        corners.map(|[x, y, z]| (lanes.sub(x, lanes.mul(shear[0], z)), lanes.sub(y, lanes.mul(shear[1], z)), z));
    let cross = |p: (L::F, L::F, L::F), q: (L::F, L::F, L::F)| lanes.sub(lanes.mul(p.0, q.1), lanes.mul(p.1, q.0));
    let (u, v, w) = (cross(c, b), cross(a, c), cross(b, a));
    let zero = lanes.splat(0.0);
    let inside = lanes.or(lanes.le(zero, lanes.min(lanes.min(u, v), w)), lanes.le(lanes.max(lanes.max(u, v), w), zero));
    if lanes.bits(inside) == 0 {
        return None;
    }
    let inverse = lanes.div(lanes.splat(1.0), lanes.add(lanes.add(u, v), w));
    let z = lanes.add(lanes.add(lanes.mul(u, a.2), lanes.mul(v, b.2)), lanes.mul(w, c.2));
    Some(Meeting {
        t: lanes.mul(lanes.mul(z, shear[2]), inverse),
        u: lanes.mul(v, inverse),
        v: lanes.mul(w, inverse),
        inside,
    })
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
        let from = origin.to_array();
        let corners = std::array::from_fn(|c| {
            direction.axes.map(|axis| lanes.sub(lanes.load(&self.corners[c][axis]), lanes.splat(from[axis])))
        });
        let mut meeting = meet(lanes, corners, direction.shear.map(|x| lanes.splat(x)))?;
        let ahead = lanes.and(meeting.inside, lanes.le(lanes.splat(0.0), meeting.t));
        meeting.t = lanes.max(meeting.t, lanes.splat(near));
        let bits = lanes.bits(lanes.and(ahead, lanes.le(meeting.t, lanes.splat(limit))));
        (bits != 0).then_some((bits, meeting))
    }
}
