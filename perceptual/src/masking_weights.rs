//! Factors of quantiser_scale that follow masking: coarser where detail hides coding errors, finer in smooth areas.
//!
//! ```text
//! weight = 2^(s (a − ā))        a = log₂(1 + mean of the variances of the four 8×8 blocks of luma)      ā  mean of a
//! ```
//!
//! Contrast masking raises the threshold of a coefficient with a power of its magnitude \[Watson93\]. A weight applies
//! to all coefficients of a macroblock. The exponent s is far below Watson's 0.7, because a coarser quantiser also
//! affects faint coefficients.

use plane::Plane;

/// Exponent s, chosen according to SSIMULACRA 2 scores at equal bits. The table lists the increase of the score,
/// interpolated from quantisers 12 to 20 (192×192, 4 frames):
///
/// | s | `nave` | `conference` | Sponza |
/// |---|---|---|---|
/// | 0.2 | 1.1 to 2.5 | 1.4 to 4.0 | 2.0 to 4.1 |
/// | 0.12 | 0.8 to 1.9 | 1.2 to 3.1 | 2.3 to 2.7 |
///
/// Scores fall at s = −0.12.
const STRENGTH: f32 = 0.2;
/// Side of a macroblock \[samples\].
const MACROBLOCK: usize = 16;
/// Side of a luma block \[samples\].
const BLOCK: usize = 8;

/// Returns a factor of quantiser_scale for each macroblock of a picture with this luma \[code values\]. The geometric
/// mean of all factors is 1.
///
/// Outside the picture, the outermost samples are repeated.
#[must_use]
pub fn masking_weights(luma: &Plane<f32>) -> Plane<f32> {
    let (columns, rows) = (luma.width().div_ceil(MACROBLOCK), luma.height().div_ceil(MACROBLOCK));
    let activity = Plane::from_fn(columns, rows, |column, row| {
        let mut variances = 0.0;
        for (x, y) in [(0, 0), (BLOCK, 0), (0, BLOCK), (BLOCK, BLOCK)] {
            variances += variance(luma, column * MACROBLOCK + x, row * MACROBLOCK + y);
        }
        (1.0 + variances / 4.0).log2()
    });
    // Relative to the mean activity, the factors have a geometric mean of 1.
    let mean = activity.samples().iter().sum::<f32>() / activity.samples().len().max(1) as f32;
    activity.map(|activity| (STRENGTH * (activity - mean)).exp2())
}

/// Returns the variance of the 8×8 block with this upper left corner.
fn variance(luma: &Plane<f32>, left: usize, top: usize) -> f32 {
    let (mut sum, mut squares) = (0.0, 0.0);
    for y in top..top + BLOCK {
        for x in left..left + BLOCK {
            let sample = luma.get_clamped(x as isize, y as isize);
            sum += sample;
            squares += sample * sample;
        }
    }
    let count = (BLOCK * BLOCK) as f32;
    (squares / count - (sum / count).powi(2)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detail_is_coded_coarser_than_what_is_even() {
        // The macroblocks are uniform, a step at a block border, and checkerboards of ±16 and ±32. The last macroblock
        // is truncated.
        let luma = Plane::from_fn(60, 12, |x, y| {
            let check = if (x + y) % 2 == 0 { 1.0 } else { -1.0 };
            match x / 16 {
                0 => 100.0,
                1 if x < 24 => 50.0,
                1 => 150.0,
                2 => 100.0 + 16.0 * check,
                _ => 100.0 + 32.0 * check,
            }
        });
        let weights = masking_weights(&luma);
        assert_eq!((weights.width(), weights.height()), (4, 1));
        let [even, step, faint, strong] = [0, 1, 2, 3].map(|column| weights.get(column, 0));
        // A step between two blocks causes no masking inside them.
        assert!(even == step && step < faint && faint < strong, "{weights:?}");
        assert!((even * step * faint * strong - 1.0).abs() < 1e-5, "{weights:?}");
        // The ratio of the weights of two pure checkerboards is the ratio of their (1 + variance), to the power s.
        assert!((faint / even - 257f32.powf(STRENGTH)).abs() < 0.02, "{weights:?}");
        assert!(masking_weights(&Plane::filled(33, 17, 7.0)).samples().iter().all(|&weight| weight == 1.0));
    }
}
