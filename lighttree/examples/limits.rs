//! Plots the precision loss of `f32` near the singularities of a light's contribution: `docs/limits.svg`.
//!
//! `cargo run --release -p lighttree --example limits`

use glam::{DVec3, Vec3};
use lighttree::{Emission, Ggx, Lambert, Light, exhaustive};
use plot::{BLUE, GREEN, Plot, RED};
use std::f64::consts::PI;

const GEOMETRY_TERM_BOUND: f32 = 0.01;

/// Returns the relative error of the light from one source at `position` that faces the receiver, in `f32` roundings.
/// The result is at least 0.1.
fn error(position: Vec3) -> f32 {
    let receiver = Lambert { position: Vec3::ZERO, normal: Vec3::new(0.6, 0.0, 0.8), reflectance: Vec3::ONE };
    let light = Light { position, emission: Emission::Cosine(-position.normalize()), intensity: Vec3::ONE };
    let found = f64::from(exhaustive(&[light], GEOMETRY_TERM_BOUND, &receiver, |_, _| true).x);
    let Emission::Cosine(axis) = light.emission else { unreachable!("made above") };
    let (way, normal) = (position.as_dvec3(), receiver.normal.as_dvec3());
    let direction = way.normalize();
    let cosines = normal.dot(direction) * -axis.as_dvec3().dot(direction);
    let exact = cosines / (PI * (way.length_squared() + f64::from(GEOMETRY_TERM_BOUND)));
    ((found / exact - 1.0).abs() / f64::from(f32::EPSILON)).max(0.1) as f32
}

/// Evaluates the lobe of a rough metal, seen from straight above, by definition in `f64`.
fn lobe(alpha: f64, way: DVec3) -> f64 {
    let (alpha2, cos_i) = (alpha * alpha, way.z);
    let cos_h = (way + DVec3::Z).normalize().z;
    let density = alpha2 / (PI * (cos_h * cos_h * (alpha2 - 1.0) + 1.0).powi(2));
    density / (2.0 * ((cos_i * cos_i * (1.0 - alpha2) + alpha2).sqrt() + cos_i)) * cos_i
}

/// Returns the largest relative error of the lobe within four half widths and 80°, as (log₁₀ α, log₁₀ error).
fn lobes(alpha: f32) -> (f32, f32) {
    let (position, normal, view) = (Vec3::ZERO, Vec3::Z, Vec3::Z);
    let receiver = Ggx { position, normal, view, diffuse: Vec3::ZERO, specular: Vec3::ONE, alpha };
    let errors = (0..64).map(|k| {
        let angle = (4.0 * alpha).min(1.4) * k as f32 / 64.0;
        let way = Vec3::new(angle.sin(), 0.0, angle.cos());
        let light = Light { position: way, emission: Emission::Cosine(-way.normalize()), intensity: Vec3::ONE };
        let found = f64::from(exhaustive(&[light], 0.0, &receiver, |_, _| true).x);
        let exact = lobe(alpha.into(), way.as_dvec3().normalize()) / way.as_dvec3().length_squared();
        ((found / exact - 1.0).abs() / f64::from(f32::EPSILON)).max(0.1) as f32
    });
    (alpha.log10(), errors.fold(0.0, f32::max).log10())
}

/// Returns the largest error for 64 neighboring positions, as (log₁₀ parameter, log₁₀ error).
fn worst(parameter: f32, place: impl Fn(f32) -> Vec3) -> (f32, f32) {
    let errors = (0..64).map(|k| error(place(k as f32 / 64.0)));
    (parameter.log10(), errors.fold(0.0, f32::max).log10())
}

fn main() {
    let mut plot = Plot::new(
        "Error in f32 against f64",
        "distance by softening, cosine, or α of a lobe",
        "relative, in roundings of 1.2e-7",
    );
    plot.logarithmic();
    let distances = (-12..=12).map(|k| 10f32.powf(k as f32 / 4.0));
    let at =
        |distance: f32| move |k: f32| Vec3::new(k - 0.5, 0.3, 1.0).normalize() * distance * GEOMETRY_TERM_BOUND.sqrt();
    plot.line("contact to far away", BLUE, distances.map(|d| worst(d, at(d))).collect());
    let cosines = (0..=16).map(|k| 10f32.powf(-k as f32 / 4.0));
    // Compute a light position. Its angle to the receiver's plane has this sine.
    let grazing = |cosine: f32| {
        move |k: f32| {
            let (normal, along) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.8 * k.cos(), k.sin(), -0.6 * k.cos()));
            normal * cosine + along * (1.0 - cosine * cosine).max(0.0).sqrt()
        }
    };
    plot.line("grazing light, by cosine", RED, cosines.map(|c| worst(c, grazing(c))).collect());
    // The smallest roughness is 0.02.
    let alphas = (0..=6).map(|k| 10f32.powf(-k as f32 / 4.0)).chain([0.02]);
    plot.line("rough metal, by α", GREEN, alphas.map(lobes).collect());
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/limits.svg");
    std::fs::write(path, plot.finish()).unwrap_or_else(|error| panic!("{path}: {error}"));
    println!("{path}");
}
