//! Lights on three sides of a box, for measurements.

use glam::Vec3;
use lighttree::{Emission, Light};

/// Returns reproducible numbers in 0 … 1: fractional parts of multiples of roots (Roberts' R3 sequence).
pub fn spread(k: usize) -> Vec3 {
    let step = [0.819_172_5, 0.671_043_6, 0.549_700_5f64];
    Vec3::from_array(step.map(|s| (s * (k + 1) as f64).fract() as f32))
}

pub fn walls(count: usize) -> Vec<Light> {
    (0..count)
        .map(|k| {
            let p = spread(k) * 2.0 - 1.0;
            let (position, axis) = match k % 3 {
                0 => (p.with_x(1.0), Vec3::NEG_X),
                1 => (p.with_y(1.0), Vec3::NEG_Y),
                _ => (p.with_z(1.0), Vec3::NEG_Z),
            };
            let intensity = Vec3::splat((0.1 + p.x * p.x) / count as f32);
            Light { position, emission: Emission::Cosine(axis), intensity }
        })
        .collect()
}
