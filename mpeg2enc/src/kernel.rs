//! The innermost loops, each compiled twice: for any processor, and for those with AVX2.
//!
//! The source of both is the same plain loop over fixed sizes, so both give the same bits; the compiler makes vector
//! instructions of it where it may. A test runs every one both ways.

/// Can AVX2 be used? The answer is kept by the standard library: this is one load.
#[inline(always)]
pub(crate) fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Defines a function that runs its body with AVX2 where there is such, and `$plain` that does not.
macro_rules! vectorised {
    ($(#[$meta:meta])* fn $name:ident, $plain:ident $(<const $n:ident: usize>)? ($($arg:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        #[inline(always)]
        pub(crate) fn $plain $(<const $n: usize>)? ($($arg: $type),*) $(-> $out)? $body

        $(#[$meta])*
        #[inline]
        #[allow(unsafe_code, reason = "a function with AVX2 is called after a check that the processor has it")]
        pub(crate) fn $name $(<const $n: usize>)? ($($arg: $type),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2 $(<const $n: usize>)? ($($arg: $type),*) $(-> $out)? {
                    $plain $(::<$n>)? ($($arg),*)
                }
                if has_avx2() {
                    // SAFETY: the processor has AVX2.
                    return unsafe { avx2 $(::<$n>)? ($($arg),*) };
                }
            }
            $plain $(::<$n>)? ($($arg),*)
        }
    };
}

/// Where prediction comes from: the rest of a plane from the upper left whole sample on, and half-sample steps.
#[derive(Clone, Copy)]
pub(crate) struct Place<'a> {
    pub samples: &'a [u8],
    pub stride: usize,
    pub half: (bool, bool),
}

/// Writes N predicted samples of row `i` (7.6.4).
#[inline(always)]
fn predict_row<const N: usize>(place: &Place, i: usize, out: &mut [u8; N]) {
    let at = |row: usize, column: usize| -> &[u8; N] {
        place.samples[row * place.stride + column..][..N].try_into().expect("N samples")
    };
    match place.half {
        (false, false) => *out = *at(i, 0),
        (true, false) => mean_of_two(at(i, 0), at(i, 1), out),
        (false, true) => mean_of_two(at(i, 0), at(i + 1, 0), out),
        (true, true) => {
            let (a, b, c, d) = (at(i, 0), at(i, 1), at(i + 1, 0), at(i + 1, 1));
            for k in 0..N {
                let sum = u16::from(a[k]) + u16::from(b[k]) + u16::from(c[k]) + u16::from(d[k]);
                out[k] = ((sum + 2) >> 2) as u8;
            }
        }
    }
}

#[inline(always)]
fn mean_of_two<const N: usize>(a: &[u8; N], b: &[u8; N], out: &mut [u8; N]) {
    for k in 0..N {
        out[k] = ((u16::from(a[k]) + u16::from(b[k]) + 1) >> 1) as u8;
    }
}

vectorised! {
    /// N rows of N predicted samples (7.6.4).
    fn predict, predict_plain<const N: usize>(place: Place, out: &mut [[u8; N]; N]) {
        for (i, row) in out.iter_mut().enumerate() {
            predict_row(&place, i, row);
        }
    }
}

vectorised! {
    /// The mean of two predictions, rounded up (7.6.7.1).
    fn mean, mean_plain(a: &[u8], b: &[u8], out: &mut [u8]) {
        for ((&a, &b), out) in a.iter().zip(b).zip(out) {
            *out = ((u16::from(a) + u16::from(b) + 1) >> 1) as u8;
        }
    }
}

vectorised! {
    /// Sum of absolute differences between N×N samples and their prediction.
    fn absolute_difference, absolute_difference_plain<const N: usize>(source: &[[u8; N]; N], place: Place) -> u32 {
        let mut sum = 0;
        let mut row = [0; N];
        for (i, source) in source.iter().enumerate() {
            predict_row(&place, i, &mut row);
            for k in 0..N {
                sum += u32::from(source[k].abs_diff(row[k]));
            }
        }
        sum
    }
}

vectorised! {
    /// Sum of squared differences.
    fn squared_difference, squared_difference_plain(a: &[u8; 64], b: &[u8; 64]) -> u32 {
        let mut sum = 0;
        for k in 0..64 {
            let difference = i32::from(a[k]) - i32::from(b[k]);
            sum += (difference * difference) as u32;
        }
        sum
    }
}

