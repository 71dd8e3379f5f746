//! Light of all surfaces in a film with baked light: texels light static surfaces, probes light dynamic ones.
//!
//! ```text
//! E(y) = V E_direct + E_indirect + ΔE   y on a static surface: light of the texels
//! E(y) = E_direct + P(n)                y on a dynamic surface: light of the nearest point of `mover_points.rs`
//!   V   fraction of the direct light that dynamic objects do not hide
//!   ΔE  change of the indirect light by nearby dynamic objects: see `change.rs`
//!   P   irradiance at the center of the dynamic instance, by the normal n: see `probe.rs`
//! ```

use super::mover_points::MoverPoints;
use super::movers::{Directions, Movers};
use super::probe::Probes;
use super::texel_blocks::TexelBlocks;
use crate::baked_light::BakedLight;
use crate::frame::Frame;
use crate::plan::moving_lamps;
use crate::shade::direct::shades;
use crate::shade::movement::{Movement, MovingBox};
use crate::texels::BakedTexels;
use glam::{Vec3, Vec3A, vec2};
use render_core::sampling::{hash, hash_unit};
use render_core::{AtlasPoint, Bsdf, Environment, GatherDirections, Hit, ShadingPoint, Source, Surface, luminance};
use std::f32::consts::PI;
use std::sync::Arc;

/// Number of rays that gather the light of a record.
pub(super) const GATHER_RAYS: usize = 128;
/// Number of rays that light a point on a dynamic instance for the ends of rays.
const POINT_RAYS: usize = 32;
/// Ratio of a ray's width to the distance, for textures.
const SPREAD: f32 = 0.1;
/// Number of reflections between surfaces that dynamic objects change.
pub(super) const MOST_FOLLOWED: usize = 2;
/// Maximum number of dynamic surfaces through which a ray passes.
const MOST_CROSSED: usize = 16;
/// Number of blocks of texels along the radius of the largest dynamic object, for shadows and for changes of indirect
/// light.
const SHADOWS_PER_RADIUS: f32 = 8.0;
const CHANGES_PER_RADIUS: f32 = 3.0;
/// Numbers of directions from which the change of a block's indirect light is estimated.
const CHANGE_DIRECTIONS: (usize, usize) = (16, 16);
/// Minimum fraction of the hemisphere that objects cover where they change the indirect light of a block.
const LEAST_BLOCK_COVER: f32 = 0.02;

/// Texels at the time of a frame.
pub(in crate::shade) struct TexelsOfFrame {
    texels: Arc<BakedTexels>,
    /// Whether the light is the same in all frames.
    is_constant: bool,
}

impl TexelsOfFrame {
    /// Returns the texels of `light` at a `time` \[s\].
    pub fn new(light: &BakedLight, time: f32) -> Self {
        Self { texels: light.at(time), is_constant: light.is_constant() }
    }
}

/// Light of a frame in a film with baked light.
pub(in crate::shade) struct TexelLight<'a> {
    pub(super) texels: &'a BakedTexels,
    /// Whether the light of the texels is the same in all frames.
    pub(super) is_constant: bool,
    pub(super) frame: &'a Frame<'a>,
    /// Directions of the rays of a record.
    pub(super) directions: GatherDirections,
    /// Directions of the rays of a point on a dynamic instance.
    point_directions: GatherDirections,
    /// Boxes around all moving instances, except lamps whose shadows are baked.
    pub(super) standing: Vec<MovingBox>,
    /// Regions of the lamps in which shadow rays end.
    sources: Vec<Source>,
    probes: Probes,
    /// Points on dynamic instances, for the ends of rays.
    points: MoverPoints,
    pub(super) movers: Movers,
    /// Fractions of direct light that dynamic objects do not hide.
    shadows: TexelBlocks<f32>,
    /// Changes of the indirect light by dynamic objects \[W·m⁻²\]: without the changes of other surfaces, and with them.
    changes: [TexelBlocks<Vec3>; 2],
}

/// Irradiance of the texels around a point \[W·m⁻²\].
pub(super) struct TexelSum {
    direct: Vec3,
    indirect: Vec3,
    /// Texel with the largest weight.
    nearest: u32,
}

impl std::fmt::Debug for TexelLight<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TexelLight").field("standing", &self.standing).finish_non_exhaustive()
    }
}

