//! Plots the response of thresholds to changing input: `docs/dynamics.svg`.
//!
//! `cargo run --release -p render2mpeg-perceptual --example dynamics`

use perceptual::{Feedback, MaskingModel, ObservedFrame, ToneMap, WHITE_LUMA};
use plane::{Correspondence, Plane};
use plot::{BLUE, GRAY, GREEN, Plot, RED};

const SIDE: usize = 16;
const FRAMES: usize = 80;
/// Index of the frame in which the input changes.
const EVENT: usize = 10;

/// Returns the mean of ΔY per frame, relative to the first frame. `input` returns the brightness and quantiser_scale of
/// a frame. `taken` is the renderer's error as a fraction of the threshold; the error alternates in sign between
/// frames.
fn response(weight: f32, kappa: f32, taken: f32, input: impl Fn(usize) -> (f32, f32)) -> Vec<(f32, f32)> {
    let still = Correspondence::still(SIDE, SIDE);
    let tone_map = ToneMap::default();
    let mut feedback = Feedback::new(MaskingModel::default(), tone_map, weight).with_kappa(kappa);
    let mut means = Vec::new();
    for n in 0..FRAMES {
        let (brightness, quantiser_scale) = input(n);
        let allowed = feedback.thresholds_for_next(&still);
        let luminance = Plane::from_fn(SIDE, SIDE, |x, y| {
            let truth = brightness * (0.2 + 0.1 * ((x * 7 + y * 3) % 5) as f32);
            let wrong = taken * allowed.resolve(x, y, truth);
            (truth + if n % 2 == 0 { wrong } else { -wrong }).max(0.0)
        });
        let luma = luminance.map(|y| WHITE_LUMA * tone_map.encode(y));
        let known = (n > 0).then_some(&still);
        let thresholds = feedback.observe(ObservedFrame { luma: &luma, luminance: &luminance, known }, quantiser_scale);
        means.push(thresholds.samples().iter().sum::<f32>() / (SIDE * SIDE) as f32);
    }
    let first = means[0];
    means.into_iter().enumerate().map(|(n, mean)| (n as f32, mean / first)).collect()
}

fn main() {
    let flash = |n: usize| (if (EVENT..2 * EVENT).contains(&n) { 1.0 } else { 0.5 }, 8.0);
    let mut plot = Plot::new("Mean threshold by frame", "frame", "relative to the first");
    plot.line("light doubled, w = 0.5", BLUE, response(0.5, 1.0, 0.0, flash));
    plot.line("the same, w = 0.9", GRAY, response(0.9, 1.0, 0.0, flash));
    let jumps = |n: usize| (0.5, if n < EVENT || n.is_multiple_of(2) { 16.0 } else { 32.0 });
    plot.line("q = 16 and 32 in turn", GREEN, response(0.5, 1.0, 0.0, jumps));
    plot.line("closed loop, κ = 1/4, q = 48", RED, response(0.5, 0.25, 1.0, |_| (1.0, 48.0)));
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/dynamics.svg");
    std::fs::write(path, plot.finish()).unwrap_or_else(|error| panic!("{path}: {error}"));
    println!("{path}");
}
