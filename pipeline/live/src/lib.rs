//! Walks through lit scenes in a browser: pictures on demand, steered by viewers and by their lines.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod camera;
pub mod controls;
pub mod error;
pub mod flow;
pub mod message;
pub mod picture;
pub mod server;
pub mod session;

pub use error::{LiveError, LiveResult};
pub use picture::{Detail, LiveLoop, LivePicture, LivePlans, PictureRequest};

/// Crates with types in public signatures, re-exported.
pub use {mpeg2enc, pipeline, render_core, render2mpeg, renderer};
