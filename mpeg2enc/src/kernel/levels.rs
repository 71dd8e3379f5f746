//! From coefficients to levels and back, all of a block at once.

use super::vectorised;
use crate::dct::COEFFICIENT_BITS;

/// `(|value|·reciprocal + zero) >> shift` of every value, and a bit for each that is not zero.
#[inline]
#[allow(unsafe_code, reason = "a function with AVX2 is called after a check that the processor has it")]
pub(crate) fn divide(values: &[i32; 64], reciprocals: &[u32; 64], zero: u32, shift: u32, out: &mut [u32; 64]) -> u64 {
    #[cfg(target_arch = "x86_64")]
    if super::has_avx2() {
        // SAFETY: the processor has AVX2.
        return unsafe { super::blocks::divide(values, reciprocals, zero, shift, out) };
    }
    divide_plain(values, reciprocals, zero, shift, out)
}

/// [`divide`] for any processor.
pub(super) fn divide_plain(
    values: &[i32; 64],
    reciprocals: &[u32; 64],
    zero: u32,
    shift: u32,
    out: &mut [u32; 64],
) -> u64 {
    let mut nonzero = 0;
    for i in 0..64 {
        out[i] = (values[i].unsigned_abs() * reciprocals[i] + zero) >> shift;
        nonzero |= u64::from(out[i] != 0) << i;
    }
    nonzero
}

/// The largest level of MPEG-2.
const LEVEL_MAX: u32 = 2047;

vectorised! {
    /// What a decoder of MPEG-2 makes of the levels of a non-intra block (7.4.2.3, 7.4.3), but for mismatch control, with the
    /// signs of the coefficients that they were made of:
    ///
    /// ```text
    /// F'' = ±(2·|QF| + 1) · W · quantiser_scale / 32, 0 where QF is      F' = F'' within −2048 … 2047
    /// ```
    /// Levels are held at their limit. Given back are by how much the squared error changes, in last places of the coefficients,
    /// and the sum of F'. Squares of all coefficients together fit into 31 bits, as those of 64 differences of samples do.
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
