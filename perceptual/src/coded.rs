//! Tolerable errors from the actual coding of a picture: the steps, modes and losses of one encoder.
//!
//! An error of the renderer passes through the same quantiser as the picture. Where a level is written, the error of
//! the coefficient is fully visible. Where the level is zero, the error is invisible unless it lifts the coefficient
//! over the dead zone. Visible errors add to the coding error. This gives the equations
//!
//! ```text
//! (6)  D = d_ij² summed over the block / 64                       mean square coding error, code values²
//! (7)  P = Σ p_ij a_ij      a_ij = 1 where a level is written, min(1, (d_ij / Z_ij)²) elsewhere
//! (8)  e' = min( √(√(D D̄) / (P N)),  M_ij / (12 √p_ij) over all ij without level )
//!      N = 1 + (n − 1)(1 − P')            for an intra picture, otherwise 1
//!      M_ij = max(Z_ij − |d_ij|, Z_ij / 8)
//!
//!   d_ij  DCT of source − decoded: without a level the coefficient, or in a predicted block its residual
//!   Z_ij  dead zone: ½ Δ_ij in intra blocks, otherwise Δ_ij       Δ_ij  quantiser step: w_ij · quantiser_scale / 16,
//!   p_ij  fraction of the renderer's error in coefficient ij             8, 4, 2 or 1 for the DC of intra blocks
//!   D̄     mean of D over the picture                              w_ij  matrix in use
//!   n     number of pictures in the group                         P'    P of the block if predicted
//! ```
//! P of (7) is the visible fraction of an error. (8) allows visible errors as large as the coding error. It also keeps
//! 1.5 standard deviations of the invisible error within the remaining dead zone. Decoded PSNR weighs all errors of the
//! picture equally, while the eye judges single blocks. The allowed energy is therefore the geometric mean of D and D̄.
//!
//! An error in an intra picture stays visible in the pictures predicted from it until one of them replaces the block.
//! In total, N pictures show the error. The table lists measurements on `cornell`, with only one picture type rendered
//! coarser:
//!
//! | coarser pictures | quantiser | decoded error over the film, relative to the error of these pictures |
//! |---|---|---|
//! | I | 2 | 1.05 |
//! | I | 48 | 10 |
//! | P | 2 | 0.93 |
//! | P | 48 | 0 |
//!
//! [`NextPicture`] specifies the mode of the next picture. The effect of an intra picture on a block is computed from
//! the block's coefficients. A predicted picture after an intra picture is assumed to leave the block unchanged.

use crate::bounded;
use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};
use plane::{Coded, Plane, dct};
use threads::prelude::*;

/// Quantiser steps of an encoder.
#[derive(Clone, Debug, PartialEq)]
pub struct QuantiserSteps {
    /// Weights w_ij of intra blocks, in raster order.
    pub intra_matrix: [u8; 64],
    /// Weights w_ij of predicted blocks, in raster order.
    pub non_intra_matrix: [u8; 64],
    /// Step of the DC of intra blocks: 8, 4, 2 or 1 for intra_dc_precision 8 to 11 bits (ISO/IEC 13818-2, 7.4.1).
    pub intra_dc_step: f32,
}

impl Default for QuantiserSteps {
    /// Returns MPEG-2's default matrices, with 8-bit DC precision.
    fn default() -> Self {
        Self { intra_matrix: DEFAULT_INTRA_MATRIX, non_intra_matrix: DEFAULT_NON_INTRA_MATRIX, intra_dc_step: 8.0 }
    }
}

/// Coding mode of the next picture, with respect to the current picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NextPicture {
    /// Intra coding, as the first picture of a group.
    Intra {
        /// Number n of pictures in the group, at least 1.
        group: u32,
    },
    /// Prediction from the current picture.
    Predicted,
}

/// Returns the fractions p_ij in raster order. Their sum is 1. Neighboring pixels use nearly the same clusters, so
/// their errors are nearly equal and low frequencies dominate.
///
/// Fraction of the energy of lightcut errors per coefficient, measured at quantisers 2 to 48, and in this model:
///
/// | | DC | each of the two lowest AC | first on the diagonal |
/// |---|---|---|---|
/// | `cornell` | 65 to 67 % | 7 to 8 % | 1.3 % |
/// | `nave` | 46 to 58 % | 4 to 9 % | 1.5 to 2 % |
/// | model | 66 % | 9 % | 1.4 % |
fn error_spectrum() -> [f32; 64] {
    let along = |u: usize| 1.0 / (1.0 + 6.0 * (u * u) as f32);
    let p: [f32; 64] = std::array::from_fn(|k| along(k / 8) * along(k % 8));
    let sum: f32 = p.iter().sum();
    p.map(|p| p / sum)
}

