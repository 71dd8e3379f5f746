//! Lights as direct light needs them: points to trace shadow rays to, and what surfaces with a BRDF of their own reflect.

use super::balance::Balance;
use super::{Disc, ShadingPoint, Traced, bits};
use crate::accel::{PACKET, Shadows};
use crate::emitter::{AreaLight, AreaSample, PointLight, SunLight};
use crate::environment::SkyLamp;
use crate::polygon::Polygon;
use crate::sampling::centered_sobol;
use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A};
use std::f32::consts::PI;

/// Sample points of an area light, and those that shadow rays are traced to first. The rest is skipped where these and the
/// corners of the light agree. Without the corners a penumbra begins too late, and with a step.
const AREA_SAMPLES: usize = 64;
pub(super) const FIRST_AREA_SAMPLES: usize = 16;
/// Distance of corner samples from the corner, as a share of that to the middle: objects that touch a lamp hide its border.
const INWARD: f32 = 0.05;
/// A light of more pieces than this is summed over its points even where nothing hides it.
const MOST_POLYGONS: usize = 4;
/// Sample points of the disc of the sun, and those that shadow rays are traced to first, after the border.
const SUN_SAMPLES: usize = 32;
pub(super) const FIRST_SUN_SAMPLES: usize = 2;
/// Points of the unit square that go to the border of a disc, an eighth of a turn apart.
const BORDER: [Vec2; 8] = [
    Vec2::new(0.0, 0.0),
    Vec2::new(1.0, 1.0),
    Vec2::new(1.0, 0.0),
    Vec2::new(0.0, 1.0),
    Vec2::new(0.5, 0.0),
    Vec2::new(0.5, 1.0),
    Vec2::new(1.0, 0.5),
    Vec2::new(0.0, 0.5),
];

/// A glowing surface.
#[derive(Debug)]
pub(super) struct Area {
    pub instance: u32,
    pub samples: Vec<AreaSample>,
    /// Where it ends, where its shape is simple.
    pub corners: Vec<AreaSample>,
    /// Positions of the samples and the corners.
    pub positions: Vec<Vec3A>,
    /// Its shape, where that is simple enough for a closed form.
    pub polygons: Vec<Polygon>,
    /// Factors that give the samples the intensity of the whole light, where there is no closed form.
    pub balance: Option<Balance>,
}

impl Area {
    pub fn new(light: &AreaLight, surfaces: &Surfaces) -> Self {
        // A few evenly glowing polygons have a closed form. What has none is summed over its samples, in balance.
        let simple = light.patch_count() <= MOST_POLYGONS && !light.is_textured();
        let samples = light.samples(surfaces, AREA_SAMPLES);
        let pieces = light.polygons(surfaces);
        let balance = (!simple).then(|| Balance::new(&pieces, &samples));
        let polygons = if simple { pieces } else { Vec::new() };

        // Corners give nothing: they only tell whether the light is partly hidden.
        let corners: Vec<AreaSample> = polygons.iter().flat_map(|polygon| corners(polygon, &samples[0])).collect();
        Self {
            instance: light.instance as u32,
            positions: samples.iter().chain(&corners).map(|sample| sample.position).collect(),
            samples,
            corners,
            polygons,
            balance,
        }
    }

    /// Unshadowed irradiance from one of the samples.
    #[inline]
    fn unhidden_sample(&self, receiver: &ShadingPoint, sample: &AreaSample) -> Vec3 {
        sample.intensity * Disc::of_sample(sample).term(receiver)
    }

    /// Factor for light of the samples at a receiver.
    pub fn balance_at(&self, receiver: &ShadingPoint) -> f32 {
        self.balance.as_ref().map_or(1.0, |balance| balance.at(receiver.position))
    }

    /// Unshadowed irradiance from the whole light.
    pub fn unhidden(&self, receiver: &ShadingPoint) -> Vec3 {
        if self.polygons.is_empty() {
            let sum: Vec3 = self.samples.iter().map(|sample| self.unhidden_sample(receiver, sample)).sum();
            return sum * self.balance_at(receiver);
        }
        let ShadingPoint { position, normal, geometric_normal } = *receiver;
        self.polygons.iter().map(|polygon| polygon.irradiance(position, normal, geometric_normal)).sum()
    }

