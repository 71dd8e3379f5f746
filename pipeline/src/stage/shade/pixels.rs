//! Indirect light without a cache: each pixel asks for itself.

use super::calibrate::LARGEST_CALIBRATED_CUT;
use super::cuts::{LightTransport, receiver};
use super::macroblock::{by_macroblock, places};
use crate::settings::Lighting;
use glam::Vec3;
use lighttree::{Lambert, Scratch};
use plane::Plane;
use render_core::{Busy, NOTHING};
use std::cell::Cell;
use std::f32::consts::PI;

/// Indirectly reflected radiance of every pixel; adds the work to `busy`.
pub(super) fn light(transport: &LightTransport, busy: &Busy) -> Plane<Vec3> {
    let pixels = &transport.seen.pixels;
    // What is promised may need more clusters than the paper allows.
    let scratch = || match transport.allowance.calibration {
        Some(_) => Scratch::with_max_size(LARGEST_CALIBRATED_CUT),
        None => Scratch::default(),
    };
    by_macroblock((pixels.width(), pixels.height()), busy, scratch, |scratch, columns, rows| {
        places(columns, rows).map(|(x, y)| pixel(transport, x, y, scratch)).collect()
    })
}

fn pixel(transport: &LightTransport, x: usize, y: usize, scratch: &mut Scratch) -> Vec3 {
    let pixel = transport.seen.pixels.get(x, y);
    let albedo = Vec3::from(pixel.albedo);
    if pixel.instance == NOTHING || albedo == Vec3::ZERO {
        return Vec3::ZERO;
    }
    let receiver = receiver(&pixel, transport.prepared.epsilon);
    let lambert = Lambert { position: receiver.position.into(), normal: receiver.normal.into(), reflectance: albedo };
    let tree = &transport.prepared.tree;
    let light = match transport.settings.lighting {
        Lighting::Lightcuts => {
            let visible = |lamp: &lighttree::Light, _| transport.visible(&receiver, lamp);
            let (stop, class) = (transport.stop_at_pixel(x, y), transport.class_at(x, y));
            let cut = tree.lightcut(&lambert, transport.calibrated(stop, class), visible, scratch);
            if transport.is_audited(x, y) {
                transport.audit(class, stop, cut.radiance, &lambert, visible, scratch);
            }
            transport.figures.count(cut.size, cut.shadow_rays);
            transport.figures.note(y * transport.seen.pixels.width() + x, cut.size);
            cut.radiance
        }
        Lighting::AllLights => {
            let asked = Cell::new(0);
            let light = tree.exhaustive(&lambert, |lamp, _| {
                asked.set(asked.get() + 1);
                transport.visible(&receiver, lamp)
            });
            transport.figures.count(tree.len() as u32, asked.get());
            light
        }
    };
    if !transport.compensates {
        return light;
    }
    let found = transport.look_around(&receiver, (y as u64) << 32 | x as u64);
    light + albedo / PI * transport.prepared.gather.removed_light(&found).0
}
