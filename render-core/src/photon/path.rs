//! The way of one photon: emission, reflections by roulette, end.

use super::Swept;
use crate::accel::Accelerator;
use crate::anchor::Spot;
use crate::emitter::{EMISSION_DIMENSIONS, PhotonSource};
use crate::luminance;
use crate::sampling::{cosine_hemisphere, halton};
use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A};

/// Roulette ends paths before, at a reflectance of 0.95 all but two in a million; a box of perfect walls must end too.
pub(super) const LONGEST_PATH: usize = 256;
/// Dimensions of a bounce: direction (2) and roulette (1).
const BOUNCE_DIMENSIONS: usize = 3;

/// What all photons of a frame have in common.
pub(super) struct Walk<'a> {
    pub accelerator: &'a Accelerator,
    pub surfaces: &'a Surfaces<'a>,
    pub source: &'a PhotonSource<'a>,
    /// For each instance, whether it moves.
    pub moving: Vec<bool>,
    /// Width over which textures are averaged \[m\].
    pub footprint: f32,
    /// Rays start this far off their surface \[m\].
    pub epsilon: f32,
    pub count: u64,
    pub seed: u64,
    pub bounces: usize,
}

/// Where a photon was reflected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reflection {
    pub position: Vec3A,
    pub normal: Vec3A,
    /// \[W\]
    pub flux: Vec3,
    /// The moving instance it was reflected by.
    pub carrier: Option<u32>,
    /// How far it came from the reflection before, or from its light \[m\].
    came: f32,
}

impl Reflection {
    /// Where its energy is shared out.
    pub fn spot(&self) -> Spot {
        let Self { position, normal, carrier, came, .. } = *self;
        Spot { position, normal, instance: carrier, came: Some(came) }
    }
}

/// A photon's way; kept from one photon to the next for its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Path {
    pub emitted: Vec3,
    pub reflections: Vec<Reflection>,
    /// What left the scene or ended behind a surface \[W\].
    pub lost: Vec3,
    /// Started from a light that moves.
    from_moving: bool,
    start: Vec3A,
    /// Where the last segment ends, if it went on beyond the last reflection.
    end: Option<Vec3A>,
}

impl Walk<'_> {
    /// Follows photon `index` to its end.
    pub fn follow(&self, index: u64, path: &mut Path) {
        let start = self.source.emit(self.surfaces, self.seed, index, self.count);
        let (mut origin, mut direction, mut flux) = (start.origin, start.direction, start.flux);
        path.reflections.clear();
        *path = Path {
            emitted: flux,
            reflections: std::mem::take(&mut path.reflections),
            lost: Vec3::ZERO,
            from_moving: start.from_moving,
            start: origin,
            end: None,
        };
        for bounce in 0..self.bounces {
            let Some(hit) = self.accelerator.closest(origin, direction) else {
                path.lost = flux;
                path.end = Some(origin + direction * Swept::FAR);
                return;
            };
            let surface = self.surfaces.at(&hit, direction, self.footprint);
            if !(surface.front || surface.double_sided) {
                path.lost = flux;
                path.end = Some(surface.position);
                return;
            }
            let reflected = flux * surface.albedo;
            path.reflections.push(Reflection {
                position: surface.position,
                normal: surface.geometric_normal,
                flux: reflected,
                carrier: self.moving[hit.instance as usize].then_some(hit.instance),
                came: if bounce == 0 && start.distant { f32::INFINITY } else { hit.distance },
            });
            let u = |k| halton(self.seed, index, EMISSION_DIMENSIONS + bounce * BOUNCE_DIMENSIONS + k);
            let survival = (luminance(reflected) / luminance(flux)).clamp(0.0, 0.95);
            // A photon without energy divides 0 by 0.
            if survival.is_nan() || u(2) >= survival {
                return;
            }
            flux = reflected / survival;
            direction = cosine_hemisphere(surface.shading_normal.into(), Vec2::new(u(0), u(1))).into();
            if direction.dot(surface.geometric_normal) <= 0.0 {
                return;
            }
            origin = surface.position + surface.geometric_normal * self.epsilon;
        }
    }
}

impl Path {
    /// Whether anything that moves may ever stand in this path's way, or be its beginning.
    pub fn meets(&self, swept: &Swept) -> bool {
        let points = || self.reflections.iter().map(|reflection| reflection.position);
        let begins = std::iter::once(self.start).chain(points());
        let ends = points().chain(self.end);
        self.from_moving
            || self.reflections.iter().any(|reflection| reflection.carrier.is_some())
            || begins.zip(ends).any(|(from, to)| swept.is_entered(from, to))
    }
}
