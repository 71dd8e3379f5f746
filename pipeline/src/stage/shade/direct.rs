//! Light straight from its sources.

use super::cuts::receiver;
use super::macroblock::{by_macroblock, places};
use crate::message::Prepared;
use glam::Vec3;
use plane::Plane;
use render_core::{Busy, GBuffer, NOTHING, PixelSurface, Receiver};
use std::cell::Cell;
use std::f32::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

/// Emitted and directly reflected radiance of every pixel of `seen`, and the shadow rays that it took; adds the work to
/// `busy`.
pub(super) fn light(prepared: &Prepared, seen: &GBuffer, busy: &Busy) -> (Plane<Vec3>, u64) {
    let size = (seen.pixels.width(), seen.pixels.height());
    let rays = AtomicU64::new(0);
    let light = by_macroblock(
        size,
        busy,
        || (),
        |(), columns, rows| {
            let pixels: Vec<PixelSurface> = places(columns, rows).map(|(x, y)| seen.pixels.get(x, y)).collect();
            let reflects = |pixel: &PixelSurface| pixel.instance != NOTHING && pixel.albedo != [0.0; 3];
            // What light falls on is asked together: the lights send their rays to all of it at once.
            let receivers: Vec<Receiver> =
                pixels.iter().filter(|pixel| reflects(pixel)).map(|pixel| receiver(pixel, prepared.epsilon)).collect();
            let asked = Cell::new(0);
            let mut irradiance = prepared.direct.irradiance_tile(&prepared.accelerator, &receivers, &asked).into_iter();
            rays.fetch_add(asked.get(), Ordering::Relaxed);
            let lit = |pixel: &PixelSurface| {
                let arriving = if reflects(pixel) { irradiance.next().unwrap_or(Vec3::ZERO) } else { Vec3::ZERO };
                Vec3::from(pixel.emission) + Vec3::from(pixel.albedo) * arriving / PI
            };
            pixels.iter().map(lit).collect()
        },
    );
    (light, rays.into_inner())
}
