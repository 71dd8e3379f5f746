//! Prints error against time for several methods of lighting a receiver from 100 000 lights. If a path is given, also
//! plots the results.
//!
//! `cargo run --release -p lighttree --example sweep [out.svg]`
//!
//! Shadow rays only test a ball and cost almost nothing. Where rays are more expensive, also compare their number.
//! Figures with times vary between runs. The figures of `docs/`, made by `examples/figures.rs`, do not vary.

mod rivals;
mod room;

use glam::Vec3;
use lighttree::{Lambert, Light, LightTree, Scratch, Stop, luminance};
use plot::{BLUE, GRAY, GREEN, Plot, RED};
use rivals::{Method, illuminate};
use room::{floor, params, room, unblocked};

const LIGHTS: usize = 100_000;
/// Number of runs. The shortest time is reported.
const REPEATS: usize = 5;

/// Name of a setting, and the function from a stream of random numbers to the method.
type Setting = (String, Box<dyn Fn(u64) -> Method>);

/// A method with the color of its line in the plot.
struct Rival {
    name: &'static str,
    color: &'static str,
    settings: Vec<Setting>,
}

/// Returns the CPU time of this thread \[s\].
fn now() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn main() {
    let tree = LightTree::build(&room(LIGHTS), params(LIGHTS));
    let receivers = floor(16);
    let visible = |receiver: &Lambert, light: &Light| unblocked(receiver.position, light.position);
    // The exhaustive sum is the reference for time and error.
    let start = now();
    let truth: Vec<f32> =
        receivers.iter().map(|r| luminance(tree.exhaustive(r, |light, _| visible(r, light)))).collect();
    let every_light = (now() - start) / receivers.len() as f64;
    println!("{:38} {:>12} {:>12} {:>12}", "", "µs", "shadow rays", "error, rms");
    println!("{:38} {:12.1} {LIGHTS:12} {:>12}", "every light", every_light * 1e6, "0");

    let mean = truth.iter().sum::<f32>() / truth.len() as f32;
    let mut scratch = Scratch::with_max_size(LIGHTS as u32);
    let mut plot = Plot::new(
        &format!("Every light takes {:.0} µs", every_light * 1e6),
        "time for a receiver [µs]",
        "relative error, rms [%]",
    );
    plot.logarithmic();
    for Rival { name, color, settings } in rivals(mean) {
        let points = settings.iter().map(|(setting, method)| {
            let mut light_all = || -> Vec<(Vec3, u32)> {
                let each = (0..).zip(&receivers);
                each.map(|(stream, receiver)| {
                    let sees = |light: &Light, _| visible(receiver, light);
                    let cut = illuminate(&tree, receiver, method(stream), sees, &mut scratch);
                    (cut.radiance, cut.shadow_rays)
                })
                .collect()
            };
            // Measure the error in the first run and the time in the repetitions.
            let found = light_all();
            let mut least = f64::INFINITY;
            for _ in 0..REPEATS {
                let start = now();
                std::hint::black_box(light_all());
                least = least.min(now() - start);
            }
            let count = receivers.len() as f32;
            let microseconds = least as f32 / count * 1e6;
            let squares = found.iter().zip(&truth).map(|(&(found, _), truth)| (luminance(found) / truth - 1.0).powi(2));
            let error = 100.0 * (squares.sum::<f32>() / count).sqrt();
            let rays = found.iter().map(|&(_, rays)| rays as f32).sum::<f32>() / count;
            println!("{:38} {microseconds:12.1} {rays:12.1} {error:10.2} %", format!("{name}, {setting}"));
            (microseconds.log10(), error.log10())
        });
        plot.line(name, color, points.collect());
    }
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(&path, plot.finish()).unwrap_or_else(|error| panic!("{path}: {error}"));
    }
}

/// Returns all methods, for receivers with this mean luminance.
fn rivals(mean: f32) -> [Rival; 4] {
    const SHARES: [f32; 6] = [0.2, 0.1, 0.05, 0.02, 0.01, 0.005];
    fn by<T: Copy + 'static>(
        values: &[T],
        name: impl Fn(T) -> String,
        method: impl Fn(T, u64) -> Method + Copy + 'static,
    ) -> Vec<Setting> {
        let setting = |&value: &T| {
            let method: Box<dyn Fn(u64) -> Method> = Box::new(move |stream| method(value, stream));
            (name(value), method)
        };
        values.iter().map(setting).collect()
    }
    let of_mean = |share: f32| format!("{share} of the mean");
    let absolute = move |share: f32| Stop::Absolute(share * mean);
    let relative = |fraction| Method::Lightcut(Stop::Relative { fraction, known_luminance: 0.0 });
    let own = |share: f32| format!("{share} of its own");
    [
        Rival {
            name: "lightcut",
            color: BLUE,
            settings: by(&SHARES, of_mean, move |share, _| Method::Lightcut(absolute(share))),
        },
        Rival { name: "lightcut, relative", color: GRAY, settings: by(&SHARES, own, move |share, _| relative(share)) },
        Rival {
            name: "lights drawn for each",
            color: GREEN,
            settings: by(&SHARES, of_mean, move |share, stream| Method::Stochastic { stop: absolute(share), stream }),
        },
        Rival {
            name: "tree sampled from the root",
            color: RED,
            settings: by(
                &[4, 16, 64, 256, 1024],
                |samples| format!("{samples} samples"),
                |samples, stream| Method::Sampled { samples, stream },
            ),
        },
    ]
}