/// Minimum remaining fraction of a dead zone. Without this minimum, a block that almost gets a level would have to be
/// exact. The residual of such a block is known only to a fraction of the dead zone.
const LEAST_MARGIN: f32 = 0.125;

/// Minimum magnitude of an intra coefficient with a level \[steps\], fitted to the decisions of `mpeg2enc`.
const WORTH_A_LEVEL: f32 = 0.6;

/// Evaluator of eqs. (6) to (8), with precomputed constants.
pub(crate) struct CodedMasking {
    steps: QuantiserSteps,
    p: [f32; 64],
    /// Factor from a margin M_ij to a tolerable error: 1 / (12 √p_ij).
    per_margin: [f32; 64],
}

/// Effect of the coding on a block and on errors in it.
struct BlockLoss {
    /// Mean square coding error D of the block \[code values²\].
    d2: f32,
    /// Visible fraction P of an error, or P N before an intra picture.
    passes: f32,
    /// Minimum of M_ij / (12 √p_ij) over the coefficients without a level.
    within_dead_zone: f32,
}

impl CodedMasking {
    pub fn new(steps: QuantiserSteps) -> Self {
        let p = error_spectrum();
        Self { steps, p, per_margin: p.map(|p| 1.0 / (12.0 * p.sqrt())) }
    }

    /// Returns e′ of every 8×8 block: the tolerable root-mean-square luma error \[code values\], finite and ≥ 0.
    ///
    /// `luma` is in code values above black, before the rounding for the encoder.
    pub fn tolerable_luma(&self, luma: &Plane<f32>, coded: &Coded, next: NextPicture) -> Plane<f32> {
        let (columns, rows) = luma.block_counts();
        let losses: Vec<BlockLoss> = (0..columns * rows)
            .into_par_iter()
            .with_min_len(64)
            .map(|k| self.block_loss(luma, coded, next, k))
            .collect();
        // Sum in order, so that the result does not depend on the number of threads.
        let mean = losses.iter().map(|loss| f64::from(loss.d2)).sum::<f64>() / losses.len().max(1) as f64;
        let e = losses.iter().map(|loss| {
            let d2 = (loss.d2 * mean as f32).sqrt();
            bounded((d2 / loss.passes.max(f32::MIN_POSITIVE)).sqrt().min(loss.within_dead_zone), 0.0, 219.0)
        });
        Plane::from_vec(columns, rows, e.collect())
    }

    /// Returns the effect of the coding on the k-th block in raster order.
    fn block_loss(&self, luma: &Plane<f32>, coded: &Coded, next: NextPicture, k: usize) -> BlockLoss {
        let columns = luma.block_counts().0;
        let (column, row) = (k % columns, k / columns);
        let (across, down) = (coded.intra().width().max(1) - 1, coded.intra().height().max(1) - 1);
        let (x, y) = ((column / 2).min(across), (row / 2).min(down));
        let scale = f32::from(coded.quantiser_scales().get(x, y)) / 16.0;
        let was_intra = coded.intra().get(x, y);
        // Compute d_ij of the decoded block.
        let source = luma.block(column, row).map(|v| if v.is_finite() { v.clamp(-16.0, 239.0) } else { 0.0 });
        let decoded = coded.luma().block(column, row);
        let lost = dct(&std::array::from_fn(|i| source[i] + 16.0 - f32::from(decoded[i])));
        // A predicted picture after an intra picture is assumed to write no levels.
        let levels = coded.levels().get(column, row);
        let predicted = self.predicted_loss(&lost, if was_intra { 0 } else { levels }, scale);
        let NextPicture::Intra { group } = next else { return predicted };
        // For an intra picture, count the pictures that show the error.
        let intra = if was_intra {
            self.loss(&lost, levels, &self.intra_steps(scale), 0.5)
        } else {
            self.predicted_intra_loss(&dct(&source), scale)
        };
        let shown = 1.0 + (group.max(1) - 1) as f32 * (1.0 - predicted.passes).max(0.0);
        BlockLoss { passes: intra.passes * shown, ..intra }
    }

