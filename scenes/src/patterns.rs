//! Textures of wallpapers, plasters and veined stones.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3, vec2};

use crate::noise::{fractal, mix, smoothstep, value};
use crate::texture::Texture;

/// Returns fine plaster with faint clouds and trowel marks around a mean reflectance.
#[must_use]
pub fn plaster(size: usize, mean: Vec3, contrast: f32, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let clouds = fractal([u, v], [3, 3], 5, seed);
        let grain = value(u, v, 160, 160, seed + 50);
        let strokes = fractal([u + 0.03 * clouds, v], [6, 40], 3, seed + 70);
        Vec3::splat(1.0 + contrast * (1.2 * (clouds - 0.5) + 0.35 * (grain - 0.5) + 0.5 * (strokes - 0.5)))
    })
    .with_mean(mean)
}

/// Returns the brightness of woven cloth: alternating threads of slightly uneven strength.
fn weave(u: f32, v: f32, threads: i32, seed: u32) -> f32 {
    let (x, y) = (u * threads as f32, v * threads as f32);
    let over = (x.floor() as i32 + y.floor() as i32).rem_euclid(2) == 0;
    let (warp, weft) = ((x.fract() * PI).sin(), (y.fract() * PI).sin());
    let uneven = value(u, v, threads, threads, seed) - 0.5;
    (if over { warp } else { weft }) * 0.7 + 0.3 * uneven
}

/// Returns linen: a weave with slubs around a mean reflectance.
#[must_use]
pub fn linen(size: usize, mean: Vec3, threads: i32, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let slub = fractal([u, v], [4, 60], 3, seed) + fractal([u, v], [60, 4], 3, seed + 9) - 1.0;
        Vec3::splat(1.0 + 0.22 * (weave(u, v, threads, seed) - 0.5) + 0.25 * slub)
    })
    .with_mean(mean)
}

/// Returns the coverage of a leaf-shaped blade with this `width` from `a` to `b`: 1 inside, 0 outside.
fn blade(p: Vec2, a: Vec2, b: Vec2, width: f32) -> f32 {
    let axis = b - a;
    let t = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    let half = width * (PI * t.powf(0.8)).sin().max(0.0);
    let d = (p - a - axis * t).length() - half;
    smoothstep(0.008, -0.008, d)
}

/// Returns the damask motif in a cell with x and y in -½..½, mirrored about x = 0.
fn damask_motif(p: Vec2) -> f32 {
    let p = vec2(p.x.abs(), p.y);
    let mut ink = 0.0f32;
    // Draw a palmette: blades that fan out from a foot.
    let foot = vec2(0.0, -0.10);
    for k in 0..5 {
        let angle = k as f32 * 0.42;
        let length = 0.34 - 0.035 * k as f32;
        let tip = foot + length * vec2(angle.sin(), angle.cos());
        ink = ink.max(blade(p, foot + (tip - foot) * 0.18, tip, 0.043));
    }
    // Draw volutes next to the foot, a stem with two leaves below it, and a bud at the end of the stem.
    let volute = (p - vec2(0.115, -0.155)).length();
    ink = ink.max(smoothstep(0.010, -0.004, (volute - 0.052).abs() - 0.014));
    ink = ink.max(smoothstep(0.006, -0.006, volute - 0.016));
    ink = ink.max(blade(p, vec2(0.0, -0.12), vec2(0.0, -0.42), 0.022));
    ink = ink.max(blade(p, vec2(0.0, -0.36), vec2(0.15, -0.25), 0.030));
    ink = ink.max(blade(p, vec2(0.0, -0.44), vec2(0.11, -0.37), 0.024));
    ink.max(smoothstep(0.006, -0.006, (p - vec2(0.0, 0.29)).length() - 0.028))
}

/// Returns damask around a mean reflectance: woven palmettes in half-drop repeat inside an ogee lattice.
#[must_use]
pub fn damask(size: usize, mean: Vec3, contrast: f32) -> Texture {
    Texture::new(size, |u, v| {
        // Each repeat has two cells: one at the corner, and one shifted by half in both directions.
        let cell = |du: f32, dv: f32| {
            let wrap = |x: f32| x - x.round();
            // The cell is narrower than the repeat, so that the two columns do not touch.
            vec2(wrap(u + du) * 1.55, -wrap(v + dv) * 1.08)
        };
        let mut ink = damask_motif(cell(0.0, 0.0)).max(damask_motif(cell(0.5, 0.5)));
        // Draw the lattice: two opposed sine bands that touch between the motifs.
        for phase in [0.0, 0.5] {
            let wave = 0.25 * (TAU * (v + 0.25 + phase)).sin();
            for side in [0.25, 0.75] {
                let d = u - side - wave * if side < 0.5 { 0.62 } else { -0.62 };
                let d = (d - d.round()).abs();
                if phase == 0.0 {
                    ink = ink.max(0.8 * smoothstep(0.013, 0.007, (d - 0.012).abs()));
                }
            }
        }
        // The figure is satin, and the ground is plain weave. They differ in thread and tone.
        let thread = weave(u, v, 128, 5);
        let satin = value(u, v, 60, 240, 11);
        Vec3::splat(1.0 + contrast * (ink - 0.35) + mix(0.16 * (thread - 0.4), 0.10 * (satin - 0.5), ink))
    })
    .with_mean(mean)
}

/// Returns veined marble.
#[must_use]
pub fn marble(size: usize, base: Vec3, vein: Vec3, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let warp = vec2(fractal([u, v], [3, 3], 5, seed), fractal([u, v], [3, 3], 5, seed + 33)) - 0.5;
        let (wu, wv) = (u + 0.22 * warp.x, v + 0.22 * warp.y);
        let ridge = |n: f32| 1.0 - (2.0 * n - 1.0).abs();
        // Narrow ridges of warped noise are the veins: a few strong ones, and finer ones between them.
        let strong = ridge(fractal([wu, wv], [2, 2], 4, seed + 5)).powf(14.0);
        let fine = ridge(fractal([wu + 0.3, wv], [5, 5], 3, seed + 8)).powf(18.0);
        let clouds = fractal([wu, wv], [4, 4], 4, seed + 13) - 0.5;
        let t = (0.75 * strong + 0.35 * fine).min(1.0);
        base.lerp(vein, t) * (1.0 + 0.14 * clouds)
    })
}
