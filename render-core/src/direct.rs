//! Light that arrives straight from its source, with shadows.
//!
//! The sample points of a light are the same for all pixels and frames: penumbras come out smooth and still, where random
//! points would leave noise that the encoder pays for. Shadow rays of a sample are traced to all pixels of a tile together.

mod balance;
mod tile;

use crate::accel::{Accelerator, PACKET};
use crate::anchor::{Anchor, Anchors};
use crate::emitter::{AreaLight, AreaSample, Emitters, PointLight};
use crate::luminance;
use crate::polygon::Polygon;
use crate::sampling::centered_sobol;
use crate::surface::Surfaces;
use balance::Balance;
use glam::{Vec2, Vec3, Vec3A};
use std::f32::consts::PI;
use tile::Tile;

/// Sample points of an area light, and those that shadow rays are traced to first. The rest is skipped where these and the
/// corners of the light agree. Without the corners a penumbra begins too late, and with a step.
const AREA_SAMPLES: usize = 64;
const FIRST_AREA_SAMPLES: usize = 16;
/// Distance of corner samples from the corner, as a share of that to the middle: objects that touch a lamp hide its border.
const INWARD: f32 = 0.05;
/// Bound of the geometry term of a sample of an area light, as a share of that of its own disc: it keeps contact finite. With
/// the full disc a panel seen from its own width comes out 0.5 % dark, since its points already average over each other.
const AREA_BOUND: f32 = 1.0 / 8.0;
/// Least number of receivers for which a shaft to the light is worth its cost.
const WORTH_A_SHAFT: usize = 8;
/// A light of more pieces than this is summed over its points even where nothing hides it.
const MOST_POLYGONS: usize = 4;
/// The same for the disc of the sun; eight points of the border come before.
const SUN_SAMPLES: usize = 32;
const FIRST_SUN_SAMPLES: usize = 2;
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
/// Shadow rays are skipped for dynamic anchors that in sum give a receiver less than this share of its other direct light.
const UNSHADOWED_SHARE: f32 = 1e-3;

/// Lights of a frame that are sampled with shadow rays at every pixel.
#[derive(Debug)]
pub struct DirectLights {
    areas: Vec<Area>,
    points: Vec<PointLight>,
    suns: Vec<Sun>,
    dynamic: Vec<(Anchor, Vec3)>,
    dynamic_geometry_term_bound: f32,
    dynamic_apart: bool,
}

/// Light and the shadow rays traced for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct Traced<T> {
    /// Irradiance or radiance.
    pub value: T,
    /// Number of shadow rays.
    pub shadow_rays: u64,
}

/// Dynamic anchors as lights of a frame.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct DynamicLights<'a> {
    /// Each with its intensity along the normal \[W·sr⁻¹\].
    pub anchors: &'a [(Anchor, Vec3)],
    /// [`Anchors::dynamic_geometry_term_bound`] \[m²\].
    pub geometry_term_bound: f32,
}

/// A glowing surface.
#[derive(Debug)]
struct Area {
    instance: u32,
    samples: Vec<AreaSample>,
    /// Where it ends, where its shape is simple.
    corners: Vec<AreaSample>,
    /// Positions of the samples and the corners.
    positions: Vec<Vec3A>,
    /// Its shape, where that is simple enough for a closed form.
    polygons: Vec<Polygon>,
    /// Factors that give the samples the intensity of the whole light, where there is no closed form.
    balance: Option<Balance>,
}

/// The disc of a sun.
#[derive(Debug)]
struct Sun {
    irradiance: Vec3,
    towards: Vec3A,
    angular_radius: f32,
    /// Towards points of its disc, and of its border.
    directions: Vec<Vec3A>,
    border: [Vec3A; 8],
}

/// One point of each light that is sampled at every pixel.
#[derive(Clone, Debug, Default)]
pub struct Lamps {
    /// \[m\]
    points: Vec<Vec3A>,
    /// Unit vectors towards suns.
    suns: Vec<Vec3A>,
}

impl Lamps {
    /// Whether any of the points is visible from `position`, on a surface that faces along `normal`.
    pub(crate) fn are_seen(&self, accelerator: &Accelerator, position: Vec3A, normal: Vec3A) -> bool {
        let sun = |&towards: &Vec3A| normal.dot(towards) > 0.0 && !accelerator.occluded_towards(position, towards);
        let point = |&lamp: &Vec3A| normal.dot(lamp - position) > 0.0 && !accelerator.occluded(position, lamp);
        self.suns.iter().any(sun) || self.points.iter().any(point)
    }
}

