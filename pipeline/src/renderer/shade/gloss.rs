//! Light that coats reflect: metals, and the gloss on what is painted or polished.
//!
//! A coat's single scattering is taken from its sources in three ways, each light by one of them alone:
//!
//! ```text
//! point and spot lights, the sun       their direction and a shadow ray
//! glowing surfaces that pixels sample  from roughness 0.2 on by the points that direct light samples; below, by reflection rays
//! everything else                      reflection rays: glowing surfaces of the light tree, the sky, whatever is lit
//! ```
//!
//! Reflection rays are drawn by the microfacets that the viewer sees \[Dupuy23\], with points that depend on the pixel alone:
//! what noise there is stands still. The mean of what they bring is weighted by the albedo of the coat, which is known, and not
//! by what the samples happen to add up to:
//!
//! ```text
//! L = C(θ_o) · Σ wᵢ Lᵢ / Σ wᵢ            w = F·G₂/G₁   C  albedo of the coat
//! ```
//! A coat in even light is even, then, however few the rays.
//!
//! A reflection is coarser than what the viewer sees directly. In coats of roughness 0.2 and above, the virtual lights
//! around a point light it; in smoother ones it is lit by direct light and a loose cut. A coat that is seen in a
//! coat shows its sources by their lobes, and of everything else what lies in the mirrored direction. Photons know no coats:
//! light that metals throw on others is missing.

use super::cuts::{receiver, sees};
use super::macroblock::{by_macroblock, places};
use crate::renderer::frame::Frame;
use glam::{Vec2, Vec3, Vec3A};
use lighttree::{Lambert, Light, Scratch, Stop};
use plane::Plane;
use render_core::sampling::{frame, owen_sobol_point};
use render_core::{Bsdf, Busy, GBuffer, NOTHING, PixelSurface, ShadingPoint, Surface, Traced, luminance};
use std::cell::Cell;
use std::f32::consts::PI;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Perceptual roughness from which on a coat shows no sharp shapes: half of what it shows is more than 2° off the mirrored.
const ROUGH: f32 = 0.2;
/// Roughness up to which a coat is a mirror: its lobe is hardly wider than a pixel.
const MIRROR: f32 = 0.05;
/// Reflection rays of a pixel, below [`ROUGH`] and from there on.
const RAYS: [u32; 2] = [8, 16];
/// Coats that a ray is followed through.
const MOST_COATS: usize = 4;
/// Share of its luminance that a cluster may be wrong by in a cut for what a reflection shows.
const LOOSE: f32 = 0.1;
/// A ray counts at most this many times as much as the second brightest of its pixel: a small lamp that one ray of many happens
/// to meet would be a spark. What is beyond is shared among the pixels around.
const BRIGHTEST: f32 = 2.0;
/// How far, in pixels, with the weights of a tent.
const SPREAD: usize = 10;

/// `seen` with the albedo that is left under the coats, towards the viewer, for all light that [`light`] does not reflect.
/// Where there is no coat it stays the same.
pub(super) fn below_coats(seen: &GBuffer) -> GBuffer {
    let pixels = seen.pixels.map(|pixel| match Coated::of_pixel(&pixel, seen, 0.0) {
        Some(coated) => PixelSurface { albedo: coated.bsdf.diffuse_albedo(coated.outgoing.z).into(), ..pixel },
        None => pixel,
    });
    GBuffer { pixels, ..seen.clone() }
}

