//! Selection of the instructions that the processor supports.

use crate::Kernel;
#[cfg(target_arch = "x86_64")]
use crate::avx2::Avx2;
use crate::scalar::Scalar;

/// The instruction set that runs a [`Kernel`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice(ChoiceKind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ChoiceKind {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
}

impl Choice {
    /// Scalar instructions, available on any processor.
    pub const SCALAR: Self = Self(ChoiceKind::Scalar);

    /// Returns the fastest instruction set of this processor. The result is cached, so a call takes one load and one
    /// branch.
    #[inline(always)]
    #[must_use]
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = Avx2::detect() {
            return Self(ChoiceKind::Avx2(avx2));
        }
        Self::SCALAR
    }

    /// Returns whether this instruction set contains vector instructions.
    #[inline(always)]
    #[must_use]
    pub fn is_vector(self) -> bool {
        self != Self::SCALAR
    }

    /// Runs `kernel` with this instruction set.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            ChoiceKind::Scalar => kernel.run(Scalar),
            #[cfg(target_arch = "x86_64")]
            ChoiceKind::Avx2(avx2) => avx2.run(kernel),
        }
    }
}
