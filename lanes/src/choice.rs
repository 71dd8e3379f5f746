//! Which instructions there are, and work that is compiled for them.

use crate::Lanes;
#[cfg(target_arch = "x86_64")]
use crate::avx2::Avx2;
use crate::scalar::Scalar;

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

/// The instructions to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
}

impl Choice {
    /// One number after the other, on any processor.
    pub const SCALAR: Self = Self(Kind::Scalar);

    /// The fastest instructions of this processor. The answer is kept: a call costs one load and one branch.
    #[inline(always)]
    #[must_use]
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = Avx2::detect() {
            return Self(Kind::Avx2(avx2));
        }
        Self::SCALAR
    }

    /// Whether vector instructions are used.
    #[inline(always)]
    #[must_use]
    pub fn is_vector(self) -> bool {
        self != Self::SCALAR
    }

    /// Runs `kernel` with these instructions.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Kind::Scalar => kernel.run(Scalar),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(avx2) => avx2.run(kernel),
        }
    }
}
