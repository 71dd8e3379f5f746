//! Indirect light without a cache: each pixel has its own cut.
//!
//! Where thresholds are known beforehand, neighbors share most of the walk through the light tree, and the shadow rays
//! between a light and all pixels of a block are cast together. A threshold that hangs on the light that is still being found
//! allows neither: cuts at 2 % of a pixel's own luminance go one by one, as \[Walter05\] has them. On `cornell` at quantiser 2,
//! where thresholds are 2 % too, that is 0.21 instead of 1.13 CPU s a frame of 256×256; 0.56 with thresholds known and
//! pixels one by one, 0.49 with shared walks alone.

use super::cuts::{LightTransport, MadeCut, is_above, receiver};
use super::macroblock::by_macroblock;
use crate::settings::Lighting;
use glam::{Vec3, Vec3A};
use lighttree::{Calibration, Cut, Lambert, Light, Receivers, Scratch, Stop};
use plane::Plane;
use render_core::{Busy, NOTHING, ShadingPoint};
use std::cell::Cell;
use std::f32::consts::PI;
use std::ops::Range;

/// Side of the blocks of pixels whose cuts are made together. (`lighttree`'s `examples/measure.rs` has their gain.)
const BLOCK: usize = 8;

/// Indirectly reflected radiance of every pixel; adds the work to `busy`.
pub(super) fn light(transport: &LightTransport, busy: &Busy) -> Plane<Vec3> {
    let pixels = &transport.seen.pixels;
    // What is promised may need more clusters than the paper allows.
    let scratch = || match transport.allowance.calibration {
        Some(_) => Scratch::with_max_size(Calibration::LARGEST_CUT),
        None => Scratch::default(),
    };
    let block = || Block { scratch: scratch(), ..Block::default() };
    by_macroblock((pixels.width(), pixels.height()), busy, block, |block, columns, rows| {
        block.light(transport, columns, rows)
    })
}

/// A pixel that reflects something.
struct Lit {
    x: usize,
    y: usize,
    receiver: ShadingPoint,
    lambert: Lambert,
}

/// Memory of a thread, and what the pixels that it is at are.
#[derive(Default)]
struct Block {
    scratch: Scratch,
    together: Vec<Lit>,
    positions: Vec<Vec3A>,
    /// When the cut of each of `together` ends; then their thresholds, receivers and cuts.
    stops: Vec<Stop>,
    thresholds: Vec<f32>,
    lamberts: Vec<Lambert>,
    cuts: Vec<Cut>,
}

impl Block {
    /// Radiance of a macroblock in raster order.
    fn light(&mut self, transport: &LightTransport, columns: Range<usize>, rows: Range<usize>) -> Vec<Vec3> {
        let mut radiance = vec![Vec3::ZERO; columns.len() * rows.len()];
        let (left, top, width) = (columns.start, rows.start, columns.len());
        let mut put = |lit: &Lit, light: Vec3| {
            radiance[(lit.y - top) * width + lit.x - left] = light + compensation(transport, lit);
        };
        for y in rows.clone().step_by(BLOCK) {
            for x in columns.clone().step_by(BLOCK) {
                let (across, down) = (x..columns.end.min(x + BLOCK), y..rows.end.min(y + BLOCK));
                self.light_block(transport, across, down, &mut put);
            }
        }
        radiance
    }

    fn light_block(
        &mut self,
        transport: &LightTransport,
        columns: Range<usize>,
        rows: Range<usize>,
        put: &mut impl FnMut(&Lit, Vec3),
    ) {
        let Self { scratch, together, positions, stops, thresholds, lamberts, cuts } = self;
        together.clear();
        positions.clear();
        stops.clear();
        thresholds.clear();
        lamberts.clear();
        for lit in rows.flat_map(|y| columns.clone().map(move |x| (x, y))).filter_map(|place| lit(transport, place)) {
            if transport.settings.lighting == Lighting::AllLights {
                put(&lit, all_lights(transport, &lit));
                continue;
            }
            let stop = transport.stop_at_pixel(lit.x, lit.y);
            match transport.calibrated(stop, transport.class_at(lit.x, lit.y)) {
                Stop::Absolute(threshold) => {
                    thresholds.push(threshold);
                    stops.push(stop);
                    lamberts.push(lit.lambert);
                    together.push(lit);
                }
                relative => {
                    let visible = |lamp: &Light, _: usize| transport.visible(&lit.receiver, lamp);
                    let cut = transport.prepared.tree.lightcut(&lit.lambert, relative, visible, scratch);
                    finish(transport, &lit, stop, &cut, scratch);
                    put(&lit, cut.radiance);
                }
            }
        }
        positions.extend(together.iter().map(|lit| lit.receiver.position));
        let visible = |lamp: &Light, _: usize, rays: u64| {
            let place = Vec3A::from(lamp.position);
            let above = together
                .iter()
                .enumerate()
                .fold(0, |above, (k, lit)| above | u64::from(is_above(&lit.receiver, place)) << k);
            let rays = rays & above;
            rays & !transport.prepared.accelerator.occluded_packet(place, positions, rays)
        };
        transport.prepared.tree.lightcuts(Receivers { receivers: lamberts, thresholds }, visible, scratch, cuts);
        for ((lit, cut), &stop) in together.iter().zip(&*cuts).zip(&*stops) {
            finish(transport, lit, stop, cut, scratch);
            put(lit, cut.radiance);
        }
    }
}

fn lit(transport: &LightTransport, (x, y): (usize, usize)) -> Option<Lit> {
    let pixel = transport.seen.pixels.get(x, y);
    let albedo = Vec3::from(pixel.albedo);
    (pixel.instance != NOTHING && albedo != Vec3::ZERO).then(|| {
        let receiver = receiver(&pixel, transport.prepared.epsilon);
        let lambert =
            Lambert { position: receiver.position.into(), normal: receiver.normal.into(), reflectance: albedo };
        Lit { x, y, receiver, lambert }
    })
}

/// Counts a cut, and measures its error where its pixel is audited.
fn finish(transport: &LightTransport, lit: &Lit, stop: Stop, cut: &Cut, scratch: &mut Scratch) {
    let &Lit { x, y, ref receiver, ref lambert } = lit;
    if transport.is_audited(x, y) {
        let visible = |lamp: &Light, _: usize| transport.visible(receiver, lamp);
        let made = MadeCut { class: transport.class_at(x, y), stop, radiance: cut.radiance };
        transport.audit(made, lambert, visible, scratch);
    }
    transport.figures.count(cut.size, cut.shadow_rays);
    transport.figures.note(y * transport.seen.pixels.width() + x, cut.size);
}

fn all_lights(transport: &LightTransport, lit: &Lit) -> Vec3 {
    let tree = &transport.prepared.tree;
    let rays = Cell::new(0);
    let light = tree.exhaustive(&lit.lambert, |lamp, _| {
        rays.set(rays.get() + 1);
        transport.visible(&lit.receiver, lamp)
    });
    transport.figures.count(tree.len() as u32, rays.get());
    light
}

/// Bias compensation: the light from close by that softening took.
fn compensation(transport: &LightTransport, lit: &Lit) -> Vec3 {
    if !transport.compensates {
        return Vec3::ZERO;
    }
    let found = transport.final_gather(&lit.receiver, (lit.y as u64) << 32 | lit.x as u64);
    lit.lambert.reflectance / PI * transport.prepared.gather.compensation(&found).irradiance
}