/// A region that direct light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// A box around a light.
    Lamp {
        /// \[m\]
        low: Vec3A,
        /// \[m\]
        high: Vec3A,
    },
    /// A disc in the sky.
    Sun {
        /// Unit vector.
        towards: Vec3A,
        /// \[rad\]
        angular_radius: f32,
    },
}

/// A surface point to be lit.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint {
    /// A little off the surface, meters.
    pub position: Vec3A,
    /// Unit normal to shade with.
    pub normal: Vec3A,
    /// Unit normal of the triangle, on the same side.
    pub geometric_normal: Vec3A,
}

impl DirectLights {
    /// Prepares a frame. `areas` are the indices in [`Emitters::areas`] of the glowing surfaces that are sampled here;
    /// `dynamic_flux` is that of [`Anchors::dynamic`] \[W\].
    #[must_use]
    pub fn new(
        emitters: &Emitters,
        surfaces: &Surfaces,
        anchors: &Anchors,
        dynamic_flux: &[Vec3],
        areas: &[usize],
    ) -> Self {
        let dynamic = anchors.dynamic_in_world(surfaces).into_iter().zip(dynamic_flux);
        Self {
            areas: areas.iter().map(|&place| Area::new(&emitters.areas[place], surfaces)).collect(),
            points: emitters.points.clone(),
            suns: emitters
                .suns
                .iter()
                .map(|sun| Sun {
                    irradiance: sun.irradiance,
                    towards: sun.towards,
                    angular_radius: sun.angular_radius,
                    directions: centered_sobol(SUN_SAMPLES).map(|u| sun.direction(u)).collect(),
                    border: BORDER.map(|u| sun.direction(u)),
                })
                .collect(),
            dynamic: dynamic
                .filter(|(_, energy)| energy.max_element() > 0.0)
                .map(|(anchor, energy)| (anchor, *energy / PI))
                .collect(),
            dynamic_geometry_term_bound: anchors.dynamic_geometry_term_bound(),
            dynamic_apart: false,
        }
    }

    /// Leaves out the dynamic anchors: their light has to be added from [`DirectLights::dynamic`].
    #[must_use]
    pub fn with_dynamic_apart(self) -> Self {
        Self { dynamic_apart: true, ..self }
    }

