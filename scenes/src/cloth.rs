//! Textures and shapes of cloth: patterns, curtains and banners.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, vec2};

use crate::mesh::Mesh;
use crate::noise::{fractal, mix, smoothstep, value};
use crate::texture::Texture;

/// Returns the texture of a dyed cloth with a woven diaper pattern of lighter thread.
#[must_use]
pub fn brocade(size: usize, dye: Vec3, thread: Vec3, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let p = vec2(u, v) * 2.0;
        // The pattern has lozenges with a four-petalled flower in each.
        let (a, b) = ((p.x + p.y).fract(), (p.x - p.y + 4.0).fract());
        let lattice = a.min(1.0 - a).min(b).min(1.0 - b);
        let band = smoothstep(0.045, 0.03, lattice) * smoothstep(0.008, 0.016, lattice);
        let c = vec2(a - 0.5, b - 0.5);
        let angle = c.y.atan2(c.x);
        let petal = 0.17 + 0.09 * (4.0 * angle).cos();
        let flower = smoothstep(0.02, -0.01, c.length() - petal) * smoothstep(0.03, 0.05, c.length());
        // Weave the pattern from lighter thread, and vary weft and wear.
        let ink = band.max(flower);
        let weft = value(u, v, 180, 180, seed) - 0.5;
        let wear = fractal([u, v], [4, 4], 4, seed + 3) - 0.5;
        dye.lerp(thread, 0.8 * ink) * (1.0 + 0.25 * weft + 0.3 * wear)
    })
}

/// A curtain in folds that hangs from the rod between `a` and `b`. It is tied at three quarters of its drop.
#[derive(Clone, Copy, Debug)]
pub struct Curtain {
    /// One end of the rod \[m\].
    pub a: Vec3,
    /// Other end of the rod \[m\].
    pub b: Vec3,
    /// Length of the cloth \[m\].
    pub drop: f32,
    /// Number of folds.
    pub folds: f32,
    /// Depth of the folds \[m\].
    pub depth: f32,
    /// Narrowing towards `a` at the tie, as a fraction of the width. With 0 the curtain hangs straight.
    pub gather: f32,
}

impl Curtain {
    /// Adds the curtain as `nu` × `nv` quads.
    pub fn add(&self, mesh: &mut Mesh, nu: usize, nv: usize, seed: u32) {
        let along = self.b - self.a;
        let out = along.normalize().cross(Vec3::Y);
        let size = vec2(along.length() * 1.4, self.drop);
        let phase = seed as f32 * 1.7;
        mesh.surface(nu, nv, size, |u, v| {
            // Gather the cloth towards `a` at the tie, and release it slightly below.
            let tie = smoothstep(0.0, 0.72, v) * (1.0 - 0.35 * smoothstep(0.76, 1.0, v));
            let width = 1.0 - self.gather * tie;
            // Shift the folds with the height, so that they are not parallel.
            let swing = 0.35 * (TAU * 0.7 * v + phase).sin() * v;
            let fold = (TAU * (self.folds * u) + phase + swing).sin()
                + 0.35 * (TAU * (self.folds * 2.3 * u) + 2.0 * phase + 3.0 * v).sin();
            // The folds are shallow at the rod and deep at the tie.
            let depth = self.depth * mix(0.55, 1.0, smoothstep(0.0, 0.5, v)) * mix(1.0, 0.8, tie);
            self.a + along * (u * width) + out * (depth * fold) - Vec3::Y * (self.drop * v)
        });
    }
}

/// Adds a free-hanging banner with gentle waves. It is longer in the middle, where it ends in a point.
pub fn banner(mesh: &mut Mesh, a: Vec3, b: Vec3, drop: f32, seed: u32) {
    let along = b - a;
    let out = along.normalize().cross(Vec3::Y);
    let size: Vec2 = vec2(along.length(), drop);
    let phase = seed as f32 * 2.1;
    mesh.surface(12, 24, size, |u, v| {
        let wave =
            0.05 * v * (TAU * (1.1 * v + 0.35 * u) + phase).sin() + 0.025 * (TAU * 2.0 * u + phase + v).sin() * v;
        let length = drop * (1.0 - 0.12 * (2.0 * u - 1.0).abs());
        a + along * u + out * wave - Vec3::Y * (length * v)
    });
}
