//! Reflection rays, which compute the radiance that arrives at a coat.

use super::coated::{Coated, Points};
use crate::frame::Frame;
use crate::shade::visibility::sees;
use glam::{Vec2, Vec3, Vec3A};
use lighttree::{Lambert, Light, Scratch, Stop};
use ranks::portable;
use render_core::{Environment, Hit, LightPoints, LobeLight, Media, ShadingPoint, Surface, Traced, luminance};
use std::f32::consts::PI;

/// Minimum fraction of the pixel's light that the reflection of a coat must have to be followed, if the first coat is
/// smooth.
pub(super) const LEAST_SHARE: f32 = 0.02;
/// Permitted error of a cluster in a lightcut for a single reflection ray, as a fraction of luminance.
const LOOSE: f32 = 0.1;
/// Maximum permitted error of a cluster in a lightcut for a reflection ray, as a fraction of luminance.
const LOOSEST: f32 = 0.5;
/// Minimum albedo of a base for which a shadow ray is traced; polished metals have less.
const NO_BASE: f32 = 0.01;
/// Maximum radiance of a ray, relative to the typical radiance. A small lamp hit by few rays would otherwise be a
/// bright spot. The excess is spread over nearby pixels. At 4, spots appear on the floor of McGuire's
/// CornellBox-Glossy-Floor.
const MOST_TYPICAL: f32 = 2.0;

/// Computation of reflections by one thread.
pub(super) struct Reflections<'a> {
    pub prepared: &'a Frame<'a>,
    pub scratch: &'a mut Scratch,
    /// Sample points of lamps, which also determine the random points of reflection rays.
    pub points: LightPoints,
    /// Number of traced shadow rays.
    pub shadow_rays: u64,
    /// Irradiance of surfaces, if it is known.
    pub known: Option<KnownIrradiance<'a>>,
}

/// Sums over reflection rays of weight w = F·G₂/G₁ and radiance L.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Brought {
    /// Number of rays.
    pub rays: f32,
    /// Sum of 1/t over the rays, where t is the distance to the first hit \[1/m\].
    pub nearness: f32,
    /// Sum of weights, Σ w.
    weights: Vec3,
    /// Sum of weighted radiance, Σ w L \[W·m⁻²·sr⁻¹\].
    light: Vec3,
    /// Portion of Σ w L that a few very bright rays contribute, to be spread over nearby pixels \[W·m⁻²·sr⁻¹\].
    pub excess: Vec3,
    /// Sums of y², y w and w² over the rays, with the luminances y of w L and w of the weight.
    squares: Vec3,
}

portable!(Brought { rays, nearness, weights, light, excess, squares });

/// Number of rays that determine the light of a pixel, with the rays of nearby pixels.
const SHARED_RAYS: f32 = 16.0;
impl Brought {
    /// Returns `rays` rays of weight 1 with the mean light of a lobe.
    pub fn of_lobe(rays: u32, light: &LobeLight) -> Self {
        let (rays, excess) = (rays as f32, Vec3::from(light.excess));
        let radiance = Vec3::from(light.traced) + excess;
        let y = luminance(radiance);
        // The light of a pixel is the mean over several rays, so a single ray has more noise.
        let squares = rays * Vec3::new(y * y + SHARED_RAYS * light.noise * light.noise, y, 1.0);
        Self {
            rays,
            nearness: rays * light.nearness,
            weights: Vec3::splat(rays),
            light: rays * radiance,
            excess: rays * excess,
            squares,
        }
    }

    /// Adds the sums of `other` rays, scaled by `share`.
    pub fn add(&mut self, share: f32, other: &Self) {
        self.rays += share * other.rays;
        self.nearness += share * other.nearness;
        self.weights += share * other.weights;
        self.light += share * other.light;
        self.excess += share * other.excess;
        self.squares += share * share * other.squares;
    }

    /// Returns the standard deviation of the mean radiance's luminance,
    /// √(Σ k² (y − w M)²) / Σ k w, where k is the share of a ray and M is the mean.
    pub fn noise(&self) -> f32 {
        let weights = luminance(self.weights).max(f32::MIN_POSITIVE);
        let mean = luminance(self.light) / weights;
        let Vec3 { x: yy, y: yw, z: ww } = self.squares;
        (yy - 2.0 * mean * yw + mean * mean * ww).max(0.0).sqrt() / weights
    }

    /// Returns the sums with this `excess`, a portion of Σ w L.
    pub fn with_excess(self, excess: Vec3) -> Self {
        Self { excess, ..self }
    }

