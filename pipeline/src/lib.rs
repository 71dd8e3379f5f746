//! Renderer, light tree, masking model and encoder, joined into one loop.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod checkpoint;
#[cfg(feature = "compare")]
pub mod compare;
pub mod couple;
#[cfg(feature = "compare")]
pub mod false_color;
pub mod message;
pub mod observe;
pub mod output;
#[cfg(feature = "html")]
pub mod page;
pub mod plan;
#[cfg(feature = "compare")]
pub mod png_file;
pub mod reference;
pub mod report;
pub mod settings;
pub mod stage;
#[cfg(feature = "sweep")]
pub mod sweep;
pub mod video;

mod run;

pub use plan::Plan;
pub use report::Report;
pub use run::{render, render_from};
pub use settings::{Settings, Wishes};
