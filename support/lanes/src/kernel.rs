//! Work that is compiled for every kind of instructions.

use crate::Lanes;

/// Work that is written once for all kinds of [`Lanes`].
///
/// `run` and all that it calls with lanes are `#[inline(always)]`: they become part of a function that is compiled for
/// the vector instructions, and are compiled for them with it. Closures cannot be marked so, and an instruction within
/// one that is not inlined becomes a call. Hot kernels therefore take traits as visitors, and never map over lanes.
pub trait Kernel {
    /// Result of the work.
    type Output;

    /// Does the work with lanes of one kind.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}
