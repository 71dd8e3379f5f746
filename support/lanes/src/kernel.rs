//! Computations that are compiled for every instruction set.

use crate::Lanes;

/// A computation that is written once for all implementations of [`Lanes`].
///
/// `run`, and each function that `run` calls with lanes, is `#[inline(always)]`. All of them are inlined into a
/// function that is compiled for the vector instructions. Closures cannot have this attribute. A vector instruction
/// inside a closure that is not inlined becomes a function call. Hot kernels therefore use traits as visitors and never
/// map over lanes.
pub trait Kernel {
    /// Result of the computation.
    type Output;

    /// Runs the computation with one implementation of [`Lanes`].
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}
