//! Light straight from its sources.

use super::cuts::receiver;
use super::macroblock::{by_macroblock, places};
use crate::renderer::frame::Frame;
use glam::Vec3;
use plane::Plane;
use render_core::{Busy, GBuffer, PixelSurface, ShadingPoint};
use std::f32::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

/// Directly arriving irradiance at every pixel of `seen` that is `wanted`, or at all, and the shadow rays that it took; zero
/// elsewhere. Adds the work to `busy`.
pub(super) fn irradiance(
    prepared: &Frame,
    seen: &GBuffer,
    wanted: Option<&Plane<bool>>,
    busy: &Busy,
) -> (Plane<[f32; 3]>, u64) {
    let size = (seen.pixels.width(), seen.pixels.height());
    let rays = AtomicU64::new(0);
    let light = by_macroblock(
        size,
        busy,
        || (),
        |(), columns, rows| {
            let width = columns.len();
            let mut light = vec![[0.0; 3]; width * rows.len()];
            // Lit pixels are taken together: the lights send their rays to all of them at once.
            let mut reflects: Vec<(usize, PixelSurface)> = places(columns, rows)
                .enumerate()
                .filter(|&(_, (x, y))| wanted.is_none_or(|wanted| wanted.get(x, y)))
                .map(|(place, (x, y))| (place, seen.pixels.get(x, y)))
                .filter(|(_, pixel)| pixel.reflects())
                .collect();
            if reflects.is_empty() {
                return light;
            }
            // Squares of 8 × 8 pixels lie closer together than rows.
            reflects.sort_by_key(|(place, _)| (place / width / 8, place % width / 8));
            let receivers: Vec<ShadingPoint> =
                reflects.iter().map(|(_, pixel)| receiver(pixel, prepared.epsilon)).collect();
            let irradiance = prepared.direct.irradiance_tile(&prepared.accelerator, &receivers);
            rays.fetch_add(irradiance.shadow_rays, Ordering::Relaxed);
            for ((place, _), arriving) in reflects.into_iter().zip(irradiance.value) {
                light[place] = arriving.to_array();
            }
            light
        },
    );
    (light, rays.into_inner())
}

/// Emitted and directly reflected radiance of every pixel.
pub(super) fn light(seen: &GBuffer, irradiance: &Plane<[f32; 3]>) -> Plane<Vec3> {
    Plane::from_fn(seen.pixels.width(), seen.pixels.height(), |x, y| {
        let pixel = seen.pixels.get(x, y);
        let mut light = Vec3::from(pixel.emission);
        if pixel.reflects() {
            light += Vec3::from(pixel.albedo) * Vec3::from(irradiance.get(x, y)) / PI;
        }
        light
    })
}
