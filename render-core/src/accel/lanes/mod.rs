//! Eight numbers at a time, by the processor's vector instructions where it has them and one by one where not.
//!
//! A [`Kernel`] is written once over the trait [`Lanes`]. Both implementations perform the same IEEE operations in the
//! same order, none of them fused, so that results do not depend on the processor.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod scalar;

use scalar::Scalar;

/// How many numbers stand side by side.
pub(crate) const LANES: usize = 8;

/// Operations on [`LANES`] numbers. The value that implements it is the proof that the processor can do them.
pub(crate) trait Lanes: Copy {
    /// Eight `f32`.
    type F: Copy;
    /// Eight answers, yes or no.
    type Mask: Copy;

    fn splat(self, x: f32) -> Self::F;
    fn load(self, x: &[f32; LANES]) -> Self::F;
    /// Lanes 0…3 and lanes 4…7 from two places.
    fn load_halves(self, low: &[f32; LANES / 2], high: &[f32; LANES / 2]) -> Self::F;
    fn store(self, x: Self::F) -> [f32; LANES];
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a < b ? a : b`, which is `b` where either is no number.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a > b ? a : b`, which is `b` where either is no number.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    fn lt(self, a: Self::F, b: Self::F) -> Self::Mask;
    fn le(self, a: Self::F, b: Self::F) -> Self::Mask;
    fn eq(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// `a < b` where the lanes hold the bits of signed integers.
    fn lt_bits(self, a: Self::F, b: Self::F) -> Self::Mask;
    fn and(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn or(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn select(self, mask: Self::Mask, yes: Self::F, no: Self::F) -> Self::F;
    /// Lane i as bit i.
    fn bits(self, mask: Self::Mask) -> u32;

    #[inline(always)]
    fn splat3(self, [x, y, z]: [f32; 3]) -> [Self::F; 3] {
        [self.splat(x), self.splat(y), self.splat(z)]
    }

    #[inline(always)]
    fn load3(self, [x, y, z]: [&[f32; LANES]; 3]) -> [Self::F; 3] {
        [self.load(x), self.load(y), self.load(z)]
    }

    #[inline(always)]
    fn sub3(self, a: [Self::F; 3], b: [Self::F; 3]) -> [Self::F; 3] {
        [self.sub(a[0], b[0]), self.sub(a[1], b[1]), self.sub(a[2], b[2])]
    }

    #[inline(always)]
    fn mul3(self, a: [Self::F; 3], b: [Self::F; 3]) -> [Self::F; 3] {
        [self.mul(a[0], b[0]), self.mul(a[1], b[1]), self.mul(a[2], b[2])]
    }

    #[inline(always)]
    fn min3(self, a: [Self::F; 3], b: [Self::F; 3]) -> [Self::F; 3] {
        [self.min(a[0], b[0]), self.min(a[1], b[1]), self.min(a[2], b[2])]
    }

    #[inline(always)]
    fn max3(self, a: [Self::F; 3], b: [Self::F; 3]) -> [Self::F; 3] {
        [self.max(a[0], b[0]), self.max(a[1], b[1]), self.max(a[2], b[2])]
    }

    /// The greatest of three and a fourth.
    #[inline(always)]
    fn greatest(self, [x, y, z]: [Self::F; 3], least: Self::F) -> Self::F {
        self.max(self.max(x, y), self.max(z, least))
    }

    /// The least of three and a fourth.
    #[inline(always)]
    fn least(self, [x, y, z]: [Self::F; 3], greatest: Self::F) -> Self::F {
        self.min(self.min(x, y), self.min(z, greatest))
    }
}

/// Work to be done with lanes of one kind or the other.
///
/// `run` and all that it calls with lanes are `#[inline(always)]`: they become part of a function that is compiled for the
/// vector instructions, and are compiled for them with it. Closures cannot be marked so, and an instruction within one
/// that is not inlined becomes a call: that is why visitors here are traits, and why nothing maps over lanes.
pub(crate) trait Kernel {
    type Output;
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// The lanes to use, chosen once: asking the processor for each ray would cost more than the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Choice {
    /// One by one.
    Scalar,
    /// By AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2(avx2::Avx2),
}

impl Choice {
    /// The fastest that this processor has.
    pub(crate) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = avx2::Avx2::detect() {
            return Self::Avx2(avx2);
        }
        Self::Scalar
    }

    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Scalar => kernel.run(Scalar),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(avx2) => avx2.run(kernel),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash;

    /// Every operation on numbers of all kinds: ordinary ones, zeros of both signs, infinities, no numbers.
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
                lanes.min(a, b),
                lanes.max(a, b),
                lanes.select(masks[0], a, b),
                lanes.select(lanes.or(lanes.and(masks[1], masks[2]), masks[3]), lanes.splat(self.0[3]), b),
                lanes.load_halves(self.1.first_chunk().unwrap(), self.0.last_chunk().unwrap()),
            ];
            let canonical = |x: f32| if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() };
            (
                numbers.iter().flat_map(|&x| lanes.store(x).map(canonical)).collect(),
                masks.iter().map(|&mask| lanes.bits(mask)).collect(),
            )
        }
    }

    #[test]
    fn vector_instructions_do_what_the_scalar_twin_does() {
        let best = Choice::best();
        if best == Choice::Scalar {
            println!("skipped: this processor has no AVX2");
            return;
        }
        let special = [0.0, -0.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1.0, f32::MIN_POSITIVE / 8.0, f32::MAX];
        let number = |key: u64, lane: usize| {
            let bits = hash(7, key, lane as u64);
            if bits.is_multiple_of(3) { special[bits as usize / 3 % 8] } else { f32::from_bits((bits >> 20) as u32) }
        };
        for key in 0..if cfg!(miri) { 20 } else { 2000u64 } {
            let (a, b) = (std::array::from_fn(|i| number(2 * key, i)), std::array::from_fn(|i| number(2 * key + 1, i)));
            assert_eq!(best.run(Everything(&a, &b)), Choice::Scalar.run(Everything(&a, &b)), "{a:?} {b:?}");
        }
    }
}
