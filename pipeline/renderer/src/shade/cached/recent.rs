//! Motion and light of the last frames, which decide whether updates of records may wait.

use crate::shade::movement::{MovingBox, change_of_light};
use glam::Vec3;
use render_core::cache::MOST_WAITED;
use serde::{Deserialize, Serialize};

/// Ratio of the size of an object's swept box to that in the previous frame above which its motion is sudden.
const FASTER: f32 = 1.5;
/// Ratio of a change of light to that in the previous frame above which it is sudden, and the least sudden change, as a
/// fraction of all light.
const BRIGHTER: (f32, f32) = (2.0, 0.02);

/// Motion and light of the last frames.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct RecentChanges {
    /// Boxes around the poses of each moving object in this frame and in n + 1 frames before, for n from 0.
    since: Vec<Vec<MovingBox>>,
    /// Change of light since the previous frame, as a fraction of all light; `None` before the second frame.
    change: Option<f32>,
    /// Whether motion or light of this frame differs from that of the previous frame.
    is_sudden: bool,
}

impl RecentChanges {
    /// Notes the boxes `swept` since the previous frame, and the intensities of the lights `before` and `now`.
    pub fn note(&mut self, swept: &[MovingBox], before: &[Vec3], now: &[Vec3]) {
        let change = change_of_light(before, now);
        let may_change = self.change.map(|last| (BRIGHTER.0 * last).max(BRIGHTER.1));
        let moves_alike = |thing: &MovingBox| {
            let last = self.since.first().and_then(|last| last.iter().find(|last| last.instance == thing.instance));
            last.is_some_and(|last| thing.sphere().radius <= FASTER * last.sphere().radius)
        };
        self.is_sudden = may_change.is_none_or(|most| change > most) || !swept.iter().all(moves_alike);
        self.change = Some(change);

        // Extend the boxes since earlier frames by this frame.
        self.since.insert(0, Vec::new());
        self.since.truncate(MOST_WAITED);
        for since in &mut self.since {
            for thing in swept {
                match since.iter_mut().find(|known| known.instance == thing.instance) {
                    Some(known) => known.extend(thing),
                    None => since.push(thing.clone()),
                }
            }
        }
    }

    /// Returns whether motion or light of this frame differs from that of the previous frame.
    pub fn is_sudden(&self) -> bool {
        self.is_sudden
    }

    /// Returns boxes around the poses of each moving object in this frame and in the frames before it, from `frames` ago
    /// on. `None` if they are unknown.
    pub fn since(&self, frames: usize) -> Option<&[MovingBox]> {
        Some(self.since.get(frames.checked_sub(1)?)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3A;

    /// Returns the box of instance 0 on its way from x to x + `step`.
    fn moved(x: f32, step: f32) -> Vec<MovingBox> {
        vec![MovingBox::around(0, Vec3A::X * x, Vec3A::ONE + Vec3A::X * (x + step))]
    }

    #[test]
    fn a_begin_a_jump_and_a_flash_are_sudden() {
        let mut recent = RecentChanges::default();
        let lights = |power: f32| [Vec3::splat(power), Vec3::ONE];
        let mut sudden = Vec::new();
        let moves = [vec![], vec![], moved(0.0, 0.1), moved(0.1, 0.1), moved(0.2, 5.0), vec![], vec![]];
        let powers = [1.0, 1.0, 1.0, 1.0, 1.01, 1.02, 1.03, 2.0];
        for (swept, powers) in moves.iter().zip(powers.windows(2)) {
            recent.note(swept, &lights(powers[0]), &lights(powers[1]));
            sudden.push(recent.is_sudden());
        }
        assert_eq!(sudden, [true, false, true, false, true, false, true]);
    }

    #[test]
    fn boxes_enclose_the_motion_of_several_frames() {
        let mut recent = RecentChanges::default();
        assert!(recent.since(1).is_none());
        for frame in 0..6 {
            recent.note(&moved(frame as f32, 1.0), &[], &[]);
        }
        for frames in 1..=MOST_WAITED {
            let [since] = recent.since(frames).unwrap() else { panic!("one object moves") };
            let first = 6.0 - frames as f32;
            assert_eq!(since.distance2(Vec3A::new(first - 1.0, 0.5, 0.5)), 1.0);
            assert_eq!(since.distance2(Vec3A::new(first, 0.5, 0.5)), 0.0);
            assert_eq!(since.distance2(Vec3A::new(8.0, 0.5, 0.5)), 1.0);
        }
        assert!(recent.since(MOST_WAITED + 1).is_none() && recent.since(0).is_none());
    }
}
