//! Quantisation and inverse quantisation of whole blocks.

use super::vectorized;
use crate::dct::COEFFICIENT_BITS;
use lanes::{Choice, Kernel, Lanes};

/// Computes `(|value|·reciprocal + zero) >> shift` of every value, and returns a bit set of the non-zero results.
#[inline]
pub(crate) fn divide(values: &[i32; 64], reciprocals: &[u32; 64], zero: u32, shift: u32, out: &mut [u32; 64]) -> u64 {
    Choice::best().run(Divide { values, reciprocals, zero, shift, out })
}
/// Scalar version of [`divide`].
#[cfg(test)]
pub(super) fn divide_plain(
    values: &[i32; 64],
    reciprocals: &[u32; 64],
    zero: u32,
    shift: u32,
    out: &mut [u32; 64],
) -> u64 {
    Choice::SCALAR.run(Divide { values, reciprocals, zero, shift, out })
}

/// Kernel of [`divide`], with eight values at a time.
struct Divide<'a> {
    values: &'a [i32; 64],
    reciprocals: &'a [u32; 64],
    zero: u32,
    shift: u32,
    out: &'a mut [u32; 64],
}

impl Kernel for Divide<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> u64 {
        let (zero, empty) = (lanes.splat_i(self.zero as i32), lanes.splat_i(0));
        let (values, _) = self.values.as_chunks::<8>();
        let (reciprocals, _) = self.reciprocals.as_chunks::<8>();
        let (out, _) = self.out.as_chunks_mut::<8>();
        let mut nonzero = 0;
        for (i, ((values, reciprocals), out)) in values.iter().zip(reciprocals).zip(out).enumerate() {
            let products = lanes.mul_i(lanes.abs_i(lanes.load_i(values)), lanes.load_u32(reciprocals));
            let levels = lanes.shift_right_i(lanes.add_i(products, zero), self.shift);
            *out = lanes.store_u32(levels);
            // Collect one bit per non-zero level.
            nonzero |= u64::from(!lanes.bits(lanes.eq_i(levels, empty)) as u8) << (8 * i);
        }
        nonzero
    }
}

/// Maximum level of MPEG-2.
const LEVEL_MAX: u32 = 2047;

vectorized! {
    /// Restores the coefficients of a non-intra block from its levels, like an MPEG-2 decoder (7.4.2.3, 7.4.3), but without
    /// mismatch control. The restored coefficients have the signs of the original ones:
    ///
    /// ```text
    /// F'' = ±(2·|QF| + 1) · W · quantiser_scale / 32, or 0 for QF = 0      F' = F'' clamped to −2048 … 2047
    /// ```
    /// Levels are clamped to their limit. Returns the change of the squared error, in last places of the coefficients, and the
    /// sum of F'. The squares of all coefficients together fit into 31 bits, like the squares of 64 sample differences.
    fn restore, restore_plain(coefficients: &[i32; 64], scaled_weights: &[i32; 64], levels: &mut [u32; 64], restored: &mut [i32; 64]) -> (i32, i32) {
        let (mut change, mut sum) = (0, 0);
        for i in 0..64 {
            levels[i] = levels[i].min(LEVEL_MAX);
            let level = levels[i] as i32;
            let value = if level == 0 { 0 } else { ((2 * level + 1) * scaled_weights[i]) >> 5 };
            let before = coefficients[i].abs();
            let after = before - (value << COEFFICIENT_BITS);
            change += after * after - before * before;
            restored[i] = if coefficients[i] < 0 { -value } else { value }.clamp(-2048, 2047);
            sum += restored[i];
        }
        (change, sum)
    }
}
