//! The laboratory: what measures films and shows the figures. No film needs any of it.
//!
//! - [`compare`]: how far pictures, folders of pictures and videos are from others.
//! - [`sweep`]: the same frames by several methods beside a reference; error against run time.
//! - [`page`]: plots, and plots, tables and pictures as one HTML page; also the page of a single run.
//!
//! Each is a room with a feature of the same name, `html` for the pages. The loop and the renderer know none of them.
//! [`false_color`] and [`png_file`] are pictures for both comparisons and pages.

#[cfg(feature = "compare")]
pub mod compare;
#[cfg(any(feature = "compare", feature = "html"))]
pub mod false_color;
#[cfg(feature = "html")]
pub mod page;
#[cfg(any(feature = "compare", feature = "html"))]
pub mod png_file;
#[cfg(feature = "sweep")]
pub mod sweep;
