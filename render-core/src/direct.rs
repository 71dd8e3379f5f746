//! Light that arrives straight from its source, with shadows.
//!
//! The points of a light that a pixel asks are the same for all pixels and frames: penumbras come out
//! smooth and still, where random points would leave noise that the encoder pays for. And being the same, they send
//! their rays to all pixels of a tile together.

mod tile;

use crate::accel::{Accelerator, PACKET};
use crate::anchor::{Anchor, Anchors};
use crate::emitter::{AreaLight, AreaSample, Emitters, PointLight};
use crate::luminance;
use crate::polygon::Polygon;
use crate::sampling::sobol_point;
use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A};
use std::cell::Cell;
use std::f32::consts::PI;
use tile::Tile;

/// Points of an area light, and how many are asked first: when these agree on all or nothing, and with them the corners of
/// the light, so would the rest. Without the corners, where a penumbra begins is seen too late, and as a step.
const AREA_SAMPLES: usize = 64;
const FIRST_AREA_SAMPLES: usize = 16;
/// How far in from the corner that is asked, in ways from the corner to the middle: what touches a lamp hides its border.
const INWARD: f32 = 0.05;
/// Softening of a point of an area light, in units of its own share's: as small as keeps contact finite. With the full
/// share a panel seen from its own width comes out 0.5 % dark, since its points already average over each other.
const AREA_SOFTENING: f32 = 1.0 / 8.0;
/// From so many receivers on it pays to find out first what can stand between them and a light.
const WORTH_A_SHAFT: usize = 8;
/// A light of more pieces than this is summed over its points even where nothing hides it.
const MOST_POLYGONS: usize = 4;
/// The same for the disc of the sun, of which eight points of the border are asked first.
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
/// Carried anchors that together would give a receiver less than this share of its other direct light are not asked
/// whether something hides them: it would not be seen.
const UNASKED_SHARE: f32 = 1e-3;

/// What is asked for direct light at every pixel of a frame.
pub struct DirectLights {
    areas: Vec<Area>,
    points: Vec<PointLight>,
    suns: Vec<Sun>,
    carried: Vec<(Anchor, Vec3)>,
    carried_softening: f32,
    carried_apart: bool,
}

/// A glowing surface.
struct Area {
    instance: u32,
    samples: Vec<AreaSample>,
    /// Where it ends, where its shape is simple.
    corners: Vec<AreaSample>,
    /// Of the samples and the corners.
    positions: Vec<Vec3A>,
    /// Its shape, where that is simple enough for a closed form.
    polygons: Vec<Polygon>,
}

/// The disc of a sun.
struct Sun {
    irradiance: Vec3,
    towards: Vec3A,
    angular_radius: f32,
    /// Towards points of its disc, and of its border.
    directions: Vec<Vec3A>,
    border: [Vec3A; 8],
}

/// Where the lights are that each pixel asks for itself, by a point of each.
#[derive(Clone, Debug, Default)]
pub struct Lamps {
    /// \[m\]
    points: Vec<Vec3A>,
    /// Unit vectors towards suns.
    suns: Vec<Vec3A>,
}

