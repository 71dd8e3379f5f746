//! Light straight from its sources.

use super::cuts::receiver;
use super::macroblock::{by_macroblock, places};
use crate::renderer::frame::Frame;
use glam::Vec3;
use plane::Plane;
use render_core::{Busy, GBuffer, NOTHING, PixelSurface, ShadingPoint};
use std::f32::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

/// Emitted and directly reflected radiance of every pixel of `seen`, and the shadow rays that it took; adds the work to
/// `busy`.
pub(super) fn light(prepared: &Frame, seen: &GBuffer, busy: &Busy) -> (Plane<Vec3>, u64) {
    let size = (seen.pixels.width(), seen.pixels.height());
    let rays = AtomicU64::new(0);
    let light = by_macroblock(
        size,
        busy,
        || (),
        |(), columns, rows| {
            let width = columns.len();
            let pixels: Vec<PixelSurface> = places(columns, rows).map(|(x, y)| seen.pixels.get(x, y)).collect();
            // Lit pixels are taken together: the lights send their rays to all of them at once.
            let mut reflects: Vec<usize> = (0..pixels.len()).filter(|&place| is_lit(&pixels[place])).collect();
            // Squares of 8 × 8 pixels lie closer together than rows.
            reflects.sort_by_key(|place| (place / width / 8, place % width / 8));
            let receivers: Vec<ShadingPoint> =
                reflects.iter().map(|&place| receiver(&pixels[place], prepared.epsilon)).collect();
            let irradiance = prepared.direct.irradiance_tile(&prepared.accelerator, &receivers);
            rays.fetch_add(irradiance.shadow_rays, Ordering::Relaxed);
            let mut light: Vec<Vec3> = pixels.iter().map(|pixel| pixel.emission.into()).collect();
            for (place, arriving) in reflects.into_iter().zip(irradiance.value) {
                light[place] += Vec3::from(pixels[place].albedo) * arriving / PI;
            }
            light
        },
    );
    (light, rays.into_inner())
}

fn is_lit(pixel: &PixelSurface) -> bool {
    pixel.instance != NOTHING && pixel.albedo != [0.0; 3]
}