    fn predicted_loss(&self, d: &[f32; 64], levels: u64, scale: f32) -> BlockLoss {
        let steps = self.steps.non_intra_matrix.map(|w| f32::from(w.max(1)) * scale);
        self.loss(d, levels, &steps, 1.0)
    }

    /// Predicts the effect of an intra picture on a block with coefficients `c`.
    fn predicted_intra_loss(&self, c: &[f32; 64], scale: f32) -> BlockLoss {
        let steps = self.intra_steps(scale);
        let is_written = |i: usize| i == 0 || c[i].abs() >= WORTH_A_LEVEL * steps[i];
        let levels = (0..64).filter(|&i| is_written(i)).fold(0, |levels, i| levels | 1 << i);
        // Written coefficients are rounded to the nearest level.
        let d = std::array::from_fn(|i| if is_written(i) { steps[i] / 12f32.sqrt() } else { c[i] });
        self.loss(&d, levels, &steps, 0.5)
    }

    fn intra_steps(&self, scale: f32) -> [f32; 64] {
        let mut steps = self.steps.intra_matrix.map(|w| f32::from(w.max(1)) * scale);
        steps[0] = self.steps.intra_dc_step;
        steps
    }

    /// Evaluates eqs. (6) and (7). `dead_zone` is in steps. Eight lanes accumulate separate sums and minima.
    fn loss(&self, d: &[f32; 64], levels: u64, steps: &[f32; 64], dead_zone: f32) -> BlockLoss {
        let (mut d2, mut passes, mut within) = ([0.0; 8], [0.0; 8], [f32::INFINITY; 8]);
        for row in 0..8 {
            let written = (levels >> (8 * row)) as u8;
            for column in 0..8 {
                let i = 8 * row + column;
                let z = dead_zone * steps[i];
                let is_written = written & (1 << column) != 0;
                let (share, magnitude) = (d[i] / z, d[i].abs());
                d2[column] += d[i] * d[i];
                let comes_through = if share * share < 1.0 { share * share } else { 1.0 };
                passes[column] += self.p[i] * if is_written { 1.0 } else { comes_through };
                // Compute M_ij of coefficients without a level.
                let (left, least) = (z - magnitude, LEAST_MARGIN * z);
                let margin = (if left > least { left } else { least }) * self.per_margin[i];
                let margin = if is_written { f32::INFINITY } else { margin };
                within[column] = if margin < within[column] { margin } else { within[column] };
            }
        }
        let sum = |of: [f32; 8]| of.iter().sum::<f32>();
        BlockLoss {
            d2: sum(d2) / 64.0,
            passes: sum(passes),
            within_dead_zone: within.into_iter().fold(f32::INFINITY, f32::min),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plane::{Picture, dct_definition, idct};
    use std::sync::Arc;

    /// Returns a picture with this decoded luma, one mode and one quantiser_scale.
    fn coded_as(decoded: &Plane<u8>, levels: &Plane<u64>, intra: bool, quantiser_scale: u8) -> Coded {
        let (columns, rows) = (decoded.width().div_ceil(16), decoded.height().div_ceil(16));
        let scales = Plane::filled(columns, rows, quantiser_scale);
        let decoded = Arc::new(Picture::gray(decoded.clone()));
        Coded::new(decoded, levels.clone(), Plane::filled(columns, rows, intra), scales).unwrap()
    }

    /// Returns a random number in −½ … ½.
    fn random(state: &mut u32) -> f32 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*state >> 8) as f32 / (1 << 24) as f32 - 0.5
    }

    /// Returns a picture of blocks with coefficients that decay as in photographs.
    fn photograph(blocks: usize) -> Plane<f32> {
        let mut state = 5;
        let all: Vec<[f32; 64]> = (0..blocks * blocks)
            .map(|_| {
                let busy = 60.0 * (random(&mut state) + 0.5).powi(3);
                let mut c: [f32; 64] = std::array::from_fn(|k| {
                    let r = ((k / 8).pow(2) + (k % 8).pow(2)) as f32;
                    // The product of three random numbers is often small, sometimes large and rarely very large.
                    busy * 8.0 * random(&mut state) * random(&mut state) * random(&mut state) / (1.0 + 0.2 * r)
                });
                c[0] = 800.0 + 600.0 * random(&mut state);
                idct(&c)
            })
            .collect();
        Plane::from_fn(8 * blocks, 8 * blocks, |x, y| all[y / 8 * blocks + x / 8][y % 8 * 8 + x % 8])
    }