    /// Adds to `whole` the radiance that a receiver of this `brdf` reflects of the samples, each a disc.
    pub fn add_reflected(
        &self,
        shadows: &Shadows,
        receiver: &ShadingPoint,
        brdf: impl Fn(Vec3A, f32) -> Vec3,
        whole: &mut Traced<Vec3>,
    ) {
        let balance = self.balance_at(receiver);
        for samples in self.samples.chunks(PACKET) {
            // L = f E of each sample, if nothing hides it. To the BRDF it is as wide as a disc of its area.
            let (mut given, mut ends, mut active) = ([Vec3::ZERO; PACKET], [Vec3A::ZERO; PACKET], 0);
            for (i, sample) in samples.iter().enumerate() {
                let way = sample.position - receiver.position;
                let irradiance = self.unhidden_sample(receiver, sample);
                ends[i] = sample.position;
                if irradiance != Vec3::ZERO {
                    let distance = way.length();
                    let half_angle = (sample.area / PI).sqrt().atan2(distance);
                    given[i] = irradiance * brdf(way / distance, half_angle);
                    active |= u64::from(given[i] != Vec3::ZERO) << i;
                }
            }

            // One packet of shadow rays tells which of them are hidden.
            whole.shadow_rays += u64::from(active.count_ones());
            let hidden = shadows.opaque().occluded_packet(receiver.position, &ends[..samples.len()], active);
            let seen = bits(active & !hidden).map(|i| given[i] * shadows.passed(receiver.position, ends[i]));
            whole.value += balance * seen.sum::<Vec3>();
        }
    }
}

/// Points of a light that are near its corners, and give nothing.
fn corners(polygon: &Polygon, sample: &AreaSample) -> impl Iterator<Item = AreaSample> {
    let Polygon { corners, normal, .. } = *polygon;
    let middle = corners.iter().sum::<Vec3A>() / corners.len() as f32;
    // As far off the surface as the others.
    let offset = sample.offset.min(1e-3 * (corners[0] - middle).length());
    // A triangle's last corner stands twice.
    let count = if corners[2] == corners[3] { 3 } else { 4 };
    corners.into_iter().take(count).map(move |corner| AreaSample {
        position: corner.lerp(middle, INWARD) + normal * offset,
        offset,
        normal,
        intensity: Vec3::ZERO,
        area: sample.area,
    })
}

/// The disc of a sun, or a lamp of the sky.
#[derive(Debug)]
pub(super) struct Sun {
    pub irradiance: Vec3,
    pub towards: Vec3A,
    pub angular_radius: f32,
    /// Towards points of its disc, and of its border.
    pub directions: Vec<Vec3A>,
    pub border: [Vec3A; 8],
}

impl Sun {
    pub fn new(light: &SunLight) -> Self {
        Self {
            irradiance: light.irradiance,
            towards: light.towards,
            angular_radius: light.angular_radius,
            directions: centered_sobol(SUN_SAMPLES).map(|u| light.direction(u)).collect(),
            border: BORDER.map(|u| light.direction(u)),
        }
    }

    /// A small bright spot of the sky.
    pub fn in_sky(lamp: &SkyLamp) -> Self {
        Self {
            irradiance: lamp.irradiance,
            towards: lamp.towards,
            angular_radius: lamp.angular_radius,
            directions: lamp.directions(SUN_SAMPLES),
            border: lamp.border,
        }
    }

    /// All that its other fields follow from.
    pub fn light(&self) -> (Vec3, Vec3A, f32) {
        (self.irradiance, self.towards, self.angular_radius)
    }

    /// Radiance that a receiver of this `brdf` reflects of it.
    pub fn reflected(
        &self,
        shadows: &Shadows,
        receiver: &ShadingPoint,
        brdf: impl Fn(Vec3A, f32) -> Vec3,
    ) -> Traced<Vec3> {
        // L = f E cos θ, none from below the horizon of the normal or of the triangle.
        let given =
            brdf(self.towards, self.angular_radius) * self.irradiance * receiver.normal.dot(self.towards).max(0.0);
        if given == Vec3::ZERO || receiver.geometric_normal.dot(self.towards) <= 0.0 {
            return Traced { value: Vec3::ZERO, shadow_rays: 0 };
        }

        // The visible share of the disc is that of its first points.
        let first = &self.directions[..FIRST_SUN_SAMPLES];
        let seen: f32 = first.iter().map(|&towards| shadows.visible_towards(receiver.position, towards)).sum();
        Traced { value: given * (seen / first.len() as f32), shadow_rays: first.len() as u64 }
    }
}

/// Radiance that a receiver of this `brdf` reflects of a point light.
pub(super) fn reflected_point(
    light: &PointLight,
    shadows: &Shadows,
    receiver: &ShadingPoint,
    brdf: impl Fn(Vec3A, f32) -> Vec3,
) -> Traced<Vec3> {
    // L = f I(ω) cos θ / r²
    let (cos, r2) = receiver.cosine_to(light.position);
    let towards = (light.position - receiver.position).try_normalize();
    let Some(towards) = towards.filter(|_| cos > 0.0) else { return Traced::default() };
    let given = brdf(towards, 0.0) * light.intensity_towards(receiver.position) * (cos / r2);

    // Outside of a spot's cone and of a mirror's highlight nothing is left that a shadow ray could take away.
    if given == Vec3::ZERO {
        return Traced::default();
    }
    Traced { value: given * shadows.visible(receiver.position, light.position), shadow_rays: 1 }
}
