//! Light that arrives straight from its source, with shadows.
//!
//! The points of a light that a pixel asks are the same for all pixels and frames: penumbras come out
//! smooth and still, where random points would leave noise that the encoder pays for.

use crate::accel::Accelerator;
use crate::anchor::{Anchor, Anchors};
use crate::emitter::{AreaSample, Emitters, PointLight};
use crate::sampling::sobol_point;
use crate::surface::Surfaces;
use glam::{Vec3, Vec3A};
use std::cell::Cell;

/// Points of an area light, and how many are asked first: when these agree on all or nothing, so would the rest.
const AREA_SAMPLES: usize = 64;
const FIRST_AREA_SAMPLES: usize = 16;
/// Softening of a point of an area light, in units of its own share's: as small as keeps contact finite. With the full
/// share a panel seen from its own width comes out 0.5 % dark, since its points already average over each other.
const AREA_SOFTENING: f32 = 1.0 / 8.0;
/// The same for the disc of the sun, which is small.
const SUN_SAMPLES: usize = 32;
const FIRST_SUN_SAMPLES: usize = 8;

/// What is asked for direct light at every pixel of a frame.
pub struct DirectLights {
    areas: Vec<Vec<AreaSample>>,
    points: Vec<PointLight>,
    suns: Vec<(Vec3, Vec<Vec3A>)>,
    carried: Vec<(Anchor, Vec3)>,
    carried_softening: f32,
}

/// A point that light arrives at.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// A little off the surface, metres.
    pub position: Vec3A,
    /// Unit normal to shade with.
    pub normal: Vec3A,
    /// Unit normal of the triangle, on the same side.
    pub geometric_normal: Vec3A,
}

impl DirectLights {
    /// Prepares a frame. Of the glowing surfaces only those with a place in `areas` are asked here: the others
    /// are somebody else's, lights of a tree.
    pub fn new(
        emitters: &Emitters,
        surfaces: &Surfaces,
        anchors: &Anchors,
        carried_energy: &[Vec3],
        areas: &[usize],
    ) -> Self {
        let carried = anchors.carried_in_world(surfaces).into_iter().zip(carried_energy);
        Self {
            areas: areas.iter().map(|&place| emitters.areas[place].samples(surfaces, AREA_SAMPLES)).collect(),
            points: emitters.points.clone(),
            suns: emitters
                .suns
                .iter()
                .map(|sun| {
                    let directions = (0..SUN_SAMPLES as u64).map(|i| sun.direction(sobol_point(i))).collect();
                    (sun.irradiance, directions)
                })
                .collect(),
            carried: carried
                .filter(|(_, energy)| energy.max_element() > 0.0)
                .map(|(anchor, energy)| (anchor, *energy / std::f32::consts::PI))
                .collect(),
            carried_softening: anchors.carried_area_share / std::f32::consts::PI,
        }
    }

    /// Irradiance \[W·m⁻²\] at `receiver`, linear RGB; adds the shadow rays it cost to `rays`.
    pub fn irradiance(&self, accelerator: &Accelerator, receiver: &Receiver, rays: &Cell<u64>) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for samples in &self.areas {
            sum += gather(
                samples,
                FIRST_AREA_SAMPLES,
                rays,
                |s| {
                    from_disc(
                        receiver,
                        s.position,
                        s.normal,
                        s.intensity,
                        AREA_SOFTENING * s.area / std::f32::consts::PI,
                    )
                },
                |s| accelerator.occluded(receiver.position, s.position),
            );
        }
        for light in &self.points {
            let (cos, r2) = receiver.cosine_to(light.position);
            let e = light.intensity_towards(receiver.position) * (cos / r2.max(f32::MIN_POSITIVE));
            sum += gather(&[e], 1, rays, |e| *e, |_| accelerator.occluded(receiver.position, light.position));
        }
        for (irradiance, directions) in &self.suns {
            sum += gather(
                directions,
                FIRST_SUN_SAMPLES,
                rays,
                |&towards| {
                    let above = receiver.geometric_normal.dot(towards) > 0.0;
                    let cos = if above { receiver.normal.dot(towards).max(0.0) } else { 0.0 };
                    *irradiance * (cos / SUN_SAMPLES as f32)
                },
                |&towards| accelerator.occluded_towards(receiver.position, towards),
            );
        }
        for (anchor, intensity) in &self.carried {
            let e = from_disc(receiver, anchor.position, anchor.normal, *intensity, self.carried_softening);
            sum += gather(&[e], 1, rays, |e| *e, |_| accelerator.occluded(receiver.position, anchor.position));
        }
        sum
    }

    /// How many lights a pixel asks: areas, points, suns and carried anchors.
    pub fn counts(&self) -> [usize; 4] {
        [self.areas.len(), self.points.len(), self.suns.len(), self.carried.len()]
    }
}

/// Irradiance from a disc that glows evenly: `I · cos θ_light · cos θ / (r² + softening)`.
///
/// With softening = area / π this is exact on the disc's axis for a facing receiver, and finite at contact,
/// where the point light's 1/r² would not be.
#[inline]
fn from_disc(receiver: &Receiver, position: Vec3A, normal: Vec3A, intensity: Vec3, softening: f32) -> Vec3 {
    let way = position - receiver.position;
    let r2 = way.length_squared();
    let cos_light = -normal.dot(way);
    let cos = receiver.normal.dot(way);
    if cos_light <= 0.0 || cos <= 0.0 || receiver.geometric_normal.dot(way) <= 0.0 {
        return Vec3::ZERO;
    }
    // Both cosines still carry the length of `way`: divide by r² once more.
    intensity * (cos_light * cos / (r2 * (r2 + softening)))
}

/// Sums `unshadowed` over the samples that `occluded` lets through; each call of it is a ray.
///
/// After the first few, visibility is no longer asked when these all agreed; what they agree on then holds for the rest.
#[inline]
fn gather<T>(
    samples: &[T],
    first: usize,
    rays: &Cell<u64>,
    unshadowed: impl Fn(&T) -> Vec3,
    occluded: impl Fn(&T) -> bool,
) -> Vec3 {
    let mut sum = Vec3::ZERO;
    let (mut lit, mut dark) = (0, 0);
    for (index, sample) in samples.iter().enumerate() {
        let e = unshadowed(sample);
        if e == Vec3::ZERO {
            continue;
        }
        let agreed = index >= first && (lit == 0 || dark == 0);
        if agreed && lit == 0 && dark > 0 {
            break;
        }
        // Without a vote so far, as when the first few all lie below the horizon, each is asked.
        let blocked = if agreed && lit > 0 {
            false
        } else {
            rays.set(rays.get() + 1);
            occluded(sample)
        };
        if blocked {
            dark += 1;
        } else {
            lit += 1;
            sum += e;
        }
    }
    sum
}

impl Receiver {
    /// Cosine at the receiver and squared distance to `point`; 0 from below the surface.
    #[inline]
    fn cosine_to(&self, point: Vec3A) -> (f32, f32) {
        let way = point - self.position;
        let r2 = way.length_squared();
        if self.geometric_normal.dot(way) <= 0.0 {
            return (0.0, r2);
        }
        (self.normal.dot(way).max(0.0) / r2.sqrt().max(f32::MIN_POSITIVE), r2)
    }
}
