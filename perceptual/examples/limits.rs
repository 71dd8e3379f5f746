//! Plots the precision loss of `f32` near the singularities of tone curves and of equation (1): `docs/limits.svg`.
//!
//! `cargo run --release -p render2mpeg-perceptual --example limits`

use perceptual::{MaskingModel, Operator, ToneMap};
use plot::{BLUE, GRAY, GREEN, Plot, RED};

/// Returns the relative error in `f32` roundings, at least 0.1.
fn roundings(found: f32, exact: f64) -> f32 {
    ((f64::from(found) / exact - 1.0).abs() / f64::from(f32::EPSILON)).max(0.1) as f32
}

/// Returns the largest error for 64 values near `parameter`, as (log₁₀ parameter, log₁₀ error).
fn worst(parameter: f32, error: impl Fn(f32) -> f32) -> (f32, f32) {
    let errors = (0..64).map(|k| error(parameter * (1.0 + k as f32 / 64.0)));
    (parameter.log10(), errors.fold(0.0, f32::max).log10())
}

/// Returns the function from the distance below display white to the round-trip error of encoding and decoding.
fn there_and_back(tone_map: ToneMap) -> impl Fn(f32) -> f32 {
    move |below| {
        // Choose a slightly brighter value, because an exact display value would return without error.
        let linear = tone_map.decode(1.0 - below) * (1.0 + 0.37 * below);
        roundings(tone_map.decode(tone_map.encode(linear)), linear.into())
    }
}

/// Returns the error of equation (1) for a block half as bright as the mean of the picture. `share` is this mean
/// relative to white.
fn luminance_masking(share: f32) -> f32 {
    let (model, mean) = (MaskingModel::default(), share * 8.0 * 219.0);
    let (q, dc) = (f64::from(model.intra_matrix[9]), 0.5 * mean * 0.9);
    let exact = q * (f64::from(dc) / f64::from(mean)).powf(0.649 * f64::from(model.display_gamma));
    roundings(model.luminance_thresholds(dc, mean)[9], exact)
}

fn main() {
    let mut plot = Plot::new(
        "Error in f32 against f64",
        "what is left to display white, or mean of the picture by white",
        "relative, in roundings of 1.2e-7",
    );
    plot.logarithmic();
    let shares = || (1..=24).rev().map(|k| 10f32.powf(-k as f32 / 4.0));
    let curves = [
        ("sRGB, there and back", BLUE, Operator::Srgb),
        ("filmic, there and back", GREEN, Operator::Filmic),
        ("Reinhard, there and back", RED, Operator::Reinhard),
    ];
    for (name, color, operator) in curves {
        let error = there_and_back(ToneMap::of(operator));
        plot.line(name, color, shares().map(|share| worst(share, &error)).collect());
    }
    plot.line("equation (1)", GRAY, shares().map(|share| worst(share, luminance_masking)).collect());
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/limits.svg");
    std::fs::write(path, plot.finish()).unwrap_or_else(|error| panic!("{path}: {error}"));
    println!("{path}");
}
