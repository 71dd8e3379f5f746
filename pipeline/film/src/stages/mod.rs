//! A film: radiance into pictures, pictures into a stream, the stream into a file; and the thresholds that follow from it.

pub mod display;
pub mod linear;
mod masking;
mod video;
mod weights;

pub use display::{Display, Y4m};
pub use masking::Masking;
pub use video::Video;
