//! Plots the response of calibrated stopping to changing light: `docs/controller.svg`.
//!
//! In the model, a lightcut that ends at λ times the threshold has an error between 0 and `scale · λ` thresholds,
//! uniformly distributed. The target λ is therefore known: 0.9 / (0.95 scale). Each frame audits 200 pixels.
//!
//! `cargo run --release -p lighttree --example controller`

use lighttree::{Audits, Calibration};
use plot::{GRAY, Plot, RED};

const CLASS: usize = 2;
const AUDITS: u32 = 200;

/// Returns the error scale of the lightcuts of a frame.
fn scale(frame: usize) -> f32 {
    match frame {
        // A light is switched on and off every frame.
        30..70 => [0.5, 2.0][frame % 2],
        // A shot change switches to another scene, and a second one switches back.
        100..130 => 5.0,
        // A flash lasts one frame.
        160 => 1e6,
        // The light differs in every frame: scales from a half to twice, uniform in octaves.
        190..230 => (((frame * 7919 % 97) as f32 / 96.0) * 2.0 - 1.0).exp2(),
        _ => 1.0,
    }
}

fn main() {
    let mut calibration = Calibration::default();
    let (mut found, mut exact) = (Vec::new(), Vec::new());
    for frame in 0..260 {
        let lambda = calibration.lambda(CLASS);
        found.push((frame as f32, lambda.log2()));
        let aim = 0.9 / (0.95 * scale(frame));
        exact.push((frame as f32, aim.log2().max(-4.0)));
        let audits = Audits::default();
        for k in 0..AUDITS {
            audits.note(CLASS, (k as f32 + 0.5) / AUDITS as f32 * scale(frame) * lambda);
        }
        calibration.learn(&audits);
    }
    let mut plot = Plot::new(
        "λ: switched light, a cut and back, a flash of a million, noise",
        "frame",
        "octaves of the multiplier λ",
    );
    plot.line("what errors would allow", GRAY, exact);
    plot.line("λ", RED, found);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/controller.svg");
    std::fs::write(path, plot.finish()).unwrap_or_else(|error| panic!("{path}: {error}"));
    println!("{path}");
}
