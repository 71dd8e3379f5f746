//! Benchmarks for a 512×512 picture. For one core, run `RAYON_NUM_THREADS=1 cargo bench -p render2mpeg-perceptual`.

use divan::{Bencher, black_box};
use perceptual::{
    DEFAULT_WEIGHT, ExpectedCoding, Feedback, MaskingModel, NextPicture, ObservedFrame, Operator, QuantiserSteps,
    ToneMap, YCbCr, blend, luminance_plane, reproject, ssim, tolerable_error,
};
use plane::{Coded, Correspondence, Picture, Plane};
use std::sync::Arc;

fn main() {
    divan::main();
}

const SIZE: usize = 512;

/// Returns radiance with waves of several lengths, a color cast, and noise from a fixed seed.
fn radiance() -> Plane<[f32; 3]> {
    let mut state = 7u32;
    Plane::from_fn(SIZE, SIZE, |x, y| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (state >> 8) as f32 / (1 << 24) as f32;
        let wave = (x as f32 * 0.05).sin() * (y as f32 * 0.31).cos();
        let level = 0.3 + 0.2 * wave + 0.1 * noise;
        [level, 0.8 * level, 0.5 * level]
    })
}

fn picture() -> (YCbCr, Plane<f32>) {
    let radiance = radiance();
    (YCbCr::from_radiance(&radiance, &ToneMap::default()), luminance_plane(&radiance))
}

/// Times eqs. (1) to (4) for one frame.
#[divan::bench(args = [1.0, 8.0, 112.0])]
fn thresholds_of_a_frame(bencher: Bencher, quantiser_scale: f32) {
    let (picture, luminance) = picture();
    let (tone_map, model) = (ToneMap::default(), MaskingModel::default());
    bencher.bench(|| tolerable_error(&picture.luma, &luminance, quantiser_scale, &tone_map, &model));
}

/// Times eqs. (1) to (5) for one frame, with a precomputed table of the tone curve.
#[divan::bench]
fn feedback_of_a_frame(bencher: Bencher) {
    let (picture, luminance) = picture();
    let still = Correspondence::still(SIZE, SIZE);
    let mut feedback = Feedback::new(MaskingModel::default(), ToneMap::default(), DEFAULT_WEIGHT);
    let frame = ObservedFrame { luma: &picture.luma, luminance: &luminance, known: Some(&still) };
    bencher.bench_local(|| feedback.observe(frame, 8.0).get(0, 0));
}

/// Times eqs. (4) to (8) for one frame. The encoder's coding leaves a wave in every block.
#[divan::bench(args = [NextPicture::Predicted, NextPicture::Intra { group: 15 }])]
fn coded_feedback_of_a_frame(bencher: Bencher, next: NextPicture) {
    let (picture, luminance) = picture();
    let still = Correspondence::still(SIZE, SIZE);
    let mut feedback = Feedback::new(MaskingModel::default(), ToneMap::default(), DEFAULT_WEIGHT);
    let decoded = Plane::from_fn(SIZE, SIZE, |x, y| picture.picture.luma().get(x, y).saturating_add((x % 8) as u8));
    let (levels, macroblocks) = (Plane::filled(SIZE / 8, SIZE / 8, 7), SIZE / 16);
    let intra = Plane::filled(macroblocks, macroblocks, false);
    let scales = Plane::filled(macroblocks, macroblocks, 8);
    let coded = Coded::new(Arc::new(Picture::gray(decoded)), levels, intra, scales).expect("planes of one picture");
    let steps = QuantiserSteps::default();
    let frame = ObservedFrame { luma: &picture.luma, luminance: &luminance, known: Some(&still) };
    bencher.bench_local(|| feedback.observe_coded(frame, &steps, &coded, next).get(0, 0));
}

/// Times eqs. (4) to (8) for one frame, including prediction of the coding.
#[divan::bench]
fn predicted_feedback_of_a_frame(bencher: Bencher) {
    let (picture, luminance) = picture();
    let still = Correspondence::still(SIZE, SIZE);
    let mut feedback = Feedback::new(MaskingModel::default(), ToneMap::default(), DEFAULT_WEIGHT);
    let steps = QuantiserSteps::default();
    let frame = ObservedFrame { luma: &picture.luma, luminance: &luminance, known: Some(&still) };
    let expected = ExpectedCoding { quantiser_scale: 8.0, begins_group: false };
    bencher.bench_local(|| feedback.observe_predicted(frame, &steps, expected, NextPicture::Predicted).get(0, 0));
}

/// Times only eqs. (1) to (3) for one frame.
#[divan::bench]
fn masking_of_a_frame(bencher: Bencher) {
    let (picture, _) = picture();
    let model = MaskingModel::default();
    bencher.bench(|| model.worst_case_luma(&picture.luma, 8.0));
}

#[divan::bench]
fn blending_thresholds(bencher: Bencher) {
    let (e, still) = (Plane::filled(SIZE, SIZE, 0.01f32), Correspondence::still(SIZE, SIZE));
    bencher.bench(|| blend(&e, &e, &still, 0.5));
}

#[divan::bench]
fn reprojecting_thresholds(bencher: Bencher) {
    let (e, still) = (Plane::filled(SIZE, SIZE, 0.01f32), Correspondence::still(SIZE, SIZE));
    bencher.bench(|| reproject(&e, &still));
}

#[divan::bench(args = Operator::ALL)]
fn tone_mapping_to_ycbcr(bencher: Bencher, operator: Operator) {
    let (radiance, tone_map) = (radiance(), ToneMap::of(operator));
    bencher.bench(|| YCbCr::from_radiance(&radiance, &tone_map));
}

#[divan::bench]
fn transforming_all_blocks(bencher: Bencher) {
    let (picture, _) = picture();
    let (columns, rows) = picture.luma.block_counts();
    let blocks: Vec<_> = (0..columns * rows).map(|i| picture.luma.block(i % columns, i / columns)).collect();
    bencher.bench(|| blocks.iter().map(|block| plane::dct(black_box(block))[9]).sum::<f32>());
}

#[divan::bench]
fn transforming_all_blocks_back(bencher: Bencher) {
    let (picture, _) = picture();
    let (columns, rows) = picture.luma.block_counts();
    let blocks: Vec<_> = (0..columns * rows).map(|i| picture.luma.block(i % columns, i / columns)).collect();
    bencher.bench(|| blocks.iter().map(|block| plane::idct(black_box(block))[9]).sum::<f32>());
}

#[divan::bench]
fn structural_similarity(bencher: Bencher) {
    let (picture, _) = picture();
    bencher.bench(|| ssim(picture.picture.luma(), picture.picture.luma()));
}
