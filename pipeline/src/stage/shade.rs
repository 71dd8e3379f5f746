//! Light for every pixel: direct light, and a cut through the light tree that stops at the pixel's threshold.
//! The one place where rays and light tree meet.

use crate::message::{LuminanceThresholds, Prepared, Shaded};
use crate::plan::{Plan, State};
use crate::settings::{Lighting, Settings, Thresholds};
use crossbeam_channel::{Receiver, Sender};
use glam::{Vec3, Vec3A};
use lighttree::{Lambert, Scratch, Stop};
use perceptual::ThresholdMap;
use plane::Plane;
use rayon::prelude::*;
use render_core::{Busy, MACROBLOCK, NOTHING, PixelSurface, luminance};
use std::cell::Cell;

/// Share of the luminance that a pixel without a threshold may be wrong by \[Walter05\], \[Herzog08, 5.3\].
const WITHOUT_THRESHOLD: f32 = 0.02;
/// Pixels darker than this share of the picture's mean do not count in the mean relative threshold: 0/0 says nothing.
const DARK: f64 = 1e-4;

/// Lights frame after frame. With masking on, frame n waits for the thresholds of frame n−1, and for no others.
pub fn run(
    settings: &Settings,
    plan: &Plan,
    frames: &Receiver<Prepared>,
    thresholds: &Receiver<LuminanceThresholds>,
    out: &Sender<Shaded>,
) {
    for prepared in frames {
        let map = match (plan.masking, &prepared.correspondence) {
            (State::On, Some(correspondence)) => {
                let Ok(LuminanceThresholds { of, delta }) = thresholds.recv() else { return };
                assert_eq!(of + 1, prepared.frame, "thresholds out of step");
                perceptual::carry(&delta, &correspondence.matches)
            }
            _ => ThresholdMap::relative(settings.size.width, settings.size.height),
        };
        if out.send(shade(settings, plan, prepared, &map)).is_err() {
            return;
        }
    }
}

/// What a macroblock of pixels comes to.
struct Tile {
    radiance: Vec<[f32; 3]>,
    direct: f64,
    indirect: f64,
    shadow_rays: u64,
    cut_size: u64,
    cut_size_max: u32,
    surfaces: u64,
    /// Threshold and luminance of the pixels that see a surface.
    thresholds: Vec<(f32, f32)>,
}

fn shade(settings: &Settings, plan: &Plan, prepared: Prepared, map: &ThresholdMap) -> Shaded {
    let (width, height) = (settings.size.width, settings.size.height);
    let columns = width.div_ceil(MACROBLOCK);
    let tiles: Vec<Tile> = (0..columns * height.div_ceil(MACROBLOCK))
        .into_par_iter()
        .map_init(Scratch::default, |scratch, tile| {
            let (left, top) = (tile % columns * MACROBLOCK, tile / columns * MACROBLOCK);
            let area = (left..width.min(left + MACROBLOCK), top..height.min(top + MACROBLOCK));
            shade_tile(settings, plan, &prepared, map, area, scratch)
        })
        .collect();

    let mut radiance = Plane::filled(width, height, [0.0; 3]);
    for (index, tile) in tiles.iter().enumerate() {
        let (left, top) = (index % columns * MACROBLOCK, index / columns * MACROBLOCK);
        let tile_width = MACROBLOCK.min(width - left);
        for (y, row) in tile.radiance.chunks_exact(tile_width).enumerate() {
            radiance.row_mut(top + y)[left..left + tile_width].copy_from_slice(row);
        }
    }
    let mut figures = prepared.figures;
    // Tiles are summed in their order, so that the figures do not depend on the threads either.
    let surfaces: u64 = tiles.iter().map(|tile| tile.surfaces).sum();
    let per_surface = 1.0 / surfaces.max(1) as f64;
    figures.direct = tiles.iter().map(|tile| tile.direct).sum();
    figures.indirect = tiles.iter().map(|tile| tile.indirect).sum();
    figures.shadow_rays = tiles.iter().map(|tile| tile.shadow_rays).sum();
    figures.cut_size_mean = tiles.iter().map(|tile| tile.cut_size).sum::<u64>() as f64 * per_surface;
    figures.cut_size_max = tiles.iter().map(|tile| tile.cut_size_max).max().unwrap_or(0);
    let seen = || tiles.iter().flat_map(|tile| &tile.thresholds);
    let mean = seen().map(|&(_, y)| f64::from(y)).sum::<f64>() * per_surface;
    let relative: Vec<f64> =
        seen().filter(|&&(_, y)| f64::from(y) > DARK * mean).map(|&(t, y)| f64::from(t) / f64::from(y)).collect();
    figures.threshold_mean_relative = relative.iter().sum::<f64>() / relative.len().max(1) as f64;
    Shaded { frame: prepared.frame, radiance, correspondence: prepared.correspondence, figures }
}

