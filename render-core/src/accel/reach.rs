//! How far rays look for surfaces in one place: see `ties.rs`.

use glam::Vec3A;
use lanes::Lanes;

/// Hits this much farther than the nearest are looked at, as a share of distance and coordinates: enough for surfaces that rays
/// graze by 2°.
const NEAR: f32 = 1.0 / 65536.0;
/// Edge of the scaled scene, 64…128 (see [`super`]): its triangles may be as large, however close the ray begins.
const SPAN: f32 = 64.0;
/// How far beyond its nearest hit a ray looks for others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// Factor of the distance.
    factor: f32,
    /// Lengths of the unit direction.
    beyond: f32,
}

impl Reach {
    /// No farther than the hit.
    pub(super) const NONE: Self = Self { factor: 1.0, beyond: 0.0 };

    /// For rays in unit directions from `origin` in the scaled world.
    #[inline(always)]
    pub(super) fn from(origin: Vec3A) -> Self {
        Self { factor: 1.0 + NEAR, beyond: NEAR * (origin.abs().max_element() + SPAN) }
    }

    /// The same for directions of another `length`.
    pub(super) fn of_length(self, length: f32) -> Self {
        Self { beyond: self.beyond / length, ..self }
    }

    /// Distance within which others may be as near as a hit at `t`, which is not negative.
    #[inline(always)]
    pub(super) fn of(self, t: f32) -> f32 {
        let farther = t * self.factor + self.beyond;
        if farther < f32::MAX { farther } else { f32::MAX }
    }

    /// The same for eight distances, none of which is negative but those of places without a ray.
    #[inline(always)]
    pub(super) fn of_eight<L: Lanes>(self, lanes: L, t: L::F) -> L::F {
        let farther = lanes.add(lanes.mul(t, lanes.splat(self.factor)), lanes.splat(self.beyond));
        let farther = lanes.min(farther, lanes.splat(f32::MAX));
        lanes.select(lanes.lt(t, lanes.splat(0.0)), t, farther)
    }

    /// Whether it is [`Reach::NONE`].
    #[inline(always)]
    pub(super) fn is_none(self) -> bool {
        self.beyond == 0.0
    }
}
