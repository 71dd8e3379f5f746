//! Path of one photon: emission, reflections with Russian roulette, and end.

use super::glass;
use super::guide::Starts;
use crate::accel::{Accelerator, Hit};
use crate::anchor::Spot;
use crate::bsdf::{Bsdf, SurfaceLobes};
use crate::light::{EMISSION_DIMENSIONS, EmittedPhoton, PhotonSource};
use crate::luminance;
use crate::sampling::{cosine_hemisphere, frame, halton, hash_unit};
use crate::surface::{Interaction, Surface, Surfaces};
use crate::swept::SweptVolume;
use glam::{Vec2, Vec3, Vec3A};
use std::sync::Arc;

/// Maximum number of reflections. Roulette normally ends paths much earlier, but in a box of perfect walls all paths
/// have this length. The neglected light is 3·10⁻⁵ of all light at a reflectance of 0.99, and 0.6 % at 0.995.
pub(super) const LONGEST_PATH: usize = 1024;
/// Number of random dimensions per bounce: two for the direction and one for the roulette.
const BOUNCE_DIMENSIONS: usize = 3;
/// Maximum number of aimed reflections per photon. Each may double the photon's flux.
const MOST_AIMS: usize = 2;
/// Maximum number of directions drawn from a coat until a direction leaves the surface.
const MOST_DRAWS: u64 = 8;
/// Keys of the random numbers that choose between glass and opaque surface, and that let glass absorb photons.
const GLASS: u64 = 1 << 60;
const ABSORBED: u64 = 2 << 60;
/// Minimum cosine between the shading normal and the geometric normal of flat surfaces: 0.26°.
const FLAT: f32 = 1.0 - 1e-5;
/// Maximum ratio of the light received by the shading normal to that received by the geometric normal. Grazing light
/// exceeds it, and its few photons would outshine all others.
const MOST_RECEIVED: f32 = 4.0;

/// Scene, source and settings for the photon paths of one frame.
pub(super) struct Walk<'a> {
    pub accelerator: &'a Accelerator,
    pub surfaces: &'a Surfaces<'a>,
    pub source: &'a PhotonSource<'a>,
    /// Distribution of the lights and start points of photons.
    pub starts: &'a Starts,
    /// Whether each instance moves, by instance.
    pub moving: Arc<[bool]>,
    /// Width over which textures are averaged \[m\].
    pub footprint: f32,
    /// Offset of ray origins from their surface \[m\].
    pub epsilon: f32,
    pub count: u64,
    pub seed: u64,
    pub bounces: usize,
}

/// Reflection of a photon.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reflection {
    pub position: Vec3A,
    pub normal: Vec3A,
    /// Reflected flux \[W\].
    pub flux: Vec3,
    /// Index of the reflecting instance.
    pub instance: u32,
    /// Whether the reflecting instance moves.
    pub on_moving: bool,
    /// Distance from the previous reflection, or from the light \[m\].
    came: f32,
}

impl Reflection {
    /// Returns the spot at which the energy of the reflection is distributed.
    pub fn spot(&self) -> Spot {
        let Self { position, normal, instance, on_moving, came, .. } = *self;
        Spot { position, normal, instance, only_own: on_moving, came: Some(came) }
    }
}

/// Start of a path segment, which determines the rest of the path. Many are stored, so the type is small.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Leg {
    index: u32,
    /// Number of preceding reflections.
    bounce: u16,
    /// Whether the segment starts at an infinitely distant light.
    distant: bool,
    origin: Vec3,
    direction: Vec3,
    /// Flux along the segment \[W\].
    flux: Vec3,
}

impl Leg {
    /// Returns the index of the segment's photon.
    pub fn photon(&self) -> u32 {
        self.index
    }
}

/// Photon path, or the rest of a path. The value is reused for the next photon to keep its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Path {
    /// Flux emitted by the light \[W\], or zero for the rest of a path.
    pub emitted: Vec3,
    pub reflections: Vec<Reflection>,
    /// Flux that left the scene or ended on the back of a surface \[W\].
    pub lost: Vec3,
    /// Whether the path starts at a moving light.
    pub from_moving: bool,
    /// End of the last segment, if the path continues beyond the last reflection.
    end: Option<Vec3A>,
}

