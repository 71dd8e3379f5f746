//! The nearest triangle of all groups that a ray has met so far.

use super::group::{BEFORE_ALL, Met, NO_TRIANGLE, Nearest};
use super::reach::Reach;

/// The triangle that a ray met, and its group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) met: Met,
    /// Place in [`Accelerator::groups`].
    pub(super) place: usize,
    /// Whether another triangle was met within reach of it.
    pub(super) contested: bool,
}

impl Found {
    pub(super) const NOTHING: Self = Self { met: Met::NOTHING, place: usize::MAX, contested: false };

    /// The hit that group `place` must beat: of hits at one distance, the group that comes first wins.
    pub(super) fn to_beat(self, place: usize, reach: Reach) -> Nearest {
        let triangle = if place < self.place { NO_TRIANGLE } else { BEFORE_ALL };
        Nearest { met: Met { triangle, ..self.met }, contested: false, reach }
    }

    /// After the walk through group `place`, which had `to_beat`. Whether a triangle there is the nearest now.
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