impl Lamps {
    /// Whether the point of any is seen from `position`, on a surface that faces along `normal`.
    pub(crate) fn are_seen(&self, accelerator: &Accelerator, position: Vec3A, normal: Vec3A) -> bool {
        let sun = |&towards: &Vec3A| normal.dot(towards) > 0.0 && !accelerator.occluded_towards(position, towards);
        let point = |&lamp: &Vec3A| normal.dot(lamp - position) > 0.0 && !accelerator.occluded(position, lamp);
        self.suns.iter().any(sun) || self.points.iter().any(point)
    }
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
            areas: areas.iter().map(|&place| Area::new(&emitters.areas[place], surfaces)).collect(),
            points: emitters.points.clone(),
            suns: emitters
                .suns
                .iter()
                .map(|sun| Sun {
                    irradiance: sun.irradiance,
                    towards: sun.towards,
                    angular_radius: sun.angular_radius,
                    directions: (0..SUN_SAMPLES as u64).map(|i| sun.direction(sobol_point(i))).collect(),
                    border: BORDER.map(|u| sun.direction(u)),
                })
                .collect(),
            carried: carried
                .filter(|(_, energy)| energy.max_element() > 0.0)
                .map(|(anchor, energy)| (anchor, *energy / PI))
                .collect(),
            carried_softening: anchors.carried_softening(),
            carried_apart: false,
        }
    }

    /// The same without the carried anchors, whose light somebody else adds: see [`DirectLights::carried`].
    pub fn with_carried_apart(self) -> Self {
        Self { carried_apart: true, ..self }
    }

    /// The carried anchors that shine, each with its intensity along the normal \[W·sr⁻¹\], and the softening of all
    /// \[m²\]. None unless they are left out here.
    pub fn carried(&self) -> (&[(Anchor, Vec3)], f32) {
        (if self.carried_apart { &self.carried } else { &[] }, self.carried_softening)
    }

    /// Irradiance \[W·m⁻²\] at `receiver`, linear RGB; adds the shadow rays it cost to `rays`.
    pub fn irradiance(&self, accelerator: &Accelerator, receiver: &Receiver, rays: &Cell<u64>) -> Vec3 {
        self.irradiance_tile(accelerator, std::slice::from_ref(receiver), rays)[0]
    }

    /// As [`DirectLights::irradiance`], to the last bit, for each of the `receivers`; the nearer to each other they lie,
    /// the faster.
    pub fn irradiance_tile(&self, accelerator: &Accelerator, receivers: &[Receiver], rays: &Cell<u64>) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; receivers.len()];
        for (receivers, sums) in receivers.chunks(PACKET).zip(sums.chunks_mut(PACKET)) {
            let tile = Tile::new(accelerator, receivers, rays);
            self.areas.iter().for_each(|area| tile.add_area(area, sums));
            self.points.iter().for_each(|point| tile.add_point(point, sums));
            self.suns.iter().for_each(|sun| tile.add_sun(sun, sums));
            if !self.carried_apart {
                self.add_carried(&tile, sums);
            }
        }
        sums
    }

    /// A point of each glowing surface, point light and sun that is asked here.
    pub fn lamps(&self) -> Lamps {
        let areas = self.areas.iter().filter_map(|area| area.positions.first().copied());
        Lamps {
            points: areas.chain(self.points.iter().map(|point| point.position)).collect(),
            suns: self.suns.iter().map(|sun| sun.towards).collect(),
        }
    }

    /// Whether this is a glowing surface that is asked here.
    pub fn asks(&self, instance: u32) -> bool {
        self.areas.iter().any(|area| area.instance == instance)
    }

    /// Radiance that points and suns, and if asked for the `areas`, make a surface reflect that is no Lambert surface.
    ///
    /// `brdf(direction, half_angle)` is its BRDF \[sr⁻¹\] for light from a disc of `half_angle` radians around a direction. The
    /// sun is one disc, of which as much is seen as of its first points; an area light is a disc for each of its points.
    pub fn reflected(
        &self,
        accelerator: &Accelerator,
        receiver: &Receiver,
        areas: bool,
        brdf: impl Fn(Vec3A, f32) -> Vec3,
        rays: &Cell<u64>,
    ) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for light in &self.points {
            let (cos, r2) = receiver.cosine_to(light.position);
            let Some(towards) = (light.position - receiver.position).try_normalize().filter(|_| cos > 0.0) else {
                continue;
            };
            let given = brdf(towards, 0.0) * light.intensity_towards(receiver.position) * (cos / r2);
            if given != Vec3::ZERO {
                rays.set(rays.get() + 1);
                let hidden = accelerator.occluded(receiver.position, light.position);
                sum += if hidden { Vec3::ZERO } else { given };
            }
        }
        for sun in &self.suns {
            sum += sun.reflected(accelerator, receiver, &brdf, rays);
        }
        for area in self.areas.iter().filter(|_| areas) {
            for samples in area.samples.chunks(PACKET) {
                let (mut given, mut ends, mut ask) = ([Vec3::ZERO; PACKET], [Vec3A::ZERO; PACKET], 0);
                for (i, sample) in samples.iter().enumerate() {
                    let way = sample.position - receiver.position;
                    let irradiance = area.unhidden_sample(receiver, sample);
                    ends[i] = sample.position;
                    if irradiance != Vec3::ZERO {
                        let distance = way.length();
                        let half_angle = (sample.area / PI).sqrt().atan2(distance);
                        given[i] = irradiance * brdf(way / distance, half_angle);
                        ask |= u64::from(given[i] != Vec3::ZERO) << i;
                    }
                }
                rays.set(rays.get() + u64::from(ask.count_ones()));
                let hidden = accelerator.occluded_packet(receiver.position, &ends[..samples.len()], ask);
                sum += bits(ask & !hidden).map(|i| given[i]).sum::<Vec3>();
            }
        }
        sum
    }

    /// Adds what the carried anchors give.
    fn add_carried(&self, tile: &Tile, sums: &mut [Vec3]) {
        let mut unasked: [f32; PACKET] =
            std::array::from_fn(|i| sums.get(i).map_or(0.0, |&sum| luminance(sum) * UNASKED_SHARE));
        for (anchor, intensity) in &self.carried {
            let terms = tile.terms(&Disc::of_anchor(anchor, self.carried_softening));
            let mut ask = 0;
            for (i, unasked) in unasked.iter_mut().enumerate().take(sums.len()) {
                let y = luminance(*intensity * terms[i]);
                if y > *unasked {
                    ask |= 1 << i;
                } else {
                    *unasked -= y;
                }
            }
            let hidden = tile.hidden_from(anchor.position, ask, None);
            for (i, sum) in sums.iter_mut().enumerate().filter(|(i, _)| hidden >> i & 1 == 0) {
                *sum += *intensity * terms[i];
            }
        }
    }

    /// How many lights a pixel asks: areas, points, suns and carried anchors.
    pub fn counts(&self) -> [usize; 4] {
        [self.areas.len(), self.points.len(), self.suns.len(), self.carried.len()]
    }
}

