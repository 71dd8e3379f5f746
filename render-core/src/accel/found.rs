//! Nearest triangle that a ray has hit so far, over all groups.

use super::group::{BEFORE_ALL, Met, NO_TRIANGLE, Nearest};
use super::reach::Reach;

/// Triangle hit by a ray, with the index of its group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) met: Met,
    /// Index into [`Accelerator::groups`].
    pub(super) place: usize,
    /// Whether the ray hits another triangle within reach of this triangle.
    pub(super) contested: bool,
}

impl Found {
    pub(super) const NOTHING: Self = Self { met: Met::NOTHING, place: usize::MAX, contested: false };

    /// Returns the hit that a hit in group `place` must beat. At equal distances, the group with the lower index wins.
    pub(super) fn to_beat(self, place: usize, reach: Reach) -> Nearest {
        let triangle = if place < self.place { NO_TRIANGLE } else { BEFORE_ALL };
        Nearest { met: Met { triangle, ..self.met }, contested: false, reach }
    }

    /// Updates the nearest hit after the traversal of group `place`, which started with `to_beat`. Returns whether the
    /// nearest hit is now in this group.
    pub(super) fn update(&mut self, place: usize, to_beat: &Nearest, nearest: &Nearest) -> bool {
        let is_new = nearest.met != to_beat.met;
        if is_new {
            *self = Self { met: nearest.met, place, contested: nearest.contested };
        } else {
            self.contested |= nearest.contested;
        }
        is_new
    }
}
