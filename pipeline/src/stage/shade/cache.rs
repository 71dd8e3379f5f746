//! Cuts behind the irradiance cache: how a record is computed, and lit again from the clusters it remembers.

use super::cuts::LightTransport;
use crate::message::FrameFigures;
use glam::{Affine3A, BVec3A, Mat3A, Vec3, Vec3A};
use lighttree::{Cluster, Emission, Lambert, Light, Scratch, Stop, irradiance_term};
use plane::Plane;
use render_core::cache::{CachedLight, Estimate, Illumination, IrradianceCache, News, Site, footprint};
use render_core::scene::{DeformedMesh, Scene};
use render_core::{Busy, GBuffer, NOTHING, Receiver, Surroundings, luminance};
use std::f32::consts::PI;
use std::sync::Arc;

/// A record answers for many pixels and its error is seen as a stain: its threshold is this share of theirs.
const FINENESS: f32 = 0.5;
/// Reflectance below which a pixel asks for no finer irradiance: its own light hardly matters.
const LEAST_REFLECTANCE: f32 = 0.05;
/// An anchor on a moving thing that would add less than this share is not asked whether something hides it: two dozen
/// of them together stay below half a per cent.
const UNASKED_SHARE: f32 = 2e-4;
/// Points across a record's footprint where thresholds are looked up.
const FOOTPRINT_POINTS: i32 = 5;

/// The cache, and what it has to compare a frame with.
#[derive(Default)]
pub(super) struct Cache {
    records: IrradianceCache<Recipe>,
    /// Of the frame before.
    intensities: Vec<Vec3>,
    /// Where the instances were in the frame before; none before the first.
    places: Vec<Option<Place>>,
}

/// Where an instance that moves is, and in what shape.
#[derive(Clone, PartialEq)]
struct Place {
    world: Affine3A,
    /// The box around it in its own space.
    low: Vec3A,
    high: Vec3A,
    /// Its vertices, where these are bent.
    shape: Option<Arc<DeformedMesh>>,
}

/// What a record is made of.
pub(super) struct Recipe {
    clusters: Vec<(Cluster, bool)>,
    surroundings: Surroundings,
}

impl Cache {
    /// Indirectly reflected radiance of every pixel; adds the work to `busy`.
    pub fn light(&mut self, transport: &LightTransport, busy: &Busy, figures: &mut FrameFigures) -> Plane<Vec3> {
        let prepared = transport.prepared;
        let seen = transport.seen;
        let scene = prepared.surfaces.scene();
        let moving = scene.moving_instances();
        let places = places(scene, &moving, seen, &self.places);
        let lights = prepared.tree.lights().iter().map(|light| light.intensity);
        let news = News { light: lights.clone().ne(self.intensities.iter().copied()), things: self.places != places };
        let illumination = Cuts { transport, swept: swept(&self.places, &places) };
        let lit = self.records.light(seen, &moving, news, &illumination, busy);
        self.intensities = lights.collect();
        self.places = places;
        figures.cache_records = lit.in_use as u64;
        figures.cache_new = lit.computed as u64;
        reflected(seen, &lit)
    }

    /// The same for another picture of the frame that [`Cache::light`] was last asked for.
    pub fn light_more(&mut self, transport: &LightTransport, busy: &Busy, figures: &mut FrameFigures) -> Plane<Vec3> {
        let moving = transport.prepared.surfaces.scene().moving_instances();
        let illumination = Cuts { transport, swept: Vec::new() };
        let lit = self.records.light_more(transport.seen, &moving, &illumination, busy);
        figures.cache_records = figures.cache_records.max(lit.in_use as u64);
        figures.cache_new += lit.computed as u64;
        reflected(transport.seen, &lit)
    }

    /// Where the records in use are, and of how many clusters.
    pub fn records(&self) -> impl Iterator<Item = (Vec3A, usize)> {
        self.records.records_in_use().map(|(position, recipe)| (position, recipe.clusters.len()))
    }
}

/// Radiance that the surfaces of a picture reflect of its irradiance.
fn reflected(seen: &GBuffer, lit: &CachedLight) -> Plane<Vec3> {
    Plane::from_fn(seen.pixels.width(), seen.pixels.height(), |x, y| {
        Vec3::from(lit.irradiance.get(x, y)) * Vec3::from(seen.pixels.get(x, y).albedo) / PI
    })
}

/// The light tree of a frame, for the cache.
struct Cuts<'a> {
    transport: &'a LightTransport<'a>,
    /// Boxes around all that has moved since the frame before, where it was and where it is.
    swept: Vec<(Vec3A, Vec3A)>,
}