    /// Returns the mean of 1/t over the rays \[1/m\]; 0 without rays.
    pub fn mean_nearness(&self) -> f32 {
        if self.rays > 0.0 { self.nearness / self.rays } else { 0.0 }
    }

    /// Returns the mean radiance without the excess, and the excess.
    pub fn mean(&self) -> (Vec3, Vec3) {
        let weights = self.weights.max(Vec3::splat(f32::MIN_POSITIVE));
        ((self.light - self.excess) / weights, self.excess / weights)
    }

    /// Returns the luminance of the mean radiance, including the excess \[W·m⁻²·sr⁻¹\].
    pub fn luminance(&self) -> f32 {
        luminance(self.light) / luminance(self.weights).max(f32::MIN_POSITIVE)
    }

    /// Returns the portion of Σ w L beyond [`MOST_TYPICAL`] times the `typical` luminance.
    pub fn excess_over(&self, typical: f32) -> Vec3 {
        let share = 1.0 - MOST_TYPICAL * typical / self.luminance().max(f32::MIN_POSITIVE);
        self.light * share.max(0.0)
    }
}

/// Typical luminance of values L with weights k, robust against a few huge outliers: (Σ k √L / Σ k)².
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Typical {
    roots: f32,
    weights: f32,
}

impl Typical {
    /// Adds a value `luminance` with weight `share`.
    pub fn add(&mut self, share: f32, luminance: f32) {
        self.roots += share * luminance.max(0.0).sqrt();
        self.weights += share;
    }

    /// Returns the typical luminance; `None` if no value was added.
    pub fn luminance(self) -> Option<f32> {
        (self.weights > 0.0).then(|| (self.roots / self.weights).powi(2))
    }
}

/// A ray that leaves a coat.
#[derive(Clone, Copy)]
pub(super) struct ReflectedRay {
    pub direction: Vec3A,
    /// Ratio of the texture footprint to the distance.
    pub spread: f32,
    /// Fraction of the pixel's light that the ray contributes.
    pub share: f32,
    /// Number of rays that are averaged for the pixel.
    pub rays: u32,
    /// Whether the ray is followed through every coat, because its light is computed only once.
    pub is_kept: bool,
    /// Whether the ray contributes so little that surfels suffice for the light of surfaces.
    pub is_faint: bool,
}

/// Transparent surfaces that a ray has passed.
#[derive(Clone, Debug, Default)]
pub(super) struct Passed {
    /// Volumes that contain the ray.
    pub media: Media,
    /// Number of surfaces.
    pub surfaces: u32,
}

/// Function that returns the irradiance at a hit \[W·m⁻²\]; `None` if the irradiance is not known.
pub(crate) type KnownIrradiance<'a> = &'a (dyn Fn(&Hit, &Surface) -> Option<Vec3> + Sync);

