//! Light that arrives straight from its source, with shadows.
//!
//! The points of a light that a pixel asks are the same for all pixels and frames: penumbras come out
//! smooth and still, where random points would leave noise that the encoder pays for.

use crate::accel::Accelerator;
use crate::anchor::{Anchor, Anchors};
use crate::emitter::{AreaSample, Emitters, PointLight, hammersley};
use crate::surface::Surfaces;
use glam::{Vec3, Vec3A};
use std::cell::Cell;

/// Points of an area light, and how many are asked first: when these agree on all or nothing, so would the rest.
const AREA_SAMPLES: usize = 64;
const FIRST_AREA_SAMPLES: usize = 16;
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
            areas: areas
                .iter()
                .map(|&place| spread_early(emitters.areas[place].samples(surfaces, AREA_SAMPLES)))
                .collect(),
            points: emitters.points.clone(),
            suns: emitters
                .suns
                .iter()
                .map(|sun| {
                    let directions = (0..SUN_SAMPLES).map(|i| sun.direction(hammersley(i, SUN_SAMPLES))).collect();
                    (sun.irradiance, spread_early(directions))
                })
                .collect(),
            carried: carried
                .filter(|(_, energy)| energy.max_element() > 0.0)
                .map(|(anchor, energy)| (anchor, *energy / std::f32::consts::PI))
                .collect(),
            carried_softening: anchors.carried_area_share / std::f32::consts::PI,
        }
    }

    /// Irradiance [W·m⁻²] at `receiver`, linear RGB; adds the shadow rays it cost to `rays`.
    pub fn irradiance(&self, accelerator: &Accelerator, receiver: &Receiver, rays: &Cell<u64>) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for samples in &self.areas {
            sum += gather(samples, FIRST_AREA_SAMPLES, |sample| {
                let softening = sample.area / std::f32::consts::PI;
                let e = from_disc(receiver, sample.position, sample.normal, sample.intensity, softening);
                shadowed(e, || accelerator.occluded(receiver.position, sample.position), rays)
            });
        }
        for light in &self.points {
            let (cos, r2) = receiver.cosine_to(light.position);
            let e = light.intensity_towards(receiver.position) * (cos / r2.max(f32::MIN_POSITIVE));
            sum += shadowed(e, || accelerator.occluded(receiver.position, light.position), rays).0;
        }
        for (irradiance, directions) in &self.suns {
            sum += gather(directions, FIRST_SUN_SAMPLES, |&towards| {
                let cos = if receiver.geometric_normal.dot(towards) > 0.0 {
                    receiver.normal.dot(towards).max(0.0)
                } else {
                    0.0
                };
                let e = *irradiance * (cos / SUN_SAMPLES as f32);
                shadowed(e, || accelerator.occluded_towards(receiver.position, towards), rays)
            });
        }
        for (anchor, intensity) in &self.carried {
            let e = from_disc(receiver, anchor.position, anchor.normal, *intensity, self.carried_softening);
            sum += shadowed(e, || accelerator.occluded(receiver.position, anchor.position), rays).0;
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

/// The value if nothing is in the way, and whether light could have come, and did.
#[inline]
fn shadowed(e: Vec3, occluded: impl FnOnce() -> bool, rays: &Cell<u64>) -> (Vec3, Option<bool>) {
    if e == Vec3::ZERO {
        return (e, None);
    }
    rays.set(rays.get() + 1);
    if occluded() { (Vec3::ZERO, Some(false)) } else { (e, Some(true)) }
}

/// Sums over samples; after the first few, stops asking for visibility when these all agreed.
#[inline]
fn gather<T>(samples: &[T], first: usize, mut ask: impl FnMut(&T) -> (Vec3, Option<bool>)) -> Vec3 {
    let mut sum = Vec3::ZERO;
    let (mut lit, mut dark) = (false, false);
    for sample in &samples[..first] {
        let (e, visible) = ask(sample);
        sum += e;
        lit |= visible == Some(true);
        dark |= visible == Some(false);
    }
    if lit && dark {
        for sample in &samples[first..] {
            sum += ask(sample).0;
        }
        sum
    } else {
        // All of one kind: the first ones speak for the rest.
        sum * (samples.len() as f32 / first as f32)
    }
}

/// Orders samples so that the first 2ᵏ of them are spread over the whole set: bit-reversed indices.
fn spread_early<T: Copy>(samples: Vec<T>) -> Vec<T> {
    let bits = samples.len().trailing_zeros();
    debug_assert!(samples.len().is_power_of_two());
    (0..samples.len()).map(|i| samples[i.reverse_bits() >> (usize::BITS - bits)]).collect()
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