/// Radiance that coats reflect towards the viewer, single scattering, and the shadow rays that it took; adds the work to
/// `busy`.
pub(super) fn light(prepared: &Frame, seen: &GBuffer, busy: &Busy) -> (Plane<Vec3>, u64) {
    let size = (seen.pixels.width(), seen.pixels.height());
    let rays = AtomicU64::new(0);
    let sparks = Mutex::new(Plane::filled(size.0, size.1, Vec3::ZERO));
    let light = by_macroblock(size, busy, Scratch::default, |scratch, columns, rows| {
        let mut reflections = Reflections { prepared, scratch, rays: Cell::new(0) };
        let mut found = Vec::new();
        let pixel = |(x, y)| {
            let Some(coated) = Coated::of_pixel(&seen.pixels.get(x, y), seen, prepared.epsilon) else {
                return Vec3::ZERO;
            };
            let (light, spark) = reflections.of(&coated, &Points::of_pixel(x, y));
            if spark != Vec3::ZERO {
                found.push((x, y, spark));
            }
            light
        };
        let light = places(columns, rows).map(pixel).collect();
        rays.fetch_add(reflections.rays.get(), Ordering::Relaxed);
        let mut sparks = sparks.lock().expect("no panic while it is locked");
        found.into_iter().for_each(|(x, y, spark)| sparks.set(x, y, spark));
        light
    });
    let sparks = sparks.into_inner().expect("all threads are done");
    let light = by_macroblock(
        size,
        busy,
        || (),
        |(), columns, rows| {
            places(columns, rows).map(|(x, y)| light.get(x, y) + spread_sparks(&sparks, seen, x, y)).collect()
        },
    );
    (light, rays.into_inner())
}

/// The share of a pixel in the `sparks` of the coats around it on the same instance.
fn spread_sparks(sparks: &Plane<Vec3>, seen: &GBuffer, x: usize, y: usize) -> Vec3 {
    let around = |center: usize, end: usize| center.saturating_sub(SPREAD)..(center + SPREAD + 1).min(end);
    let (columns, rows) = (around(x, sparks.width()), around(y, sparks.height()));
    let instance = seen.pixels.get(x, y).instance;
    let is_coat = |pixel: &PixelSurface| pixel.instance == instance && pixel.specular != [0.0; 3];
    let any = || rows.clone().any(|v| sparks.row(v)[columns.clone()].iter().any(|&spark| spark != Vec3::ZERO));
    if !is_coat(&seen.pixels.get(x, y)) || !any() {
        return Vec3::ZERO;
    }
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for (u, v) in places(columns, rows).filter(|&(u, v)| is_coat(&seen.pixels.get(u, v))) {
        let tent = |apart: usize| (SPREAD + 1 - apart) as f32;
        let weight = tent(u.abs_diff(x)) * tent(v.abs_diff(y));
        sum += sparks.get(u, v) * weight;
        weights += weight;
    }
    sum / weights
}

/// A surface with a coat, or that may have one, seen from somewhere.
struct Coated {
    receiver: ShadingPoint,
    /// World space axes of the shading frame; z is the normal.
    axes: [Vec3; 3],
    /// Towards the viewer, in the shading frame.
    outgoing: Vec3,
    bsdf: Bsdf,
    roughness: f32,
}

impl Coated {
    /// The surface that a pixel sees, if it has a coat; rays start `epsilon` metres off it.
    fn of_pixel(pixel: &PixelSurface, seen: &GBuffer, epsilon: f32) -> Option<Self> {
        if pixel.instance == NOTHING || pixel.specular == [0.0; 3] {
            return None;
        }
        let (place, _) = seen.view.project(pixel.position.into())?;
        let (_, direction) = seen.view.ray(place);
        let bsdf = Bsdf::new(pixel.albedo.into(), pixel.specular.into(), pixel.roughness);
        Some(Self::new(receiver(pixel, epsilon), bsdf, pixel.roughness, direction))
    }

    /// At `receiver`, for a ray that came in the unit `direction`.
    fn new(receiver: ShadingPoint, bsdf: Bsdf, roughness: f32, direction: Vec3A) -> Self {
        let normal = Vec3::from(receiver.normal);
        let (x, y) = frame(normal);
        let axes = [x, y, normal];
        Self { receiver, axes, outgoing: into_frame(axes, -direction), bsdf, roughness }
    }

    /// The surface that a ray has met which came in the unit `direction`.
    fn of_surface(surface: &Surface, direction: Vec3A, epsilon: f32) -> Self {
        let &Surface { position, geometric_normal, shading_normal, albedo, specular, roughness, .. } = surface;
        let position = position + geometric_normal * epsilon;
        let receiver = ShadingPoint { position, normal: shading_normal, geometric_normal };
        Self::new(receiver, Bsdf::new(albedo, specular, roughness), roughness, direction)
    }