    /// The dynamic anchors that shine, if they are left out here ([`DirectLights::with_dynamic_apart`]); none else.
    #[must_use]
    pub fn dynamic(&self) -> DynamicLights<'_> {
        DynamicLights {
            anchors: if self.dynamic_apart { &self.dynamic } else { &[] },
            geometry_term_bound: self.dynamic_geometry_term_bound,
        }
    }

    /// Irradiance \[W·m⁻²\] at `receiver`, linear RGB.
    pub fn irradiance(&self, accelerator: &Accelerator, receiver: &ShadingPoint) -> Traced<Vec3> {
        let Traced { value, shadow_rays } = self.irradiance_tile(accelerator, std::slice::from_ref(receiver));
        Traced { value: value[0], shadow_rays }
    }

    /// As [`DirectLights::irradiance`], to the last bit, for each of the `receivers`; the nearer to each other they lie,
    /// the faster.
    pub fn irradiance_tile(&self, accelerator: &Accelerator, receivers: &[ShadingPoint]) -> Traced<Vec<Vec3>> {
        let mut sums = vec![Vec3::ZERO; receivers.len()];
        let mut shadow_rays = 0;
        for (receivers, sums) in receivers.chunks(PACKET).zip(sums.chunks_mut(PACKET)) {
            let tile = Tile::new(accelerator, receivers);
            self.areas.iter().for_each(|area| tile.add_area(area, sums));
            self.points.iter().for_each(|point| tile.add_point(point, sums));
            self.suns.iter().for_each(|sun| tile.add_sun(sun, sums));
            if !self.dynamic_apart {
                self.add_dynamic(&tile, sums);
            }
            shadow_rays += tile.shadow_rays();
        }
        Traced { value: sums, shadow_rays }
    }

    /// A point of each glowing surface, point light and sun that is sampled here.
    #[must_use]
    pub fn lamps(&self) -> Lamps {
        let areas = self.areas.iter().filter_map(|area| area.positions.first().copied());
        Lamps {
            points: areas.chain(self.points.iter().map(|point| point.position)).collect(),
            suns: self.suns.iter().map(|sun| sun.towards).collect(),
        }
    }

    /// Whether the glowing surfaces, point lights and suns are those of `other`, where they were.
    #[must_use]
    pub fn has_lamps_of(&self, other: &Self) -> bool {
        let areas = self.areas.iter().map(|area| (area.instance, &area.samples));
        areas.eq(other.areas.iter().map(|area| (area.instance, &area.samples)))
            && self.points == other.points
            && self.suns.iter().map(Sun::light).eq(other.suns.iter().map(Sun::light))
    }

    /// Boxes around the glowing surfaces and point lights, and the suns: all that shadow rays lead to.
    #[must_use]
    pub fn sources(&self) -> Vec<Source> {
        let around = |points: &[Vec3A]| Source::Lamp {
            low: points.iter().copied().fold(Vec3A::INFINITY, Vec3A::min),
            high: points.iter().copied().fold(Vec3A::NEG_INFINITY, Vec3A::max),
        };
        let areas = self.areas.iter().map(|area| around(&area.positions));
        let points = self.points.iter().map(|point| Source::Lamp { low: point.position, high: point.position });
        let suns = self.suns.iter().map(|sun| Source::Sun { towards: sun.towards, angular_radius: sun.angular_radius });
        areas.chain(points).chain(suns).collect()
    }

    /// Whether `instance` is a glowing surface that is sampled here.
    #[must_use]
    pub fn samples_instance(&self, instance: u32) -> bool {
        self.areas.iter().any(|area| area.instance == instance)
    }

    /// Radiance that a surface with a BRDF of its own reflects of points and suns, and of the areas if `areas` is set.
    ///
    /// `brdf(direction, half_angle)` is its BRDF \[sr⁻¹\] for light from a disc of `half_angle` radians around a direction. The
    /// sun is one disc, of which as much is seen as of its first points; an area light is a disc for each of its points.
    pub fn reflected(
        &self,
        accelerator: &Accelerator,
        receiver: &ShadingPoint,
        areas: bool,
        brdf: impl Fn(Vec3A, f32) -> Vec3,
    ) -> Traced<Vec3> {
        let (mut sum, mut shadow_rays) = (Vec3::ZERO, 0);
        for light in &self.points {
            let (cos, r2) = receiver.cosine_to(light.position);
            let Some(towards) = (light.position - receiver.position).try_normalize().filter(|_| cos > 0.0) else {
                continue;
            };
            let given = brdf(towards, 0.0) * light.intensity_towards(receiver.position) * (cos / r2);
            if given != Vec3::ZERO {
                shadow_rays += 1;
                let hidden = accelerator.occluded(receiver.position, light.position);
                sum += if hidden { Vec3::ZERO } else { given };
            }
        }
        for sun in &self.suns {
            let reflected = sun.reflected(accelerator, receiver, &brdf);
            sum += reflected.value;
            shadow_rays += reflected.shadow_rays;
        }
        for area in self.areas.iter().filter(|_| areas) {
            let balance = area.balance_at(receiver);
            for samples in area.samples.chunks(PACKET) {
                let (mut given, mut ends, mut active) = ([Vec3::ZERO; PACKET], [Vec3A::ZERO; PACKET], 0);
                for (i, sample) in samples.iter().enumerate() {
                    let way = sample.position - receiver.position;
                    let irradiance = area.unhidden_sample(receiver, sample);
                    ends[i] = sample.position;
                    if irradiance != Vec3::ZERO {
                        let distance = way.length();
                        let half_angle = (sample.area / PI).sqrt().atan2(distance);
                        given[i] = irradiance * brdf(way / distance, half_angle);
                        active |= u64::from(given[i] != Vec3::ZERO) << i;
                    }
                }
                shadow_rays += u64::from(active.count_ones());
                let hidden = accelerator.occluded_packet(receiver.position, &ends[..samples.len()], active);
                sum += balance * bits(active & !hidden).map(|i| given[i]).sum::<Vec3>();
            }
        }
        Traced { value: sum, shadow_rays }
    }

    /// Adds what the dynamic anchors give.
    fn add_dynamic(&self, tile: &Tile, sums: &mut [Vec3]) {
        let mut unshadowed: [f32; PACKET] =
            std::array::from_fn(|i| sums.get(i).map_or(0.0, |&sum| luminance(sum) * UNSHADOWED_SHARE));
        for (anchor, intensity) in &self.dynamic {
            let terms = tile.terms(&Disc::of_anchor(anchor, self.dynamic_geometry_term_bound));
            let mut active = 0;
            for (i, unshadowed) in unshadowed.iter_mut().enumerate().take(sums.len()) {
                let y = luminance(*intensity * terms[i]);
                if y > *unshadowed {
                    active |= 1 << i;
                } else {
                    *unshadowed -= y;
                }
            }
            let hidden = tile.hidden_from(anchor.position, active, None);
            for (i, sum) in sums.iter_mut().enumerate().filter(|(i, _)| hidden >> i & 1 == 0) {
                *sum += *intensity * terms[i];
            }
        }
    }

    /// Numbers of areas, points, suns and dynamic anchors.
    #[must_use]
    pub fn counts(&self) -> [usize; 4] {
        [self.areas.len(), self.points.len(), self.suns.len(), self.dynamic.len()]
    }
}

