//! Decisions whether to start another frame.

use crate::checkpoint::Checkpoints;
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

/// Decides before each frame, as late as possible, whether to start it.
///
/// All ranks start a frame together. With several ranks, the decision is therefore made when the previous frame is passed
/// to shading.
pub(super) struct Pace<'a> {
    stop: &'a AtomicBool,
    checkpoints: &'a Checkpoints,
    /// First frame of the run.
    first: u32,
    is_led: bool,
    decided: Cell<Option<bool>>,
}

impl<'a> Pace<'a> {
    /// Returns the pace of a run that starts with frame `first` and ends when `stop` is true. `is_led` means that other
    /// ranks follow.
    pub fn new(stop: &'a AtomicBool, checkpoints: &'a Checkpoints, first: u32, is_led: bool) -> Self {
        // Decide about the first frame at once if other ranks wait for the decision.
        let pace = Self { stop, checkpoints, first, is_led, decided: Cell::new(None) };
        pace.decided.set(is_led.then(|| pace.decide(first)));
        pace
    }

    /// Returns the decision about the next frame, to send to other ranks; `None` without other ranks.
    pub fn decision(&self) -> Option<bool> {
        self.decided.get()
    }

    /// Returns whether frame `index` is to start.
    pub fn begins(&self, index: u32) -> bool {
        self.decided.take().unwrap_or_else(|| self.decide(index))
    }

    /// Returns whether the frame after `index` starts, for other ranks; false without other ranks. Call this function when
    /// frame `index` is passed to shading.
    pub fn hand_over(&self, index: u32) -> bool {
        self.decided.set(self.is_led.then(|| self.decide(index + 1)));
        self.decision().unwrap_or_default()
    }

    fn decide(&self, next: u32) -> bool {
        // Record the last frame before the stages end, so that each leaves its state after that frame.
        let goes_on = !self.stop.load(Ordering::Relaxed);
        if !goes_on {
            self.checkpoints.end_before(next, self.first);
        }
        goes_on
    }
}
