//! Code that is compiled for every instruction set.

use crate::Lanes;

/// Computation that is written once for all implementations of [`Lanes`].
///
/// `run` and all functions that it calls with lanes are `#[inline(always)]`. They become part of a function that is
/// compiled for the vector instructions. Closures cannot be marked so, and a vector instruction inside a closure that
/// is not inlined becomes a call. Hot kernels therefore take traits as visitors and never map over lanes.
pub trait Kernel {
    /// Result of the computation.
    type Output;

    /// Runs the computation with one implementation of lanes.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}
