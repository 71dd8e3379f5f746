//! Reflection rays: the radiance that arrives at a coat.

use super::coated::Coated;
use crate::frame::Frame;
use crate::shade::visibility::sees;
use glam::{Vec2, Vec3, Vec3A};
use lighttree::{Lambert, Light, Scratch, Stop};
use ranks::portable;
use render_core::{Environment, Hit, PosedScene, ShadingPoint, Surface, Traced, luminance};
use std::f32::consts::PI;

/// Coats that a ray is followed through.
const MOST_COATS: usize = 4;
/// Share of a coat in the light of a pixel below which no ray follows its reflection any farther.
const LEAST_SHARE: f32 = 0.02;
/// The same where the first coat is rough, for smooth coats that it shows and for rough ones: metal that is seen in metal is
/// followed, and little else. At 0.1 for both, a closed room of metal of roughness 0.5 has 1 % less light than at these.
const LEAST_SHARE_IN_ROUGH: [f32; 2] = [0.1, 0.3];
/// Share of its luminance that a cluster may be wrong by in a cut for a reflection that a single ray brings, and at most.
const LOOSE: f32 = 0.1;
const LOOSEST: f32 = 0.5;
/// Albedo below which a base is not worth a shadow ray: that of polished metals.
const NO_BASE: f32 = 0.01;
/// Radiance counts up to this many times the typical one: a small lamp that one ray of many happens to meet would be a spark.
/// The excess is shared among the pixels around. At 4 instead of 2, spots show on the floor of McGuire's CornellBox-Glossy-Floor.
const MOST_TYPICAL: f32 = 2.0;

/// Reflections computed by one thread.
pub(super) struct Reflections<'a> {
    pub prepared: &'a Frame<'a>,
    pub scratch: &'a mut Scratch,
    /// Shadow rays so far.
    pub shadow_rays: u64,
}

/// Sums over reflection rays, each by its weight w = F·G₂/G₁.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Brought {
    /// Number of rays.
    pub rays: f32,
    /// Σ 1/t, t being the way to what a ray has met first \[1/m\].
    pub nearness: f32,
    /// Σ w.
    weights: Vec3,
    /// Σ w L.
    light: Vec3,
    /// Part of Σ w L that few of the rays bring and that others are to have, too.
    excess: Vec3,
}

portable!(Brought { rays, nearness, weights, light, excess });

impl Brought {
    /// Rays of weight 1 that all bring `radiance`, from far away.
    #[cfg(test)]
    pub fn of(rays: u16, radiance: Vec3) -> Self {
        let rays = f32::from(rays);
        Self { rays, weights: Vec3::splat(rays), light: rays * radiance, ..Self::default() }
    }

    /// Adds other rays, which count `share` times as much.
    pub fn add(&mut self, share: f32, other: &Self) {
        self.rays += share * other.rays;
        self.nearness += share * other.nearness;
        self.weights += share * other.weights;
        self.light += share * other.light;
        self.excess += share * other.excess;
    }

    /// With this part of Σ w L as the excess.
    pub fn with_excess(self, excess: Vec3) -> Self {
        Self { excess, ..self }
    }

    /// Mean radiance without the excess, and the excess.
    pub fn mean(&self) -> (Vec3, Vec3) {
        let weights = self.weights.max(Vec3::splat(f32::MIN_POSITIVE));
        ((self.light - self.excess) / weights, self.excess / weights)
    }

    /// Luminance of the mean radiance, with the excess.
    pub fn luminance(&self) -> f32 {
        luminance(self.light) / luminance(self.weights).max(f32::MIN_POSITIVE)
    }

    /// The part of Σ w L beyond [`MOST_TYPICAL`] times the `typical` luminance.
    pub fn excess_over(&self, typical: f32) -> Vec3 {
        let share = 1.0 - MOST_TYPICAL * typical / self.luminance().max(f32::MIN_POSITIVE);
        self.light * share.max(0.0)
    }
}

/// Luminance that is typical of values of which few may be far too large: (Σ k √L / Σ k)².
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Typical {
    roots: f32,
    weights: f32,
}

