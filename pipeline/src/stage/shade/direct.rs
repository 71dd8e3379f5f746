//! Light straight from its sources.

use super::cuts::receiver;
use super::macroblock::by_macroblock;
use crate::message::Prepared;
use glam::Vec3;
use plane::Plane;
use render_core::{Busy, NOTHING};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

/// Emitted and directly reflected radiance of every pixel, and the shadow rays that it took; adds the work to `busy`.
pub(super) fn light(prepared: &Prepared, busy: &Busy) -> (Plane<Vec3>, u64) {
    let pixels = &prepared.seen.pixels;
    let rays = AtomicU64::new(0);
    let light = by_macroblock(
        pixels.width(),
        pixels.height(),
        busy,
        || (),
        |(), x, y| {
            let pixel = pixels.get(x, y);
            let (emission, albedo) = (Vec3::from(pixel.emission), Vec3::from(pixel.albedo));
            if pixel.instance == NOTHING || albedo == Vec3::ZERO {
                return emission;
            }
            let asked = Cell::new(0);
            let receiver = receiver(&pixel, prepared.epsilon);
            let irradiance = prepared.direct.irradiance(&prepared.accelerator, &receiver, &asked);
            rays.fetch_add(asked.get(), Ordering::Relaxed);
            emission + albedo * irradiance / std::f32::consts::PI
        },
    );
    (light, rays.into_inner())
}
