//! Groups of sixteen samples, and their differences.
//!
//! On x86-64 these operations use instructions that every x86-64 processor has, on other processors plain loops. No
//! run-time detection is needed, so all functions are inlined.
//!
//! Compilers do not vectorize sums of byte differences or transpositions in loops. With these functions, plain
//! differences at half-sample positions take a third of the time, transformed differences half.

#[cfg(any(test, not(all(target_arch = "x86_64", target_feature = "sse2"))))]
mod plain;
#[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
mod sse2;

#[cfg(not(all(target_arch = "x86_64", target_feature = "sse2")))]
pub use plain::{Bytes, Words};
#[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
pub use sse2::{Bytes, Words};

use crate::samples::Memory;

macro_rules! memory {
    ($Bytes:ty) => {
        #[allow(unsafe_code, reason = "samples are read and written without a check for each")]
        impl Memory for $Bytes {
            #[inline(always)]
            unsafe fn load<const N: usize>(first: *const u8, stride: usize) -> Self {
                // SAFETY: the caller guarantees that the samples are accessible.
                unsafe {
                    if N == 16 {
                        Self::load(&*first.cast())
                    } else {
                        Self::new(*first.cast(), *first.add(stride).cast())
                    }
                }
            }

            #[inline(always)]
            unsafe fn store<const N: usize>(self, first: *mut u8, stride: usize) {
                let [low, high] = self.halves();
                // SAFETY: the caller guarantees that the samples are accessible.
                unsafe {
                    *first.cast() = low;
                    *first.add(if N == 16 { 8 } else { stride }).cast() = high;
                }
            }
        }
    };
}

memory!(Bytes);
#[cfg(all(test, target_arch = "x86_64", target_feature = "sse2"))]
memory!(plain::Bytes);

#[cfg(all(test, target_arch = "x86_64", target_feature = "sse2"))]
mod tests {
    use super::{plain, sse2};
    use crate::samples::{Differences, Samples, Sum};

    /// Calls every function of a module on the same sixteen bytes. `Words` are opaque, so their products with other
    /// words reveal the content.
    macro_rules! results {
        ($lanes:ident, $bytes:expr) => {{
            let [a, b, c, d] = $bytes.map(|[low, high]: [[u8; 8]; 2]| $lanes::Bytes::new(low, high));
            let ([w0, w1], [w2, w3]) = (a.minus(b), c.minus(d));
            let words = [w0, w1, w2, w3, w0.plus(w1), w1.minus(w2), w2.abs(), w3.max(w0)];
            let columns = $lanes::Words::transposed(words);
            let dots: Vec<i32> = words.iter().chain(&columns).flat_map(|w| columns.map(|c| w.dot(c))).collect();
            let sum = a.absolute(b).total();
            let squares = $lanes::Squared::zero().plus(w0.squares()).plus(w1.squares()).total();
            let loaded = $lanes::Bytes::load($bytes[0].as_flattened().try_into().unwrap()).mean(d);
            let means = [a.mean(b), Samples::mean_of_four([a, b, c, d]), loaded].map($lanes::Bytes::halves);
            (means, sum, squares, dots)
        }};
    }

    #[test]
    fn both_ways_give_the_same() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..if cfg!(miri) { 4 } else { 1000 } {
            let bytes: [[[u8; 8]; 2]; 4] =
                std::array::from_fn(|_| std::array::from_fn(|_| std::array::from_fn(|_| random.u8(..))));
            assert_eq!(results!(sse2, bytes), results!(plain, bytes));
        }
    }
}
