#![doc = include_str!("../README.md")]
#![deny(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2; // vector instructions
mod bytes; // sixteen samples, on any processor
mod choice; // supported instructions
mod eight; // operations on eight lanes
mod kernel; // code over lanes
mod samples; // picture samples: blocks in a plane
mod scalar; // scalar implementation

pub use crate::bytes::{Bytes, Words};
pub use crate::choice::Choice;
pub use crate::eight::{LANES, Lanes};
pub use crate::kernel::Kernel;
pub use crate::samples::{Differences, Samples, Sum, Window, WindowMut};