    /// Whether it shows no sharp shapes.
    fn is_rough(&self) -> bool {
        self.roughness >= ROUGH
    }

    /// World space direction of a direction of the shading frame, if it leads away from the triangle too.
    fn to_world(&self, local: Vec3) -> Option<Vec3A> {
        let [x, y, z] = self.axes;
        let direction = Vec3A::from((x * local.x + y * local.y + z * local.z).normalize());
        (direction.dot(self.receiver.geometric_normal) > 0.0).then_some(direction)
    }

    /// Direction of the shading frame in which a mirror shows the viewer the world.
    fn mirrored(&self) -> Vec3 {
        Vec3::new(-self.outgoing.x, -self.outgoing.y, self.outgoing.z)
    }
}

/// The components of `v` along orthonormal axes.
fn into_frame(axes: [Vec3; 3], v: Vec3A) -> Vec3 {
    Vec3::from_array(axes.map(|axis| axis.dot(v.into())))
}

/// The points of a pixel: a piece of a sequence that it shares with the pixels around it. Each piece is even in itself, and so
/// are all together: what one pixel has too much its neighbours have too little, and an encoder's blocks see little of it.
struct Points {
    seed: u64,
    piece: u32,
}

impl Points {
    /// Side of the squares of pixels that share a sequence.
    const SIDE: usize = 4;

    fn of_pixel(x: usize, y: usize) -> Self {
        let (column, row) = (x / Self::SIDE, y / Self::SIDE);
        Self { seed: (row as u64) << 32 | column as u64, piece: (y % Self::SIDE * Self::SIDE + x % Self::SIDE) as u32 }
    }

    /// Point `i` of `count`, which is a power of two.
    fn get(&self, i: u32, count: u32) -> Vec2 {
        owen_sobol_point(self.piece * count + i, self.seed)
    }
}

/// Reflections computed by one thread.
struct Reflections<'a> {
    prepared: &'a Frame<'a>,
    scratch: &'a mut Scratch,
    /// Shadow rays so far.
    rays: Cell<u64>,
}

