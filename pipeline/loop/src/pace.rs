//! Whether a film goes on with another frame.

use crate::checkpoint::Checkpoints;
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

/// Decides before each frame whether it is begun, as late as possible.
///
/// All ranks begin a frame together. With other ranks, the decision about it is therefore made when the frame before is handed over.
pub(super) struct Pace<'a> {
    stop: &'a AtomicBool,
    checkpoints: &'a Checkpoints,
    /// The first frame of this run.
    first: u32,
    is_led: bool,
    decided: Cell<Option<bool>>,
}

impl<'a> Pace<'a> {
    /// For a run that begins with frame `first`, until `stop` is true. Others follow if `is_led`.
    pub fn new(stop: &'a AtomicBool, checkpoints: &'a Checkpoints, first: u32, is_led: bool) -> Self {
        let pace = Self { stop, checkpoints, first, is_led, decided: Cell::new(None) };
        pace.decided.set(is_led.then(|| pace.decide(first)));
        pace
    }

    /// The decision that other ranks need now, about the next frame; none where no rank follows.
    pub fn decision(&self) -> Option<bool> {
        self.decided.get()
    }

    /// Whether frame `index` is begun.
    pub fn begins(&self, index: u32) -> bool {
        self.decided.take().unwrap_or_else(|| self.decide(index))
    }

    /// Decides about the frame after `index`, which is handed over now, if other ranks follow. Gives the decision; false without them.
    pub fn hand_over(&self, index: u32) -> bool {
        self.decided.set(self.is_led.then(|| self.decide(index + 1)));
        self.decision().unwrap_or_default()
    }

    fn decide(&self, next: u32) -> bool {
        let goes_on = !self.stop.load(Ordering::Relaxed);
        if !goes_on {
            self.checkpoints.end_before(next, self.first);
        }
        goes_on
    }
}
