#![doc = include_str!("../README.md")]
#![deny(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2; // by vector instructions
mod bytes; // sixteen samples, on any processor
mod choice; // which instructions there are
mod eight; // the operations
mod kernel; // work made of them
mod samples; // of pictures: blocks in a plane
mod scalar; // the twin

pub use crate::bytes::{Bytes, Words};
pub use crate::choice::Choice;
pub use crate::eight::{LANES, Lanes};
pub use crate::kernel::Kernel;
pub use crate::samples::{Differences, Samples, Sum, Window, WindowMut};