impl Illumination for Cuts<'_> {
    type Recipe = Recipe;
    type Scratch = Scratch;

    fn compute(&self, site: &Site, scratch: &mut Scratch) -> (Estimate, Recipe) {
        let Self { transport, .. } = self;
        let receiver = self.receiver(site);
        let surroundings = transport.look_around(&receiver, site.key);
        let white = Lambert {
            position: receiver.position.into(),
            normal: receiver.normal.into(),
            // Radiance reflected by π is irradiance.
            reflectance: Vec3::splat(PI),
        };
        let mut clusters = Vec::new();
        let cut = transport.prepared.tree.lightcut_with(
            &white,
            self.stop(site, &surroundings),
            |lamp, _| transport.visible(&receiver, lamp),
            scratch,
            |cluster, unit| clusters.push((cluster, unit != Vec3::ZERO)),
        );
        transport.figures.count(cut.size, cut.shadow_rays);
        let recipe = Recipe { clusters, surroundings };
        (self.estimate(&receiver, &recipe), recipe)
    }

    fn relight(&self, site: &Site, recipe: &mut Recipe) -> Option<Estimate> {
        let receiver = self.receiver(site);
        let nearby = self.transport.prepared.gather.reach_of_carried();
        if self.swept.iter().any(|swept| distance2(receiver.position, swept) < nearby * nearby) {
            return None;
        }
        let lights = self.transport.prepared.tree.lights();
        let mut rays = 0;
        for (cluster, visible) in &mut recipe.clusters {
            let lamp = &lights[cluster.light as usize];
            if self.swept.iter().any(|swept| crosses(receiver.position, lamp.position.into(), swept)) {
                *visible = self.transport.visible(&receiver, lamp);
                rays += 1;
            }
        }
        self.transport.figures.count_rays(rays);
        Some(self.estimate(&receiver, recipe))
    }
}

impl Cuts<'_> {
    fn receiver(&self, site: &Site) -> Receiver {
        let Site { position, normal, geometric_normal, .. } = *site;
        Receiver { position: position + geometric_normal * self.transport.prepared.epsilon, normal, geometric_normal }
    }

    /// The sum over the visible clusters with the intensities that they have now, and what softening took from it.
    fn estimate(&self, receiver: &Receiver, recipe: &Recipe) -> Estimate {
        let tree = &self.transport.prepared.tree;
        let (position, normal) = (receiver.position.into(), receiver.normal.into());
        let (mut irradiance, mut by_normal, mut by_position) = (Vec3::ZERO, Mat3A::ZERO, Mat3A::ZERO);
        for (cluster, _) in recipe.clusters.iter().filter(|(_, visible)| *visible) {
            let light = &tree.lights()[cluster.light as usize];
            let intensity = tree.cluster_intensity(*cluster);
            let term = irradiance_term(position, normal, light, tree.softening2());
            irradiance += intensity * term.value;
            by_normal += outer(intensity, term.by_normal);
            by_position += outer(intensity, term.by_position);
        }
        let (carried, softening2) = self.transport.prepared.direct.carried();
        let mut rays = 0;
        for (anchor, intensity) in carried {
            let emission = Emission::Cosine(anchor.normal.into());
            let lamp = Light { position: anchor.position.into(), emission, intensity: *intensity };
            let term = irradiance_term(position, normal, &lamp, softening2);
            let given = *intensity * term.value;
            // What would give next to nothing counts as seen.
            let asked = luminance(given) > UNASKED_SHARE * luminance(irradiance);
            rays += u32::from(asked);
            if term.value > 0.0 && (!asked || self.transport.visible(receiver, &lamp)) {
                irradiance += given;
                by_normal += outer(*intensity, term.by_normal);
                by_position += outer(*intensity, term.by_position);
            }
        }
        self.transport.figures.count_rays(rays);
        let Surroundings { harmonic_mean, nearest, .. } = recipe.surroundings;
        if self.transport.compensates {
            let (removed, slope) = self.transport.prepared.gather.removed_light(&recipe.surroundings);
            irradiance += removed;
            by_position += slope;
        }
        Estimate { irradiance, by_normal, by_position, harmonic_mean, nearest }
    }

    /// When the cut of a record ends: at the Gaussian average of the thresholds over its footprint \[Herzog08, 4.3\], made
    /// ones of irradiance by each pixel's reflectance.
    fn stop(&self, site: &Site, surroundings: &Surroundings) -> Stop {
        let Self { transport, .. } = self;
        let seen = transport.seen;
        let relative =
            |known_luminance| Stop::Relative { fraction: FINENESS * transport.relative_threshold(), known_luminance };
        let Some((center, _)) = seen.view.project(site.position) else { return relative(0.0) };
        let (width, height) = (seen.pixels.width() as i32, seen.pixels.height() as i32);
        let radius = footprint(site, surroundings.harmonic_mean, surroundings.nearest, &seen.view);
        let (mut sum, mut weights, mut known, mut known_weights) = (0.0, 0.0, 0.0, 0.0);
        let half = FOOTPRINT_POINTS / 2;
        for (i, j) in (-half..=half).flat_map(|j| (-half..=half).map(move |i| (i, j))) {
            let offset = glam::Vec2::new(i as f32, j as f32) / half as f32;
            let place = (center + offset * radius).floor();
            let (x, y) = (place.x as i32, place.y as i32);
            if x < 0 || y < 0 || x >= width || y >= height {
                continue;
            }
            let (x, y) = (x as usize, y as usize);
            let pixel = seen.pixels.get(x, y);
            // What glows says nothing about what is lit beside it.
            let glows = pixel.emission != [0.0; 3];
            if pixel.instance == NOTHING || glows || site.normal.dot(pixel.shading_normal.into()) < ALIKE_COSINE {
                continue;
            }
            let per_radiance = PI / luminance(pixel.albedo.into()).max(LEAST_REFLECTANCE);
            let weight = (-2.0 * offset.length_squared()).exp();
            match transport.threshold(x, y) {
                Some(threshold) => {
                    sum += weight * threshold * per_radiance;
                    weights += weight;
                }
                None => {
                    known += weight * luminance(transport.direct.get(x, y)) * per_radiance;
                    known_weights += weight;
                }
            }
        }
        if weights > known_weights {
            Stop::Absolute(FINENESS * sum / weights)
        } else {
            relative(known / known_weights.max(f32::MIN_POSITIVE))
        }
    }
}

