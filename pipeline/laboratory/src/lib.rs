//! Measurement of films, and pages with the results. Crates that make films do not depend on this crate.
//!
//! - [`compare`]: differences between pictures, folders of pictures or videos and a reference.
//! - [`sweep`]: the same frames rendered by several methods and compared with a reference: error against run time.
//! - [`page`]: plots, tables and pictures as one HTML page; also the page of a single run.
//!
//! [`false_color`] and [`png_file`] are shared by comparisons and pages.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod compare;
pub mod false_color;
pub mod page;
pub mod png_file;
pub mod sweep;
