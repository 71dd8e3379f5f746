//! Room for the examples, without a renderer: lights, receivers and visibility. Walls and ceiling glow unevenly, and
//! a ball casts shadows on the floor.

#![allow(dead_code, reason = "each example uses a part of it")]

use std::f32::consts::TAU;

use glam::Vec3;
use lighttree::{BuildParams, Emission, Lambert, Light};

/// Half the room's width \[m\].
const HALF_WIDTH: f32 = 5.0;
/// Height of the room \[m\].
const HEIGHT: f32 = 4.0;
const BALL: (Vec3, f32) = (Vec3::new(1.0, 0.5, 1.0), 0.8);

/// Generator of reproducible numbers in 0 … 1 (xorshift64*).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Returns the parameters of a tree over `count` lights of the room.
pub fn params(count: usize) -> BuildParams {
    BuildParams::for_area(4.0 * 2.0 * HALF_WIDTH * HEIGHT + 4.0 * HALF_WIDTH * HALF_WIDTH, count).with_seed(1)
}

/// Returns virtual lights on four walls and the ceiling, brighter near two lamps. One percent of them are inside the
/// room and emit in all directions.
pub fn room(count: usize) -> Vec<Light> {
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

/// Returns whether the ball leaves the segment unblocked.
pub fn unblocked(from: Vec3, to: Vec3) -> bool {
    let (center, radius) = BALL;
    let along = to - from;
    let t = ((center - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    (from + along * t).distance_squared(center) > radius * radius
}

/// Returns points of the floor, in rows.
pub fn floor(side: usize) -> Vec<Lambert> {
    let place = |k: usize| ((k as f32 + 0.5) / side as f32 * 2.0 - 1.0) * HALF_WIDTH;
    (0..side * side)
        .map(|k| Lambert {
            position: Vec3::new(place(k % side), place(k / side), 0.0),
            normal: Vec3::Z,
            reflectance: Vec3::new(0.6, 0.5, 0.4),
        })
        .collect()
}
