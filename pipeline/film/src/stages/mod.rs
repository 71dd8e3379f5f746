//! Stages of a film: display, masking and encoding.

pub mod display;
pub mod linear;
mod masking;
mod video;
mod weights;

pub use display::{Display, Y4m};
pub use masking::Masking;
pub use video::Video;
