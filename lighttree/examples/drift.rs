//! Cost of a tree over a thousand frames of moving light. A spot circles over walls of 10 000 lights. Lightcuts in the
//! tree of the first frame, which is never rebuilt, are compared with lightcuts in a new tree. The example also prints
//! the growth of the tree's cost.
//!
//! `cargo run --release -p lighttree --example drift`

mod room;

use glam::Vec3;
use lighttree::{Light, LightTree, Scratch, Stop, luminance};
use room::{floor, params, room};

const LIGHTS: usize = 10_000;
const FRAMES: usize = 1000;

/// Returns the CPU time of this thread \[s\].
fn now() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Returns the intensities of the lights under a spot that circles twice.
fn lit(lights: &[Light], frame: usize) -> Vec<Vec3> {
    let turn = 2.0 * std::f32::consts::TAU * frame as f32 / FRAMES as f32;
    let spot = Vec3::new(5.0 * turn.cos(), 5.0 * turn.sin(), 2.0 + 1.5 * (0.7 * turn).sin());
    let near = |light: &Light| (-0.5 * light.position.distance_squared(spot)).exp() + 1e-3;
    lights.iter().map(|light| light.intensity * near(light)).collect()
}

fn main() {
    let mut lights = room(LIGHTS);
    let bare = lights.clone();
    for (light, intensity) in lights.iter_mut().zip(lit(&bare, 0)) {
        light.intensity = intensity;
    }
    let params = params(LIGHTS);
    // Build a tree for the first frame. It is only updated afterwards.
    let mut tree = LightTree::build(&lights, params);
    let receivers = floor(16);
    let mut scratch = Scratch::with_max_size(u32::from(u16::MAX));
    let mut mean_size = |tree: &LightTree, stop: Stop| {
        let sizes = receivers.iter().map(|r| tree.lightcut(r, stop, |_, _| true, &mut scratch).size);
        f64::from(sizes.sum::<u32>()) / receivers.len() as f64
    };
    let mut spent = 0.0;
    println!("frame | cost growth | cut size | with a new tree | ratio");
    // Compare with a new tree every 50 frames.
    for frame in 1..=FRAMES {
        let intensities = lit(&bare, frame);
        let start = now();
        let stats = tree.update_drawn(&intensities);
        spent += now() - start;
        if frame % 50 != 0 {
            continue;
        }
        for (light, &intensity) in lights.iter_mut().zip(&intensities) {
            light.intensity = intensity;
        }
        let fresh = LightTree::build(&lights, params);
        let bright = receivers.iter().map(|r| luminance(fresh.exhaustive(r, |_, _| true))).sum::<f32>();
        let stop = Stop::Absolute(0.02 * bright / receivers.len() as f32);
        let (old, new) = (mean_size(&tree, stop), mean_size(&fresh, stop));
        let growth = stats.cost_growth;
        println!("{frame:5} | {growth:11.3} | {old:8.1} | {new:15.1} | {:.3}", old / new);
    }
    println!("update: {:.3} ms a frame", 1e3 * spent / FRAMES as f64);
}
