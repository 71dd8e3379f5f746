//! The loop thresholds → picture → coding → thresholds over up to 10 000 frames. The encoder is real, and the renderers use
//! their full error.
//!
//! `docs/limits.md` contains the analysis; `perceptual/tests/it/dynamics.rs` covers masking alone.

use mpeg2enc::{Config, Effort, Encoder, FrameRate, SuppliedMotion};
use perceptual::{Feedback, MaskingModel, NextPicture, ObservedFrame, QuantiserSteps, ToneMap, YCbCr, luminance_plane};
use plane::{Correspondence, Plane};

const WIDTH: usize = 48;
const HEIGHT: usize = 32;
const GROUP: u32 = 15;

/// Luminance of a picture with smooth areas, edges and detail.
fn scene(x: usize, y: usize) -> f32 {
    let (x, y) = (x as f32, y as f32);
    let detail = 0.5 + 0.5 * (0.9 * x).sin() * (1.1 * y).sin();
    let hill = 1.0 + (0.11 * x).sin() * (0.09 * y).cos();
    0.03 + 0.25 * hill + if x > 24.0 { 0.2 * detail } else { 0.0 }
}

/// Renders one pixel from frame, pixel, true luminance and threshold T, with an error of at most T.
type Renderer = fn(usize, usize, f32, f32) -> f32;

/// No error: the loop is open.
fn exact(_frame: usize, _pixel: usize, truth: f32, _threshold: f32) -> f32 {
    truth
}

/// An error of ±T with alternating sign in consecutive frames.
fn alternating(frame: usize, _pixel: usize, truth: f32, threshold: f32) -> f32 {
    truth + if frame.is_multiple_of(2) { threshold } else { -threshold }
}

