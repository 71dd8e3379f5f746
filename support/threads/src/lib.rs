//! Parallel loops of `rayon`, or the same loops on the calling thread.
//!
//! A library writes its loops once, with the names of `rayon`. Its feature `parallel` enables the feature `rayon` of
//! this crate. Without this feature the loops are iterators of the standard library, for targets without threads.
//!
//! ```
//! use threads::prelude::*;
//!
//! let mut samples = [3, 1, 4, 1, 5, 9];
//! samples.par_chunks_mut(2).enumerate().for_each(|(row, chunk)| chunk[0] += 10 * row);
//! assert_eq!(samples, [3, 1, 14, 1, 25, 9]);
//! ```
#![forbid(unsafe_code)]

#[cfg(feature = "rayon")]
pub use rayon::{join, prelude};

#[cfg(any(test, not(feature = "rayon")))]
mod sequential;

#[cfg(not(feature = "rayon"))]
pub use sequential::{join, prelude};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