impl<'a> TexelLight<'a> {
    /// Prepares the light of `frame`.
    pub fn new(of_frame: &'a TexelsOfFrame, frame: &'a Frame<'a>, movement: &Movement) -> Self {
        let TexelsOfFrame { ref texels, is_constant } = *of_frame;
        let [directions, point_directions] = [GATHER_RAYS, POINT_RAYS].map(GatherDirections::new);
        let (all, sources) = (movement.standing(), frame.direct.sources());
        // Omit moving lamps: light with key times contains their shadows.
        let is_baked = if is_constant { Vec::new() } else { moving_lamps(frame.surfaces.scene()) };
        let is_live = |thing: &&MovingBox| is_baked.get(thing.instance as usize) != Some(&true);
        let standing: Vec<MovingBox> = all.iter().filter(is_live).cloned().collect();
        let movers = Movers::new(&standing);
        let radii = movers.spheres.iter().map(|sphere| sphere.radius);
        let largest_radius = radii.fold(0.0, f32::max);
        let mut light = Self {
            texels,
            is_constant,
            frame,
            directions,
            point_directions,
            standing,
            sources,
            probes: Probes::default(),
            points: MoverPoints::default(),
            movers,
            shadows: TexelBlocks::new(&texels.atlas, largest_radius / SHADOWS_PER_RADIUS),
            changes: [(); 2].map(|()| TexelBlocks::new(&texels.atlas, largest_radius / CHANGES_PER_RADIUS)),
        };

        // Trace the probes without light of dynamic surfaces, which needs the probes. Then light these surfaces.
        let centers: Vec<(u32, Vec3A)> = all.iter().map(|thing| (thing.instance, thing.sphere().center)).collect();
        light.probes = Probes::trace(&centers, |center, direction| light.static_radiance(center, direction, 0.0));
        let moving: Vec<u32> = all.iter().map(|thing| thing.instance).collect();
        light.points = MoverPoints::light(frame, &moving, |instance, surface| light.computed(instance, surface));
        // Light them again by rays, which see the shadows around them. Blocks that these rays meet keep the first light.
        light.points = MoverPoints::light(frame, &moving, |_, surface| light.arriving(surface));
        light
    }

    /// Returns the radiance that leaves the surface at a ray's hit toward the ray's origin \[W·m⁻²·sr⁻¹\], except
    /// emission that direct light samples. `irradiance` returns the light at the surface.
    fn leaving(&self, hit: &Hit, direction: Vec3A, irradiance: impl FnOnce(&Surface) -> Vec3) -> Vec3 {
        let Frame { surfaces, direct, .. } = self.frame;
        // Only the camera sees unlit materials, as in path tracing.
        if surfaces.material(hit.instance as usize).unlit {
            return Vec3::ZERO;
        }
        let surface = surfaces.at_indirect(hit, direction, SPREAD * hit.distance);
        let emitted = if direct.samples_instance(hit.instance) { Vec3::ZERO } else { surface.emission };
        if !surface.front && !surface.double_sided {
            return emitted;
        }
        emitted + reflectance(&surface, direction) / PI * irradiance(&surface)
    }

    /// Returns the radiance that leaves the surface at a ray's hit, in the light of this frame \[W·m⁻²·sr⁻¹\].
    pub(super) fn radiance(&self, hit: &Hit, direction: Vec3A) -> Vec3 {
        self.leaving(hit, direction, |surface| self.irradiance_at(hit, surface))
    }

    /// Returns the change of the radiance that the static surface at a hit reflects, by shadows of dynamic objects and by
    /// `follows` reflections between changed surfaces \[W·m⁻²·sr⁻¹\].
    pub(super) fn change_of_radiance(&self, hit: &Hit, direction: Vec3A, follows: usize) -> Vec3 {
        let surface = self.frame.surfaces.at_indirect(hit, direction, SPREAD * hit.distance);
        let is_changed = self.is_shaded(surface.position) || follows > 0 && self.is_covered(&surface);
        if !is_changed || !surface.front && !surface.double_sided {
            return Vec3::ZERO;
        }
        let Some(light) = self.of_texels(hit, &surface) else { return Vec3::ZERO };
        let mut change = light.direct * (self.unshadowed(&light, &surface) - 1.0);
        if let Some(before) = follows.checked_sub(1) {
            change += self.change_nearby(&light, &surface, before).max(-light.indirect);
        }
        reflectance(&surface, direction) / PI * change
    }