impl Reflections<'_> {
    /// Returns the random points of a pixel. Further samples of the pixel have other points.
    pub fn points_of(&self, x: usize, y: usize) -> Points {
        match self.points {
            LightPoints::All => Points::of_pixel(x, y),
            LightPoints::Quarter(sample) => Points::of_sample(x, y, sample),
        }
    }

    /// Returns the radiance that the coat reflects from points and suns, and from sampled area lights if it is rough
    /// \[W·m⁻²·sr⁻¹\]. The base's deviation from uniform reflection is included, because the layer of direct light
    /// assumes uniform reflection.
    pub fn sources(&mut self, coated: &Coated) -> Vec3 {
        let Frame { accelerator, direct, .. } = self.prepared;
        // Omit the coat from area lights if it is smooth: reflection rays compute that light.
        let brdf_of = |direction, half_angle, with_coat| {
            let (towards, outgoing) = (coated.to_frame(direction), coated.outgoing);
            let excess = coated.bsdf.diffuse_excess(outgoing, towards);
            if with_coat { excess + coated.bsdf.evaluate_coat(outgoing, towards, half_angle) } else { excess }
        };
        // Rays find the area lights that a clearcoat reflects.
        let clearcoat =
            |direction, half| coated.bsdf.evaluate_clearcoat(coated.outgoing, coated.to_frame(direction), half);
        // Omit area lights for a smooth coat without a visible base: reflection rays find them.
        let (rough, has_base) = (coated.is_rough(), luminance(coated.diffuse_albedo()) > NO_BASE);
        let area_brdf = (rough || has_base).then_some(|direction, half_angle| brdf_of(direction, half_angle, rough));
        let brdf = |direction, half_angle| brdf_of(direction, half_angle, true) + clearcoat(direction, half_angle);
        self.counted(direct.reflected(accelerator, &coated.receiver, brdf, area_brdf))
    }

    /// Returns the radiance that a mirror coat reflects, except the light from [`sources`](Self::sources)
    /// \[W·m⁻²·sr⁻¹\].
    pub fn mirrored(&mut self, coated: &Coated) -> Vec3 {
        let albedo = coated.albedo();
        let Some(direction) = coated.mirrored() else { return Vec3::ZERO };
        let ray =
            ReflectedRay { direction, spread: 0.0, share: luminance(albedo), rays: 1, is_kept: false, is_faint: false };
        albedo * self.along(coated, ray).0
    }

    /// Returns the radiance that a clearcoat reflects, except the light of points and suns \[W·m⁻²·sr⁻¹\].
    pub fn clearcoat(&mut self, coated: &Coated, points: impl Iterator<Item = Vec2>, rays: u32) -> Vec3 {
        let albedo = coated.clearcoat_albedo();
        if albedo <= 0.0 {
            return Vec3::ZERO;
        }
        let (mut sum, origin) = (Vec3::ZERO, coated.receiver.position);
        for point in points {
            let Some(direction) = coated.clearcoat_direction(point) else { continue };
            let ray = ReflectedRay { direction, spread: 0.0, share: albedo, rays, is_kept: false, is_faint: false };
            sum += self.along_from(origin, ray, false, &Passed::default()).0;
        }
        sum * (albedo / rays as f32)
    }

    /// Traces rays with `points`, one by one. `rays` is the number of rays that the pixel will have in total.
    pub fn lobe(
        &mut self,
        coated: &Coated,
        points: impl Iterator<Item = Vec2>,
        rays: u32,
    ) -> impl Iterator<Item = Brought> {
        // Let each ray represent an equal fraction of a lobe with half-width α.
        let spread = 2.0 * coated.alpha() / (rays as f32).sqrt();
        let share = luminance(coated.albedo());
        points.filter_map(|point| coated.bsdf.sample_coat(coated.outgoing, point)).map(move |local| {
            let weights = coated.bsdf.coat_weight(coated.outgoing, local);
            let squares = Vec3::new(0.0, 0.0, luminance(weights).powi(2));
            let alone = Brought { rays: 1.0, weights, squares, ..Brought::default() };
            let Some(direction) = coated.to_world(local) else { return alone };
            let (light, way) =
                self.along(coated, ReflectedRay { direction, spread, share, rays, is_kept: false, is_faint: false });
            let (y, w) = (luminance(weights * light), luminance(weights));
            let squares = Vec3::new(y * y, y * w, w * w);
            Brought { light: weights * light, nearness: way.recip(), squares, ..alone }
        })
    }

    /// Returns the radiance that arrives at the coat along a ray \[W·m⁻²·sr⁻¹\], and the distance to the first hit
    /// \[m\].
    pub fn along(&mut self, coated: &Coated, ray: ReflectedRay) -> (Vec3, f32) {
        self.along_from(coated.receiver.position, ray, coated.is_rough(), &Passed::default())
    }

    /// Returns the radiance of the sky without its lamps: `sources` adds the light of lamps and suns.
    pub fn sky(&self, direction: Vec3A) -> Vec3 {
        let sky = self.prepared.surfaces.scene().sky.as_ref().and_then(Environment::beside_lamps);
        sky.map_or(Vec3::ZERO, |sky| sky.radiance(direction.into()))
    }

    /// Adds the shadow rays of a result to the count, and returns the result's value.
    fn counted<T>(&mut self, traced: Traced<T>) -> T {
        self.shadow_rays += traced.shadow_rays;
        traced.value
    }

    /// Returns the permitted relative error of clusters for a ray with this fraction of the pixel's light.
    pub fn loose(share: f32) -> f32 {
        (LOOSE / share.max(LEAST_SHARE)).clamp(LOOSE, LOOSEST)
    }

    /// Returns the radiance that a matte surface at `receiver` reflects \[W·m⁻²·sr⁻¹\]. `loose` is the permitted
    /// relative error of clusters.
    pub fn matte(&mut self, receiver: &ShadingPoint, albedo: Vec3, loose: f32) -> Vec3 {
        if albedo == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let Frame { accelerator, direct, tree, .. } = self.prepared;
        // Compute direct light first: it raises the relative threshold of the lightcut.
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
