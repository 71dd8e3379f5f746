//! Renderer, light tree, masking model and encoder, joined into one loop.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod checkpoint;
pub mod couple;
pub mod error;
pub mod laboratory;
pub mod message;
pub mod observe;
pub mod output;
pub mod reference;
pub mod renderer;
pub mod report;
pub mod settings;
pub mod stage;
pub mod video;

mod run;

pub use error::{Error, Result};
pub use renderer::plan::{self, Plan};
pub use report::Report;
pub use run::{render, render_from};
pub use settings::{Settings, Wishes};
