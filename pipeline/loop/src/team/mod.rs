//! A film that several processes make together, on one machine or on many.
//!
//! ```text
//! rank 0   Prepare ──► Shade ──► Display ──► Encode ──► Mask      thresholds flow back, files are written
//!             ║          ║
//! rank 1   Prepare ──► Shade                                      no files, no words
//!             ║          ║         ═  results of shared loops, by `ranks`
//! ```
//! Every rank prepares and shades every frame from the same state; inner loops are shared. Rank 0 says (`lead.rs`) which frame is
//! next, and with which thresholds, so nothing depends on the time that one of them takes. Before all that they compare by
//! [`muster`] what they are about to make.

mod lead;
mod muster;

pub use lead::Lead;
pub(crate) use lead::Order;
pub use muster::{Present, muster};

use ranks::{Alone, Mail, Ranks, ThreadMail};
use std::sync::Arc;

/// The ranks of a film, by the stages that share work: both work at the same time, each with messages of its own.
#[derive(Clone, Debug)]
pub struct Team {
    /// For [`Prepare`](crate::parts::Prepare).
    pub prepare: Arc<dyn Ranks>,
    /// For [`Shade`](crate::parts::Shade), and for what rank 0 says.
    pub shade: Arc<dyn Ranks>,
    /// Messages between two ranks, which are received beside the work.
    pub mail: Arc<dyn Mail>,
}

impl Team {
    /// This process alone.
    #[must_use]
    pub fn alone() -> Self {
        Self { prepare: Arc::new(Alone), shade: Arc::new(Alone), mail: Arc::new(ThreadMail::alone()) }
    }

    /// The number of this process.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.shade.rank()
    }

    /// Processes in all.
    #[must_use]
    pub fn count(&self) -> usize {
        self.shade.count()
    }
}
