//! Code tables, scans, header numbers and the inverse DCT of MPEG-1 and MPEG-2 video.
//!
//! Clause and table numbers refer to ISO/IEC 13818-2:2000 unless they begin with 11172-2.
#![forbid(unsafe_code)]

mod inverse; // inverse DCT
mod numbers; // quantiser scales, frame rates, aspect ratios
pub mod scan;
mod standard; // MPEG-1 or MPEG-2
pub mod tables;
mod vlc; // code words

pub use crate::{
    inverse::{COSINE, COSINE_BITS, inverse_onto},
    numbers::{FRAME_RATES, NON_LINEAR_SCALES, PEL_ASPECT_RATIOS},
    standard::Standard,
    vlc::Vlc,
};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
