//! The idea of this project: thresholds flow back from the encoder to the renderer, exactly one frame late.
//!
//! ```text
//!  Prepare(n+1) ──► Shade(n) ──► Display ──► Encode ──► Mask
//!                     ▲                                  │
//!                     └── ΔY(n−1) along the motion ◄─────┘
//! ```
//! [`parts`] has the four parts as state machines, `driver` joins them by bounded channels, `threads` runs one stage on one
//! thread, [`checkpoint`] continues interrupted films, [`observe`] shows what the stages make.

pub mod checkpoint;
mod driver;
pub mod figures;
mod log;
pub mod observe;
pub mod parts;
mod stages;
mod start;
mod threads;

pub use driver::{Run, couple};
pub use start::{Parts, Start};
