//! Light through glass and leaves: at each surface, rays continue in the reflected and in the refracted direction.
//!
//! ```text
//! L = R L(mirrored) + T L(refracted) + highlights of lamps        R, T  albedos of reflection and of refraction
//! ```
//! Both rays are deterministic, so smooth glass has no noise. Rough glass averages several refracted rays. Branches with
//! a small fraction of the pixel's light are not followed. Volumes may be nested ([`Media`](render_core::Media)).

use super::along::FAINT_SHARE;
use super::coated::{Coated, Points};
use super::reflections::{Passed, ReflectedRay, Reflections};
use glam::{Vec3, Vec3A};
use render_core::{Hit, ShadingPoint, Surface, luminance};

/// Maximum number of transparent surfaces on a ray. Total reflection in the wall of a vase needs about 20.
const MOST_SURFACES: u32 = 32;
/// Minimum fraction of the pixel's light of a ray that is followed.
const LEAST_SHARE: f32 = 0.01;
/// Number of refracted rays of a pixel of rough glass.
const ROUGH_RAYS: u32 = 8;

impl Reflections<'_> {
    /// Returns the radiance that a transparent surface sends back along a ray that hits it \[W·m⁻²·sr⁻¹\], or `None` if
    /// the surface is opaque.
    pub(super) fn through(&mut self, hit: &Hit, surface: &Surface, ray: ReflectedRay, passed: &Passed) -> Option<Vec3> {
        // Find the media on both sides of a volume's surface.
        let lobes = surface.lobes.as_ref().filter(|lobes| lobes.transmits())?;
        let is_volume = lobes.glass.factor > 0.0 && !lobes.glass.is_thin;
        let eta = if is_volume { passed.media.eta(hit.instance, surface.front, lobes.glass.ior) } else { Some(1.0) };
        let met = Coated::of_hit(surface, hit, ray.direction, eta, self.prepared.epsilon);
        // Replace the end of a long path by the sky in its direction.
        if passed.surfaces >= MOST_SURFACES {
            return Some(self.sky(ray.direction));
        }
        // Surfaces inside another volume have no effect.
        if eta.is_none() {
            return Some(self.branch(met.far_side(), ray, &met, met.behind_it(passed)));
        }
        Some(self.glass(&met, ray, passed))
    }

    /// Returns the radiance that a transparent surface sends back along a ray.
    fn glass(&mut self, met: &Coated, ray: ReflectedRay, passed: &Passed) -> Vec3 {
        // Reflect in the mirror direction, and add the highlights of lamps.
        let reflected = met.mirror_albedo();
        let mut sum = Vec3::ZERO;
        let share = ray.share * luminance(reflected);
        if share >= LEAST_SHARE {
            if met.is_outside() {
                sum += self.sources(met);
            }
            if let Some(direction) = met.mirrored() {
                let before = Passed { surfaces: passed.surfaces + 1, ..passed.clone() };
                let ray = ReflectedRay { direction, share, ..ray };
                sum += reflected * self.branch(met.receiver.position, ray, met, before);
            }
        }
        sum += self.base(met, ray.share);
        sum + self.refracted(met, met.refracted(), ray, passed)
    }

    /// Returns the radiance that a pixel's surface transmits toward the viewer \[W·m⁻²·sr⁻¹\]. Its reflections are not
    /// included.
    pub(super) fn transmitted(&mut self, coated: &Coated, points: Points) -> Vec3 {
        if !coated.transmits() {
            return Vec3::ZERO;
        }
        let direction = coated.middle();
        let ray = ReflectedRay { direction, spread: 0.0, share: 1.0, rays: 1, is_kept: false, is_faint: false };
        let (below, air) = (self.below(coated, 1.0), Passed::default());
        if coated.is_clear() {
            return below + self.refracted(coated, coated.refracted(), ray, &air);
        }
        // Rough glass scatters the rays.
        let spread = 2.0 * coated.alpha() / (ROUGH_RAYS as f32).sqrt();
        let mut sum = Vec3::ZERO;
        for point in points.first(ROUGH_RAYS) {
            sum += self.refracted(coated, coated.refracted_at(point), ReflectedRay { spread, ..ray }, &air);
        }
        below + sum / ROUGH_RAYS as f32
    }

    /// Returns the light along a refracted direction in the shading frame, times the albedo of refraction.
    fn refracted(&mut self, met: &Coated, direction: Option<Vec3>, ray: ReflectedRay, passed: &Passed) -> Vec3 {
        let albedo = met.transmittance();
        let share = ray.share * luminance(albedo);
        match direction.and_then(|local| met.to_far_side(local)) {
            Some(direction) if share >= LEAST_SHARE => {
                let ray = ReflectedRay { direction, share, ..ray };
                albedo * self.branch(met.far_side(), ray, met, met.behind_it(passed))
            }
            _ => Vec3::ZERO,
        }
    }

    /// Returns the radiance along a ray that leaves a transparent surface.
    fn branch(&mut self, origin: Vec3A, ray: ReflectedRay, met: &Coated, passed: Passed) -> Vec3 {
        let is_faint = ray.share < FAINT_SHARE;
        self.along_from(origin, ReflectedRay { rays: 1, is_kept: false, is_faint, ..ray }, met.is_rough(), &passed).0
    }

    /// Returns the light of the opaque base, seen by a ray.
    fn base(&mut self, met: &Coated, share: f32) -> Vec3 {
        let base = self.matte(&met.receiver, met.diffuse_albedo(), Self::loose(share));
        base + self.below(met, share)
    }

    /// Returns the light that the base transmits diffusely.
    fn below(&mut self, met: &Coated, share: f32) -> Vec3 {
        let ShadingPoint { normal, geometric_normal, .. } = met.receiver;
        let far = ShadingPoint { position: met.far_side(), normal: -normal, geometric_normal: -geometric_normal };
        self.matte(&far, met.diffuse_transmittance(), Self::loose(share))
    }
}

impl Coated {
    /// Returns the transparent surfaces that a ray has passed behind this one.
    fn behind_it(&self, passed: &Passed) -> Passed {
        Passed { media: self.behind(&passed.media), surfaces: passed.surfaces + 1 }
    }
}
