//! Lights a plane with 100 000 virtual lights, without a renderer. The walls and ceiling of a room glow unevenly, and a
//! ball casts shadows on the floor. Prints lightcut size, time and error for several thresholds.
//!
//! `cargo run --release -p lighttree --example plane [lights] [floor points along a side]`

mod room;

use std::time::{Duration, Instant};

use glam::Vec3;
use lighttree::{LightTree, Lightcut, Scratch, Stop, luminance};
use room::{floor, params, room, unblocked};

fn main() {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse().expect("a number"));
    let lights = room(arguments.next().unwrap_or(100_000));
    let points = floor(arguments.next().unwrap_or(256));

    let start = Instant::now();
    let params = params(lights.len());
    let mut tree = LightTree::build(&lights, params);
    println!("{} lights: built in {:?}, depth {}", tree.len(), start.elapsed(), tree.depth());
    let intensities: Vec<Vec3> = lights.iter().map(|light| light.intensity).collect();
    let start = Instant::now();
    let stats = tree.update(&intensities);
    println!("updated in {:?}, {:.1} % of nodes swapped", start.elapsed(), 100.0 * stats.swapped_share);

    // Compute the reference only at a few points, because it is slow.
    let stride = (points.len() / 100).max(1);
    let start = Instant::now();
    let truth: Vec<Vec3> = points
        .iter()
        .step_by(stride)
        .map(|p| tree.exhaustive(p, |light, _| unblocked(p.position, light.position)))
        .collect();
    let exhaustive_time = start.elapsed() / truth.len() as u32;
    let truth = Truth { luminance: truth.into_iter().map(luminance).collect(), stride, time: exhaustive_time };
    let mean = truth.luminance.iter().sum::<f32>() / truth.luminance.len() as f32;
    println!("every light: {exhaustive_time:?} per point, mean luminance {mean:.4} W/(m²·sr)\n");

    println!("threshold     | cut size | shadow rays | visited | µs/point | ns/node | × faster | error rms, worst");
    // Print one line of the table for each threshold.
    let mut scratch = Scratch::default();
    let absolute =
        [0.05, 0.02, 0.01, 0.005, 0.002].map(|share| (format!("{share:.3} of mean"), Stop::Absolute(share * mean)));
    let relative = [0.02, 0.01]
        .map(|fraction| (format!("relative {fraction:.2}"), Stop::Relative { fraction, known_luminance: 0.0 }));
    for (name, stop) in absolute.into_iter().chain(relative) {
        let start = Instant::now();
        let cuts: Vec<Lightcut> = points
            .iter()
            .map(|p| tree.lightcut(p, stop, |light, _| unblocked(p.position, light.position), &mut scratch))
            .collect();
        report(&name, start.elapsed(), &cuts, &truth);
    }
}

/// Reference, computed as sums over all lights.
struct Truth {
    /// Luminance of every `stride`-th point.
    luminance: Vec<f32>,
    stride: usize,
    /// Computation time per point.
    time: Duration,
}

fn report(name: &str, time: Duration, cuts: &[Lightcut], truth: &Truth) {
    let count = cuts.len() as f64;
    let mean = |f: fn(&Lightcut) -> u32| cuts.iter().map(|cut| f64::from(f(cut))).sum::<f64>() / count;
    let mut errors: Vec<f32> = Vec::new();
    for (cut, &truth) in cuts.iter().step_by(truth.stride).zip(&truth.luminance) {
        errors.push((luminance(cut.radiance) - truth).abs() / truth);
    }
    let rms = (errors.iter().map(|e| e * e).sum::<f32>() / errors.len() as f32).sqrt();
    let visited = mean(|cut| cut.nodes_visited);
    println!(
        "{name:13} | {:8.1} | {:11.1} | {visited:7.1} | {:8.2} | {:7.1} | {:8.0} | {:.2} %, {:.2} %",
        mean(|cut| cut.size),
        mean(|cut| cut.shadow_rays),
        time.as_secs_f64() * 1e6 / count,
        time.as_secs_f64() * 1e9 / count / visited,
        truth.time.as_secs_f64() * count / time.as_secs_f64(),
        100.0 * rms,
        100.0 * errors.iter().fold(0.0, |a: f32, &b| a.max(b)),
    );
}
