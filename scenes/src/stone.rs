//! Textures of masonry, paving and foliage, with joints or cells.

use glam::{Vec2, Vec3, vec2};

use crate::noise::{fractal, hash, mix, smoothstep, value};
use crate::texture::Texture;

/// Returns a brightness factor around 1 with pits and clouds, as on a dressed stone face.
fn stone_face(u: f32, v: f32, seed: u32) -> f32 {
    let clouds = fractal([u, v], [4, 4], 5, seed) - 0.5;
    let grain = value(u, v, 220, 220, seed + 31) - 0.5;
    let pits = smoothstep(0.80, 0.92, fractal([u, v], [40, 60], 2, seed + 57));
    1.0 + 0.34 * clouds + 0.10 * grain - 0.22 * pits
}

/// Returns coursed ashlar. A repeat has `courses` rows, with blocks of uneven length and tone.
#[must_use]
pub fn ashlar(size: usize, mean: Vec3, courses: usize, contrast: f32, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let row = (v * courses as f32).floor();
        let local_v = v * courses as f32 - row;
        let id = row as i32;
        // Each row has two or three blocks. The joints are shifted from row to row.
        let blocks = 2 + (id + seed as i32).rem_euclid(2);
        let shifted = (u + hash(id, 1, seed)).rem_euclid(1.0) * blocks as f32;
        let jitter = |k: i32| 0.28 * (hash(id, k.rem_euclid(blocks) + 10, seed) - 0.5);
        // Find the block. Jitter moves its joints to either side of the grid.
        let mut k = shifted.floor() as i32;
        if shifted < k as f32 + jitter(k) {
            k -= 1;
        }
        if shifted >= (k + 1) as f32 + jitter(k + 1) {
            k += 1;
        }
        let left = shifted - (k as f32 + jitter(k));
        let right = (k + 1) as f32 + jitter(k + 1) - shifted;
        // Compute the distances to the joints, in units of the course height.
        let wide = courses as f32 / blocks as f32;
        let edge = (left.min(right) * wide).min(local_v).min(1.0 - local_v);
        let worn = 0.02 * (fractal([u, v], [30, 30], 2, seed + 3) - 0.5);
        let joint = smoothstep(0.012, 0.045, edge + worn);
        // Vary tone and warmth from block to block.
        let block = id * 7 + k.rem_euclid(blocks);
        let tone = 1.0 + contrast * (hash(block, 2, seed) - 0.5);
        let warm = 0.12 * contrast * (hash(block, 3, seed) - 0.5);
        let tone = tone * stone_face(u, v, seed + 7) * mix(0.62, 1.0, joint);
        tone * Vec3::new(1.0 + warm, 1.0, 1.0 - 1.6 * warm)
    })
    .with_mean(mean)
}

/// Returns stone without joints, for columns and moldings.
#[must_use]
pub fn plain_stone(size: usize, mean: Vec3, seed: u32) -> Texture {
    Texture::new(size, |u, v| Vec3::splat(stone_face(u, v, seed))).with_mean(mean)
}

/// Returns square slabs of two stones in a checkerboard, `n` × `n` per repeat.
#[must_use]
pub fn checker(size: usize, light: Vec3, dark: Vec3, n: usize, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let p = vec2(u, v) * n as f32;
        let cell = p.floor();
        let f = p - cell;
        let (x, y) = (cell.x as i32, cell.y as i32);
        let base = if (x + y) % 2 == 0 { light } else { dark };
        let joint = smoothstep(0.006, 0.018, f.x.min(1.0 - f.x).min(f.y).min(1.0 - f.y));
        let warp = fractal([u, v], [5, 5], 4, seed + 2);
        // Shift the veins from slab to slab, so that they stop at the joints.
        let vein = 1.0 - (2.0 * fractal([u + 0.2 * warp, v + hash(x, y, 5)], [6, 6], 3, seed) - 1.0).abs();
        let tone = mix(0.85, 1.12, hash(x, y, seed)) * (1.0 - 0.22 * vein.powf(10.0));
        base * (tone * mix(0.55, 1.0, joint) * mix(0.9, 1.1, stone_face(u, v, seed + 9) - 0.5))
    })
}

/// Returns a paving of octagons with small dark squares between their corners, `n` × `n` per repeat.
#[must_use]
pub fn octagons(size: usize, light: Vec3, dark: Vec3, n: usize, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let p = vec2(u, v) * n as f32;
        let cell = p.floor();
        let f = p - cell;
        let (x, y) = (cell.x as i32, cell.y as i32);
        // The corner squares are rotated by 45°. Their inside has a small |dx| + |dy|.
        let c = vec2(f.x.min(1.0 - f.x), f.y.min(1.0 - f.y));
        let tip = c.x + c.y - 0.26;
        let (base, id, edge) = if tip < 0.0 {
            (dark, hash((p.x + 0.5).floor() as i32 % n as i32, (p.y + 0.5).floor() as i32 % n as i32, 8), -tip)
        } else {
            (light, hash(x, y, seed), tip.min(c.x).min(c.y))
        };
        // Darken the joints, and vary tone and warmth from slab to slab.
        let joint = smoothstep(0.004, 0.016, edge);
        let tone = mix(0.82, 1.14, id) * stone_face(u, v, seed + 4) * mix(0.5, 1.0, joint);
        let warm = 0.05 * (hash(x, y, seed + 1) - 0.5);
        base * tone * Vec3::new(1.0 + warm, 1.0, 1.0 - warm)
    })
}

/// Returns the leaves of a dense hedge.
#[must_use]
pub fn leaves(size: usize, mean: Vec3, seed: u32) -> Texture {
    const N: i32 = 22;
    Texture::new(size, |u, v| {
        let p = vec2(u, v) * N as f32;
        let (cx, cy) = (p.x.floor() as i32, p.y.floor() as i32);
        let mut tone = 0.25;
        let mut top = -1.0;
        // Find the topmost leaf of this and the adjacent cells.
        for dy in -1..=1 {
            for dx in -1..=1 {
                let (x, y) = (cx + dx, cy + dy);
                let key = |k: u32| hash(x.rem_euclid(N), y.rem_euclid(N), seed + k);
                let center = vec2(x as f32 + key(0), y as f32 + key(1));
                let (sin, cos) = (key(2) * std::f32::consts::TAU).sin_cos();
                let d: Vec2 = p - center;
                // Stretch the leaf, and lighten its midrib.
                let d = vec2(d.x * cos + d.y * sin, (d.y * cos - d.x * sin) * 2.2);
                let r = d.length();
                if r < 0.85 && key(3) > top {
                    top = key(3);
                    tone = mix(0.5, 1.3, key(3)) * mix(1.1, 0.7, r) * if d.y.abs() < 0.08 { 1.15 } else { 1.0 };
                }
            }
        }
        Vec3::new(tone.powf(1.1), tone, tone.powf(1.3))
    })
    .with_mean(mean)
}
