//! The laboratory: what measures films and shows the figures. No film needs any of it.
//!
//! - [`compare`]: how far pictures, folders of pictures and videos are from others.
//! - [`sweep`]: the same frames by several methods beside a reference; error against run time.
//! - [`page`]: plots, and plots, tables and pictures as one HTML page; also the page of a single run.
//!
//! Each is a room with a feature of the same name, `html` for the pages. The loop and the renderer know none of them.

#[cfg(feature = "compare")]
pub mod compare;
#[cfg(feature = "html")]
pub mod page;
#[cfg(feature = "sweep")]
pub mod sweep;
