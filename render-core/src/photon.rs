//! Photons walk from the lights through the scene and leave their energy at the anchors.
//!
//! The same Halton numbers are used for every frame: where nothing moves, the energies are the same to
//! the last bit, and where something does, they change as little as the scene \[Herzog08, 4.1.1\].

use crate::accel::Accelerator;
use crate::anchor::{AnchorGrid, Anchors};
use crate::emitter::{EMISSION_DIMENSIONS, Emitters};
use crate::sampling::{cosine_hemisphere, halton};
use crate::surface::Surfaces;
use crate::{Busy, Units, luminance};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// What the photons of one frame left behind.
#[derive(Clone, Debug, PartialEq)]
pub struct Energies {
    /// Flux that the surface around each fixed anchor sends back \[W\], linear RGB.
    pub fixed: Vec<Vec3>,
    /// The same for the carried anchors.
    pub carried: Vec<Vec3>,
    /// What was emitted \[W\].
    pub emitted: Vec3,
    /// What all photons together were sent back with \[W\]: the sum that the anchors must hold.
    pub reflected: Vec3,
    /// What left the scene, or met surfaces from behind \[W\].
    pub lost: Vec3,
}

/// Photons that share an accumulator: few enough to spread over threads, and the same for any number of them.
const CHUNKS: u64 = 32;
/// Roulette ends paths long before; a mirror box of white walls must end too.
const LONGEST_PATH: usize = 64;
/// Dimensions of a bounce: direction (2) and roulette (1).
const BOUNCE_DIMENSIONS: usize = 3;

struct Sums {
    fixed: Vec<Vec3>,
    carried: Vec<Vec3>,
    emitted: DVec3,
    reflected: DVec3,
    lost: DVec3,
}

/// Traces `count` photons, with numbers that follow from `seed`; adds the work to `busy`. Twice the same call gives the same bits, for any number of threads.
pub fn trace_photons(
    accelerator: &Accelerator,
    surfaces: &Surfaces,
    emitters: &Emitters,
    anchors: &Anchors,
    units: &Units,
    (count, seed): (u64, u64),
    busy: &Busy,
) -> Energies {
    let mut energies = Energies {
        fixed: vec![Vec3::ZERO; anchors.fixed.len()],
        carried: vec![Vec3::ZERO; anchors.carried.len()],
        emitted: Vec3::ZERO,
        reflected: Vec3::ZERO,
        lost: Vec3::ZERO,
    };
    let Some(source) = emitters.photons(surfaces.scene()) else { return energies };
    let moving = surfaces.scene().moving_nodes();
    let carried_now = anchors.carried_in_world(surfaces);
    let grids = [
        AnchorGrid::new(&anchors.fixed, anchors.area_share),
        AnchorGrid::new(&carried_now, anchors.carried_area_share),
    ];
    // An anchor sees its neighbourhood blurred: so do the photons that feed it.
    let footprint = anchors.area_share.sqrt();
    let walk = |chunk: u64| {
        let mut sums = Sums {
            fixed: vec![Vec3::ZERO; anchors.fixed.len()],
            carried: vec![Vec3::ZERO; anchors.carried.len()],
            emitted: DVec3::ZERO,
            reflected: DVec3::ZERO,
            lost: DVec3::ZERO,
        };
        for index in count * chunk / CHUNKS..count * (chunk + 1) / CHUNKS {
            let start = source.emit(surfaces, seed, index, count);
            let (mut origin, mut direction, mut flux) = (start.origin, start.direction, start.flux);
            sums.emitted += flux.as_dvec3();
            for bounce in 0..LONGEST_PATH {
                let hit = accelerator.closest(origin, direction);
                let surface = hit.map(|hit| (hit, surfaces.at(&hit, direction, footprint)));
                let Some((hit, surface)) = surface.filter(|(_, s)| s.front || s.double_sided) else {
                    sums.lost += flux.as_dvec3();
                    break;
                };
                let reflected = flux * surface.albedo;
                let instance = hit.instance as usize;
                let carried = moving[surfaces.scene().instances[instance].node];
                let energy = if carried { &mut sums.carried } else { &mut sums.fixed };
                let only = carried.then_some(hit.instance);
                let taken = grids[usize::from(carried)].splat(
                    surface.position,
                    surface.geometric_normal,
                    only,
                    |anchor, weight| energy[anchor] += reflected * weight,
                );
                if !taken {
                    // An object too small to carry an anchor of its own.
                    sums.lost += flux.as_dvec3();
                    break;
                }
                sums.reflected += reflected.as_dvec3();
                let u = |k| halton(seed, index, EMISSION_DIMENSIONS + bounce * BOUNCE_DIMENSIONS + k);
                let survival = (luminance(reflected) / luminance(flux)).clamp(0.0, 0.95);
                if u(2) >= survival {
                    break;
                }
                flux = reflected / survival;
                direction = cosine_hemisphere(surface.shading_normal.into(), Vec2::new(u(0), u(1))).into();
                if direction.dot(surface.geometric_normal) <= 0.0 {
                    break;
                }
                origin = surface.position + surface.geometric_normal * units.epsilon;
            }
        }
        sums
    };
    let chunks: Vec<Sums> = (0..CHUNKS).into_par_iter().map(|chunk| busy.measure(|| walk(chunk))).collect();
    let (mut emitted, mut reflected, mut lost) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for sums in &chunks {
        energies.fixed.iter_mut().zip(&sums.fixed).for_each(|(total, part)| *total += *part);
        energies.carried.iter_mut().zip(&sums.carried).for_each(|(total, part)| *total += *part);
        emitted += sums.emitted;
        reflected += sums.reflected;
        lost += sums.lost;
    }
    energies.emitted = emitted.as_vec3();
    energies.reflected = reflected.as_vec3();
    energies.lost = lost.as_vec3();
    energies
}
