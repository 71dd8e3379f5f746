//! Rendering of scenes into films with global illumination.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod also;
pub mod error;
pub mod job;
pub mod join;
mod light_file;
pub mod memory;
mod open;
pub mod picture_file;
pub mod places;
mod render;
pub mod report;
pub mod settings;
mod shading;
pub mod stages;
pub mod still;
pub mod transparency;

pub use error::{Error, Result};
pub use light_file::make_light;
pub use open::Film;
pub use render::{Render, render};
pub use report::Report;
pub use settings::{Options, Settings};

/// Crates with types in public signatures, re-exported.
pub use {mpeg2enc, perceptual, pipeline, plane, render_core, renderer};
