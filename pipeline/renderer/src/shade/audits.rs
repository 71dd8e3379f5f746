//! Audits: light that is found once more, better, to learn how wrong it was.
//!
//! | light | audited | found once more by | error steers |
//! |---|---|---|---|
//! | cut of a pixel | 1 pixel or more of each macroblock, in turns | a cut at a tenth of its threshold | [`Calibration`] of the next frame |
//! | cut of a new record | one record in 32, by chance | the same | the same |
//! | carried light | one macroblock in 16, in turns | the layer that it was carried for | the limit of what is carried |
//!
//! An error is noted in units of what the light was allowed; an audit is *within* where that is 1 at most.

use super::counts::Counts;
use glam::Vec3;
use lighttree::{Calibration, Light, LightTree, Scratch, Stop};
use render_core::sampling::hash;
use render_core::{AuditCounts, MACROBLOCK, Reuse, luminance};
use std::ops::AddAssign;

/// One record in this number is audited with calibrated stopping; an audit takes some times as long as a record.
const RECORDS: u64 = 32;
/// Each macroblock of carried light is lit anew once in this number of frames.
const TURN: usize = 16;

/// Errors that the audits of a frame found.
#[derive(Debug, Default)]
pub struct Audits {
    /// Of cuts, by class of their threshold.
    pub cuts: lighttree::Audits,
    /// Of carried light.
    pub carried: AuditCounts,
}

impl AddAssign for Audits {
    fn add_assign(&mut self, other: Self) {
        self.cuts.add(&other.cuts);
        self.carried.within += other.carried.within;
        self.carried.all += other.carried.all;
    }
}

/// A cut that was made, to be compared with a finer one.
pub(super) struct MadeCut<'a> {
    pub tree: &'a LightTree,
    /// Index of its entry among the errors.
    pub class: usize,
    /// The error that it may have.
    pub stop: Stop,
    pub radiance: Vec3,
}

impl MadeCut<'_> {
    /// Notes in `counts` how wrong the cut for `receiver` is, and the rays that it took to find out.
    /// `scratch` allows cuts of [`Calibration::LARGEST_CUT`]: one that ends for its size alone would pass for the truth.
    pub fn audit<M: lighttree::Receiver>(
        &self,
        receiver: &M,
        sees: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
        counts: &Counts,
    ) {
        let found = luminance(self.radiance);
        let threshold = self.stop.threshold_at(found);
        let fine = Stop::Absolute(Calibration::fine(threshold));
        let cut = self.tree.lightcut(receiver, fine, sees, scratch);
        counts.count_rays(cut.shadow_rays);
        counts.audits.note(self.class, (found - luminance(cut.radiance)).abs() / threshold);
    }
}

/// Whether the cut of a pixel is audited in a frame: as many in each macroblock, and in 256 frames all of them equally often.
pub(super) fn is_pixel_audited(x: usize, y: usize, width: usize, frame: u32, of_a_macroblock: usize) -> bool {
    let block = (y / MACROBLOCK) * width.div_ceil(MACROBLOCK) + x / MACROBLOCK;
    // Odd multipliers run through all 256 places.
    let first = (frame as usize * 151 + block * 89) % 256;
    (y % MACROBLOCK * MACROBLOCK + x % MACROBLOCK + 256 - first) * 45 % 256 < of_a_macroblock
}

/// Whether the cut of a new record is audited in a frame: one in [`RECORDS`] for each pixel that would be of a macroblock.
pub(super) fn is_record_audited(key: u64, frame: u32, of_a_macroblock: usize) -> bool {
    hash(key, u64::from(frame), 0) % RECORDS < of_a_macroblock as u64
}

/// Whether the light of a pixel, where it has not changed, is carried over or found anew, for comparison.
pub(super) fn reuse_in_turns(x: usize, y: usize, frame: u32) -> Reuse {
    // Odd multipliers: macroblocks in their turn do not lie side by side.
    let turn = x / MACROBLOCK * 7 + y / MACROBLOCK * 19 + frame as usize;
    if turn.is_multiple_of(TURN) { Reuse::Audited } else { Reuse::Allowed }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_its_turn() {
        for of_a_macroblock in [1, 5] {
            let mut audits = vec![0; 32 * 32];
            for n in 0..256 {
                for (i, audits) in audits.iter_mut().enumerate() {
                    *audits += usize::from(is_pixel_audited(i % 32, i / 32, 32, n, of_a_macroblock));
                }
            }
            assert!(audits.iter().all(|&times| times == of_a_macroblock));
        }
    }

    #[test]
    fn carried_light_of_each_macroblock_is_found_anew_once_in_16_frames() {
        for (x, y) in [(0, 0), (17, 5), (100, 200)] {
            let turns = (0..TURN as u32).filter(|&n| reuse_in_turns(x, y, n) == Reuse::Audited);
            assert_eq!(turns.count(), 1);
        }
    }

    #[test]
    fn audits_of_layers_add_up() {
        let of = |within, ratio| {
            let audits = Audits { carried: AuditCounts { within, all: 4 }, ..Audits::default() };
            audits.cuts.note(1, ratio);
            audits
        };
        let mut sum = of(3, 0.25);
        sum += of(1, 0.25);
        assert_eq!(sum.carried, AuditCounts { within: 4, all: 8 });
        let learned = Calibration::default().learn(&sum.cuts).expect("audits");
        assert_eq!(learned, Calibration::default().learn(&of(0, 0.25).cuts).expect("an audit"));
    }
}
