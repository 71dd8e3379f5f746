#![doc = include_str!("../README.md")]
#![deny(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2; // vector instructions
mod bytes; // sixteen samples, on any processor
mod choice; // selection of the supported instructions
mod eight; // operations on eight lanes
mod kernel; // computations over lanes
mod samples; // blocks of picture samples
mod scalar; // scalar implementation

pub use crate::bytes::{Bytes, Words};
pub use crate::choice::Choice;
pub use crate::eight::{LANES, Lanes};
pub use crate::kernel::Kernel;
pub use crate::samples::{Differences, Samples, Sum, Window, WindowMut};