vectorised! {
    /// Sum of absolute transformed differences of N×N samples, N a multiple of eight.
    ///
    /// Each block of 8×8 differences goes through a Hadamard transform; an eighth of the sum of magnitudes is taken:
    /// one coefficient of a flat difference d then counts 8·d, about as 64 plain differences spread over many
    /// coefficients do.
    fn transformed_difference, transformed_difference_plain<const N: usize>(
        source: &[[u8; N]; N], predicted: &[[u8; N]; N]
    ) -> u32 {
        let mut sum = 0;
        let mut top = 0;
        while top < N {
            let mut left = 0;
            while left < N {
                let mut differences = [[0i16; 8]; 8];
                for y in 0..8 {
                    for x in 0..8 {
                        differences[y][x] = i16::from(source[top + y][left + x]) - i16::from(predicted[top + y][left + x]);
                    }
                }
                sum += hadamard_sum(&mut differences);
                left += 8;
            }
            top += 8;
        }
        sum
    }
}

/// An eighth of the sum of magnitudes of the transformed differences, which are used up.
#[inline(always)]
fn hadamard_sum(block: &mut [[i16; 8]; 8]) -> u32 {
    hadamard(block);
    let mut transposed = [[0i16; 8]; 8];
    for y in 0..8 {
        for x in 0..8 {
            transposed[x][y] = block[y][x];
        }
    }
    hadamard(&mut transposed);
    let mut sum = 0;
    for row in &transposed {
        for &value in row {
            sum += u32::from(value.unsigned_abs());
        }
    }
    (sum + 4) >> 3
}

/// The eight-point Hadamard transform along the first index, eight at a time.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "x is a lane: the compiler takes all eight at once")]
fn hadamard(rows: &mut [[i16; 8]; 8]) {
    for x in 0..8 {
        let (a0, a1, a2, a3) =
            (rows[0][x] + rows[4][x], rows[1][x] + rows[5][x], rows[2][x] + rows[6][x], rows[3][x] + rows[7][x]);
        let (a4, a5, a6, a7) =
            (rows[0][x] - rows[4][x], rows[1][x] - rows[5][x], rows[2][x] - rows[6][x], rows[3][x] - rows[7][x]);
        let (b0, b1, b2, b3) = (a0 + a2, a1 + a3, a0 - a2, a1 - a3);
        let (b4, b5, b6, b7) = (a4 + a6, a5 + a7, a4 - a6, a5 - a7);
        rows[0][x] = b0 + b1;
        rows[1][x] = b0 - b1;
        rows[2][x] = b2 + b3;
        rows[3][x] = b2 - b3;
        rows[4][x] = b4 + b5;
        rows[5][x] = b4 - b5;
        rows[6][x] = b6 + b7;
        rows[7][x] = b6 - b7;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u32) -> u8 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*state >> 24) as u8
    }

    fn block<const N: usize>(state: &mut u32) -> [[u8; N]; N] {
        std::array::from_fn(|_| std::array::from_fn(|_| random(state)))
    }

    #[test]
    fn both_ways_give_the_same() {
        let mut state = 1;
        for _ in 0..200 {
            let samples: Vec<u8> = (0..40 * 40).map(|_| random(&mut state)).collect();
            let source = block::<16>(&mut state);
            for half in [(false, false), (true, false), (false, true), (true, true)] {
                let place = Place { samples: &samples[43..], stride: 40, half };
                let (mut a, mut b) = ([[0; 16]; 16], [[0; 16]; 16]);
                predict(place, &mut a);
                predict_plain(place, &mut b);
                assert_eq!(a, b);
                assert_eq!(absolute_difference(&source, place), absolute_difference_plain(&source, place));
                assert_eq!(transformed_difference(&source, &a), transformed_difference_plain(&source, &b));
            }
            let (a, b): ([u8; 64], [u8; 64]) = (std::array::from_fn(|_| random(&mut state)), [random(&mut state); 64]);
            assert_eq!(squared_difference(&a, &b), squared_difference_plain(&a, &b));
            let (mut x, mut y) = ([0; 64], [0; 64]);
            mean(&a, &b, &mut x);
            mean_plain(&a, &b, &mut y);
            assert_eq!(x, y);
        }
    }

    #[test]
    fn the_transform_is_its_definition() {
        let mut state = 7;
        for _ in 0..100 {
            let (source, predicted) = (block::<8>(&mut state), block::<8>(&mut state));
            // Entry (u, v) has the sign of the parity of the bits that u and x, v and y have in common.
            let mut sum = 0i32;
            for (u, v) in (0..8).flat_map(|u| (0..8).map(move |v| (u, v))) {
                let sign = |u: usize, x: usize| if (u & x).count_ones().is_multiple_of(2) { 1 } else { -1 };
                let difference = |i: usize| i32::from(source[i / 8][i % 8]) - i32::from(predicted[i / 8][i % 8]);
                sum += (0..64).map(|i| sign(v, i / 8) * sign(u, i % 8) * difference(i)).sum::<i32>().abs();
            }
            assert_eq!(transformed_difference(&source, &predicted), ((sum + 4) / 8) as u32);
        }
        assert_eq!(transformed_difference(&[[255; 8]; 8], &[[0; 8]; 8]), 255 * 8, "the largest values fit");
    }
}