fn shade_tile(
    settings: &Settings,
    plan: &Plan,
    prepared: &Prepared,
    map: &ThresholdMap,
    (columns, rows): (std::ops::Range<usize>, std::ops::Range<usize>),
    scratch: &mut Scratch,
) -> Tile {
    let places = || rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y)));
    let accelerator = &*prepared.accelerator;
    let rays = Cell::new(0);

    let busy = Busy::default();
    let direct_light = places().map(|(x, y)| {
        let pixel = prepared.seen.pixels.get(x, y);
        let emission = Vec3::from(pixel.emission);
        let albedo = Vec3::from(pixel.albedo);
        if pixel.instance == NOTHING || albedo == Vec3::ZERO {
            return emission;
        }
        let receiver = render_core::Receiver {
            position: off_surface(&pixel, prepared.epsilon),
            normal: pixel.shading_normal.into(),
            geometric_normal: pixel.geometric_normal.into(),
        };
        let irradiance = prepared.direct.irradiance(accelerator, &receiver, &rays);
        emission + albedo * irradiance / std::f32::consts::PI
    });
    let mut light: Vec<Vec3> = busy.measure(|| direct_light.collect());
    let direct = busy.seconds();

    let busy = Busy::default();
    let mut tile = Tile {
        radiance: Vec::new(),
        direct,
        indirect: 0.0,
        shadow_rays: 0,
        cut_size: 0,
        cut_size_max: 0,
        surfaces: 0,
        thresholds: Vec::new(),
    };
    busy.measure(|| {
        for ((x, y), light) in places().zip(&mut light) {
            let pixel = prepared.seen.pixels.get(x, y);
            if pixel.instance == NOTHING {
                continue;
            }
            tile.surfaces += 1;
            if plan.indirect == State::Off || pixel.albedo == [0.0; 3] {
                continue;
            }
            let position = off_surface(&pixel, prepared.epsilon);
            let lambert = Lambert {
                position: position.into(),
                normal: pixel.shading_normal.into(),
                reflectance: pixel.albedo.into(),
            };
            let geometric_normal = Vec3A::from(pixel.geometric_normal);
            let visible = |lamp: &lighttree::Light, _: usize| {
                let lamp = Vec3A::from(lamp.position);
                // A light below the triangle's own plane is hidden by it, whatever the smooth normal says.
                geometric_normal.dot(lamp - position) > 0.0 && !accelerator.occluded(position, lamp)
            };
            let known = luminance(*light);
            let (stop, threshold) = match (settings.thresholds, map.get(x, y)) {
                (Thresholds::Perceptual, Some(delta)) => (Stop::Absolute(delta), Some(delta)),
                (Thresholds::Perceptual, None) => (relative(WITHOUT_THRESHOLD, known), None),
                (Thresholds::Fixed(share), _) => (relative(share, known), None),
            };
            match settings.lighting {
                Lighting::Lightcuts => {
                    let cut = prepared.tree.lightcut(&lambert, stop, visible, scratch);
                    *light += cut.radiance;
                    tile.shadow_rays += u64::from(cut.shadow_rays);
                    tile.cut_size += u64::from(cut.size);
                    tile.cut_size_max = tile.cut_size_max.max(cut.size);
                    let total = luminance(*light);
                    let share =
                        if let Thresholds::Fixed(share) = settings.thresholds { share } else { WITHOUT_THRESHOLD };
                    tile.thresholds.push((threshold.unwrap_or(share * total), total));
                }
                Lighting::AllLights => {
                    let asked = Cell::new(0u64);
                    *light += prepared.tree.exhaustive(&lambert, |lamp, index| {
                        asked.set(asked.get() + 1);
                        visible(lamp, index)
                    });
                    tile.shadow_rays += asked.get();
                    tile.cut_size += prepared.tree.len() as u64;
                    tile.cut_size_max = prepared.tree.len() as u32;
                    tile.thresholds.push((0.0, luminance(*light)));
                }
            }
        }
    });
    tile.indirect = busy.seconds();
    tile.shadow_rays += rays.get();
    tile.radiance = light.iter().map(Vec3::to_array).collect();
    tile
}

fn relative(fraction: f32, known_luminance: f32) -> Stop {
    Stop::Relative { fraction, known_luminance }
}

/// Where rays from a pixel's surface start.
fn off_surface(pixel: &PixelSurface, epsilon: f32) -> Vec3A {
    Vec3A::from(pixel.position) + Vec3A::from(pixel.geometric_normal) * epsilon
}
