//! Films made by several processes together, on one machine or on many.
//!
//! ```text
//! rank 0   Prepare ──► Shade ──► Display ──► Encode ──► Mask      thresholds flow back, files are written
//!             ║          ║
//! rank 1   Prepare ──► Shade                                      no files, no words
//!             ║          ║         ═  results of shared loops, by `ranks`
//! ```
//! Every rank prepares and shades every frame from the same state; inner loops are shared. Rank 0 orders the next
//! frame with its thresholds (`lead.rs`), so no result depends on the timing of a rank. First, all ranks compare the
//! film that they are about to make ([`muster`]).

mod lead;
mod muster;

pub use lead::Lead;
pub(crate) use lead::Order;
pub use muster::{Present, muster};

use ranks::{Alone, Mail, Ranks, ThreadMail};
use std::sync::Arc;

/// Ranks of a film for each stage with shared work. Both stages work in parallel, with separate messages.
#[derive(Clone, Debug)]
pub struct Team {
    /// Ranks of [`Prepare`](crate::parts::Prepare).
    pub prepare: Arc<dyn Ranks>,
    /// Ranks of [`Shade`](crate::parts::Shade), also used for orders of rank 0.
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

    /// Number of this process.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.shade.rank()
    }

    /// Number of processes.
    #[must_use]
    pub fn count(&self) -> usize {
        self.shade.count()
    }
}
