//! Light that arrives straight from its source, with shadows.
//!
//! The sample points of a light are the same for all pixels and frames: penumbras come out smooth and still, where random
//! points would leave noise that the encoder pays for. Shadow rays of a sample are traced to all pixels of a tile together.

mod balance;
mod lights;
mod tile;

use crate::accel::{Accelerator, PACKET, Shadows};
use crate::anchor::{Anchor, Anchors};
use crate::emitter::{AreaSample, Emitters, PointLight};
use crate::luminance;
use crate::surface::Surfaces;
use glam::{Vec3, Vec3A};
use lights::{Area, Sun, reflected_point};
use std::f32::consts::PI;
use tile::Tile;

/// Bound of the geometry term of a sample of an area light, as a share of that of its own disc: it keeps contact finite. With
/// the full disc a panel seen from its own width comes out 0.5 % dark, since its points already average over each other.
const AREA_BOUND: f32 = 1.0 / 8.0;
/// Least number of receivers for which a shaft to the light is worth its cost.
const WORTH_A_SHAFT: usize = 8;
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

impl ShadingPoint {
    /// `epsilon` meters off the place of a surface with these normals: to shade with, and of the triangle.
    #[inline]
    #[must_use]
    pub fn off_surface(place: Vec3A, [normal, geometric_normal]: [Vec3A; 2], epsilon: f32) -> Self {
        Self { position: place + geometric_normal * epsilon, normal, geometric_normal }
    }
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
        // A Lambertian emitter of flux Φ has the intensity Φ / π along its normal.
        let mut dynamic = Vec::new();
        for (anchor, &flux) in anchors.dynamic_in_world(surfaces).into_iter().zip(dynamic_flux) {
            if flux.max_element() > 0.0 {
                dynamic.push((anchor, flux / PI));
            }
        }
        let sky_lamps = surfaces.scene().sky.iter().flat_map(|sky| sky.lamps());
        Self {
            areas: areas.iter().map(|&place| Area::new(&emitters.areas[place], surfaces)).collect(),
            points: emitters.points.clone(),
            suns: emitters.suns.iter().map(Sun::new).chain(sky_lamps.map(Sun::in_sky)).collect(),
            dynamic,
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
        let shadows = Shadows::new(accelerator);
        for (receivers, sums) in receivers.chunks(PACKET).zip(sums.chunks_mut(PACKET)) {
            // Dynamic anchors come last: those that are faint beside the other lights get no shadow rays.
            let tile = Tile::new(&shadows, receivers);
            for area in &self.areas {
                tile.add_area(area, sums);
            }
            for point in &self.points {
                tile.add_point(point, sums);
            }
            for sun in &self.suns {
                tile.add_sun(sun, sums);
            }
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
        // The first sample stands for its area.
        let mut points = Vec::new();
        for area in &self.areas {
            points.extend(area.positions.first());
        }
        for point in &self.points {
            points.push(point.position);
        }
        Lamps { points, suns: self.suns.iter().map(|sun| sun.towards).collect() }
    }

    /// Whether the glowing surfaces, point lights and suns are those of `other`, where they were.
    #[must_use]
    pub fn has_lamps_of(&self, other: &Self) -> bool {
        // Samples have the place and the brightness of an area: all else of it follows from the same surface.
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

        // Shadow rays of an area end at its samples and corners; no other place of it matters.
        let mut sources = Vec::new();
        for area in &self.areas {
            sources.push(around(&area.positions));
        }
        for point in &self.points {
            sources.push(Source::Lamp { low: point.position, high: point.position });
        }
        for sun in &self.suns {
            sources.push(Source::Sun { towards: sun.towards, angular_radius: sun.angular_radius });
        }
        sources
    }

    /// Whether `instance` is a glowing surface that is sampled here.
    #[must_use]
    pub fn samples_instance(&self, instance: u32) -> bool {
        self.areas.iter().any(|area| area.instance == instance)
    }

    /// Radiance that a surface with a BRDF of its own reflects of points and suns, and by another BRDF of areas, if there is one.
    ///
    /// `brdf(direction, half_angle)` is its BRDF \[sr⁻¹\] for light from a disc of `half_angle` radians around a direction. The
    /// sun is one disc, of which as much is seen as of its first points; an area light is a disc for each of its points.
    pub fn reflected(
        &self,
        accelerator: &Accelerator,
        receiver: &ShadingPoint,
        brdf: impl Fn(Vec3A, f32) -> Vec3,
        area_brdf: Option<impl Fn(Vec3A, f32) -> Vec3>,
    ) -> Traced<Vec3> {
        // Points and suns need a shadow ray or two each, an area light one for every sample that gives light.
        let shadows = &Shadows::new(accelerator);
        let mut whole = Traced::default();
        for light in &self.points {
            whole.add(reflected_point(light, shadows, receiver, &brdf));
        }
        for sun in &self.suns {
            whole.add(sun.reflected(shadows, receiver, &brdf));
        }
        if let Some(brdf) = area_brdf {
            for area in &self.areas {
                area.add_reflected(shadows, receiver, &brdf, &mut whole);
            }
        }
        whole
    }

    /// Adds what the dynamic anchors give.
    fn add_dynamic(&self, tile: &Tile, sums: &mut [Vec3]) {
        // Luminance that each receiver may still take from anchors without asking whether these are hidden.
        let mut unshadowed = [0.0; PACKET];
        for (unshadowed, &sum) in unshadowed.iter_mut().zip(&*sums) {
            *unshadowed = luminance(sum) * UNSHADOWED_SHARE;
        }
        for (anchor, intensity) in &self.dynamic {
            // Shadow rays go to the receivers at which the anchor is too bright for that.
            let terms = tile.terms(&Disc::of_anchor(anchor, self.dynamic_geometry_term_bound));
            let mut active = 0;
            for i in 0..sums.len() {
                let y = luminance(*intensity * terms[i]);
                if y > unshadowed[i] {
                    active |= 1 << i;
                } else {
                    unshadowed[i] -= y;
                }
            }

            // Those that no ray was traced to are not hidden.
            let hidden = tile.hidden_from(anchor.position, active, None);
            for (i, sum) in sums.iter_mut().enumerate() {
                if hidden >> i & 1 == 0 {
                    let passed = if active >> i & 1 == 1 { tile.passed(anchor.position, i) } else { 1.0 };
                    *sum += *intensity * terms[i] * passed;
                }
            }
        }
    }

    /// Numbers of areas, points, suns and dynamic anchors.
    #[must_use]
    pub fn counts(&self) -> [usize; 4] {
        [self.areas.len(), self.points.len(), self.suns.len(), self.dynamic.len()]
    }
}

impl Traced<Vec3> {
    fn add(&mut self, other: Self) {
        self.value += other.value;
        self.shadow_rays += other.shadow_rays;
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
        // cos θ = n · way / r; no light comes through the triangle, whatever the shading normal.
        let way = point - self.position;
        let r2 = way.length_squared();
        if self.geometric_normal.dot(way) <= 0.0 {
            return (0.0, r2);
        }
        (self.normal.dot(way).max(0.0) / r2.sqrt().max(f32::MIN_POSITIVE), r2)
    }
}