impl Walk<'_> {
    /// Traces the photon with this `index` to its end. Calls `each` with the start of each segment.
    pub fn follow(&self, index: u32, path: &mut Path, each: impl FnMut(Leg)) {
        let u = |dimension| halton(self.seed, index.into(), dimension);
        let start = self.starts.draw(f64::from(u(0)), Vec2::new(u(1), u(2)), Vec2::new(u(3), u(4)));
        let photon = self.source.emit(self.surfaces, start, self.count);
        let EmittedPhoton { origin, direction, flux, from_moving, distant } = photon;
        let leg = Leg { index, bounce: 0, distant, origin: origin.into(), direction: direction.into(), flux };
        self.follow_from(leg, path, each);
        (path.emitted, path.from_moving) = (flux, from_moving);
    }

    /// Traces a photon from the start of a segment to its end. Calls `each` with the start of each further segment.
    pub fn follow_from(&self, mut leg: Leg, path: &mut Path, mut each: impl FnMut(Leg)) {
        // Clear the previous photon, but keep the memory of its reflections.
        path.reflections.clear();
        *path = Path { reflections: std::mem::take(&mut path.reflections), ..Path::default() };
        let index = u64::from(leg.index);
        for bounce in usize::from(leg.bounce)..self.bounces {
            each(leg);
            let (origin, direction, flux) = (Vec3A::from(leg.origin), Vec3A::from(leg.direction), leg.flux);

            // End the path of a photon that leaves the scene or hits a back side. Its flux is lost.
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

            // Let photons through glass, which stores no light.
            if let Some(lobes) = self.glass(index, bounce, &surface) {
                path.reflections.push(self.without_light(&surface, &hit));
                match self.through(&leg, &surface.surface(), &lobes, hit.distance) {
                    Some(next) => leg = next,
                    None => return,
                }
                continue;
            }

            // Compute the albedo of a coat for this direction, because it depends on the direction.
            let coat = surface.coat();
            let (albedo, normal) = match &coat {
                Some((bsdf, normal)) => (bsdf.directional_albedo(-direction.dot(*normal)), *normal),
                None => (surface.albedo(), surface.shading_normal()),
            };
            // Leave flat surfaces out, whose two normals differ by rounding.
            let is_flat = normal.dot(surface.geometric_normal) > FLAT;
            let received = if is_flat { 1.0 } else { received_share(direction, normal, surface.geometric_normal) };

            // Store the reflection. Its energy is distributed among surfels later.
            let reflected = flux * albedo * received;
            path.reflections.push(Reflection {
                position: surface.position,
                normal: surface.geometric_normal,
                flux: reflected,
                instance: hit.instance,
                on_moving: self.moving[hit.instance as usize],
                came: if leg.distant { f32::INFINITY } else { hit.distance },
            });

            // End or continue the path by Russian roulette.
            let u = |k| halton(self.seed, index, EMISSION_DIMENSIONS + bounce * BOUNCE_DIMENSIONS + k);
            // Use the reflectance as survival probability, which keeps the energy of photons constant. If the probability
            // were limited to q < 1, long-lived photons would grow and a few would outshine all others. For reflectances
            // above √q, the variance would be unbounded.
            let survival = (luminance(reflected) / luminance(flux)).clamp(0.0, 1.0);
            // End photons without energy, for which the survival probability is 0/0.
            if survival.is_nan() || u(2) >= survival {
                return;
            }

            // Draw the next direction from the lobes of a coat, or from a cosine lobe that may be aimed.
            let point = Vec2::new(u(0), u(1));
            let (direction, weight) = match coat {
                // Reuse u(2) / survival, which is uniform in 0…1 for surviving photons.
                Some((bsdf, normal)) => {
                    let again = |k| hash_unit(self.seed, index, (bounce as u64) << 32 | k);
                    leave(bsdf, normal, direction, u(2) / survival, |k| match k {
                        0 => point,
                        _ => Vec2::new(again(2 * k), again(2 * k + 1)),
                    })
                }
                None => {
                    // The radiance of a matte surface is the same in all directions above its triangle.
                    let normal = if is_flat { normal } else { surface.geometric_normal }.into();
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
            // End photons that the shading normals of coats send into the surface.
            if Vec3A::from(direction).dot(surface.geometric_normal) <= 0.0 {
                return;
            }

            // Divide by the survival probability, so that the expected flux is unchanged.
            leg = Leg {
                index: leg.index,
                bounce: (bounce + 1) as u16,
                distant: false,
                origin: (surface.position + surface.geometric_normal * self.epsilon).into(),
                direction,
                flux: flux * weight * received / survival,
            };
        }
    }
}

impl Walk<'_> {
    /// Returns the glass that a photon hits, or `None` at an opaque surface or the opaque fraction of a surface.
    fn glass(&self, index: u64, bounce: usize, surface: &Interaction) -> Option<Box<SurfaceLobes>> {
        if !surface.transmits() {
            return None;
        }
        glass::glass(&surface.surface(), hash_unit(self.seed, index, GLASS | bounce as u64))
    }

    /// Returns the reflection of a photon at a surface that stores no light.
    fn without_light(&self, surface: &Interaction, hit: &Hit) -> Reflection {
        Reflection {
            position: surface.position,
            normal: surface.geometric_normal,
            flux: Vec3::ZERO,
            instance: hit.instance,
            on_moving: self.moving[hit.instance as usize],
            came: hit.distance,
        }
    }

    /// Returns the segment of a photon behind glass, or `None` if the glass absorbs the photon. `came` is the length of
    /// the segment `leg` \[m\].
    fn through(&self, leg: &Leg, surface: &Surface, lobes: &SurfaceLobes, came: f32) -> Option<Leg> {
        let (index, bounce) = (u64::from(leg.index), usize::from(leg.bounce));
        let u = |k| halton(self.seed, index, EMISSION_DIMENSIONS + bounce * BOUNCE_DIMENSIONS + k);
        let passed = glass::pass(surface, lobes, leg.direction.into(), came, [u(2), u(0), u(1)])?;

        // Roulette absorbs photons, so that flux never grows.
        let flux = leg.flux * passed.weight;
        let survival = (luminance(flux) / luminance(leg.flux)).clamp(0.0, 1.0);
        if survival.is_nan() || hash_unit(self.seed, index, ABSORBED | bounce as u64) >= survival {
            return None;
        }
        let is_refracted = Vec3A::from(passed.direction).dot(surface.geometric_normal) < 0.0;
        let offset = if is_refracted { -self.epsilon } else { self.epsilon };
        Some(Leg {
            index: leg.index,
            bounce: (bounce + 1) as u16,
            distant: false,
            origin: (surface.position + surface.geometric_normal * offset).into(),
            direction: passed.direction,
            flux: flux / survival,
        })
    }
}

