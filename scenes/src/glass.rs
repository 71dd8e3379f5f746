//! Textures of leaded glass: colored panes between dark lines.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, vec2, vec3};

use crate::noise::{fractal, hash, mix, smoothstep};
use crate::texture::Texture;

/// Returns the brightness factor of the glass, from uneven thickness and weathering.
fn piece(u: f32, v: f32, seed: u32) -> f32 {
    mix(0.78, 1.15, fractal([u, v], [24, 24], 3, seed)) * mix(0.85, 1.05, fractal([u, v], [3, 5], 3, seed + 4))
}

const LEAD: Vec3 = vec3(0.006, 0.006, 0.007);

/// Returns pale lozenge glazing in two lights with a colored border, for windows `aspect` times as high as wide. The
/// texture covers the whole opening.
#[must_use]
pub fn grisaille(size: usize, aspect: f32, warm: Vec3, border: Vec3, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        // Each light has half the width of the window.
        let x = (u * 2.0).fract();
        let y = v * aspect * 2.0;
        let side = x.min(1.0 - x);
        // Draw the lozenges between two families of slanted leads.
        let (a, b) = ((x + y * 0.62) * 4.0, (x - y * 0.62) * 4.0 + 200.0);
        let lozenge = a.fract().min(1.0 - a.fract()).min(b.fract()).min(1.0 - b.fract());
        let id = hash(a.floor() as i32, b.floor() as i32, seed);
        let (mut c, mut lead) = (warm * mix(0.72, 1.1, id), lozenge / 4.0);
        if id > 0.86 {
            c = c.lerp(border, 0.65);
        }
        // Add a medallion at regular intervals up the light.
        let m = vec2(x - 0.5, (y / 1.5).fract() * 1.5 - 0.75);
        let r = m.length();
        if r < 0.30 {
            let petal = (m.y.atan2(m.x) / TAU * 6.0 + 6.5).fract();
            let inks = [vec3(0.62, 0.07, 0.05), vec3(0.06, 0.16, 0.62), vec3(0.80, 0.52, 0.08)];
            // Divide the medallion into a center and two rings.
            let ring = if r > 0.23 {
                1
            } else if r > 0.09 {
                0
            } else {
                2
            };
            c = inks[ring];
            let spokes = if r > 0.09 { petal.min(1.0 - petal) * r } else { 1.0 };
            lead = (r - 0.23).abs().min((r - 0.09).abs()).min(0.30 - r).min(spokes);
        }
        // Add the border with alternating pieces along both sides.
        if side < 0.10 {
            let step = (y * 3.0).floor() as i32;
            c = if step % 2 == 0 { border } else { border.lerp(warm, 0.55) };
            lead = lead.max(1.0).min(0.10 - side).min((y * 3.0).fract() / 3.0);
        }
        // Add iron crossbars, which wide windows need.
        let bar = ((y / 0.75).fract() - 0.5).abs() * 0.75;
        let line = smoothstep(0.008, 0.020, lead) * smoothstep(0.008, 0.016, bar);
        LEAD.lerp(c * piece(u, v, seed), line)
    })
}

