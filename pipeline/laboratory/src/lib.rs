//! Measurements of films, and pages of the results. Films do not depend on this crate.
//!
//! - [`compare`]: differences of pictures, folders of pictures and videos from a reference.
//! - [`sweep`]: the same frames by several methods, compared with a reference: error against run time.
//! - [`page`]: plots, tables and pictures as one HTML page; also the page of a single run.
//!
//! [`false_color`] and [`png_file`] serve both comparisons and pages.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod compare;
pub mod false_color;
pub mod page;
pub mod png_file;
pub mod sweep;
