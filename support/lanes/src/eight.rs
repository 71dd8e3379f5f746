//! Operations on eight lanes.

use crate::{Bytes, Differences, Samples};
use std::fmt::Debug;

/// Number of lanes.
pub const LANES: usize = 8;

/// Operations on [`LANES`] numbers of 32 bits.
///
/// A value of an implementing type proves that the processor has the instructions. The type alone proves it too,
/// because code outside this crate cannot name it and receives it only as the parameter of
/// [`Kernel::run`](crate::Kernel::run).
///
/// All implementations perform the same IEEE operations in the same order, without fusion, so results do not depend
/// on the processor. Only the bits of NaN results may differ.
pub trait Lanes: Copy + Debug {
    /// The only value of this type, for overloaded operators, which cannot receive it as an argument.
    const PROOF: Self;

    /// Eight `f32`.
    type F: Copy + Debug;
    /// Eight `i32`. Sums and products wrap to the low 32 bits.
    type I: Copy + Debug;
    /// Eight flags.
    type Mask: Copy + Debug;
    /// A register of picture samples.
    type Samples: Samples;
    /// Difference rows of two adjacent blocks.
    type Words: Differences;

    /// Returns the same number in all lanes.
    fn splat(self, x: f32) -> Self::F;
    /// Loads lane i from element i.
    fn load(self, x: &[f32; LANES]) -> Self::F;
    /// Loads lanes 0…3 from `low` and lanes 4…7 from `high`.
    fn load_halves(self, low: &[f32; LANES / 2], high: &[f32; LANES / 2]) -> Self::F;
    /// Returns an array with lane i in element i.
    fn store(self, x: Self::F) -> [f32; LANES];
    /// Stores lanes 0…3 to `low` and lanes 4…7 to `high`.
    fn store_halves(self, x: Self::F, low: &mut [f32; LANES / 2], high: &mut [f32; LANES / 2]);
    /// Returns `a + b` for each lane.
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    /// Returns `a - b` for each lane.
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    /// Returns `a * b` for each lane.
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    /// Returns `a / b` for each lane.
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// Returns `-a`: the sign of every lane is reversed, even the sign of a zero.
    fn neg(self, a: Self::F) -> Self::F;
    /// Returns the absolute value of each lane.
    fn abs(self, a: Self::F) -> Self::F;
    /// Returns the square root of each lane, correctly rounded.
    fn sqrt(self, a: Self::F) -> Self::F;
    /// Returns `a < b ? a : b`, which is `b` if either is NaN or both are zeros.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// Returns `a > b ? a : b`, which is `b` if either is NaN or both are zeros.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    /// Returns `a < b` for each lane.
    fn lt(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// Returns `a <= b` for each lane.
    fn le(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// Returns `a == b` for each lane.
    fn eq(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// Returns `a < b`, with the lanes interpreted as signed integers.
    fn lt_bits(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// Returns the logical AND of two masks.
    fn and(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Returns the logical OR of two masks.
    fn or(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Returns `yes` where the mask is set, `no` elsewhere.
    fn select(self, mask: Self::Mask, yes: Self::F, no: Self::F) -> Self::F;
    /// Returns the mask of lane i as bit i.
    fn bits(self, mask: Self::Mask) -> u32;
    /// Returns the transposed rows: lane j of element i becomes lane i of element j.
    fn transposed(self, rows: [Self::F; LANES]) -> [Self::F; LANES];

    /// Returns the same integer in all lanes.
    fn splat_i(self, x: i32) -> Self::I;
    /// Loads lane i from element i.
    fn load_i(self, x: &[i32; LANES]) -> Self::I;
    /// Loads lane i from element i, with unchanged bits.
    fn load_u32(self, x: &[u32; LANES]) -> Self::I;
    /// Loads lane i from element i, zero-extended.
    fn load_u8(self, x: &[u8; LANES]) -> Self::I;
    /// Returns an array with lane i in element i.
    fn store_i(self, x: Self::I) -> [i32; LANES];
    /// Returns an array with the unchanged bits of lane i in element i.
    fn store_u32(self, x: Self::I) -> [u32; LANES];
    /// Returns `a + b` for each lane.
    fn add_i(self, a: Self::I, b: Self::I) -> Self::I;
    /// Returns `a - b` for each lane.
    fn sub_i(self, a: Self::I, b: Self::I) -> Self::I;
    /// Returns the low 32 bits of `a * b` for each lane.
    fn mul_i(self, a: Self::I, b: Self::I) -> Self::I;
    /// Returns the absolute value of each lane, as an unsigned number.
    fn abs_i(self, a: Self::I) -> Self::I;
    /// Shifts right by `by` bits, 0…31, and fills with zeros.
    fn shift_right_i(self, a: Self::I, by: u32) -> Self::I;
    /// Returns `a == b` for each lane.
    fn eq_i(self, a: Self::I, b: Self::I) -> Self::Mask;
    /// Returns the sum of all lanes, wrapped to 32 bits.
    fn sum_i(self, a: Self::I) -> i32;
    /// Converts each lane to the nearest `f32`, ties to even.
    fn to_f(self, a: Self::I) -> Self::F;
    /// Reinterprets the bits of floats as integers.
    fn to_bits(self, a: Self::F) -> Self::I;
    /// Returns lane j of element i as byte 8·i + j, clamped to 0…255.
    fn to_u8(self, rows: [Self::I; 4]) -> [u8; 4 * LANES];

    /// Returns the differences between two groups of sixteen samples.
    fn differences(self, samples: Bytes, minus: Bytes) -> Self::Words;

    /// Returns three coordinates, each repeated in all lanes.
    #[inline(always)]
    fn splat3(self, [x, y, z]: [f32; 3]) -> [Self::F; 3] {
        [self.splat(x), self.splat(y), self.splat(z)]
    }

    /// Loads the lanes of three coordinates.
    #[inline(always)]
    fn load3(self, [x, y, z]: [&[f32; LANES]; 3]) -> [Self::F; 3] {
        [self.load(x), self.load(y), self.load(z)]
    }

    /// Returns `a - b` for each lane of three coordinates.
    #[inline(always)]
    fn sub3(self, a: [Self::F; 3], b: [Self::F; 3]) -> [Self::F; 3] {
        [self.sub(a[0], b[0]), self.sub(a[1], b[1]), self.sub(a[2], b[2])]
    }

    /// Returns `a * b` for each lane of three coordinates.
    #[inline(always)]
    fn mul3(self, a: [Self::F; 3], b: [Self::F; 3]) -> [Self::F; 3] {
        [self.mul(a[0], b[0]), self.mul(a[1], b[1]), self.mul(a[2], b[2])]
    }

    /// Returns the minimum of `a` and `b` for each lane of three coordinates.
    #[inline(always)]
    fn min3(self, a: [Self::F; 3], b: [Self::F; 3]) -> [Self::F; 3] {
        [self.min(a[0], b[0]), self.min(a[1], b[1]), self.min(a[2], b[2])]
    }

    /// Returns the maximum of `a` and `b` for each lane of three coordinates.
    #[inline(always)]
    fn max3(self, a: [Self::F; 3], b: [Self::F; 3]) -> [Self::F; 3] {
        [self.max(a[0], b[0]), self.max(a[1], b[1]), self.max(a[2], b[2])]
    }

    /// Returns the maximum of three numbers and `least`, for each lane.
    #[inline(always)]
    fn greatest(self, [x, y, z]: [Self::F; 3], least: Self::F) -> Self::F {
        self.max(self.max(x, y), self.max(z, least))
    }

    /// Returns the minimum of three numbers and `greatest`, for each lane.
    #[inline(always)]
    fn least(self, [x, y, z]: [Self::F; 3], greatest: Self::F) -> Self::F {
        self.min(self.min(x, y), self.min(z, greatest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Choice, Kernel};
    use fastrand::Rng;

    /// Kernel that applies every floating-point operation to two sets of numbers.
    struct Everything<'a>(&'a [f32; LANES], &'a [f32; LANES]);

    impl Kernel for Everything<'_> {
        type Output = (Vec<u32>, Vec<u32>);

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) -> Self::Output {
            let (a, b) = (lanes.load(self.0), lanes.load(self.1));
            let masks = [lanes.lt(a, b), lanes.le(a, b), lanes.eq(a, b), lanes.lt_bits(a, b)];
            let numbers = [
                lanes.add(a, b),
                lanes.sub(a, b),
                lanes.mul(a, b),
                lanes.div(a, b),
                lanes.neg(a),
                lanes.abs(a),
                lanes.sqrt(a),
                lanes.min(a, b),
                lanes.max(a, b),
                lanes.select(masks[0], a, b),
                lanes.select(lanes.or(lanes.and(masks[1], masks[2]), masks[3]), lanes.splat(self.0[3]), b),
                lanes.load_halves(self.1.first_chunk().unwrap(), self.0.last_chunk().unwrap()),
            ];
            let rows = [a, b, lanes.add(a, b), lanes.sub(a, b), lanes.mul(a, b), lanes.max(a, b), lanes.min(a, b), b];
            let (mut low, mut high) = ([0.0; 4], [0.0; 4]);
            lanes.store_halves(a, &mut low, &mut high);
            let canonical = |x: f32| if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() };
            let stored = numbers.into_iter().chain(lanes.transposed(rows)).flat_map(|x| lanes.store(x));
            (
                stored.chain(low).chain(high).map(canonical).collect(),
                masks.iter().map(|&mask| lanes.bits(mask)).collect(),
            )
        }
    }

    /// Kernel that applies every integer operation to two sets of integers.
    struct Integers<'a>(&'a [i32; LANES], &'a [i32; LANES]);

    impl Kernel for Integers<'_> {
        type Output = (Vec<i32>, Vec<u32>, [u8; 32]);

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) -> Self::Output {
            let (a, b) = (lanes.load_i(self.0), lanes.load_i(self.1));
            let bytes = self.1.map(|x| x as u8);
            let integers = [
                lanes.add_i(a, b),
                lanes.sub_i(a, b),
                lanes.mul_i(a, b),
                lanes.abs_i(a),
                lanes.shift_right_i(a, self.1[0] as u32 % 32),
                lanes.load_u8(&bytes),
                lanes.load_u32(&self.1.map(|x| x as u32)),
                lanes.load_u32(&lanes.store_u32(a)),
                lanes.splat_i(self.0[1]),
                lanes.to_bits(lanes.to_f(a)),
            ];
            (
                integers.into_iter().flat_map(|x| lanes.store_i(x)).chain([lanes.sum_i(a)]).collect(),
                vec![lanes.bits(lanes.eq_i(a, b)), lanes.bits(lanes.eq_i(a, a))],
                lanes.to_u8([a, b, lanes.shift_right_i(a, 23), lanes.load_u8(&bytes)]),
            )
        }
    }

    #[test]
    fn vector_instructions_have_the_bits_of_the_scalar_twin() {
        let best = Choice::best();
        if !best.is_vector() {
            println!("skipped: no vector instructions for this processor");
            return;
        }
        let special = [0.0, -0.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1.0, f32::MIN_POSITIVE / 8.0, f32::MAX];
        let mut random = Rng::with_seed(7);
        let mut number = || {
            let bits = random.u32(..);
            if bits.is_multiple_of(3) { special[bits as usize / 3 % 8] } else { f32::from_bits(random.u32(..)) }
        };
        for _ in 0..if cfg!(miri) { 20 } else { 2000 } {
            let (a, b) = (std::array::from_fn(|_| number()), std::array::from_fn(|_| number()));
            assert_eq!(best.run(Everything(&a, &b)), Choice::SCALAR.run(Everything(&a, &b)), "{a:?} {b:?}");
        }
        let special = [0, 1, -1, i32::MAX, i32::MIN, 255, 256, -32769];
        let mut random = Rng::with_seed(8);
        let mut number = || {
            let bits = random.u32(..);
            if bits.is_multiple_of(3) { special[bits as usize / 3 % 8] } else { random.i32(..) }
        };
        for _ in 0..if cfg!(miri) { 20 } else { 2000 } {
            let (a, b) = (std::array::from_fn(|_| number()), std::array::from_fn(|_| number()));
            assert_eq!(best.run(Integers(&a, &b)), Choice::SCALAR.run(Integers(&a, &b)), "{a:?} {b:?}");
        }
    }

    /// Minimum and maximum match C's `a < b ? a : b` for ±0 and NaN, independent of the processor's instructions.
    #[test]
    fn least_and_greatest_of_zeros_and_of_what_is_not_a_number() {
        struct Extremes(f32, f32);
        impl Kernel for Extremes {
            type Output = [f32; 2];
            #[inline(always)]
            fn run<L: Lanes>(self, lanes: L) -> [f32; 2] {
                let (a, b) = (lanes.splat(self.0), lanes.splat(self.1));
                [lanes.store(lanes.min(a, b))[0], lanes.store(lanes.max(a, b))[0]]
            }
        }
        for choice in [Choice::SCALAR, Choice::best()] {
            let bits = |a, b| choice.run(Extremes(a, b)).map(f32::to_bits);
            assert_eq!(bits(0.0, -0.0), [(-0.0f32).to_bits(); 2]);
            assert_eq!(bits(-0.0, 0.0), [0; 2]);
            assert_eq!(bits(f32::NAN, 1.0), [1.0f32.to_bits(); 2]);
            assert!(choice.run(Extremes(1.0, f32::NAN)).iter().all(|x| x.is_nan()));
        }
    }
}
