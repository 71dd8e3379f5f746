//! The loop of renderer, display, encoder and masking model: thresholds flow back exactly one frame late.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod checkpoint;
pub mod chunks;
mod driver;
pub mod early_end;
pub mod error;
pub mod exposure;
pub mod figures;
mod follow;
mod log;
pub mod observe;
pub mod output;
mod pace;
pub mod report;
pub mod sealed;
pub mod stage;
mod stages;
mod start;
pub mod state;
pub mod streams;
pub mod team;
mod threads;

pub use driver::{Run, couple};
pub use error::{Error, Result};
pub use follow::follow;
pub use start::{Stages, Start};

/// Crates that define types in public signatures.
pub use {perceptual, plane};
