//! Predicted coding of a picture, for encoders with lookahead. Such an encoder has not coded a picture when its
//! thresholds are needed.
//!
//! A simple luma coder replaces the encoder. The first picture of a group is an I picture, all other pictures are P
//! pictures. P pictures are predicted from the previous picture with the renderer's motion. All macroblocks have one
//! quantiser_scale. Coefficients are rounded to the nearest level in intra blocks and towards zero in predicted blocks,
//! as in ISO/IEC 13818-2, 7.4, without rate-distortion decisions. The result is a [`Coded`] picture. Its decoded luma
//! predicts the next picture.
//!
//! B pictures are treated as P pictures. Actual B pictures may be coarser, so the resulting thresholds are
//! conservative.

use crate::bounded;
use crate::coded::QuantiserSteps;
use plane::{Coded, Correspondence, NO_MATCH, Picture, Plane, dct, idct};
use std::sync::Arc;
use threads::prelude::*;

/// State of the simple coder between pictures.
#[derive(Debug, Default)]
pub(crate) struct PredictedCoding {
    /// Last decoded picture, with neutral chroma. Empty before the first picture.
    decoded: Arc<Picture>,
}

/// Decoded samples of a block, and the bit set of its nonzero levels.
type CodedBlock = ([u8; 64], u64);

impl PredictedCoding {
    /// Returns the state after this decoded picture.
    pub fn after(decoded: Plane<u8>) -> Self {
        Self { decoded: Arc::new(Picture::gray(decoded)) }
    }

    /// Decoded luma of the last picture. Code value 16 is black. Empty before the first picture.
    pub fn decoded(&self) -> &Plane<u8> {
        self.decoded.luma()
    }

    /// Codes a picture. `luma` is in code values above black. `known` is the correspondence to the previous picture,
    /// or `None` for an intra picture.
    pub fn code(
        &mut self,
        luma: &Plane<f32>,
        known: Option<&Correspondence>,
        quantiser_scale: f32,
        steps: &QuantiserSteps,
    ) -> Coded {
        let (width, height) = (luma.width(), luma.height());
        let (columns, rows) = luma.block_counts();
        let (across, down) = (width.div_ceil(16), height.div_ceil(16));
        let scale = bounded(quantiser_scale, 1.0, 112.0);
        let matches = known.map(Correspondence::matches);
        // The decoded previous picture predicts this picture.
        let past = self.decoded.luma().samples();
        // Code a macroblock intra if fewer than half of its pixels have a match.
        let is_intra = |column: usize, row: usize| {
            let Some(matches) = matches else { return true };
            let (left, right) = (16 * column, width.min(16 * column + 16));
            let rows = 16 * row..height.min(16 * row + 16);
            let all = rows.len() * (right - left);
            let is_known = |&&index: &&u32| (index as usize) < past.len();
            let known: usize = rows.map(|y| matches.row(y)[left..right].iter().filter(is_known).count()).sum();
            2 * known < all
        };
        let intra: Vec<bool> =
            (0..across * down).into_par_iter().map(|k| is_intra(k % across.max(1), k / across.max(1))).collect();
        // Code the blocks in parallel. They depend only on the previous picture.
        let blocks: Vec<CodedBlock> = (0..columns * rows)
            .into_par_iter()
            .with_min_len(64)
            .map(|k| {
                let (column, row) = (k % columns, k / columns);
                let source = luma.block(column, row).map(|v| 16.0 + bounded(v, -16.0, 239.0));
                let coder = BlockCoder { steps, scale: scale / 16.0 };
                if intra[row / 2 * across + column / 2] {
                    return coder.code(&source, None);
                }
                // Pixels without a match have no residual.
                let from = matches.map_or([NO_MATCH; 64], |matches| matches.block(column, row));
                let prediction =
                    std::array::from_fn(|i| past.get(from[i] as usize).map_or(source[i], |&sample| f32::from(sample)));
                coder.code(&source, Some(&prediction))
            })
            .collect();
        // Discard the previous picture if the size has changed.
        if (self.decoded.width(), self.decoded.height()) != (width, height) {
            self.decoded = Arc::new(Picture::black(width, height));
        }
        // Update in place, unless the last picture is still in use elsewhere.
        let [decoded, ..] = Arc::make_mut(&mut self.decoded).samples_mut();
        for (y, row) in decoded.chunks_mut(width.max(1)).enumerate() {
            for (samples, block) in row.chunks_mut(8).zip(&blocks[y / 8 * columns..]) {
                samples.copy_from_slice(&block.0[y % 8 * 8..][..samples.len()]);
            }
        }
        let levels = Plane::from_vec(columns, rows, blocks.iter().map(|block| block.1).collect());
        let intra = Plane::from_vec(across, down, intra);
        let scales = Plane::filled(across, down, scale.round() as u8);
        Coded::new(self.decoded.clone(), levels, intra, scales).expect("planes of one picture")
    }
}