    /// Quantises a coefficient to the nearest level (intra) or towards zero (predicted). Returns the reconstructed
    /// value of (7.4), and whether the level is written.
    fn quantised(c: f32, step: f32, dead_zone: f32, is_dc: bool) -> (f32, bool) {
        let level = if is_dc { (c / step).round() } else { (c.abs() / step + 1.0 - dead_zone).floor() * c.signum() };
        // Levels truncated towards zero are reconstructed in the middle of their interval.
        let middle = if dead_zone == 1.0 { 0.5 * level.signum() } else { 0.0 };
        ((level + middle * f32::from(level != 0.0)) * step, level != 0.0 || is_dc)
    }

    /// Codes `source` block by block, as an intra picture or predicted from `base`.
    fn coded(source: &Plane<f32>, base: &Plane<f32>, scale: f32, intra: bool) -> (Plane<u8>, Plane<u64>) {
        let model = CodedMasking::new(QuantiserSteps::default());
        let (columns, rows) = source.block_counts();
        let steps = if intra {
            model.intra_steps(scale / 16.0)
        } else {
            model.steps.non_intra_matrix.map(|w| f32::from(w) * scale / 16.0)
        };
        let mut levels = Plane::filled(columns, rows, 0u64);
        let mut decoded = Plane::filled(source.width(), source.height(), 0u8);
        for (column, row) in (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))) {
            let (own, below) = (source.block(column, row), base.block(column, row));
            let c = dct(&std::array::from_fn(|i| own[i] - below[i]));
            let dead_zone = if intra { 0.5 } else { 1.0 };
            let q: [(f32, bool); 64] = std::array::from_fn(|i| quantised(c[i], steps[i], dead_zone, intra && i == 0));
            levels.set(column, row, (0..64).fold(0, |set, i| set | u64::from(q[i].1) << i));
            let back = idct(&q.map(|(c, _)| c));
            let sum = |i: usize| (back[i] + below[i] + 16.0f32).round().clamp(0.0, 255.0) as u8;
            decoded.set_block(column, row, &std::array::from_fn(sum));
        }
        (decoded, levels)
    }

    fn mean_square(a: &Plane<f32>, b: &Plane<u8>) -> f64 {
        let of = |(&a, &b): (&f32, &u8)| f64::from(a + 16.0 - f32::from(b)).powi(2);
        a.samples().iter().zip(b.samples()).map(of).sum::<f64>() / a.samples().len() as f64
    }

    /// Errors with the model's spectrum and a fraction κ of e′ per block pass through a quantiser. The decoded
    /// picture's mean square error grows by at most κ² D, as eqs. (7) and (8) predict.
    #[test]
    fn what_comes_through_is_what_was_allowed() {
        let model = CodedMasking::new(QuantiserSteps::default());
        let source = photograph(24);
        let p = error_spectrum();
        let mut state = 77;
        for (intra, quantiser_scale) in
            [(true, 4.0), (true, 16.0), (true, 48.0), (false, 4.0), (false, 16.0), (false, 48.0)]
        {
            // In a predicted picture, the light of every block has changed by a random factor of up to a tenth.
            let changed: Vec<f32> = (0..24 * 24).map(|_| 0.95 + 0.1 * random(&mut state)).collect();
            let before = |x: usize, y: usize| source.get(x, y) * changed[y / 8 * 24 + x / 8];
            let base = Plane::from_fn(192, 192, |x, y| if intra { 0.0 } else { before(x, y) });
            let (decoded, levels) = coded(&source, &base, quantiser_scale, intra);
            let picture = coded_as(&decoded, &levels, intra, quantiser_scale as u8);
            let next = if intra { NextPicture::Intra { group: 1 } } else { NextPicture::Predicted };
            let tolerable = model.tolerable_luma(&source, &picture, next);
            let kappa = 0.5;
            let mut wrong = source.clone();
            for (column, row) in (0..24).flat_map(|row| (0..24).map(move |column| (column, row))) {
                let sigma = kappa * tolerable.get(column, row);
                // The random numbers are uniformly distributed with a variance of 1/12.
                let e = idct(&p.map(|p| sigma * 8.0 * (12.0 * p).sqrt() * random(&mut state)));
                let block = source.block(column, row);
                wrong.set_block(column, row, &std::array::from_fn(|i| block[i] + e[i]));
            }
            let (other, _) = coded(&wrong, &base, quantiser_scale, intra);
            let (before, after) = (mean_square(&source, &decoded), mean_square(&source, &other));
            let share = (after - before) / before / f64::from(kappa * kappa);
            println!("intra {intra}, quantiser_scale {quantiser_scale}: κ² D allowed, {share:.2} of it came through");
            // These limits are the figures of the README, to two decimals.
            assert!((0.245..0.955).contains(&share), "intra {intra}, quantiser_scale {quantiser_scale}: {share}");
        }
    }

    /// Eqs. (6) to (8) are compared with their definition.
    #[test]
    fn blocks_follow_the_equations() {
        let model = CodedMasking::new(QuantiserSteps::default());
        let source = photograph(4);
        let (decoded, levels) = coded(&source, &Plane::filled(32, 32, 0.0), 16.0, true);
        let picture = coded_as(&decoded, &levels, true, 16);
        let tolerable = model.tolerable_luma(&source, &picture, NextPicture::Intra { group: 1 });
        let d_of = |k: usize| {
            let (s, c) = (source.block(k % 4, k / 4), decoded.block(k % 4, k / 4));
            dct_definition(&std::array::from_fn(|i| f64::from(s[i]) + 16.0 - f64::from(c[i])))
        };
        let d2 = |k: usize| d_of(k).iter().map(|d| d * d).sum::<f64>() / 64.0;
        let mean = (0..16).map(d2).sum::<f64>() / 16.0;
        let p = error_spectrum().map(f64::from);
        for k in 0..16 {
            let d = d_of(k);
            let written = |i: usize| levels.get(k % 4, k / 4) >> i & 1 == 1;
            let z = |i: usize| f64::from(DEFAULT_INTRA_MATRIX[i]) / 2.0;
            let passes: f64 =
                (0..64).map(|i| p[i] * if written(i) { 1.0 } else { (d[i] / z(i)).powi(2).min(1.0) }).sum();
            let margin = |i: usize| (z(i) - d[i].abs()).max(z(i) / 8.0);
            let within = (0..64)
                .filter(|&i| !written(i))
                .map(|i| margin(i) / (12.0 * p[i].sqrt()))
                .fold(f64::INFINITY, f64::min);
            let expected = ((d2(k) * mean).sqrt() / passes).sqrt().min(within);
            let got = f64::from(tolerable.get(k % 4, k / 4));
            assert!((got / expected - 1.0).abs() < 1e-3, "block {k}: {got}, by definition {expected}");
        }
    }

    /// If predicted pictures code no levels, an error in an intra picture is visible in all pictures of its group.
    #[test]
    fn what_stays_counts_as_often_as_it_is_seen() {
        let model = CodedMasking::new(QuantiserSteps::default());
        // A uniform gray picture has only DC coefficients.
        let (luma, decoded) = (Plane::filled(16, 16, 84.4f32), Plane::filled(16, 16, 100));
        let picture = coded_as(&decoded, &Plane::filled(2, 2, 1), true, 112);
        let of = |group| model.tolerable_luma(&luma, &picture, NextPicture::Intra { group }).get(0, 0);
        // The DC difference d_00 = 3.2 is within a dead zone of 112.
        let stays = 1.0 - model.p[0] * (3.2f32 / 112.0).powi(2);
        for group in [1, 2, 15] {
            let expected = of(1) / (1.0 + (group - 1) as f32 * stays).sqrt();
            assert!((of(group) / expected - 1.0).abs() < 1e-3, "{group}: {}, expected {expected}", of(group));
        }
    }

    #[test]
    fn extremes_stay_finite() {
        let model = CodedMasking::new(QuantiserSteps::default());
        let mut luma = Plane::filled(20, 12, 100.0);
        luma.set(3, 3, f32::NAN);
        luma.set(4, 3, f32::INFINITY);
        for (scale, levels, intra) in
            [(1, 0, true), (112, u64::MAX, true), (1, u64::MAX, false), (112, 0, false), (0, 1, true)]
        {
            for decoded in [0, 116, 255] {
                let picture = coded_as(&Plane::filled(20, 12, decoded), &Plane::filled(4, 2, levels), intra, scale);
                for next in [NextPicture::Intra { group: 132 }, NextPicture::Predicted] {
                    let tolerable = model.tolerable_luma(&luma, &picture, next);
                    assert!(tolerable.samples().iter().all(|e| (0.0..=219.0).contains(e)), "{scale} {levels} {next:?}");
                }
            }
        }
    }
}
