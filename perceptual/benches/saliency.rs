//! Benchmarks of saliency for a 512×512 picture on one thread: `cargo bench -p render2mpeg-perceptual --bench
//! saliency`.

use divan::Bencher;
use perceptual::{saliency, steady_saliency};
use plane::{Correspondence, Plane};

fn main() {
    divan::main();
}

const SIZE: usize = 512;

/// Returns a picture with waves of several lengths and hues, and noise from a fixed seed.
fn picture() -> Plane<[f32; 3]> {
    let mut state = 7u32;
    Plane::from_fn(SIZE, SIZE, |x, y| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (state >> 8) as f32 / (1 << 24) as f32;
        let (x, y) = (x as f32, y as f32);
        let wave = (x * 0.05).sin() * (y * 0.31).cos();
        let hue = (x * 0.013).cos() * (y * 0.021).sin();
        [0.5 + 0.2 * wave + 0.1 * hue + 0.1 * noise, 0.4 + 0.2 * wave, 0.4 + 0.2 * wave - 0.1 * hue]
    })
}

/// Returns the motion of a rotating camera, with an independently moving strip.
fn motion() -> Plane<[f32; 2]> {
    Plane::from_fn(SIZE, SIZE, |x, y| {
        let pan = [1.5 + 0.002 * x as f32, 0.001 * y as f32];
        if (200..230).contains(&x) { [-2.0, 1.0] } else { pan }
    })
}

#[divan::bench]
fn saliency_of_a_frame(bencher: Bencher) {
    let rgb = picture();
    bencher.bench(|| saliency(&rgb, None));
}

#[divan::bench]
fn saliency_of_a_frame_with_motion(bencher: Bencher) {
    let (rgb, motion) = (picture(), motion());
    bencher.bench(|| saliency(&rgb, Some(&motion)));
}

#[divan::bench]
fn steadying_saliency(bencher: Bencher) {
    let (now, still) = (saliency(&picture(), None), Correspondence::still(SIZE, SIZE));
    bencher.bench(|| steady_saliency(&now, &now, &still));
}