/// Rounds to the nearest integer below 2²². The sum with 3·2²² has no bits for a fraction. On processors without
/// rounding instructions, `round` would be a function call.
fn nearest(x: f32) -> f32 {
    const ROUNDING: f32 = 12_582_912.0;
    x + ROUNDING - ROUNDING
}

struct BlockCoder<'a> {
    steps: &'a QuantiserSteps,
    /// Step multiplier s: quantiser_scale / 16.
    scale: f32,
}

impl BlockCoder<'_> {
    fn code(&self, source: &[f32; 64], prediction: Option<&[f32; 64]>) -> CodedBlock {
        // Transform the residual, or the source of an intra block.
        let base = *prediction.unwrap_or(&[0.0; 64]);
        let c = dct(&std::array::from_fn(|i| source[i] - base[i]));
        let (mut quantised, mut levels) = ([0.0; 64], 0);
        match prediction {
            None => {
                for i in 0..64 {
                    // Round to the nearest level. The DC has its own step.
                    let step = f32::from(self.steps.intra_matrix[i].max(1)) * self.scale;
                    quantised[i] = nearest(c[i] / step) * step;
                }
                quantised[0] = nearest(c[0] / self.steps.intra_dc_step) * self.steps.intra_dc_step;
                levels = 1;
            }
            Some(_) => {
                for i in 0..64 {
                    let step = f32::from(self.steps.non_intra_matrix[i].max(1)) * self.scale;
                    let level = (c[i].abs() / step) as i32 as f32;
                    // A level truncated towards zero is reconstructed in the middle of its interval.
                    let magnitude = if level == 0.0 { 0.0 } else { (level + 0.5) * step };
                    quantised[i] = magnitude.copysign(c[i]);
                }
            }
        }
        // The DC of an intra block counts as written even if it is zero.
        for (i, &value) in quantised.iter().enumerate() {
            levels |= u64::from(value != 0.0) << i;
        }
        // A block without levels equals its prediction.
        let back = if levels == 0 { [0.0; 64] } else { idct(&quantised) };
        (std::array::from_fn(|i| ((back[i] + base[i]).clamp(0.0, 255.0) + 0.5) as u8), levels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grain(x: usize, y: usize, seed: usize) -> f32 {
        let h = (x * 7919 + y * 104_729 + seed * 1_299_709) ^ (x * y + seed);
        ((h * 2_654_435_761) % 1000) as f32 / 1000.0 - 0.5
    }

    /// The decoded error is below half a step in every intra coefficient, and below one step in every predicted
    /// coefficient.
    #[test]
    fn coefficients_are_off_by_less_than_the_dead_zone() {
        let steps = QuantiserSteps::default();
        let first = Plane::from_fn(64, 48, |x, y| 100.0 + 60.0 * grain(x / 3, y / 3, 1) + 20.0 * grain(x, y, 2));
        let second = Plane::from_fn(64, 48, |x, y| first.get(x, y) + 40.0 * grain(x / 2, y / 2, 3));
        for quantiser_scale in [2.0, 16.0, 62.0] {
            let mut coding = PredictedCoding::default();
            for (picture, known) in [(&first, None), (&second, Some(Correspondence::still(64, 48)))] {
                let coded = coding.code(picture, known.as_ref(), quantiser_scale, &steps);
                assert!(coded.intra().samples().iter().all(|&intra| intra == known.is_none()));
                for (column, row) in (0..6).flat_map(|row| (0..8).map(move |column| (column, row))) {
                    let (source, decoded) = (picture.block(column, row), coded.luma().block(column, row));
                    let d = dct(&std::array::from_fn(|i| source[i] + 16.0 - f32::from(decoded[i])));
                    for (i, d) in d.iter().enumerate() {
                        let (matrix, dead_zone) =
                            if known.is_none() { (steps.intra_matrix, 0.5) } else { (steps.non_intra_matrix, 1.0) };
                        let zone = match (known.is_none(), i) {
                            (true, 0) => 4.0,
                            _ => dead_zone * f32::from(matrix[i]) * quantiser_scale / 16.0,
                        };
                        // Allow for the rounding of 64 samples, at most ½ each.
                        assert!(d.abs() <= zone + 4.0, "quantiser_scale {quantiser_scale}, coefficient {i}: {d}");
                    }
                }
            }
        }
    }

    /// Unchanged pixels are not sent again, and disoccluded areas are coded intra.
    #[test]
    fn still_parts_are_skipped_and_new_ones_are_intra() {
        let steps = QuantiserSteps::default();
        let picture = Plane::from_fn(48, 16, |x, y| 100.0 + 80.0 * grain(x / 2, y / 2, 4));
        let mut matches = Correspondence::still(48, 16).matches().clone();
        for (x, y) in (0..16).flat_map(|y| (32..48).map(move |x| (x, y))) {
            matches.set(x, y, NO_MATCH);
        }
        let mut coding = PredictedCoding::default();
        coding.code(&picture, None, 16.0, &steps);
        // Half of a coarse intra step may exceed a finer step. The rounding error may then get a level.
        let before = coding.code(&picture, Some(&Correspondence::still(48, 16)), 16.0, &steps).luma().clone();
        let coded = coding.code(&picture, Some(&Correspondence::from_matches(matches)), 16.0, &steps);
        assert_eq!(coded.intra().samples(), [false, false, true]);
        let sent = |column: usize| coded.levels().get(column, 0);
        assert!((0..4).all(|column| sent(column) == 0), "{:?}", coded.levels());
        assert!((4..6).all(|column| sent(column) & 1 == 1));
        let same = |x: usize, y: usize| coded.luma().get(x, y) == before.get(x, y);
        assert!((0..16).all(|y| (0..32).all(|x| same(x, y))));
    }

    #[test]
    fn extremes_are_coded() {
        let steps = QuantiserSteps { intra_matrix: [0; 64], non_intra_matrix: [0; 64], intra_dc_step: 1.0 };
        let mut luma = Plane::filled(17, 9, f32::NAN);
        luma.set(3, 3, f32::INFINITY);
        luma.set(4, 3, f32::NEG_INFINITY);
        let mut coding = PredictedCoding::default();
        for quantiser_scale in [f32::NAN, 0.0, 1e9] {
            let to_one_place = Correspondence::from_matches(Plane::filled(17, 9, 5));
            for known in [None, Some(Correspondence::still(17, 9)), Some(to_one_place)] {
                let coded = coding.code(&luma, known.as_ref(), quantiser_scale, &steps);
                assert_eq!((coded.luma().width(), coded.intra().width(), coded.levels().width()), (17, 2, 3));
            }
        }
        assert_eq!(coding.code(&Plane::filled(0, 0, 0.0), None, 2.0, &steps).luma().samples().len(), 0);
    }
}
