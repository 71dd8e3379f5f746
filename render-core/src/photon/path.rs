//! Path of one photon: emission, reflections with Russian roulette, end.

use super::guide::Starts;
use crate::accel::Accelerator;
use crate::anchor::Spot;
use crate::bsdf::Bsdf;
use crate::light::{EMISSION_DIMENSIONS, EmittedPhoton, PhotonSource};
use crate::luminance;
use crate::sampling::{cosine_hemisphere, frame, halton, hash_unit};
use crate::surface::Surfaces;
use crate::swept::SweptVolume;
use glam::{Vec2, Vec3, Vec3A};
use std::sync::Arc;

/// Maximum number of reflections. Roulette normally ends paths much earlier, but in a box of perfect walls all paths
/// have this length. The neglected light is 3·10⁻⁵ of all light at a reflectance of 0.99, and 0.6 % at 0.995.
pub(super) const LONGEST_PATH: usize = 1024;
/// Random dimensions per bounce: direction (2) and roulette (1).
const BOUNCE_DIMENSIONS: usize = 3;
/// Maximum number of aimed reflections per photon: each may double its flux.
const MOST_AIMS: usize = 2;
/// Maximum number of directions drawn from a coat until one leaves the surface.
const MOST_DRAWS: u64 = 8;

/// Scene, source and settings of the photon paths of one frame.
pub(super) struct Walk<'a> {
    pub accelerator: &'a Accelerator,
    pub surfaces: &'a Surfaces<'a>,
    pub source: &'a PhotonSource<'a>,
    /// Distribution of lights and starts.
    pub starts: &'a Starts,
    /// For each instance, whether it moves.
    pub moving: Arc<[bool]>,
    /// Width over which textures are averaged \[m\].
    pub footprint: f32,
    /// Offset of ray origins from their surface \[m\].
    pub epsilon: f32,
    pub count: u64,
    pub seed: u64,
    pub bounces: usize,
}

/// A reflection of a photon.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reflection {
    pub position: Vec3A,
    pub normal: Vec3A,
    /// Reflected flux \[W\].
    pub flux: Vec3,
    /// Index of the reflecting instance.
    pub instance: u32,
    /// Whether that instance moves.
    pub on_moving: bool,
    /// Distance from the previous reflection, or from the light \[m\].
    came: f32,
}

impl Reflection {
    /// Returns the spot where its energy is distributed.
    pub fn spot(&self) -> Spot {
        let Self { position, normal, instance, on_moving, came, .. } = *self;
        Spot { position, normal, instance, only_own: on_moving, came: Some(came) }
    }
}

/// The start of a path segment, which determines the rest of the path. Many are kept, so it is small.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    index: u32,
    /// Number of reflections before it.
    bounce: u16,
    /// Whether it starts at an infinitely distant light.
    distant: bool,
    origin: Vec3,
    direction: Vec3,
    /// Flux \[W\].
    flux: Vec3,
}

impl Leg {
    /// Returns the index of the photon.
    pub fn photon(&self) -> u32 {
        self.index
    }
}

/// A photon path, or the rest of one; reused for the next photon to keep its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Path {
    /// Flux emitted by its light \[W\]; zero for the rest of a path.
    pub emitted: Vec3,
    pub reflections: Vec<Reflection>,
    /// Flux that left the scene or ended on the back of a surface \[W\].
    pub lost: Vec3,
    /// Whether it starts at a moving light.
    pub from_moving: bool,
    /// End of the last segment, if it continues beyond the last reflection.
    end: Option<Vec3A>,
}

