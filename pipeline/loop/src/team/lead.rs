//! Orders of rank 0 to the other ranks: initial state, next frame, end.

use crate::error::{Error, Result};
use crate::stage::LuminanceThresholds;
use crate::state::{decode_bytes, encode};
use plane::Plane;
use ranks::{Alone, Ranks};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Order of rank 0.
#[derive(Debug, Deserialize)]
pub(crate) enum Order {
    /// Restore the initial state of all ranks. `first` is the first frame to make.
    Start { first: u32, restored: Option<RestoredState> },
    /// Compute the state that all frames have in common.
    Ready,
    /// Prepare the first frame if rank 0 `goes_on`.
    Begin { goes_on: bool },
    /// Shade this frame. Store the state if it is `marked`; prepare the next frame if rank 0 `goes_on`.
    Frame { index: u32, marked: bool, goes_on: bool, thresholds: Option<SentThresholds> },
    /// Shade no further frame. Store the state if `state_wanted`. Prepare one more frame if rank 0 `goes_on`.
    End { state_wanted: bool, goes_on: bool },
}

/// States of preparation and shading after a finished frame.
#[derive(Debug, Deserialize)]
pub(crate) struct RestoredState {
    /// Number of the finished frame.
    pub last: u32,
    pub prepare: Vec<u8>,
    pub shade: Vec<u8>,
}

/// Thresholds of a frame: its number, ΔY and luminance.
type SentThresholds = (u32, Plane<f32>, Plane<f32>);

/// Order as rank 0 sends it, with references instead of owned data.
#[derive(Serialize)]
enum Sent<'a> {
    Start { first: u32, restored: Option<(u32, &'a [u8], &'a [u8])> },
    Ready,
    Begin { goes_on: bool },
    Frame { index: u32, marked: bool, goes_on: bool, thresholds: Option<(u32, &'a Plane<f32>, &'a Plane<f32>)> },
    End { state_wanted: bool, goes_on: bool },
}

impl Order {
    /// Returns the next order of rank 0.
    ///
    /// # Errors
    /// If the bytes are not an order.
    pub fn next(ranks: &dyn Ranks) -> Result<Self> {
        // Send no bytes: a broadcast returns the bytes of rank 0 on every rank.
        decode_bytes(&ranks.broadcast(Vec::new())).map_err(|_| Error::Fault("rank 0 sent an unknown order".into()))
    }

    /// Converts the received thresholds of a frame.
    pub fn thresholds((of, delta, luminance): SentThresholds) -> LuminanceThresholds {
        LuminanceThresholds { of, delta: Arc::new(delta), luminance: Arc::new(luminance) }
    }
}

/// Leadership of rank 0 over all other ranks. If dropped early, it announces that no further frame follows.
#[derive(Debug)]
pub struct Lead {
    ranks: Arc<dyn Ranks>,
    has_ended: bool,
    /// Whether rank 0 prepares a frame that it has not ordered from the other ranks yet.
    goes_on: bool,
}

impl Lead {
    /// Returns the leader of `ranks`. This rank must be the first.
    pub fn of(ranks: Arc<dyn Ranks>) -> Self {
        // Without other ranks, send no orders.
        let has_ended = ranks.count() == 1;
        Self { ranks, has_ended, goes_on: false }
    }

    /// Returns a leader without other ranks.
    pub fn nobody() -> Self {
        Self::of(Arc::new(Alone))
    }

    /// Returns the communication between this rank and the ranks that it leads.
    pub fn ranks(&self) -> Arc<dyn Ranks> {
        self.ranks.clone()
    }

    fn say(&self, message: &Sent) {
        if !self.has_ended {
            self.ranks.broadcast(encode(message));
        }
    }

    /// Orders the other ranks to start a film at frame `first`, with states of [`Prepare`](crate::stage::Prepare) and
    /// [`Shade`](crate::stage::Shade) after the previous frame if it is resumed.
    pub fn start(&self, first: u32, restored: Option<(&[u8], &[u8])>) {
        let restored = restored.map(|(prepare, shade)| (first - 1, prepare, shade));
        self.say(&Sent::Start { first, restored });
    }

    /// Orders the other ranks to compute the state that all frames have in common.
    pub fn make_ready(&self) {
        self.say(&Sent::Ready);
    }

    /// Announces whether the first frame is prepared.
    pub fn begin(&self, goes_on: bool) {
        self.say(&Sent::Begin { goes_on });
    }

    /// Records whether rank 0 prepares another frame.
    pub fn notes(&mut self, goes_on: bool) {
        self.goes_on = goes_on;
    }

    /// Orders the other ranks to shade frame `index` with the given `thresholds`.
    pub fn frame(&mut self, index: u32, marked: bool, thresholds: Option<&LuminanceThresholds>) {
        let thresholds = thresholds.map(|known| (known.of, &*known.delta, &*known.luminance));
        // Clear the flag, so that the end of the film does not announce the same preparation again.
        let goes_on = std::mem::take(&mut self.goes_on);
        self.say(&Sent::Frame { index, marked, goes_on, thresholds });
    }

    /// Announces the end. With `state_wanted`, every rank stores its state.
    pub fn end(&mut self, state_wanted: bool) {
        let goes_on = std::mem::take(&mut self.goes_on);
        self.say(&Sent::End { state_wanted, goes_on });
        self.has_ended = true;
    }
}

impl Drop for Lead {
    fn drop(&mut self) {
        // Send nothing if this rank panics: the other ranks may be in a collective operation that it left.
        if !std::thread::panicking() {
            self.end(false);
        }
    }
}
