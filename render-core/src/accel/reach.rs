//! Tolerance within which rays search for coincident surfaces, see `ties.rs`.

use glam::Vec3A;
use lanes::Lanes;

/// Length of the search beyond the nearest hit, as a fraction of distance and coordinates. It suffices for surfaces at
/// grazing angles down to 2°.
const NEAR: f32 = 1.0 / 65536.0;
/// Minimum extent of the scaled scene, which is 64…128 (see [`super`]). Triangles may be this large even close to the
/// ray's origin.
const SPAN: f32 = 64.0;
/// Search range of a ray beyond the nearest hit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// Factor on the distance of the nearest hit.
    factor: f32,
    /// Length added to the distance, in lengths of the direction.
    beyond: f32,
}

impl Reach {
    /// Empty search range.
    pub(super) const NONE: Self = Self { factor: 1.0, beyond: 0.0 };

    /// Returns the reach of rays in unit directions from `origin` in the scaled world.
    #[inline(always)]
    pub(super) fn from(origin: Vec3A) -> Self {
        Self { factor: 1.0 + NEAR, beyond: NEAR * (origin.abs().max_element() + SPAN) }
    }

    /// Returns the reach of rays with directions of the given `length`.
    pub(super) fn of_length(self, length: f32) -> Self {
        Self { beyond: self.beyond / length, ..self }
    }

    /// Returns the distance within which other hits may coincide with a hit at distance `t` ≥ 0.
    #[inline(always)]
    pub(super) fn of(self, t: f32) -> f32 {
        let farther = t * self.factor + self.beyond;
        // Clamp to the largest number: the product overflows for distant hits.
        if farther < f32::MAX { farther } else { f32::MAX }
    }

    /// Returns [`Reach::of`] for eight distances. Negative distances mark lanes without a ray and stay unchanged.
    #[inline(always)]
    pub(super) fn of_eight<L: Lanes>(self, lanes: L, t: L::F) -> L::F {
        let farther = lanes.add(lanes.mul(t, lanes.splat(self.factor)), lanes.splat(self.beyond));
        let farther = lanes.min(farther, lanes.splat(f32::MAX));
        lanes.select(lanes.lt(t, lanes.splat(0.0)), t, farther)
    }

    /// Returns whether the reach is [`Reach::NONE`].
    #[inline(always)]
    pub(super) fn is_none(self) -> bool {
        self.beyond == 0.0
    }
}
