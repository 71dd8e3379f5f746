//! Audits: recomputation of light with higher accuracy, to measure errors.
//!
//! | light | audited | recomputed by | error sets |
//! |---|---|---|---|
//! | lightcut of a pixel | ≥ 1 pixel per macroblock, in rotation | lightcut at 1/10 of its threshold | next [`Calibration`] |
//! | lightcut of a new record | one random record in 32 | lightcut at 1/10 of its threshold | next [`Calibration`] |
//! | reprojected light | one macroblock in 16, in rotation | the reprojected layer | the limit of reprojection |
//!
//! Errors are stored as multiples of the permitted error. An audit is *within* if the measured error is at most 1.

use super::counts::Counts;
use glam::Vec3;
use lighttree::{Calibration, Light, LightTree, Scratch, Stop};
use render_core::sampling::hash;
use render_core::{AuditCounts, MACROBLOCK, Reuse, luminance};
use std::ops::AddAssign;

/// Number of records per audited record, with calibrated stopping. An audit costs several times as much as a record.
const RECORDS: u64 = 32;
/// Number of frames after which the rotation of recomputed macroblocks of reprojected light repeats.
const TURN: usize = 16;

/// Errors measured by the audits of a frame.
#[derive(Debug, Default)]
pub struct Audits {
    /// Errors of lightcuts, by the class of their threshold.
    pub cuts: lighttree::Audits,
    /// Counts of audited pixels with reprojected light: all pixels, and pixels within the permitted error.
    pub reprojected: AuditCounts,
}

impl AddAssign for Audits {
    fn add_assign(&mut self, other: Self) {
        self.cuts.add(&other.cuts);
        self.reprojected.within += other.reprojected.within;
        self.reprojected.all += other.reprojected.all;
    }
}

/// A lightcut to compare with a finer lightcut.
pub(super) struct MadeLightcut<'a> {
    pub tree: &'a LightTree,
    /// Calibration class of the lightcut's threshold.
    pub class: usize,
    /// Stopping criterion, with the permitted error.
    pub stop: Stop,
    pub radiance: Vec3,
}

impl MadeLightcut<'_> {
    /// Adds the lightcut's error at `receiver` and the audit's shadow rays to `counts`. `scratch` must allow lightcuts
    /// of [`Calibration::LARGEST_CUT`], because a lightcut stopped by its size would be an inaccurate reference.
    pub fn audit<M: lighttree::Receiver>(
        &self,
        receiver: &M,
        sees: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
        counts: &Counts,
    ) {
        let found = luminance(self.radiance);
        let threshold = self.stop.threshold_at(found);
        // Measure the error against a lightcut with a tighter threshold.
        let fine = Stop::Absolute(Calibration::fine(threshold));
        let cut = self.tree.lightcut(receiver, fine, sees, scratch);
        counts.count_rays(cut.shadow_rays);
        counts.audits.note(self.class, (found - luminance(cut.radiance)).abs() / threshold);
    }
}

/// Returns whether a pixel's lightcut is audited in a frame. Each macroblock has the same number of audited pixels.
/// Every pixel is audited equally often in 256 frames.
pub(super) fn is_pixel_audited(x: usize, y: usize, width: usize, frame: u32, of_a_macroblock: usize) -> bool {
    let block = (y / MACROBLOCK) * width.div_ceil(MACROBLOCK) + x / MACROBLOCK;
    // Use an odd multiplier: it permutes all 256 positions.
    let first = (frame as usize * 151 + block * 89) % 256;
    (y % MACROBLOCK * MACROBLOCK + x % MACROBLOCK + 256 - first) * 45 % 256 < of_a_macroblock
}

/// Returns whether a new record's lightcut is audited in a frame. The probability is `of_a_macroblock`, the number of
/// audited pixels per macroblock, divided by [`RECORDS`].
pub(super) fn is_record_audited(key: u64, frame: u32, of_a_macroblock: usize) -> bool {
    hash(key, u64::from(frame), 0) % RECORDS < of_a_macroblock as u64
}

/// Returns whether a pixel's unchanged light is only reprojected, or is also recomputed for comparison.
pub(super) fn reuse_in_turns(x: usize, y: usize, frame: u32) -> Reuse {
    // Use odd multipliers: they scatter the audited macroblocks of a frame.
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
            let audits = Audits { reprojected: AuditCounts { within, all: 4 }, ..Audits::default() };
            audits.cuts.note(1, ratio);
            audits
        };
        let mut sum = of(3, 0.25);
        sum += of(1, 0.25);
        assert_eq!(sum.reprojected, AuditCounts { within: 4, all: 8 });
        let learned = Calibration::default().learn(&sum.cuts).expect("audits");
        assert_eq!(learned, Calibration::default().learn(&of(0, 0.25).cuts).expect("an audit"));
    }
}
