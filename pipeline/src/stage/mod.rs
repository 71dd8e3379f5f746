//! The stages of the pipeline, in the order that a frame passes them. Each is a plain thread between channels.
//!
//! A stage ends when the channel it reads from is closed, or when nobody reads what it writes: then
//! someone behind it has failed, and the driver will report that.

pub mod display;
pub mod encode;
pub mod mask;
pub mod prepare;
pub mod shade;
