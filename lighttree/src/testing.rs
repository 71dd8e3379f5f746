//! Random scenes for tests: all scales, coincident and dark lights, both emissions, receivers on lights.

use glam::Vec3;
use proptest::prelude::*;

use crate::light::{Emission, Light};
use crate::receiver::Lambert;

#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub lights: Vec<Light>,
    pub receiver: Lambert,
    /// A unit vector to use freely.
    pub direction: Vec3,
    pub softening2: f32,
    pub seed: u64,
}

/// A reproducible coin for light k: does the shadow ray reach it?
pub(crate) fn visible(seed: u64, k: usize) -> bool {
    (seed ^ (k as u64 + 1)).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63 == 0
}

pub(crate) fn scene(count: std::ops::Range<usize>) -> impl Strategy<Value = Scene> {
    let scales = (-3.0..3.0f32, -3.0..3.0f32, -4.0..0.0f32);
    let lights = prop::collection::vec(light(), count);
    (lights, scales, point(), unit(), unit(), prop::option::weighted(0.2, any::<prop::sample::Index>()), any::<u64>())
        .prop_map(|(mut lights, (length, power, softening), position, normal, direction, on_light, seed)| {
            let (length, power) = (10f32.powf(length), 10f32.powf(power));
            for light in &mut lights {
                light.position *= length;
                light.intensity *= power;
            }
            let position = match on_light {
                Some(index) if !lights.is_empty() => index.get(&lights).position,
                _ => position * length,
            };
            let receiver = Lambert { position, normal, reflectance: Vec3::new(0.9, 0.5, 0.1) };
            Scene { lights, receiver, direction, softening2: length * length * 10f32.powf(softening), seed }
        })
}

fn light() -> impl Strategy<Value = Light> {
    let emission = prop_oneof![1 => Just(Emission::Omni), 3 => unit().prop_map(Emission::Cosine)];
    let color = (0.0..1.0f32, 0.0..1.0f32, 0.0..1.0f32).prop_map(|(r, g, b)| Vec3::new(r, g, b));
    let intensity = prop_oneof![1 => Just(Vec3::ZERO), 6 => color, 1 => Just(Vec3::splat(50.0))];
    (point(), emission, intensity).prop_map(|(position, emission, intensity)| Light { position, emission, intensity })
}

/// Free points, points of a coarse grid that coincide, and far ones as of a sky dome.
fn point() -> impl Strategy<Value = Vec3> {
    let free = (-1.0..1.0f32, -1.0..1.0f32, -1.0..1.0f32).prop_map(|(x, y, z)| Vec3::new(x, y, z));
    let grid = (-1..2i32, -1..2i32, 0..2i32).prop_map(|(x, y, z)| Vec3::new(x as f32, y as f32, z as f32) * 0.5);
    prop_oneof![6 => free, 3 => grid, 1 => unit().prop_map(|direction| direction * 100.0)]
}

/// Unit vectors, the six axes among them.
fn unit() -> impl Strategy<Value = Vec3> {
    let free = (-1.0..1.0f32, 0.0..std::f32::consts::TAU).prop_map(|(z, phi)| {
        let (sin, cos) = phi.sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * cos, r * sin, z)
    });
    let axes = prop::sample::select(Vec3::AXES.iter().flat_map(|&a| [a, -a]).collect::<Vec<_>>());
    prop_oneof![2 => free, 1 => axes]
}
