//! Textures of wall pictures, a whiteboard and carpets.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, vec2, vec3};

use crate::noise::{fractal, hash, mix, smoothstep, value};
use crate::texture::Texture;

/// Returns the distance from a point to a segment.
fn segment(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a + (b - a) * t)
}

/// Returns a landscape in layers: a low sun over hills that fade with distance.
#[must_use]
pub fn landscape(size: usize, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let sky = vec3(0.78, 0.50, 0.28).lerp(vec3(0.20, 0.38, 0.62), smoothstep(0.6, 0.0, v));
        let cloud = smoothstep(0.5, 0.75, fractal([u, v * 2.0], [3, 6], 5, seed)) * smoothstep(0.6, 0.2, v);
        let mut c = sky.lerp(vec3(0.85, 0.72, 0.60), 0.7 * cloud);
        let sun = vec2(u - 0.62, v - 0.40).length();
        c = c.lerp(vec3(0.95, 0.80, 0.45), smoothstep(0.065, 0.055, sun));
        // Paint the hills from the farthest to the nearest.
        for k in 0..5 {
            let k = k as f32;
            let line =
                0.45 + 0.11 * k + 0.10 * (fractal([u, 0.1 + 0.2 * k], [3 + k as i32, 8], 4, seed + k as u32) - 0.5);
            let near = k / 4.0;
            let hill = vec3(0.42, 0.42, 0.50).lerp(vec3(0.07, 0.11, 0.06), near);
            let hill = hill * mix(0.85, 1.2, fractal([u, v], [12, 30], 3, seed + 9));
            c = c.lerp(hill, smoothstep(line, line + 0.006, v));
        }
        // Add brush strokes.
        c * (1.0 + 0.14 * (value(u, v, 40, 130, seed + 4) - 0.5))
    })
}

/// Returns an abstract picture: overlapping discs and bands of flat color.
#[must_use]
pub fn abstract_picture(size: usize, seed: u32) -> Texture {
    let inks = [
        vec3(0.70, 0.12, 0.07),
        vec3(0.10, 0.24, 0.42),
        vec3(0.82, 0.55, 0.12),
        vec3(0.06, 0.07, 0.09),
        vec3(0.20, 0.44, 0.38),
    ];
    Texture::new(size, |u, v| {
        let mut c = vec3(0.78, 0.73, 0.63);
        for k in 0..9 {
            let key = |i: i32| hash(k, i, seed);
            let ink = inks[(k as usize + seed as usize) % 5];
            let center = vec2(mix(0.15, 0.85, key(1)), mix(0.15, 0.85, key(2)));
            let p = vec2(u, v) - center;
            // Every third shape is a band, the others are discs.
            let inside = if k % 3 == 2 {
                let (sin, cos) = (key(4) * TAU).sin_cos();
                (p.x * cos + p.y * sin).abs() - mix(0.008, 0.03, key(3))
            } else {
                p.length() - mix(0.06, 0.24, key(3))
            };
            // Overlaps mix the color below with ink, like translucent paint.
            c = c.lerp(c.lerp(c * ink * 1.6, 0.35).lerp(ink, 0.65), smoothstep(0.004, -0.004, inside));
        }
        c * (1.0 + 0.12 * (fractal([u, v], [30, 30], 3, seed) - 0.5))
    })
}