/// Cosine between normals from which on two pixels are taken to be lit alike.
const ALIKE_COSINE: f32 = 0.9;

/// `a · bᵀ`.
fn outer(a: Vec3, b: Vec3) -> Mat3A {
    let a = Vec3A::from(a);
    Mat3A::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Where the instances that move are in the picture `seen`; what keeps its shape keeps its box from `before`.
fn places(scene: &Scene, moving: &[bool], seen: &GBuffer, before: &[Option<Place>]) -> Vec<Option<Place>> {
    let around = |positions: &[Vec3]| {
        let empty = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        positions.iter().fold(empty, |(low, high), &p| (low.min(p.into()), high.max(p.into())))
    };
    let place = |(index, &moves): (usize, &bool)| {
        let shape = seen.deformed.get(index).cloned().flatten();
        let known = before.get(index).and_then(Option::as_ref).map(|place| (place.low, place.high));
        let (low, high) = match (&shape, known) {
            (Some(shape), _) => around(&shape.positions),
            (None, Some(known)) => known,
            (None, None) => around(&scene.meshes[scene.instances[index].mesh].positions),
        };
        moves.then_some(Place { world: seen.world[index], low, high, shape })
    };
    moving.iter().enumerate().map(place).collect()
}

/// Boxes in the world around what is elsewhere, or otherwise, than before: at both places.
fn swept(before: &[Option<Place>], now: &[Option<Place>]) -> Vec<(Vec3A, Vec3A)> {
    let both = before.iter().zip(now).filter_map(|(then, now)| then.as_ref().zip(now.as_ref()));
    both.filter(|(then, now)| then != now)
        .map(|(then, now)| {
            let points = [then, now].into_iter().flat_map(|Place { world, low, high, .. }| {
                let select = |i: u32| Vec3A::select(BVec3A::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), *low, *high);
                (0..8).map(move |i| world.transform_point3a(select(i)))
            });
            points.fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
        })
        .collect()
}

/// Squared distance from a point to a box.
fn distance2(point: Vec3A, &(low, high): &(Vec3A, Vec3A)) -> f32 {
    (low - point).max(point - high).max(Vec3A::ZERO).length_squared()
}

/// Whether the segment between two points touches the box (slabs).
fn crosses(from: Vec3A, to: Vec3A, &(low, high): &(Vec3A, Vec3A)) -> bool {
    let way = to - from;
    let (a, b) = ((low - from) / way, (high - from) / way);
    // A segment in the plane of a face is 0/0 and may count either way: what stands there is no thicker than that plane.
    let (enter, leave) = (a.min(b), a.max(b));
    enter.max_element().max(0.0) <= leave.min_element().min(1.0)
}
