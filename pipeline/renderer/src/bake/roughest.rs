//! Time at which lamps deviate most from the interpolation between key times, found without light.
//!
//! ```text
//! d(t) = Σ |s(t) − (1 − w) s(t_k) − w s(t_(k+1))|        sum over lamps        w = (t − t_k) / (t_(k+1) − t_k)
//! s = Φ (1, p / r, n)        Φ  flux, p  position, n  direction of the lamp, r  radius of the scene
//! ```
//! Light that is equal at both keys may differ between them, as in a flash. The deviation finds it at the keys of the
//! animation and between them.

use glam::Vec3A;
use render_core::scene::Scene;
use render_core::{Emitters, Surfaces, Units, luminance};
use std::f32::consts::PI;

/// Number of steps of an interval between key times, in addition to the keys of the animation.
const STEPS: usize = 8;
/// Maximum number of tested times. Each needs a pose of the scene.
const MOST_TIMES: usize = 2048;
/// Smallest deviation that is measured, as a fraction of the flux of all lamps.
const LEAST: f64 = 1e-3;
/// Number of points by which the position and direction of an area lamp are averaged.
const POINTS: usize = 4;

/// State s of a lamp.
type LampState = [f64; 7];

/// Returns the time at which the lamps of `scene` deviate most from the interpolation between the key `times`; `None` if
/// no lamp deviates.
pub(super) fn roughest(scene: &Scene, times: &[f32]) -> Option<f32> {
    let units = Units::of(scene);
    let keys: Vec<Vec<LampState>> = times.iter().map(|&time| states(scene, &units, time)).collect();
    let mut most = (0.0, None);
    for time in tested_times(scene, times) {
        let next = times.partition_point(|&key| key <= time).clamp(1, times.len() - 1);
        let weight = f64::from((time - times[next - 1]) / (times[next] - times[next - 1]));
        let (mut deviation, mut whole) = (0.0, 0.0);
        let ends = keys[next - 1].iter().zip(&keys[next]);
        for ((begin, end), now) in ends.zip(states(scene, &units, time)) {
            for ((begin, end), now) in begin.iter().zip(end).zip(now) {
                deviation += (now - (1.0 - weight) * begin - weight * end).abs();
            }
            whole += begin[0].max(end[0]).max(now[0]);
        }
        if deviation > LEAST * whole && deviation > most.0 {
            most = (deviation, Some(time));
        }
    }
    most.1
}

/// Returns the times between the key `times` at which the lamps are tested: the keys of the animation, even steps, and
/// the middles between all of these.
fn tested_times(scene: &Scene, times: &[f32]) -> Vec<f32> {
    let mut tested: Vec<f32> = Vec::new();
    for pair in times.windows(2) {
        tested.extend((0..STEPS).map(|step| pair[0] + (pair[1] - pair[0]) * step as f32 / STEPS as f32));
    }
    let lights = scene.light_channels.iter().map(|channel| &channel.keys);
    let materials = scene.material_channels.iter().map(|channel| &channel.keys);
    let last = times[times.len() - 1];
    for channel in scene.channels.iter().chain(lights).chain(materials) {
        tested.extend(channel.times.iter().filter(|time| (0.0..=last).contains(*time)));
    }
    tested.sort_by(f32::total_cmp);
    tested.dedup();
    let middles: Vec<f32> = tested.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0).collect();
    tested.extend(middles);

    // Test evenly distributed times if there are too many.
    tested.sort_by(f32::total_cmp);
    let step = tested.len().div_ceil(MOST_TIMES);
    tested.into_iter().step_by(step).collect()
}

/// Returns the states of all lamps at a `time`, in a fixed order. Dark lamps have a state of zeros.
fn states(scene: &Scene, units: &Units, time: f32) -> Vec<LampState> {
    let pose = scene.pose(time);
    let surfaces = Surfaces::new(scene, &pose);
    let emitters = Emitters::new(&surfaces, &pose, units);
    let mut states = vec![[0.0; 7]; scene.instances.len()];
    for lamp in &emitters.areas {
        let samples = lamp.samples(&surfaces, POINTS);
        let flux = luminance(lamp.power()) / samples.len().max(1) as f32;
        for sample in samples {
            let state = state(flux, sample.position / units.radius, sample.normal);
            states[lamp.instance].iter_mut().zip(state).for_each(|(sum, own)| *sum += own);
        }
    }
    for point in &emitters.points {
        states.push(state(4.0 * PI * luminance(point.intensity), point.position / units.radius, point.axis));
    }
    for sun in &emitters.suns {
        let area = PI * units.radius * units.radius;
        states.push(state(area * luminance(sun.irradiance), Vec3A::ZERO, sun.towards));
    }
    states
}

/// Returns the state of a lamp with a flux \[W\], a position in units of the scene's radius, and a direction.
fn state(flux: f32, position: Vec3A, direction: Vec3A) -> LampState {
    let [x, y, z] = position.to_array();
    let [a, b, c] = direction.to_array();
    [1.0, x, y, z, a, b, c].map(|part| f64::from(flux) * f64::from(part))
}