/// Returns a whiteboard after a meeting: axes, a falling and a rising curve, boxes and lines of writing.
#[must_use]
pub fn whiteboard(size: usize) -> Texture {
    Texture::new(size, |u, v| {
        let p = vec2(u * 2.0, v);
        let mut c = vec3(0.80, 0.81, 0.82) * (1.0 - 0.05 * fractal([u, v], [4, 4], 4, 3));
        let mut draw = |d: f32, ink: Vec3| c = c.lerp(ink, 0.9 * smoothstep(0.0065, 0.0035, d));
        let (black, blue, red, green) =
            (vec3(0.03, 0.03, 0.04), vec3(0.03, 0.07, 0.35), vec3(0.50, 0.03, 0.03), vec3(0.03, 0.25, 0.08));
        // Draw the axes with arrowheads.
        let origin = vec2(0.14, 0.80);
        draw(segment(p, origin, vec2(0.14, 0.16)), black);
        draw(segment(p, origin, vec2(0.98, 0.80)), black);
        for (a, b) in [
            ((0.14, 0.16), (0.12, 0.20)),
            ((0.14, 0.16), (0.16, 0.20)),
            ((0.98, 0.80), (0.94, 0.78)),
            ((0.98, 0.80), (0.94, 0.82)),
        ] {
            draw(segment(p, a.into(), b.into()), black);
        }
        // Draw both curves as polylines of 24 segments.
        let curve = |f: &dyn Fn(f32) -> f32| {
            let mut d = 1.0f32;
            for i in 0..24 {
                let (s, t) = (i as f32 / 24.0, (i + 1) as f32 / 24.0);
                let at = |s: f32| vec2(0.17 + 0.76 * s, f(s));
                d = d.min(segment(p, at(s), at(t)));
            }
            d
        };
        draw(curve(&|s| 0.76 - 0.52 * (-3.2 * s).exp()), red);
        draw(curve(&|s| 0.74 - 0.30 * s * s - 0.03 * (9.0 * s).sin()), blue);
        // Draw three boxes connected by arrows.
        for k in 0..3 {
            let y = 0.17 + 0.22 * k as f32;
            let corners = [vec2(1.15, y), vec2(1.42, y), vec2(1.42, y + 0.12), vec2(1.15, y + 0.12)];
            for i in 0..4 {
                draw(segment(p, corners[i], corners[(i + 1) % 4]), green);
            }
            if k < 2 {
                draw(segment(p, vec2(1.285, y + 0.12), vec2(1.285, y + 0.22)), black);
                draw(segment(p, vec2(1.285, y + 0.22), vec2(1.265, y + 0.19)), black);
            }
            // Add writing: shaky lines with gaps between words.
            let row = |x0: f32, x1: f32, y: f32, seed: u32| {
                let shake = 0.010 * (value(p.x * 0.5, 0.3, 120, 2, seed) - 0.5) + 0.012 * (p.x * 160.0).sin();
                let gap = value(p.x * 0.5, 0.7, 22, 2, seed) < 0.25;
                if p.x < x0 || p.x > x1 || gap { 1.0 } else { (p.y - y - shake).abs() }
            };
            draw(row(1.19, 1.38, y + 0.06, 5 + k), black);
            draw(row(1.50, 1.88, y + 0.03, 15 + k), blue);
            draw(row(1.50, 1.80, y + 0.09, 25 + k), blue);
        }
        c
    })
}

/// Returns carpet tiles of cut pile with a broken line pattern.
#[must_use]
pub fn carpet(size: usize, base: Vec3, accent: Vec3, seed: u32) -> Texture {
    Texture::new(size, |u, v| {
        let (x, y) = ((u * 2.0).floor() as i32, (v * 2.0).floor() as i32);
        // Exchange the axes of every second tile, so that the lines of adjacent tiles are perpendicular.
        let (s, t) = if (x + y) % 2 == 0 { (u, v) } else { (v, u) };
        let line = (s * 64.0).floor() as i32;
        let run = smoothstep(0.52, 0.60, value(t + hash(line, 1, seed), 0.5, 14, 2, seed + line as u32));
        let pile = 0.7 * hash((u * 512.0) as i32, (v * 512.0) as i32, seed) + 0.3 * fractal([u, v], [8, 8], 3, seed);
        let stripe = run * if hash(line, 2, seed) > 0.45 { 0.75 } else { 0.15 };
        let edge = (u * 2.0).fract().min((v * 2.0).fract());
        base.lerp(accent, stripe) * mix(0.70, 1.30, pile) * mix(0.82, 1.0, smoothstep(0.0, 0.008, edge))
    })
}
