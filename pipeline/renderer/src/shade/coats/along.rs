//! Light along a reflection ray, which passes sheets and is followed from coat to coat.
//!
//! A sheet is a surface with holes or a partial opacity. A ray sees each sheet with the fraction of its opacity, as
//! camera rays do:
//!
//! ```text
//! L = Σ αᵢ Lᵢ Π_{j<i} (1 − αⱼ)        Lᵢ, αᵢ  radiance and opacity of the surfaces along the ray, front to back
//! ```
//! A ray that hit each sheet by chance would show its grain in mirrors.

use super::coated::Coated;
use super::reflections::{LEAST_SHARE, Passed, ReflectedRay, Reflections};
use crate::frame::Frame;
use glam::{Vec3, Vec3A};
use render_core::{Hit, Layered, PosedScene, SheetHit, Surface, luminance};
use std::f32::consts::PI;

/// Maximum number of coats through which a ray is followed.
const MOST_COATS: usize = 4;
/// Minimum fraction of the pixel's light if the first coat is rough, for smooth and for rough coats within it. With
/// these values, rays are followed from metal to metal, and rarely otherwise. With 0.1 for both, a closed room of metal
/// with roughness 0.5 has 1 % less light.
const LEAST_SHARE_IN_ROUGH: [f32; 2] = [0.1, 0.3];
/// Fraction of the pixel's light below which surfels suffice for the light of surfaces. Reflections at normal incidence
/// have 0.04.
pub(super) const FAINT_SHARE: f32 = 0.15;
/// Opacity from which on a sheet counts as the first hit of a ray.
const MOSTLY_OPAQUE: f32 = 0.5;

/// Ray on its way from coat to coat.
struct CoatPath<'a> {
    ray: ReflectedRay,
    /// Whether the first coat is rough.
    blurred: bool,
    /// Whether the last coat that the ray has left is rough: its lobe contains the sampled area lights.
    rough: bool,
    /// Transparent surfaces before the ray.
    passed: &'a Passed,
}

/// Surface that a ray hits, with its coat.
struct MetPoint<'a> {
    hit: &'a Hit,
    surface: &'a Surface,
    met: &'a Coated,
}