/// Irradiance from a disc that glows evenly, per intensity: `cos θ_light · cos θ / (r² + bound)` \[m⁻²\].
///
/// With bound = area / π this is exact on the disc's axis for a facing receiver, and finite at contact,
/// where the point light's 1/r² would not be. Zero from below the normal to shade with, and from below the triangle.
#[inline(always)]
fn disc_term(position: [f32; 3], [normal, geometric_normal]: [[f32; 3]; 2], disc: &Disc) -> f32 {
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let way = [disc.position[0] - position[0], disc.position[1] - position[1], disc.position[2] - position[2]];
    let (r2, cos_light, cos) = (dot(way, way), -dot(disc.normal, way), dot(normal, way));
    // Both cosines still carry the length of `way`: divide by r² once more.
    let term = cos_light * cos / (r2 * (r2 + disc.bound));
    // Without branches, so that many receivers are computed side by side.
    let shines = (cos_light > 0.0) & (cos > 0.0) & (dot(geometric_normal, way) > 0.0);
    if shines { term } else { 0.0 }
}

/// Where a glowing disc is and the way it faces \[m, m²\].
struct Disc {
    position: [f32; 3],
    normal: [f32; 3],
    bound: f32,
}

impl Disc {
    /// On the surface itself: objects that touch a lamp may be nearer to it than its sample points.
    fn of_sample(sample: &AreaSample) -> Self {
        let bound = AREA_BOUND * sample.area / PI;
        let position = sample.position - sample.normal * sample.offset;
        Self { position: position.to_array(), normal: sample.normal.to_array(), bound }
    }

    fn of_anchor(anchor: &Anchor, bound: f32) -> Self {
        Self { position: anchor.position.to_array(), normal: anchor.normal.to_array(), bound }
    }

    /// Irradiance at `receiver` per intensity \[m⁻²\].
    fn term(&self, receiver: &ShadingPoint) -> f32 {
        let normals = [receiver.normal.to_array(), receiver.geometric_normal.to_array()];
        disc_term(receiver.position.to_array(), normals, self)
    }
}

impl Area {
    fn new(light: &AreaLight, surfaces: &Surfaces) -> Self {
        let simple = light.patch_count() <= MOST_POLYGONS && !light.is_textured();
        let samples = light.samples(surfaces, AREA_SAMPLES);
        let pieces = light.polygons(surfaces);
        let balance = (!simple).then(|| Balance::new(&pieces, &samples));
        let polygons = if simple { pieces } else { Vec::new() };
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
    fn balance_at(&self, receiver: &ShadingPoint) -> f32 {
        self.balance.as_ref().map_or(1.0, |balance| balance.at(receiver.position))
    }

    /// Unshadowed irradiance from the whole light.
    fn unhidden(&self, receiver: &ShadingPoint) -> Vec3 {
        if self.polygons.is_empty() {
            let sum: Vec3 = self.samples.iter().map(|sample| self.unhidden_sample(receiver, sample)).sum();
            return sum * self.balance_at(receiver);
        }
        let ShadingPoint { position, normal, geometric_normal } = *receiver;
        self.polygons.iter().map(|polygon| polygon.irradiance(position, normal, geometric_normal)).sum()
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

impl Sun {
    /// All that its other fields follow from.
    fn light(&self) -> (Vec3, Vec3A, f32) {
        (self.irradiance, self.towards, self.angular_radius)
    }

    fn reflected(
        &self,
        accelerator: &Accelerator,
        receiver: &ShadingPoint,
        brdf: impl Fn(Vec3A, f32) -> Vec3,
    ) -> Traced<Vec3> {
        let given =
            brdf(self.towards, self.angular_radius) * self.irradiance * receiver.normal.dot(self.towards).max(0.0);
        if given == Vec3::ZERO || receiver.geometric_normal.dot(self.towards) <= 0.0 {
            return Traced { value: Vec3::ZERO, shadow_rays: 0 };
        }
        let first = &self.directions[..FIRST_SUN_SAMPLES];
        let seen = first.iter().filter(|&&towards| !accelerator.occluded_towards(receiver.position, towards));
        Traced { value: given * (seen.count() as f32 / first.len() as f32), shadow_rays: first.len() as u64 }
    }
}

/// Indices of the bits that are set.
fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = mask.trailing_zeros() as usize;
        (mask != 0).then(|| {
            mask &= mask - 1;
            place
        })
    })
}

impl ShadingPoint {
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
