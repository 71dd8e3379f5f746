//! Orders of rank 0 to the other ranks: the initial state, the next frame, the end.

use crate::error::{Error, Result};
use crate::parts::LuminanceThresholds;
use crate::state::{decode_bytes, encode};
use plane::Plane;
use ranks::{Alone, Ranks};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Order of rank 0.
#[derive(Debug, Deserialize)]
pub(crate) enum Order {
    /// Initial state of all ranks, and the first frame to make.
    Start { first: u32, restored: Option<RestoredState> },
    /// Announces whether the first frame is made.
    Begin { goes_on: bool },
    /// Shade this frame. Store the state if it is `marked`; prepare the next frame if rank 0 `goes_on`.
    Frame { index: u32, marked: bool, goes_on: bool, thresholds: Option<SentThresholds> },
    /// No further frame. The state after the last one may be needed; one more frame may be prepared, as on rank 0.
    End { state_wanted: bool, goes_on: bool },
}

/// States after a finished frame.
#[derive(Debug, Deserialize)]
pub(crate) struct RestoredState {
    /// Number of that frame.
    pub last: u32,
    pub prepare: Vec<u8>,
    pub shade: Vec<u8>,
}

/// Thresholds of a frame: its number, ΔY and luminance.
type SentThresholds = (u32, Plane<f32>, Plane<f32>);

/// The same orders as they are sent.
#[derive(Serialize)]
enum Sent<'a> {
    Start { first: u32, restored: Option<(u32, &'a [u8], &'a [u8])> },
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
        decode_bytes(&ranks.broadcast(Vec::new())).map_err(|_| Error::Fault("rank 0 sent an unknown order".into()))
    }

    /// Converts the received thresholds of a frame.
    pub fn thresholds((of, delta, luminance): SentThresholds) -> LuminanceThresholds {
        LuminanceThresholds { of, delta: Arc::new(delta), luminance: Arc::new(luminance) }
    }
}

/// Rank 0 as the leader of all others. If dropped early, it announces that no further frame follows.
#[derive(Debug)]
pub struct Lead {
    ranks: Arc<dyn Ranks>,
    has_ended: bool,
    /// True if rank 0 prepares a frame that the other ranks have no order for yet.
    goes_on: bool,
}

impl Lead {
    /// Returns the leader of `ranks`, where this rank is the first.
    pub fn of(ranks: Arc<dyn Ranks>) -> Self {
        let has_ended = ranks.count() == 1;
        Self { ranks, has_ended, goes_on: false }
    }

    /// Returns a leader without other ranks.
    pub fn nobody() -> Self {
        Self::of(Arc::new(Alone))
    }

    /// This rank and the ranks that it leads.
    pub fn ranks(&self) -> Arc<dyn Ranks> {
        self.ranks.clone()
    }

    fn say(&self, message: &Sent) {
        if !self.has_ended {
            self.ranks.broadcast(encode(message));
        }
    }

    /// Starts a film at frame `first`, with states of [`Prepare`](crate::parts::Prepare) and
    /// [`Shade`](crate::parts::Shade) after the previous frame if it is resumed.
    pub fn start(&self, first: u32, restored: Option<(&[u8], &[u8])>) {
        let restored = restored.map(|(prepare, shade)| (first - 1, prepare, shade));
        self.say(&Sent::Start { first, restored });
    }

    /// Announces whether the first frame is prepared.
    pub fn begin(&self, goes_on: bool) {
        self.say(&Sent::Begin { goes_on });
    }

    /// Notes whether rank 0 prepares another frame.
    pub fn notes(&mut self, goes_on: bool) {
        self.goes_on = goes_on;
    }

    /// Orders frame `index` to be shaded with these thresholds.
    pub fn frame(&mut self, index: u32, marked: bool, thresholds: Option<&LuminanceThresholds>) {
        let thresholds = thresholds.map(|known| (known.of, &*known.delta, &*known.luminance));
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
        // A rank that panics sends nothing: the other ranks may be inside an operation that it left.
        if !std::thread::panicking() {
            self.end(false);
        }
    }
}