/// A random error of at most T.
fn random(frame: usize, pixel: usize, truth: f32, threshold: f32) -> f32 {
    let mixed = (frame as u64 * 1_000_003 + pixel as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    truth + threshold * ((mixed >> 40) as f32 / (1 << 23) as f32 - 1.0)
}

/// Rounding to multiples of 2 T.
fn rounding(_frame: usize, _pixel: usize, truth: f32, threshold: f32) -> f32 {
    if threshold > 0.0 { (truth / (2.0 * threshold)).round() * 2.0 * threshold } else { truth }
}

const RENDERERS: [(&str, Renderer); 3] = [("alternating", alternating), ("random", random), ("rounding", rounding)];

struct Loop {
    encoder: Encoder,
    feedback: Feedback,
    renderer: Renderer,
    frame: usize,
}

impl Loop {
    fn new(renderer: Renderer, quantiser_scale: u32) -> Self {
        let config = Config::new(WIDTH, HEIGHT, FrameRate::FPS_25).with_effort(Effort::Fast).with_gop(GROUP);
        let encoder = config.with_quantiser_scale(quantiser_scale).encoder().unwrap();
        let feedback = Feedback::new(MaskingModel::default(), ToneMap::default(), 0.5);
        Self { encoder, feedback, renderer, frame: 0 }
    }

    /// Renders the next frame at this brightness, and returns the mean T relative to the mean luminance.
    fn step(&mut self, brightness: f32) -> f64 {
        let still = Correspondence::still(WIDTH, HEIGHT);
        let allowed = self.feedback.thresholds_for_next(&still);
        let radiance = Plane::from_fn(WIDTH, HEIGHT, |x, y| {
            let truth = brightness * scene(x, y);
            let threshold = allowed.get(x, y).unwrap_or(0.02 * truth);
            [(self.renderer)(self.frame, y * WIDTH + x, truth, threshold).max(0.0); 3]
        });
        let picture = YCbCr::from_radiance(&radiance, &ToneMap::default());
        let packet = self.encoder.push(&picture.picture, SuppliedMotion::default()).remove(0);
        self.frame += 1;
        let begins_group = (self.frame as u32).is_multiple_of(GROUP);
        let next = if begins_group { NextPicture::Intra { group: GROUP } } else { NextPicture::Predicted };
        let coded = packet.coded();
        let luminance = luminance_plane(&radiance);
        let steps = QuantiserSteps::default();
        let known = (self.frame > 1).then_some(&still);
        let frame = ObservedFrame { luma: &picture.luma, luminance: &luminance, known };
        let thresholds = self.feedback.observe_coded(frame, &steps, &coded, next);
        assert!(thresholds.samples().iter().all(|t| t.is_finite() && *t >= 0.0));
        let sum = |plane: &Plane<f32>| plane.samples().iter().map(|&value| f64::from(value)).sum::<f64>();
        sum(thresholds) / sum(&luminance).max(1e-9)
    }
}

/// Mean of the last ten groups.
fn settled(frames: &[f64]) -> f64 {
    let last = &frames[frames.len() - 10 * GROUP as usize..];
    last.iter().sum::<f64>() / last.len() as f64
}

/// A static picture gives bit-identical thresholds in every group.
#[test]
fn ten_thousand_still_frames_repeat_group_by_group() {
    for (quantiser_scale, frames) in [(2, 900), (112, 900), (32, 10_000)] {
        let mut still = Loop::new(exact, quantiser_scale);
        let means: Vec<f64> = (0..frames).map(|_| still.step(1.0)).collect();
        let group = GROUP as usize;
        // From the third group on, as the very first picture has no predecessor.
        let of = |n: usize| &means[n * group..(n + 1) * group];
        for n in 3..frames / group {
            assert_eq!(of(n), of(2), "quantiser {quantiser_scale}, group {n}");
        }
    }
}

/// Errors within the thresholds cost bits and lower the next thresholds. The closed loop converges below 1.05 times the open
/// loop, from every initial state.
#[test]
fn errors_that_are_taken_do_not_feed_on_themselves() {
    for quantiser_scale in [2, 16, 48, 112] {
        // The open loop: no error.
        let open = settled(
            &(0..300)
                .map(|_| ())
                .scan(Loop::new(exact, quantiser_scale), |l, ()| Some(l.step(1.0)))
                .collect::<Vec<_>>(),
        );
        for (name, renderer) in RENDERERS {
            let means = [0.0, 1e-4, 1e4].map(|start| {
                let mut closed = Loop::new(renderer, quantiser_scale);
                if start > 0.0 {
                    closed.feedback.restore(Plane::filled(WIDTH, HEIGHT, start));
                }
                settled(&(0..450).map(|_| closed.step(1.0)).collect::<Vec<_>>())
            });
            println!("quantiser {quantiser_scale}, {name}: {means:.5?}, open {open:.5}");
            for mean in means {
                assert!(
                    mean < 1.05 * open && mean > 0.5 * open,
                    "quantiser {quantiser_scale}, {name}: {mean} of {open}"
                );
                assert!((mean / means[0] - 1.0).abs() < 0.02, "quantiser {quantiser_scale}, {name}: {means:?}");
            }
        }
    }
}

/// Under changing light and quantisers, thresholds stay between half the smallest and 1.5 times the largest of the open loop.
#[test]
fn whatever_light_and_quantiser_do_it_stays_in_its_band() {
    type Input = fn(usize) -> (f32, u32);
    let inputs: [(&str, Input); 5] = [
        ("a step", |n| (if n < 100 { 0.05 } else { 3.0 }, 16)),
        ("a square wave", |n| (if n / 7 % 2 == 0 { 1.0 } else { 8.0 }, 16)),
        ("noise", |n| (0.1 + (n * 7919 % 1000) as f32 / 300.0, 32)),
        ("a jumping quantiser", |n| (1.0, if n % 2 == 0 { 1 } else { 112 })),
        ("another quantiser for every frame", |n| (1.0, [2, 48, 8, 104, 24, 5, 62][n % 7])),
    ];
    for (what, input) in inputs {
        let means = |renderer: Renderer| -> Vec<f64> {
            let mut run = Loop::new(renderer, 16);
            let next = |n: usize| {
                let (brightness, quantiser_scale) = input(n);
                run.encoder.set_quantiser_scale(quantiser_scale).unwrap();
                run.step(brightness)
            };
            (0..300).map(next).collect()
        };
        let range = |means: &[f64]| means.iter().fold((f64::MAX, 0.0f64), |(low, high), &t| (low.min(t), high.max(t)));
        let (low, high) = range(&means(exact));
        for (name, renderer) in RENDERERS {
            let (least, most) = range(&means(renderer));
            println!("{what}, {name}: {least:.4} to {most:.4}, open {low:.4} to {high:.4}");
            assert!(least > 0.5 * low && most < 1.5 * high, "{what}, {name}: {least} to {most}, open {low} to {high}");
        }
    }
}

/// Ten frames after a flash of 10⁶, thresholds are below twice the undisturbed ones. The weight alone would keep a tenth of the
/// effect.
#[test]
fn a_flash_is_forgotten() {
    for (name, renderer) in [("none", exact as Renderer), RENDERERS[0], RENDERERS[1], RENDERERS[2]] {
        let (mut calm, mut run) = (Loop::new(renderer, 32), Loop::new(renderer, 32));
        // Neither picture 32 nor the next ten start a group.
        for frame in 0..44 {
            let (undisturbed, after) = (calm.step(1.0), run.step(if frame == 32 { 1e6 } else { 1.0 }));
            println!("{name}, frame {frame}: {after:.5}, undisturbed {undisturbed:.5}");
            assert!(
                frame < 42 || after < 2.0 * undisturbed,
                "{name}, frame {frame}: {after}, undisturbed {undisturbed}"
            );
        }
    }
}
