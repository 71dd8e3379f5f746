//! Orders of rank 0 to the others: the state to begin with, the next frame, the end.

use crate::error::{Error, Result};
use crate::parts::LuminanceThresholds;
use crate::state::{decode_bytes, encode};
use plane::Plane;
use ranks::{Alone, Ranks};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A message of rank 0.
#[derive(Debug, Deserialize)]
pub(crate) enum Order {
    /// The state that all begin with. The first frame to be made is `first`.
    Start { first: u32, restored: Option<RestoredState> },
    /// Whether the first frame is made.
    Begin { goes_on: bool },
    /// Shade this frame. It is `marked` if its state is wanted; the one after it is to be prepared if rank 0 `goes_on`.
    Frame { index: u32, marked: bool, goes_on: bool, thresholds: Option<SentThresholds> },
    /// No further frame. The state after the last one may be wanted; one more frame may be prepared, as rank 0 does.
    End { state_wanted: bool, goes_on: bool },
}

/// States after a frame that is done.
#[derive(Debug, Deserialize)]
pub(crate) struct RestoredState {
    /// That frame.
    pub last: u32,
    pub prepare: Vec<u8>,
    pub shade: Vec<u8>,
}

/// Thresholds of a frame: its number, ΔY and luminance.
type SentThresholds = (u32, Plane<f32>, Plane<f32>);

/// The same messages as they are sent.
#[derive(Serialize)]
enum Sent<'a> {
    Start { first: u32, restored: Option<(u32, &'a [u8], &'a [u8])> },
    Begin { goes_on: bool },
    Frame { index: u32, marked: bool, goes_on: bool, thresholds: Option<(u32, &'a Plane<f32>, &'a Plane<f32>)> },
    End { state_wanted: bool, goes_on: bool },
}

impl Order {
    /// The next message of rank 0.
    ///
    /// # Errors
    /// The bytes are no message.
    pub fn next(ranks: &dyn Ranks) -> Result<Self> {
        decode_bytes(&ranks.broadcast(Vec::new())).map_err(|_| Error::Fault("rank 0 says what no rank knows".into()))
    }

    /// The thresholds of a frame.
    pub fn thresholds((of, delta, luminance): SentThresholds) -> LuminanceThresholds {
        LuminanceThresholds { of, delta: Arc::new(delta), luminance: Arc::new(luminance) }
    }
}

/// Rank 0 as the one whom all others follow. Dropped before the end, it tells them that there is no further frame.
#[derive(Debug)]
pub struct Lead {
    ranks: Arc<dyn Ranks>,
    has_ended: bool,
    /// Whether rank 0 prepares a frame that the others do not know of yet.
    goes_on: bool,
}

impl Lead {
    /// Leads these ranks, of which this is the first.
    pub fn of(ranks: Arc<dyn Ranks>) -> Self {
        let has_ended = ranks.count() == 1;
        Self { ranks, has_ended, goes_on: false }
    }

    /// Leads nobody.
    pub fn nobody() -> Self {
        Self::of(Arc::new(Alone))
    }

    /// This rank and those that it leads.
    pub fn ranks(&self) -> Arc<dyn Ranks> {
        self.ranks.clone()
    }

    fn say(&self, message: &Sent) {
        if !self.has_ended {
            self.ranks.broadcast(encode(message));
        }
    }

    /// A film whose next frame is `first` begins, with states of [`Prepare`](crate::parts::Prepare) and
    /// [`Shade`](crate::parts::Shade) after the frame before it, unless it begins at its beginning.
    pub fn start(&self, first: u32, restored: Option<(&[u8], &[u8])>) {
        let restored = restored.map(|(prepare, shade)| (first - 1, prepare, shade));
        self.say(&Sent::Start { first, restored });
    }

    /// The first frame is prepared, or none is.
    pub fn begin(&self, goes_on: bool) {
        self.say(&Sent::Begin { goes_on });
    }

    /// Rank 0 goes on to prepare a frame more, or does not.
    pub fn notes(&mut self, goes_on: bool) {
        self.goes_on = goes_on;
    }

    /// Frame `index` is shaded with these thresholds.
    pub fn frame(&mut self, index: u32, marked: bool, thresholds: Option<&LuminanceThresholds>) {
        let thresholds = thresholds.map(|known| (known.of, &*known.delta, &*known.luminance));
        let goes_on = std::mem::take(&mut self.goes_on);
        self.say(&Sent::Frame { index, marked, goes_on, thresholds });
    }

    /// There is no further frame. With `state_wanted`, every rank gives its state once more.
    pub fn end(&mut self, state_wanted: bool) {
        let goes_on = std::mem::take(&mut self.goes_on);
        self.say(&Sent::End { state_wanted, goes_on });
        self.has_ended = true;
    }
}

impl Drop for Lead {
    fn drop(&mut self) {
        // A rank that panics says nothing: others may be in the middle of what it has left.
        if !std::thread::panicking() {
            self.end(false);
        }
    }
}