impl Typical {
    /// Adds a luminance that counts `share` times.
    pub fn add(&mut self, share: f32, luminance: f32) {
        self.roots += share * luminance.max(0.0).sqrt();
        self.weights += share;
    }

    /// The luminance; `None` without values.
    pub fn luminance(self) -> Option<f32> {
        (self.weights > 0.0).then(|| (self.roots / self.weights).powi(2))
    }
}

/// A ray that leaves a coat.
pub(super) struct ReflectedRay<'a> {
    pub direction: Vec3A,
    /// Textures are averaged over this share of the distance.
    pub spread: f32,
    /// Share that the ray has in the light of its pixel.
    pub share: f32,
    /// Rays that the pixel's light is the mean of.
    pub rays: u32,
    /// Irradiance of surfaces, if it is known. Such a ray follows every coat that it meets: its light is found once.
    pub known: Option<KnownIrradiance<'a>>,
}

/// Irradiance \[W·m⁻²\] of a surface that a ray has met; none where it is not known.
pub(crate) type KnownIrradiance<'a> = &'a (dyn Fn(&Hit, &Surface) -> Option<Vec3> + Sync);

impl Reflections<'_> {
    /// Radiance that the coat reflects of points and suns, and if it is rough of the areas that pixels sample; and how much more or
    /// less of these the base sends back than of even light, which the layer of direct light takes it for.
    pub fn sources(&mut self, coated: &Coated) -> Vec3 {
        let Frame { accelerator, direct, .. } = self.prepared;
        // Of areas, smooth coats have reflection rays: only the base is left.
        let brdf_of = |direction, half_angle, with_coat| {
            let (towards, outgoing) = (coated.to_frame(direction), coated.outgoing);
            let excess = coated.bsdf.diffuse_excess(outgoing, towards);
            if with_coat { excess + coated.bsdf.evaluate_coat(outgoing, towards, half_angle) } else { excess }
        };
        let (rough, has_base) = (coated.is_rough(), luminance(coated.diffuse_albedo()) > NO_BASE);
        let area_brdf = (rough || has_base).then_some(|direction, half_angle| brdf_of(direction, half_angle, rough));
        let brdf = |direction, half_angle| brdf_of(direction, half_angle, true);
        self.counted(direct.reflected(accelerator, &coated.receiver, brdf, area_brdf))
    }

    /// Radiance that a coat without a lobe reflects of all but its [`sources`](Self::sources).
    pub fn mirrored(&mut self, coated: &Coated) -> Vec3 {
        let albedo = coated.albedo();
        let Some(direction) = coated.mirrored() else { return Vec3::ZERO };
        let ray = ReflectedRay { direction, spread: 0.0, share: luminance(albedo), rays: 1, known: None };
        albedo * self.along(coated, ray).0
    }

    /// The rays drawn with `points`, one by one; the pixel is going to have `rays` of them.
    pub fn lobe(
        &mut self,
        coated: &Coated,
        points: impl Iterator<Item = Vec2>,
        rays: u32,
    ) -> impl Iterator<Item = Brought> {
        // Each ray stands for its share of a lobe that is about α wide on either side.
        let spread = 2.0 * coated.alpha() / (rays as f32).sqrt();
        let share = luminance(coated.albedo());
        points.filter_map(|point| coated.bsdf.sample_coat(coated.outgoing, point)).map(move |local| {
            let weights = coated.bsdf.coat_weight(coated.outgoing, local);
            let alone = Brought { rays: 1.0, weights, ..Brought::default() };
            let Some(direction) = coated.to_world(local) else { return alone };
            let (light, way) = self.along(coated, ReflectedRay { direction, spread, share, rays, known: None });
            Brought { light: weights * light, nearness: way.recip(), ..alone }
        })
    }

    /// Radiance that arrives at the coat along a ray, and the way to what the ray meets first \[m\].
    pub fn along(&mut self, coated: &Coated, ray: ReflectedRay<'_>) -> (Vec3, f32) {
        let Frame { accelerator, surfaces, direct, gather, epsilon, .. } = self.prepared;
        let scene = surfaces.scene();
        let (mut origin, mut direction, mut throughput) = (coated.receiver.position, ray.direction, Vec3::ONE);
        let mut sum = Vec3::ZERO;
        // Whether the first coat is rough, and whether the one that the ray has left last is.
        let (blurred, mut rough) = (coated.is_rough(), coated.is_rough());
        let (mut way, mut first) = (0.0, f32::INFINITY);
        for coats in 0..=MOST_COATS {
            // The next surface on the ray's way; if there is none, the sky.
            let Some(hit) = accelerator.closest(origin, direction) else {
                // Lamps of the sky are reflected as suns are.
                let sky = scene.sky.as_ref().and_then(Environment::beside_lamps);
                let sky = sky.map_or(Vec3::ZERO, |sky| sky.radiance(direction.into()));
                return (sum + throughput * sky, first);
            };
            way += hit.distance;
            first = first.min(way);
            let surface = surfaces.at(&hit, direction, ray.spread * way);

            // Its glow, which counts once.
            let unlit = scene.materials[scene.meshes[scene.instances[hit.instance as usize].mesh].material].unlit;
            // As for paths: what is unlit shines for the camera alone. Rough coats know the areas from their points.
            let known = rough && direct.samples_instance(hit.instance);
            if !unlit && !known {
                sum += throughput * surface.emission;
            }
            if unlit || (!surface.front && !surface.double_sided) {
                break;
            }

            // A coat is followed while its reflection is a large enough part of the pixel's light.
            let met = Coated::of_surface(&surface, direction, *epsilon);
            let (coat, diffuse) = (met.albedo(), met.diffuse_albedo());
            let share = ray.share * luminance(throughput);
            let is_metal = luminance(coat) > luminance(diffuse);
            let least_share = if blurred { LEAST_SHARE_IN_ROUGH[usize::from(met.is_rough())] } else { LEAST_SHARE };
            let is_small = share * luminance(coat) < least_share || (blurred || met.is_rough()) && !is_metal;
            let ends = coats == MOST_COATS || coat == Vec3::ZERO || is_small && ray.known.is_none();

            // The base is lit. A coat that no ray follows reflects as if it were part of it.
            let albedo = if ends { diffuse + coat } else { diffuse };
            sum += throughput
                * if let Some(irradiance) = ray.known.and_then(|known| known(&hit, &surface)) {
                    albedo / PI * irradiance
                } else if blurred {
                    gather.surfel_radiance(PosedScene::new(accelerator, surfaces), &surface, hit.instance)
                        * (luminance(albedo) / luminance(diffuse + coat).max(f32::MIN_POSITIVE))
                } else {
                    let loose = LOOSE * (ray.rays as f32).sqrt() / share.max(LEAST_SHARE);
                    self.matte(&met.receiver, albedo, loose.clamp(LOOSE, LOOSEST))
                };
            if ends {
                break;
            }

            // A coat shows sources by its lobe, and all else in the mirrored direction.
            sum += throughput * self.sources(&met);
            throughput *= coat;
            let Some(next) = met.mirrored() else { break };
            (origin, direction) = (met.receiver.position, next);
            rough = met.is_rough();
        }
        (sum, first)
    }

    /// Adds the shadow rays of a result and unwraps it.
    fn counted<T>(&mut self, traced: Traced<T>) -> T {
        self.shadow_rays += traced.shadow_rays;
        traced.value
    }

    /// Radiance that a matte surface at `receiver` reflects; clusters may be wrong by the share `loose` of it.
    fn matte(&mut self, receiver: &ShadingPoint, albedo: Vec3, loose: f32) -> Vec3 {
        if albedo == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let Frame { accelerator, direct, tree, .. } = self.prepared;
        let light = albedo / PI * self.counted(direct.irradiance(accelerator, receiver));
        let lambert =
            Lambert { position: receiver.position.into(), normal: receiver.normal.into(), reflectance: albedo };
        let stop = Stop::Relative { fraction: loose, known_luminance: luminance(light) };
        let visible = |lamp: &Light, _| sees(accelerator, receiver, lamp);
        let cut = tree.lightcut(&lambert, stop, visible, self.scratch);
        self.shadow_rays += u64::from(cut.shadow_rays);
        light + cut.radiance
    }
}
