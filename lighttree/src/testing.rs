//! Random scenes for tests: all scales, coincident and dark lights, all emissions, receivers on lights.

use glam::Vec3;
use proptest::prelude::*;

use crate::light::{Emission, Light};
use crate::receiver::Lambert;

#[derive(Clone, Debug)]
pub(crate) struct TestScene {
    pub lights: Vec<Light>,
    pub receiver: Lambert,
    /// Unit vector for any use.
    pub direction: Vec3,
    pub geometry_term_bound: f32,
    pub seed: u64,
}

/// Returns the reproducible random visibility of light k.
pub(crate) fn visible(seed: u64, k: usize) -> bool {
    (seed ^ (k as u64 + 1)).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63 == 0
}

pub(crate) fn scene(count: std::ops::Range<usize>) -> impl Strategy<Value = TestScene> {
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
            TestScene {
                lights,
                receiver,
                direction,
                geometry_term_bound: length * length * 10f32.powf(softening),
                seed,
            }
        })
}

fn light() -> impl Strategy<Value = Light> {
    let emission = prop_oneof![
        1 => Just(Emission::Omni),
        4 => unit().prop_map(Emission::Cosine),
        1 => unit().prop_map(Emission::Directional),
    ];
    let color = (0.0..1.0f32, 0.0..1.0f32, 0.0..1.0f32).prop_map(|(r, g, b)| Vec3::new(r, g, b));
    let intensity = prop_oneof![1 => Just(Vec3::ZERO), 6 => color, 1 => Just(Vec3::splat(50.0))];
    (point(), emission, intensity).prop_map(|(position, emission, intensity)| Light { position, emission, intensity })
}

/// Generates free points, coincident points of a coarse grid, and distant points like a sky dome.
fn point() -> impl Strategy<Value = Vec3> {
    let free = (-1.0..1.0f32, -1.0..1.0f32, -1.0..1.0f32).prop_map(|(x, y, z)| Vec3::new(x, y, z));
    let grid = (-1..2i32, -1..2i32, 0..2i32).prop_map(|(x, y, z)| Vec3::new(x as f32, y as f32, z as f32) * 0.5);
    prop_oneof![6 => free, 3 => grid, 1 => unit().prop_map(|direction| direction * 100.0)]
}

/// Generates unit vectors, including the six axes.
fn unit() -> impl Strategy<Value = Vec3> {
    let free = (-1.0..1.0f32, 0.0..std::f32::consts::TAU).prop_map(|(z, phi)| {
        let (sin, cos) = phi.sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * cos, r * sin, z)
    });
    let axes = prop::sample::select(Vec3::AXES.iter().flat_map(|&a| [a, -a]).collect::<Vec<_>>());
    prop_oneof![2 => free, 1 => axes]
}

/// Generator of reproducible random numbers (SplitMix64), for tests of many cases. Proptest strategies would be too
/// slow.
#[derive(Clone, Debug)]
pub(crate) struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number in `low` … `high`.
    pub fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * ((self.bits() >> 40) as f32 / (1u64 << 24) as f32)
    }

    /// Returns whether an event with probability 1 / `times` occurs.
    pub fn once_in(&mut self, times: u64) -> bool {
        self.bits().is_multiple_of(times)
    }

    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0))
    }

    /// Returns a unit vector, often an axis.
    pub fn unit(&mut self) -> Vec3 {
        let sign = if self.once_in(2) { 1.0 } else { -1.0 };
        let axis = Vec3::AXES[(self.bits() % 3) as usize] * sign;
        if self.once_in(3) { axis } else { self.vector().try_normalize().unwrap_or(axis) }
    }

    fn place(&mut self) -> Vec3 {
        match self.bits() % 10 {
            0 => self.unit() * 100.0,
            1..4 => (self.vector() * 1.5).round() * 0.5,
            _ => self.vector(),
        }
    }

    /// Returns lights and a receiver at any scale of length and power between 10⁻⁶ and 10⁶. The scenes include
    /// coincident, dark and distant lights, axes in all directions, all emissions, and receivers on lights.
    pub fn scene(&mut self, most: u64) -> TestScene {
        let (length, power) = (10f32.powf(self.within(-6.0, 6.0)), 10f32.powf(self.within(-6.0, 6.0)));
        let geometry_term_bound = length * length * 10f32.powf(self.within(-6.0, 0.0));
        // In a third of the scenes all lights face a similar direction, as on a wall, and the cones are narrow.
        let wall = self.once_in(3).then(|| (self.unit(), self.within(0.0, 0.5)));
        let lights: Vec<Light> = (0..1 + self.bits() % most)
            .map(|_| {
                let axis = match wall {
                    Some((axis, spread)) => (axis + self.vector() * spread).try_normalize().unwrap_or(axis),
                    None => self.unit(),
                };
                let emission = match self.bits() % 8 {
                    0 => Emission::Omni,
                    1 => Emission::Directional(axis),
                    _ => Emission::Cosine(axis),
                };
                let intensity = match self.bits() % 8 {
                    0 => Vec3::ZERO,
                    1 => Vec3::splat(50.0),
                    _ => self.vector().abs(),
                };
                Light { position: self.place() * length, emission, intensity: intensity * power }
            })
            .collect();
        // A fifth of the receivers are at the position of a light.
        let position = if self.once_in(5) { lights[0].position } else { self.place() * length };
        let receiver = Lambert { position, normal: self.unit(), reflectance: Vec3::new(0.9, 0.5, 0.1) };
        TestScene { lights, receiver, direction: self.unit(), geometry_term_bound, seed: self.bits() }
    }
}