impl Reflections<'_> {
    /// Radiance that the coat reflects, with these points, and apart from it what a single ray of them brings too much.
    fn of(&mut self, coated: &Coated, points: &Points) -> (Vec3, Vec3) {
        let rough = coated.is_rough();
        let (wo, albedo) = (coated.outgoing, coated.bsdf.coat_albedo(coated.outgoing.z));
        let sources = self.sources(coated);
        if coated.roughness < MIRROR {
            let seen = coated.to_world(coated.mirrored()).map(|direction| self.along(coated, direction, 0.0));
            return (sources + albedo * seen.unwrap_or(Vec3::ZERO), Vec3::ZERO);
        }
        let count = RAYS[usize::from(rough)];
        // Each ray stands for its share of a lobe that is about α wide on either side.
        let spread = 2.0 * coated.roughness * coated.roughness / (count as f32).sqrt();
        let (mut sum, mut weights) = (Vec3::ZERO, Vec3::ZERO);
        let (mut brightest, mut second) = (Vec3::ZERO, 0.0);
        for local in (0..count).filter_map(|i| coated.bsdf.sample_coat(wo, points.get(i, count))) {
            let weight = coated.bsdf.coat_weight(wo, local);
            weights += weight;
            let Some(direction) = coated.to_world(local) else { continue };
            let light = weight * self.along(coated, direction, spread);
            sum += light;
            if luminance(light) > luminance(brightest) {
                (brightest, second) = (light, luminance(brightest));
            } else {
                second = luminance(light).max(second);
            }
        }
        let excess = 1.0 - BRIGHTEST * second / luminance(brightest).max(f32::MIN_POSITIVE);
        let spark = brightest * excess.max(0.0);
        let per_weight = albedo / weights.max(Vec3::splat(f32::MIN_POSITIVE));
        (sources + per_weight * (sum - spark), per_weight * spark)
    }

    /// Radiance that the coat reflects of points and suns, and if it is rough of the areas that are sampled.
    fn sources(&self, coated: &Coated) -> Vec3 {
        let Frame { accelerator, direct, .. } = self.prepared;
        let brdf = |direction, half_angle| {
            coated.bsdf.evaluate_coat(coated.outgoing, into_frame(coated.axes, direction), half_angle)
        };
        self.counted(direct.reflected(accelerator, &coated.receiver, coated.is_rough(), brdf))
    }

    /// Radiance that arrives at the coat from a unit `direction`. Textures are averaged over `spread` of the distance.
    fn along(&mut self, coated: &Coated, mut direction: Vec3A, spread: f32) -> Vec3 {
        let Frame { accelerator, surfaces, direct, gather, epsilon, .. } = self.prepared;
        let scene = surfaces.scene();
        let (mut origin, mut throughput, mut sum) = (coated.receiver.position, Vec3::ONE, Vec3::ZERO);
        // Whether the coat that the ray has left is rough, and whether any before it was.
        let (mut rough, mut blurred) = (coated.is_rough(), coated.is_rough());
        let mut way = 0.0;
        for coats in 0..=MOST_COATS {
            let Some(hit) = accelerator.closest(origin, direction) else {
                let sky = scene.sky.as_ref().map_or(Vec3::ZERO, |sky| sky.radiance(direction.into()));
                return sum + throughput * sky;
            };
            way += hit.distance;
            let surface = surfaces.at(&hit, direction, spread * way);
            let unlit = scene.materials[scene.meshes[scene.instances[hit.instance as usize].mesh].material].unlit;
            // As for paths: what is unlit shines for the camera alone. Rough coats know the areas from their points.
            let known = rough && direct.samples_instance(hit.instance);
            if !unlit && !known {
                sum += throughput * surface.emission;
            }
            if unlit || (!surface.front && !surface.double_sided) {
                break;
            }
            let seen = Coated::of_surface(&surface, direction, *epsilon);
            let albedo = seen.bsdf.diffuse_albedo(seen.outgoing.z);
            sum += throughput
                * match luminance(surface.albedo) {
                    // Photons know the base alone, and all of it.
                    base if blurred && base > 0.0 => {
                        gather.surfel_radiance(&surface, hit.instance) * (luminance(albedo) / base).min(1.0)
                    }
                    _ => self.matte(&seen.receiver, albedo),
                };
            if surface.specular == Vec3::ZERO || coats == MOST_COATS {
                break;
            }
            sum += throughput * self.sources(&seen);
            throughput *= seen.bsdf.coat_albedo(seen.outgoing.z);
            let Some(next) = seen.to_world(seen.mirrored()) else { break };
            (origin, direction) = (seen.receiver.position, next);
            rough = seen.is_rough();
            blurred |= rough;
        }
        sum
    }

    /// Adds the shadow rays of a result and unwraps it.
    fn counted<T>(&self, traced: Traced<T>) -> T {
        self.rays.set(self.rays.get() + traced.shadow_rays);
        traced.value
    }

    /// Radiance that a matte surface at `receiver` reflects.
    fn matte(&mut self, receiver: &ShadingPoint, albedo: Vec3) -> Vec3 {
        if albedo == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let Frame { accelerator, direct, tree, .. } = self.prepared;
        let light = albedo / PI * self.counted(direct.irradiance(accelerator, receiver));
        let lambert =
            Lambert { position: receiver.position.into(), normal: receiver.normal.into(), reflectance: albedo };
        let stop = Stop::Relative { fraction: LOOSE, known_luminance: luminance(light) };
        let visible = |lamp: &Light, _| sees(accelerator, receiver, lamp);
        let cut = tree.lightcut(&lambert, stop, visible, self.scratch);
        self.rays.set(self.rays.get() + u64::from(cut.shadow_rays));
        light + cut.radiance
    }
}

#[cfg(test)]
mod tests;