/// Returns richly colored glass: a column of quatrefoil scenes on a blue and ruby ground.
#[must_use]
pub fn medallions(size: usize, aspect: f32, seed: u32) -> Texture {
    let ground = [vec3(0.015, 0.085, 0.52), vec3(0.46, 0.022, 0.012)];
    let figure = [
        vec3(0.82, 0.48, 0.05),
        vec3(0.03, 0.40, 0.10),
        vec3(0.62, 0.60, 0.46),
        vec3(0.08, 0.30, 0.62),
        vec3(0.70, 0.62, 0.20),
    ];
    Texture::new(size, |u, v| {
        let x = u * 2.0 - 1.0;
        let y = v * aspect * 2.0;
        let row = (y / 1.6).floor();
        let m = vec2(x, y - (row + 0.5) * 1.6);
        // A quatrefoil is the union of four circles.
        let foil = |scale: f32| {
            [vec2(0.30, 0.0), vec2(-0.30, 0.0), vec2(0.0, 0.30), vec2(0.0, -0.30)]
                .iter()
                .map(|o| (m - *o * scale).length() - 0.36 * scale)
                .fold(f32::MAX, f32::min)
        };
        let (outer, inner) = (foil(1.0), foil(0.82));
        // The cells around the nearest jittered points are irregular, like the glass pieces of a scene.
        let cells = |p: Vec2, scale: f32, seed: u32| {
            let q = p * scale;
            let (mut best, mut second, mut id) = (f32::MAX, f32::MAX, 0.0);
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let (cx, cy) = (q.x.floor() as i32 + dx, q.y.floor() as i32 + dy);
                    let center = vec2(cx as f32 + hash(cx, cy, seed), cy as f32 + hash(cx, cy, seed + 1));
                    let d = q.distance(center);
                    if d < best {
                        (second, best, id) = (best, d, hash(cx, cy, seed + 2));
                    } else if d < second {
                        second = d;
                    }
                }
            }
            ((second - best) / scale, id)
        };
        // Color the scene inside the quatrefoil, its rim, or the ground around it.
        let (c, lead);
        if inner < 0.0 {
            let (edge, id) = cells(vec2(m.x.abs(), m.y), 6.5, seed + row as u32 * 7);
            c = figure[(id * 5.0) as usize % 5] * mix(0.75, 1.1, hash((id * 999.0) as i32, 1, seed));
            lead = edge.min(-inner);
        } else if outer < 0.0 {
            c = vec3(0.70, 0.40, 0.03);
            lead = (-outer).min(inner);
        } else {
            let (a, b) = ((x + y) * 3.5 + 50.0, (x - y) * 3.5 + 50.0);
            let id = (a.floor() as i32 + b.floor() as i32).rem_euclid(2) as usize;
            c = ground[id] * mix(0.7, 1.15, hash(a.floor() as i32, b.floor() as i32, seed));
            lead = (a.fract().min(1.0 - a.fract()).min(b.fract()).min(1.0 - b.fract()) / 3.5).min(outer);
        }
        // Add the border with alternating pieces along both sides.
        let side = 1.0 - x.abs();
        let (c, lead) = if side < 0.13 {
            let step = (y * 4.0).floor() as i32;
            let c = if step % 2 == 0 { vec3(0.60, 0.58, 0.42) } else { vec3(0.02, 0.24, 0.20) };
            (c, (0.13 - side).min((y * 4.0).fract() / 4.0))
        } else {
            (c, lead)
        };
        // Add the iron crossbars.
        let bar = ((y / 0.8).fract() - 0.5).abs() * 0.8;
        let line = smoothstep(0.008, 0.022, lead) * smoothstep(0.008, 0.016, bar);
        LEAD.lerp(c * piece(u, v, seed), line)
    })
}

/// Returns a rose window: rings of petals around the middle of the texture.
#[must_use]
pub fn rose(size: usize, seed: u32) -> Texture {
    let inks = [vec3(0.62, 0.07, 0.05), vec3(0.06, 0.16, 0.62), vec3(0.85, 0.58, 0.12), vec3(0.12, 0.40, 0.18)];
    Texture::new(size, |u, v| {
        let p = vec2(u - 0.5, v - 0.5) * 2.0;
        let (r, a) = (p.length(), p.y.atan2(p.x) / TAU);
        let ring = (r * 4.0).floor() as i32;
        // Divide each ring into petals.
        let count = [1, 6, 12, 24, 24][ring.clamp(0, 4) as usize];
        let petal = ((a + 1.0) * count as f32).fract();
        let step = ((a + 1.0) * count as f32).floor() as i32 % count;
        // Draw leads between petals and between rings.
        let spoke = if count > 1 { petal.min(1.0 - petal) * TAU * r / count as f32 } else { 1.0 };
        let band = (r * 4.0).fract().min(1.0 - (r * 4.0).fract()) / 4.0;
        let c = inks[((ring + step * (1 + ring)) % 4) as usize] * mix(0.8, 1.1, hash(ring, step, seed));
        LEAD.lerp(c * piece(u, v, seed), smoothstep(0.012, 0.03, spoke.min(band)))
    })
}