    /// Returns the radiance that arrives at `origin` from `direction` without dynamic surfaces \[W·m⁻²·sr⁻¹\]. The ray
    /// begins at the distance `way` \[m\] and passes through dynamic surfaces.
    pub(super) fn static_radiance(&self, origin: Vec3A, direction: Vec3A, mut way: f32) -> Vec3 {
        for _ in 0..MOST_CROSSED {
            let start = origin + direction * way;
            let Some(hit) = self.frame.accelerator.closest(start, direction) else { break };
            way += hit.distance;
            if !self.moves(hit.instance) {
                return self.leaving(&hit, direction, |surface| {
                    self.of_texels(&hit, surface).map_or(Vec3::ZERO, |light| light.direct + light.indirect)
                });
            }
            // Continue behind the dynamic surface.
            way += self.frame.epsilon;
        }
        self.sky(direction)
    }

    /// Returns the radiance of the sky without sampled lamps \[W·m⁻²·sr⁻¹\].
    fn sky(&self, direction: Vec3A) -> Vec3 {
        let sky = self.frame.surfaces.scene().sky.as_ref().and_then(Environment::beside_lamps);
        sky.map_or(Vec3::ZERO, |sky| sky.radiance(direction.into()))
    }

    /// Returns whether the instance moves during the film.
    pub(super) fn moves(&self, instance: u32) -> bool {
        self.frame.surfaces.moving()[instance as usize]
    }

    /// Returns the irradiance at a ray's hit, in the light of this frame \[W·m⁻²\].
    pub(super) fn irradiance_at(&self, hit: &Hit, surface: &Surface) -> Vec3 {
        let Some(light) = self.of_texels(hit, surface) else {
            let nearest = self.points.nearest(hit.instance, surface);
            return nearest.unwrap_or_else(|| self.computed(hit.instance, surface));
        };
        let indirect = light.indirect + self.change_nearby(&light, surface, MOST_FOLLOWED - 1);
        light.direct * self.unshadowed(&light, surface) + indirect.max(Vec3::ZERO)
    }

    /// Returns the light of the texels at a hit; `None` without texels.
    fn of_texels(&self, hit: &Hit, surface: &Surface) -> Option<TexelSum> {
        let &Surface { position, geometric_normal, .. } = surface;
        let at = AtlasPoint { instance: hit.instance, triangle: hit.triangle, position, geometric_normal };
        let blend = self.texels.atlas.bilinear(&self.frame.surfaces, &at)?;
        let mut sum = TexelSum { direct: Vec3::ZERO, indirect: Vec3::ZERO, nearest: blend.texels[0] };
        let mut most = 0.0;
        for (texel, weight) in blend.texels.into_iter().zip(blend.weights) {
            sum.direct += weight * Vec3::from(self.texels.direct[texel as usize]);
            sum.indirect += weight * Vec3::from(self.texels.indirect[texel as usize]);
            if weight > most {
                (sum.nearest, most) = (texel, weight);
            }
        }
        Some(sum)
    }

    /// Returns the fraction of the texels' direct light that dynamic objects do not hide.
    pub(super) fn unshadowed(&self, light: &TexelSum, surface: &Surface) -> f32 {
        if light.direct == Vec3::ZERO || !self.is_shaded(surface.position) {
            return 1.0;
        }
        let BakedTexels { atlas, direct, .. } = self.texels;
        self.shadows.value(atlas, light.nearest, |texel| {
            let Some(receiver) = self.receiver(texel) else { return 1.0 };
            let whole = luminance(direct[texel].into());
            let left = luminance(self.frame.direct.irradiance(&self.frame.accelerator, &receiver).value);
            if whole > 0.0 { (left / whole).min(1.0) } else { 1.0 }
        })
    }

