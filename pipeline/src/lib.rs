//! Renderer, light tree, masking model and encoder, joined into one loop.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod also;
#[cfg(feature = "bake")]
pub mod bake;
#[cfg(feature = "command-line")]
pub mod command_line;
pub mod early_end;
pub mod error;
pub mod feedback_loop;
pub mod figures;
pub mod film;
pub mod join;
pub mod laboratory;
pub mod memory;
pub mod output;
pub mod parts;
pub mod picture_file;
pub mod places;
pub mod ranks;
pub mod renderer;
pub mod report;
pub mod settings;
pub mod still;

mod open;
mod render;
mod state;

pub use error::{Error, Result};
pub use open::Film;
pub use render::{Render, render};
pub use renderer::plan::{self, Plan};
pub use report::Report;
pub use settings::{Options, Settings};

/// The crates whose types stand in signatures.
pub use {glam, lighttree, mpeg2enc, perceptual, plane, render_core};