impl Reflections<'_> {
    /// Returns the radiance that arrives at a coat along a ray from `origin`, as [`along`](Self::along) does. `blurred`
    /// is whether the coat is rough, and `passed` are the transparent surfaces before the ray.
    pub fn along_from(&mut self, origin: Vec3A, ray: ReflectedRay, blurred: bool, passed: &Passed) -> (Vec3, f32) {
        // Follow the ray through coats until the contribution is small.
        let Frame { accelerator, surfaces, epsilon, .. } = self.prepared;
        let (mut origin, mut direction, mut throughput) = (origin, ray.direction, Vec3::ONE);
        let mut sum = Vec3::ZERO;
        let mut path = CoatPath { ray, blurred, rough: blurred, passed };
        let (mut way, mut first) = (0.0, f32::INFINITY);
        for coats in 0..=MOST_COATS {
            // Find the surfaces on the ray's path, and add the light of sheets before the first opaque surface.
            let end = match accelerator.layered(origin, direction, ray.spread * way, ray.spread) {
                None => accelerator.closest(origin, direction),
                Some(Layered { sheets, end, .. }) => {
                    path.ray = ReflectedRay { direction, share: ray.share * luminance(throughput), ..ray };
                    for SheetHit { hit, opacity } in sheets {
                        sum += throughput * opacity * self.of_sheet(&hit, opacity, way, &path);
                        throughput *= 1.0 - opacity;
                        path.ray.share *= 1.0 - opacity;
                        if opacity >= MOSTLY_OPAQUE {
                            first = first.min(way + hit.distance);
                        }
                    }
                    end
                }
            };
            let Some(hit) = end else { return (sum + throughput * self.sky(direction), first) };
            throughput *= passed.media.transmittance(hit.distance);
            way += hit.distance;
            first = first.min(way);
            let surface = surfaces.at(&hit, direction, ray.spread * way);
            path.ray = ReflectedRay { direction, share: ray.share * luminance(throughput), ..ray };

            // Add the emission of the surface. Unlit surfaces and backs end the ray.
            sum += throughput * self.emission(&hit, &surface, path.rough);
            if self.is_unlit(&hit) || (!surface.front && !surface.double_sided) {
                break;
            }

            // Continue on both sides of transparent surfaces.
            if let Some(light) = self.through(&hit, &surface, path.ray, passed) {
                return (sum + throughput * light, first);
            }
            let met = Coated::of_hit(&surface, &hit, direction, None, *epsilon);

            // Follow a coat while its reflection is a large enough fraction of the pixel's light.
            let (coat, diffuse) = (met.mirror_albedo(), met.diffuse_albedo());
            let is_metal = luminance(coat) > luminance(diffuse);
            let least_share = if blurred { LEAST_SHARE_IN_ROUGH[usize::from(met.is_rough())] } else { LEAST_SHARE };
            let is_small = path.ray.share * luminance(coat) < least_share || (blurred || met.is_rough()) && !is_metal;
            let ends = coats == MOST_COATS || coat == Vec3::ZERO || is_small && !ray.is_kept;

            // Light the base. A coat that is not followed reflects as a portion of the base.
            let albedo = if ends { diffuse + coat } else { diffuse };
            sum += throughput * self.of_base(&MetPoint { hit: &hit, surface: &surface, met: &met }, albedo, &path);
            if ends {
                break;
            }

            // Add light sources by the coat's lobe; all other light comes from the mirror direction.
            sum += throughput * self.sources(&met);
            throughput *= coat;
            let Some(next) = met.mirrored() else { break };
            (origin, direction) = (met.receiver.position, next);
            path.rough = met.is_rough();
        }
        (sum, first)
    }

    /// Returns the radiance of a sheet toward the start of a ray, which it hits with this `opacity` after `way` meters
    /// before its last coat \[W·m⁻²·sr⁻¹\]. The sheet's coat reflects as a portion of its base.
    fn of_sheet(&mut self, hit: &Hit, opacity: f32, way: f32, path: &CoatPath) -> Vec3 {
        let Frame { surfaces, epsilon, .. } = self.prepared;
        let arriving = path.passed.media.transmittance(hit.distance);
        let share = path.ray.share * luminance(arriving) * opacity;
        let path = &CoatPath { ray: ReflectedRay { share, ..path.ray }, ..*path };
        let surface = &surfaces.at(hit, path.ray.direction, path.ray.spread * (way + hit.distance));
        let light = if self.is_unlit(hit) {
            Vec3::ZERO
        } else if let Some(light) = self.through(hit, surface, path.ray, path.passed) {
            light
        } else {
            let met = &Coated::of_hit(surface, hit, path.ray.direction, None, *epsilon);
            self.of_base(&MetPoint { hit, surface, met }, met.diffuse_albedo() + met.mirror_albedo(), path)
        };
        arriving * (self.emission(hit, surface, path.rough) + light)
    }

    /// Returns the emission of a surface along a ray, unless it is counted elsewhere: rough coats have added sampled
    /// area lights already.
    fn emission(&self, hit: &Hit, surface: &Surface, rough: bool) -> Vec3 {
        let is_sampled = rough && self.prepared.direct.samples_instance(hit.instance);
        if is_sampled || self.is_unlit(hit) { Vec3::ZERO } else { surface.emission }
    }

    /// Returns whether a surface is unlit. Only the camera sees unlit materials, as in path tracing.
    fn is_unlit(&self, hit: &Hit) -> bool {
        let scene = self.prepared.surfaces.scene();
        scene.materials[scene.meshes[scene.instances[hit.instance as usize].mesh].material].unlit
    }

    /// Returns the radiance of a surface `met` as a matte surface with this albedo \[W·m⁻²·sr⁻¹\].
    fn of_base(&mut self, point: &MetPoint, albedo: Vec3, path: &CoatPath) -> Vec3 {
        let MetPoint { hit, surface, met } = *point;
        let Frame { accelerator, surfaces, gather, .. } = self.prepared;
        if let Some(irradiance) = self.known.and_then(|known| known(hit, surface)) {
            return albedo / PI * irradiance;
        }
        // The light of a studio is smooth, so surfels suffice for faint reflections.
        let CoatPath { ray, blurred, .. } = *path;
        let in_studio = surfaces.scene().ground.is_some();
        if blurred || ray.is_faint || in_studio && ray.share < FAINT_SHARE {
            let whole = luminance(met.diffuse_albedo() + met.mirror_albedo());
            let radiance = gather.surfel_radiance(PosedScene::new(accelerator, surfaces), surface, hit.instance);
            return radiance * (luminance(albedo) / whole.max(f32::MIN_POSITIVE));
        }
        self.matte(&met.receiver, albedo, Self::loose(ray.share / (ray.rays as f32).sqrt()))
    }
}