    /// Returns the change of the texels' indirect light by dynamic objects nearby \[W·m⁻²\], with `follows` reflections
    /// between changed surfaces.
    fn change_nearby(&self, light: &TexelSum, surface: &Surface, follows: usize) -> Vec3 {
        if !self.is_covered(surface) {
            return Vec3::ZERO;
        }
        let (around, hemisphere) = CHANGE_DIRECTIONS;
        self.changes[follows].value(&self.texels.atlas, light.nearest, |texel| {
            // A point within an object would lose all light, but its block may extend beyond the object.
            let receiver = self.receiver(texel).filter(|receiver| !self.is_within(receiver));
            // Equal directions for all blocks would shift their light together.
            let shift = vec2(hash_unit(texel as u64, 1, 0), hash_unit(texel as u64, 2, 0));
            let directions = Directions { around, hemisphere, follows, shift };
            receiver.map_or(Vec3::ZERO, |receiver| self.change_at(&receiver, directions))
        })
    }

    /// Returns whether a dynamic object may hide a lamp from a point.
    fn is_shaded(&self, point: Vec3A) -> bool {
        let is_between = |thing: &MovingBox| self.sources.iter().any(|source| shades(thing, point, source));
        self.standing.iter().any(is_between)
    }

    /// Returns whether dynamic objects cover so much of the surroundings that they change the indirect light.
    fn is_covered(&self, surface: &Surface) -> bool {
        let &Surface { position, shading_normal: normal, geometric_normal, .. } = surface;
        self.movers.cover(&ShadingPoint { position, normal, geometric_normal }) >= LEAST_BLOCK_COVER
    }

    /// Returns whether a point is within a dynamic object: the first surface over it is the back of such an object.
    pub(super) fn is_within(&self, receiver: &ShadingPoint) -> bool {
        let ShadingPoint { position, geometric_normal: up, .. } = *receiver;
        let first = self.frame.accelerator.closest(position, up);
        first.is_some_and(|hit| self.moves(hit.instance) && !self.frame.surfaces.is_front(&hit, up))
    }

    /// Returns the first point of a texel.
    fn receiver(&self, texel: usize) -> Option<ShadingPoint> {
        let site = *self.texels.atlas.sites(texel, &self.frame.surfaces).first()?;
        let normals = [site.shading_normal, site.geometric_normal];
        Some(ShadingPoint::off_surface(site.position, normals, self.frame.epsilon))
    }

    /// Computes the irradiance of a surface of a dynamic instance \[W·m⁻²\].
    fn computed(&self, instance: u32, surface: &Surface) -> Vec3 {
        self.direct(surface) + self.probes.irradiance(instance, surface.shading_normal)
    }

    /// Computes the irradiance of a surface with a few rays \[W·m⁻²\].
    fn arriving(&self, surface: &Surface) -> Vec3 {
        let ShadingPoint { position, normal, geometric_normal } = self.over(surface);
        // Rotate the directions by an angle that depends on the position.
        let key = position.to_array().map(f32::to_bits).into_iter().fold(0, |key, bits| hash(key, bits.into(), 0));
        let mut light = Vec3::ZERO;
        for direction in self.point_directions.around(normal, key) {
            if direction.dot(geometric_normal) > 0.0 {
                light += match self.frame.accelerator.closest(position, direction) {
                    Some(hit) => self.radiance(&hit, direction),
                    None => self.sky(direction),
                };
            }
        }
        self.direct(surface) + light * (PI / POINT_RAYS as f32)
    }

    /// Computes the direct irradiance at a hit \[W·m⁻²\].
    fn direct(&self, surface: &Surface) -> Vec3 {
        self.frame.direct.irradiance(&self.frame.accelerator, &self.over(surface)).value
    }

    /// Returns the origin of rays from a surface.
    fn over(&self, surface: &Surface) -> ShadingPoint {
        let &Surface { position, geometric_normal, shading_normal, .. } = surface;
        ShadingPoint::off_surface(position, [shading_normal, geometric_normal], self.frame.epsilon)
    }
}

/// Returns the fraction of light that a surface reflects toward the origin of a ray in this `direction`.
pub(super) fn reflectance(surface: &Surface, direction: Vec3A) -> Vec3 {
    if surface.specular == Vec3::ZERO {
        return surface.albedo;
    }
    let cosine = -surface.shading_normal.dot(direction);
    Bsdf::new(surface.albedo, surface.specular, surface.roughness).directional_albedo(cosine.max(0.0))
}