impl Walk<'_> {
    /// Traces photon `index` to its end; calls `each` with the start of each segment.
    pub fn follow(&self, index: u32, path: &mut Path, each: impl FnMut(Leg)) {
        let u = |dimension| halton(self.seed, index.into(), dimension);
        let start = self.starts.draw(f64::from(u(0)), Vec2::new(u(1), u(2)), Vec2::new(u(3), u(4)));
        let photon = self.source.emit(self.surfaces, start, self.count);
        let EmittedPhoton { origin, direction, flux, from_moving, distant } = photon;
        let leg = Leg { index, bounce: 0, distant, origin: origin.into(), direction: direction.into(), flux };
        self.follow_from(leg, path, each);
        (path.emitted, path.from_moving) = (flux, from_moving);
    }

    /// Traces a photon from the start of a segment.
    pub fn follow_from(&self, mut leg: Leg, path: &mut Path, mut each: impl FnMut(Leg)) {
        path.reflections.clear();
        *path = Path { reflections: std::mem::take(&mut path.reflections), ..Path::default() };
        let index = u64::from(leg.index);
        for bounce in usize::from(leg.bounce)..self.bounces {
            each(leg);
            let (origin, direction, flux) = (Vec3A::from(leg.origin), Vec3A::from(leg.direction), leg.flux);
            // A photon that leaves the scene or hits a back side is lost.
            let Some(hit) = self.accelerator.closest(origin, direction) else {
                path.lost = flux;
                path.end = Some(origin + direction * SweptVolume::FAR);
                return;
            };
            let surface = self.surfaces.meet(&hit, direction, self.footprint);
            if surface.is_back() {
                path.lost = flux;
                path.end = Some(surface.position);
                return;
            }
            // The albedo of a coat depends on the direction.
            let coat = surface.coat();
            let albedo = match &coat {
                Some((bsdf, normal)) => bsdf.directional_albedo(-direction.dot(*normal)),
                None => surface.albedo(),
            };
            let reflected = flux * albedo;
            path.reflections.push(Reflection {
                position: surface.position,
                normal: surface.geometric_normal,
                flux: reflected,
                instance: hit.instance,
                on_moving: self.moving[hit.instance as usize],
                came: if leg.distant { f32::INFINITY } else { hit.distance },
            });
            let u = |k| halton(self.seed, index, EMISSION_DIMENSIONS + bounce * BOUNCE_DIMENSIONS + k);
            // Survival by the reflectance keeps the energy of photons constant. With a lower probability, long-lived
            // photons would grow and a few would outshine all others: above √0.95, their variance is unbounded.
            let survival = (luminance(reflected) / luminance(flux)).clamp(0.0, 1.0);
            // A photon without energy gives 0/0.
            if survival.is_nan() || u(2) >= survival {
                return;
            }
            // The next direction follows the lobes of a coat, or a cosine lobe that may be aimed.
            let point = Vec2::new(u(0), u(1));
            let (direction, weight) = match coat {
                // For surviving photons, u(2) / survival is uniform in 0…1.
                Some((bsdf, normal)) => {
                    let again = |k| hash_unit(self.seed, index, (bounce as u64) << 32 | k);
                    leave(bsdf, normal, direction, u(2) / survival, |k| match k {
                        0 => point,
                        _ => Vec2::new(again(2 * k), again(2 * k + 1)),
                    })
                }
                None => {
                    let normal = surface.shading_normal().into();
                    let cone = if bounce < MOST_AIMS { self.starts.cone(surface.position) } else { None };
                    match cone {
                        Some(cone) => {
                            let (direction, gain) = cone.draw(normal, u(2) / survival, point);
                            (direction, albedo * gain)
                        }
                        None => (cosine_hemisphere(normal, point), albedo),
                    }
                }
            };
            // Shading normals can send photons into the surface, where they end.
            if Vec3A::from(direction).dot(surface.geometric_normal) <= 0.0 {
                return;
            }
            leg = Leg {
                index: leg.index,
                bounce: (bounce + 1) as u16,
                distant: false,
                origin: (surface.position + surface.geometric_normal * self.epsilon).into(),
                direction,
                flux: flux * weight / survival,
            };
        }
    }
}

/// Draws the direction in which a photon from `direction` leaves a coat or the base below it, and its weight:
///
/// ```text
/// C/p  by the coat, with chance p        B/(1 − p)  by the base          p = Y(C) / Y(C + B)
///   C, B  albedo of the coat's single scattering and of all else for light from there      Y  luminance
/// ```
/// Both weights have the luminance of the total albedo, so photons keep their energy. Weights by direction, F·G₂/G₁
/// over its mean, would make a few photons outshine all others.
fn leave(bsdf: Bsdf, normal: Vec3A, direction: Vec3A, choice: f32, point: impl Fn(u64) -> Vec2) -> (Vec3, Vec3) {
    let normal = Vec3::from(normal);
    let (x, y) = frame(normal);
    let outgoing = Vec3::from_array([x, y, normal].map(|axis| -axis.dot(direction.into())));
    let (coat, base) = (bsdf.coat_albedo(outgoing.z), bsdf.diffuse_albedo(outgoing.z));
    let share = luminance(coat) / luminance(coat + base);
    if choice < share
        && let Some(d) = (0..MOST_DRAWS).find_map(|k| bsdf.sample_coat(outgoing, point(k)))
    {
        return ((x * d.x + y * d.y + normal * d.z).normalize(), coat / share);
    }
    let weight = if choice < share { coat / share } else { base / (1.0 - share) };
    (cosine_hemisphere(normal, point(0)), weight)
}

impl Path {
    /// Returns the index of the first segment that moving geometry may ever block or affect. `legs` are the starts of
    /// the segments. Reflections within the `near` space count too, because moving geometry may hide their surfels.
    pub fn first_met(&self, legs: &[Leg], swept: &SweptVolume, near: &SweptVolume) -> Option<usize> {
        let ends = self.reflections.iter().map(|reflection| reflection.position).chain(self.end);
        let meets = |(leg, end): (&Leg, Vec3A)| swept.is_entered(leg.origin.into(), end);
        let entered = legs.iter().zip(ends).position(meets);
        let is_beside = |r: &Reflection| r.on_moving || near.is_entered(r.position, r.position);
        let beside = self.reflections.iter().position(is_beside);
        entered.into_iter().chain(beside).min()
    }

    /// Splits the path at a segment. The start stays here, and the rest is returned.
    pub fn split_off(&mut self, segment: usize) -> Path {
        let reflections = self.reflections.split_off(segment);
        Path { reflections, lost: std::mem::take(&mut self.lost), end: self.end.take(), ..Path::default() }
    }
}