/// Irradiance from a disc that glows evenly, per intensity: `cos θ_light · cos θ / (r² + softening)` \[m⁻²\].
///
/// With softening = area / π this is exact on the disc's axis for a facing receiver, and finite at contact,
/// where the point light's 1/r² would not be. Zero from below the normal to shade with, and from below the triangle.
#[inline(always)]
fn disc_term(position: [f32; 3], [normal, geometric_normal]: [[f32; 3]; 2], disc: &Disc) -> f32 {
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let way = [disc.position[0] - position[0], disc.position[1] - position[1], disc.position[2] - position[2]];
    let (r2, cos_light, cos) = (dot(way, way), -dot(disc.normal, way), dot(normal, way));
    // Both cosines still carry the length of `way`: divide by r² once more.
    let term = cos_light * cos / (r2 * (r2 + disc.softening));
    // Without branches, so that many receivers are computed side by side.
    let shines = (cos_light > 0.0) & (cos > 0.0) & (dot(geometric_normal, way) > 0.0);
    if shines { term } else { 0.0 }
}

/// Where a glowing disc is and the way it faces \[m, m²\].
struct Disc {
    position: [f32; 3],
    normal: [f32; 3],
    softening: f32,
}

impl Disc {
    /// On the surface itself: what touches a lamp may be nearer to it than its points are, and yet is before them.
    fn of_sample(sample: &AreaSample) -> Self {
        let softening = AREA_SOFTENING * sample.area / PI;
        let position = sample.position - sample.normal * sample.offset;
        Self { position: position.to_array(), normal: sample.normal.to_array(), softening }
    }

    fn of_anchor(anchor: &Anchor, softening: f32) -> Self {
        Self { position: anchor.position.to_array(), normal: anchor.normal.to_array(), softening }
    }

    /// Irradiance at `receiver` per intensity \[m⁻²\].
    fn term(&self, receiver: &Receiver) -> f32 {
        let normals = [receiver.normal.to_array(), receiver.geometric_normal.to_array()];
        disc_term(receiver.position.to_array(), normals, self)
    }
}

impl Area {
    fn new(light: &AreaLight, surfaces: &Surfaces) -> Self {
        let simple = light.patch_count() <= MOST_POLYGONS && !light.is_textured();
        let samples = light.samples(surfaces, AREA_SAMPLES);
        let polygons = if simple { light.polygons(surfaces) } else { Vec::new() };
        let corners: Vec<AreaSample> = polygons.iter().flat_map(|polygon| corners(polygon, &samples[0])).collect();
        Self {
            instance: light.instance as u32,
            positions: samples.iter().chain(&corners).map(|sample| sample.position).collect(),
            samples,
            corners,
            polygons,
        }
    }

    /// What one of the samples gives while nothing hides it.
    #[inline]
    fn unhidden_sample(&self, receiver: &Receiver, sample: &AreaSample) -> Vec3 {
        sample.intensity * Disc::of_sample(sample).term(receiver)
    }

    /// What the whole light gives while nothing hides it.
    fn unhidden(&self, receiver: &Receiver) -> Vec3 {
        if self.polygons.is_empty() {
            return self.samples.iter().map(|sample| self.unhidden_sample(receiver, sample)).sum();
        }
        let Receiver { position, normal, geometric_normal } = *receiver;
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
    fn reflected(
        &self,
        accelerator: &Accelerator,
        receiver: &Receiver,
        brdf: impl Fn(Vec3A, f32) -> Vec3,
        rays: &Cell<u64>,
    ) -> Vec3 {
        let given =
            brdf(self.towards, self.angular_radius) * self.irradiance * receiver.normal.dot(self.towards).max(0.0);
        if given == Vec3::ZERO || receiver.geometric_normal.dot(self.towards) <= 0.0 {
            return Vec3::ZERO;
        }
        let first = &self.directions[..FIRST_SUN_SAMPLES];
        rays.set(rays.get() + first.len() as u64);
        let seen = first.iter().filter(|&&towards| !accelerator.occluded_towards(receiver.position, towards));
        given * (seen.count() as f32 / first.len() as f32)
    }
}

/// Places of the bits that are set.
fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = mask.trailing_zeros() as usize;
        (mask != 0).then(|| {
            mask &= mask - 1;
            place
        })
    })
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