/// Returns the ratio of the light that a surface receives by its shading normal s to the light that it receives by its
/// geometric normal g, for light along the unit vector `direction` \[Veach97, 5.3\]:
///
/// ```text
/// (−ω · s)⁺ / (−ω · g)        at most 4
/// ```
/// Photons arrive in proportion to −ω · g, but path tracing evaluates the shading normal.
fn received_share(direction: Vec3A, shading: Vec3A, geometric: Vec3A) -> f32 {
    let [by_shading, by_geometric] = [shading, geometric].map(|normal| -direction.dot(normal));
    if by_geometric <= 0.0 {
        return 1.0;
    }
    (by_shading / by_geometric).clamp(0.0, MOST_RECEIVED)
}

/// Draws the direction in which a photon from `direction` leaves a coat or the base below it, and the photon's weight:
///
/// ```text
/// C/p  if the coat reflects, with probability p        B/(1 − p)  if the base reflects          p = Y(C) / Y(C + B)
///   C, B  albedo of the coat's single scattering, and of all other reflection, for this direction      Y  luminance
/// ```
/// Both weights have the luminance of the total albedo, so photons keep their energy. With weights by direction
/// (F·G₂/G₁ over its mean), a few photons would outshine all others.
fn leave(bsdf: Bsdf, normal: Vec3A, direction: Vec3A, choice: f32, point: impl Fn(u64) -> Vec2) -> (Vec3, Vec3) {
    // Compute the albedos of coat and base in the shading frame.
    let normal = Vec3::from(normal);
    let (x, y) = frame(normal);
    let outgoing = Vec3::from_array([x, y, normal].map(|axis| -axis.dot(direction.into())));
    let (coat, base) = (bsdf.coat_albedo(outgoing.z), bsdf.diffuse_albedo(outgoing.z));
    let share = luminance(coat) / luminance(coat + base);
    // Reflect by the coat. If all drawn directions point below the surface, use a cosine lobe.
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
    /// the segments. Reflections within the `near` space are also affected, because moving geometry may hide their
    /// surfels.
    pub fn first_met(&self, legs: &[Leg], swept: &SweptVolume, near: &SweptVolume) -> Option<usize> {
        // Compare each segment with the swept volume, and each reflection with the widened volume.
        let ends = self.reflections.iter().map(|reflection| reflection.position).chain(self.end);
        let meets = |(leg, end): (&Leg, Vec3A)| swept.is_entered(leg.origin.into(), end);
        let entered = legs.iter().zip(ends).position(meets);
        let is_beside = |r: &Reflection| r.on_moving || near.is_entered(r.position, r.position);
        let beside = self.reflections.iter().position(is_beside);
        entered.into_iter().chain(beside).min()
    }

    /// Splits the path at a segment. The start of the path remains in `self`, and the rest is returned.
    pub fn split_off(&mut self, segment: usize) -> Path {
        let reflections = self.reflections.split_off(segment);
        Path { reflections, lost: std::mem::take(&mut self.lost), end: self.end.take(), ..Path::default() }
    }
}
