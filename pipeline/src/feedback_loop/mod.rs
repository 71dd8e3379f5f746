//! The idea of this project: thresholds flow back from the encoder to the renderer, exactly one frame late.
//!
//! ```text
//!  Prepare(n+1) ──► Shade(n) ──► Display ──► Encode ──► Mask
//!                     ▲                                  │
//!                     └── ΔY(n−1) along the motion ◄─────┘
//! ```
//! `driver` joins the [`parts`](crate::parts) by bounded channels, `threads` runs one stage on one thread, [`checkpoint`]
//! continues interrupted films, `follow` is the loop on the ranks that are led, [`observe`] shows the results of the stages.

pub mod checkpoint;
mod driver;
mod follow;
mod log;
pub mod observe;
mod stages;
mod start;
mod threads;

pub use driver::{Run, couple};
pub(crate) use follow::follow;
pub use start::{Parts, Start};
