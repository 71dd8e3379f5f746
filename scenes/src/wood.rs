//! Textures of wood: boards, parquet and veneer.

use glam::{Vec2, Vec3, vec2};

use crate::noise::{fractal, hash, mix, smoothstep, value};
use crate::texture::Texture;

/// Returns a brightness factor around 1 for the figure of one board. `along` and `across` are in board widths.
fn grain(along: f32, across: f32, seed: u32) -> f32 {
    let shift = hash(seed as i32, 3, 77) * 17.0;
    let (s, t) = ((along * 0.02 + shift).rem_euclid(1.0), (across * 0.05 + shift).rem_euclid(1.0));
    // Slanted growth rings appear as bands across the board that meander along it.
    let wander = fractal([s, t], [24, 20], 3, seed);
    let rings = ((across * 2.2 + wander * 3.4 + shift) * std::f32::consts::TAU).sin();
    let pores = value(s, t, 60, 900, seed + 5);
    1.0 + 0.10 * rings + 0.16 * (pores - 0.5) + 0.25 * (wander - 0.5)
}

/// Returns straight veneer without joints. The grain extends along v.
#[must_use]
pub fn veneer(size: usize, mean: Vec3, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let wander = fractal([u, v], [5, 2], 4, seed);
        // The grain consists of wavy growth rings and fine pores.
        let rings = ((u * 14.0 + wander * 2.2).fract() - 0.5).abs() * 2.0;
        let rings = if rings.is_nan() { 0.0 } else { smoothstep(0.0, 1.0, rings) };
        let pores = value(u, v, 300, 14, seed + 5);
        let tone = 1.0 + 0.20 * (rings - 0.5) + 0.22 * (pores - 0.5) + 0.35 * (wander - 0.5);
        // Darker wood is redder.
        Vec3::new(tone.powf(0.9), tone, tone.powf(1.15))
    })
    .with_mean(mean)
}

/// Returns herringbone parquet. Its blocks are four times as long as wide. A repeat is `n` block widths wide, and `n`
/// must be a multiple of 4.
#[must_use]
pub fn herringbone(size: usize, mean: Vec3, n: usize, seed: u32) -> Texture {
    const LENGTH: i32 = 4;
    Texture::new(size, |u, v| {
        let p = vec2(u, v) * n as f32;
        let (x, y) = (p.x.floor() as i32, p.y.floor() as i32);
        // In each row, four cells belong to a horizontal block and the next four cells to vertical blocks. The pattern
        // shifts by one cell from row to row.
        let k = (x - y).rem_euclid(2 * LENGTH);
        let (start, lying) = if k < LENGTH {
            (vec2((x - k) as f32, y as f32), true)
        } else {
            // In a column of vertical cells, the block begins where k is largest.
            (vec2(x as f32, (y - (2 * LENGTH - 1 - k)) as f32), false)
        };
        let local: Vec2 = p - start;
        let (along, across) = if lying { (local.x, local.y) } else { (local.y, local.x) };
        let wrap = n as i32;
        let id = (start.x as i32).rem_euclid(wrap) * 64 + (start.y as i32).rem_euclid(wrap);
        let edge = across.min(1.0 - across).min(along).min(LENGTH as f32 - along);
        let joint = smoothstep(0.0, 0.045, edge);
        // Vary the tone from block to block, with dark joints.
        let tone = grain(along, across, seed + id as u32) * mix(0.80, 1.18, hash(id, 9, seed));
        let tone = tone * mix(0.45, 1.0, joint);
        Vec3::new(tone.powf(0.9), tone, tone.powf(1.2))
    })
    .with_mean(mean)
}
