//! Sums of absolute transformed differences: what a prediction leaves, weighed as coefficients are.

/// Differences of 8×8 samples after a Hadamard transform, as the sum of their magnitudes.
///
/// An eighth of the sum is taken: one coefficient of a flat difference d counts 8·d, about as 64 plain differences
/// spread over many coefficients do.
#[inline]
pub(crate) fn block(differences: &[[i16; 8]; 8]) -> u32 {
    // Columns, eight at a time; then the same over rows of the transposed block.
    let once = hadamard(differences);
    let mut transposed = [[0; 8]; 8];
    for (y, row) in once.iter().enumerate() {
        for (x, &value) in row.iter().enumerate() {
            transposed[x][y] = value;
        }
    }
    let twice = hadamard(&transposed);
    let sum: u32 = twice.iter().flatten().map(|&value| u32::from(value.unsigned_abs())).sum();
    (sum + 4) >> 3
}

/// The eight-point Hadamard transform along the first index.
#[inline(always)]
fn hadamard(rows: &[[i16; 8]; 8]) -> [[i16; 8]; 8] {
    let mut values = *rows;
    for half in [4, 2, 1] {
        let mut next = values;
        for i in 0..8 {
            let (a, b) = (values[i & !half], values[i | half]);
            next[i] = if i & half == 0 {
                std::array::from_fn(|k| a[k] + b[k])
            } else {
                std::array::from_fn(|k| a[k] - b[k])
            };
        }
        values = next;
    }
    values
}

/// Of N×N samples, N a multiple of eight: the sum over their blocks.
#[inline]
pub(crate) fn of_rows<const N: usize>(source: &[&[u8; N]; N], predicted: &[[u8; N]; N]) -> u32 {
    let mut sum = 0;
    for (top, left) in (0..N).step_by(8).flat_map(|top| (0..N).step_by(8).map(move |left| (top, left))) {
        let mut differences = [[0; 8]; 8];
        for (y, row) in differences.iter_mut().enumerate() {
            for (x, difference) in row.iter_mut().enumerate() {
                *difference = i16::from(source[top + y][left + x]) - i16::from(predicted[top + y][left + x]);
            }
        }
        sum += block(&differences);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_its_definition() {
        let mut state = 1u32;
        for _ in 0..100 {
            let differences: [[i16; 8]; 8] = std::array::from_fn(|_| {
                std::array::from_fn(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (state >> 23) as i16 % 256 - (state >> 12) as i16 % 256
                })
            });
            // Entry (u, v) has the sign of the parity of the bits that u and x, v and y have in common.
            let mut sum = 0i32;
            for (u, v) in (0..8).flat_map(|u| (0..8).map(move |v| (u, v))) {
                let sign = |u: usize, x: usize| if (u & x).count_ones() % 2 == 0 { 1 } else { -1 };
                let coefficient: i32 = (0..64)
                    .map(|i| sign(v, i / 8) * sign(u, i % 8) * i32::from(differences[i / 8][i % 8]))
                    .sum();
                sum += coefficient.abs();
            }
            assert_eq!(block(&differences), ((sum + 4) / 8) as u32);
        }
    }

    #[test]
    fn the_largest_differences_fit() {
        assert_eq!(block(&[[255; 8]; 8]), 255 * 8);
        assert_eq!(block(&[[-255; 8]; 8]), 255 * 8);
    }
}
