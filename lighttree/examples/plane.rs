//! Lights a plane with 100 000 virtual lights, without any renderer: a room whose walls and ceiling glow unevenly, and
//! a ball that throws shadows on the floor. Prints the cut size, time and error for several thresholds.
//!
//! `cargo run --release -p lighttree --example plane [lights] [floor points along a side]`

use std::f32::consts::{PI, TAU};
use std::time::{Duration, Instant};

use glam::Vec3;
use lighttree::{BuildParams, Cut, Emission, Lambert, Light, LightTree, Scratch, Stop, luminance};

/// Half the room's width, and its height \[m\].
const HALF_WIDTH: f32 = 5.0;
const HEIGHT: f32 = 4.0;
const BALL: (Vec3, f32) = (Vec3::new(1.0, 0.5, 1.0), 0.8);

/// Reproducible numbers in 0 … 1 (xorshift64*).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Virtual lights on four walls and the ceiling, brighter near two lamps; the last hundredth hang free and shine
/// everywhere.
fn room(count: usize) -> Vec<Light> {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let lamps = [Vec3::new(-4.0, -4.0, 3.0), Vec3::new(4.5, 2.0, 2.0)];
    (0..count)
        .map(|k| {
            let (u, v) = ((2.0 * random.next() - 1.0) * HALF_WIDTH, random.next() * HEIGHT);
            let w = (2.0 * random.next() - 1.0) * HALF_WIDTH;
            let (position, axis) = match k % 6 {
                0 => (Vec3::new(-HALF_WIDTH, u, v), Vec3::X),
                1 => (Vec3::new(HALF_WIDTH, u, v), Vec3::NEG_X),
                2 => (Vec3::new(u, -HALF_WIDTH, v), Vec3::Y),
                3 => (Vec3::new(u, HALF_WIDTH, v), Vec3::NEG_Y),
                _ => (Vec3::new(u, w, HEIGHT), Vec3::NEG_Z),
            };
            let glow: f32 = lamps.iter().map(|lamp| 1.0 / (0.5 + lamp.distance_squared(position))).sum();
            let color = Vec3::new(1.0, 0.9, 0.7).lerp(Vec3::new(0.6, 0.7, 1.0), random.next());
            let intensity = color * (glow * 0.5 + random.next() * 0.1) * (1000.0 / count as f32);
            match k % 100 {
                99 => Light { position: position * 0.9, emission: Emission::Omni, intensity: intensity / TAU },
                _ => Light { position, emission: Emission::Cosine(axis), intensity },
            }
        })
        .collect()
}

/// Does the ball leave the segment free?
fn unblocked(from: Vec3, to: Vec3) -> bool {
    let (centre, radius) = BALL;
    let along = to - from;
    let t = ((centre - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    (from + along * t).distance_squared(centre) > radius * radius
}

fn floor(side: usize) -> Vec<Lambert> {
    let place = |k: usize| ((k as f32 + 0.5) / side as f32 * 2.0 - 1.0) * HALF_WIDTH;
    (0..side * side)
        .map(|k| Lambert {
            position: Vec3::new(place(k % side), place(k / side), 0.0),
            normal: Vec3::Z,
            reflectance: Vec3::new(0.6, 0.5, 0.4),
        })
        .collect()
}

fn main() {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse().expect("a number"));
    let lights = room(arguments.next().unwrap_or(100_000));
    let points = floor(arguments.next().unwrap_or(256));

    let start = Instant::now();
    let lit_area = 4.0 * 2.0 * HALF_WIDTH * HEIGHT + 4.0 * HALF_WIDTH * HALF_WIDTH;
    let softening2 = lit_area / (PI * lights.len() as f32);
    let mut tree = LightTree::build(&lights, BuildParams { softening2, seed: 1 });
    println!("{} lights: built in {:?}, depth {}", tree.len(), start.elapsed(), tree.depth());
    let intensities: Vec<Vec3> = lights.iter().map(|light| light.intensity).collect();
    let start = Instant::now();
    let stats = tree.update(&intensities);
    println!("updated in {:?}, {:.1} % of nodes swapped", start.elapsed(), 100.0 * stats.swapped_share);

    // The truth at few points only: it takes long, which is the point.
    let stride = (points.len() / 100).max(1);
    let start = Instant::now();
    let truth: Vec<Vec3> = points
        .iter()
        .step_by(stride)
        .map(|p| tree.exhaustive(p, |light, _| unblocked(p.position, light.position)))
        .collect();
    let exhaustive_time = start.elapsed() / truth.len() as u32;
    let mean = truth.iter().map(|&t| luminance(t)).sum::<f32>() / truth.len() as f32;
    println!("every light: {exhaustive_time:?} per point, mean luminance {mean:.4} W/(m²·sr)\n");

    println!("threshold     | cut size | shadow rays | visited | µs/point | ns/node | × faster | error rms, worst");
    let mut scratch = Scratch::default();
    let absolute =
        [0.05, 0.02, 0.01, 0.005, 0.002].map(|share| (format!("{share:.3} of mean"), Stop::Absolute(share * mean)));
    let relative = [0.02, 0.01]
        .map(|fraction| (format!("relative {fraction:.2}"), Stop::Relative { fraction, known_luminance: 0.0 }));
    for (name, stop) in absolute.into_iter().chain(relative) {
        let start = Instant::now();
        let cuts: Vec<Cut> = points
            .iter()
            .map(|p| tree.lightcut(p, stop, |light, _| unblocked(p.position, light.position), &mut scratch))
            .collect();
        report(&name, start.elapsed(), &cuts, &truth, stride, exhaustive_time);
    }
}

fn report(name: &str, time: Duration, cuts: &[Cut], truth: &[Vec3], stride: usize, exhaustive_time: Duration) {
    let count = cuts.len() as f64;
    let mean = |f: fn(&Cut) -> u32| cuts.iter().map(|cut| f64::from(f(cut))).sum::<f64>() / count;
    let errors: Vec<f32> = cuts
        .iter()
        .step_by(stride)
        .zip(truth)
        .map(|(cut, &truth)| (luminance(cut.radiance) - luminance(truth)).abs() / luminance(truth))
        .collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f32>() / errors.len() as f32).sqrt();
    let visited = mean(|cut| cut.nodes_visited);
    println!(
        "{name:13} | {:8.1} | {:11.1} | {visited:7.1} | {:8.2} | {:7.1} | {:8.0} | {:.2} %, {:.2} %",
        mean(|cut| cut.size),
        mean(|cut| cut.shadow_rays),
        time.as_secs_f64() * 1e6 / count,
        time.as_secs_f64() * 1e9 / count / visited,
        exhaustive_time.as_secs_f64() * count / time.as_secs_f64(),
        100.0 * rms,
        100.0 * errors.iter().fold(0.0, |a: f32, &b| a.max(b)),
    );
}
