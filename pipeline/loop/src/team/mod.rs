//! Films made by several processes together, on one machine or on many.
//!
//! ```text
//! rank 0   Prepare ──► Shade ──► Display ──► Encode ──► Mask      thresholds flow back, files are written
//!             ║          ║
//! rank 1   Prepare ──► Shade                                      writes and prints nothing
//!             ║          ║         ═  results of shared loops, exchanged by `ranks`
//! ```
//! Every rank prepares and shades every frame from the same state; the ranks share the work of inner loops. Rank 0
//! orders the next frame with its thresholds (`lead.rs`), so no result depends on the timing of a rank. Before the
//! first frame, all ranks check that they make the same film ([`muster`]).

mod lead;
mod muster;

pub use lead::Lead;
pub(crate) use lead::Order;
pub use muster::{Present, muster};

use ranks::{Alone, Mail, Ranks, ThreadMail};
use std::sync::Arc;

/// Communication between the ranks of a film. Both stages with shared work run in parallel, with separate messages.
#[derive(Clone, Debug)]
pub struct Team {
    /// Communication of [`Prepare`](crate::stage::Prepare).
    pub prepare: Arc<dyn Ranks>,
    /// Communication of [`Shade`](crate::stage::Shade), also used for orders of rank 0.
    pub shade: Arc<dyn Ranks>,
    /// Messages between two ranks, received in parallel with the work.
    pub mail: Arc<dyn Mail>,
}

impl Team {
    /// Returns a team of this process alone.
    #[must_use]
    pub fn alone() -> Self {
        Self { prepare: Arc::new(Alone), shade: Arc::new(Alone), mail: Arc::new(ThreadMail::alone()) }
    }

    /// Returns the number of this process, from 0.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.shade.rank()
    }

    /// Returns the number of processes.
    #[must_use]
    pub fn count(&self) -> usize {
        self.shade.count()
    }
}
