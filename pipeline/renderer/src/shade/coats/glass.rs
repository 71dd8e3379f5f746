//! Light through glass and leaves: at each surface, rays continue in the reflected and in the refracted direction.
//!
//! ```text
//! L = R L(mirrored) + T L(refracted) + highlights of lamps        R, T  albedos of reflection and of refraction
//! ```
//! Both rays are deterministic, so smooth glass has no noise. Rough glass averages several refracted rays. Branches with
//! a small fraction of the pixel's light are not followed.

use super::coated::{Coated, Points};
use super::reflections::{Passage, ReflectedRay, Reflections};
use glam::{Vec3, Vec3A};
use render_core::{ShadingPoint, luminance};

/// Maximum number of transparent surfaces on a ray.
const MOST_SURFACES: u32 = 10;
/// Minimum fraction of the pixel's light of a ray that is followed.
const LEAST_SHARE: f32 = 0.01;
/// Number of refracted rays of a pixel of rough glass.
const ROUGH_RAYS: u32 = 8;

impl Reflections<'_> {
    /// Returns the radiance that a transparent surface sends back along a ray that hits it \[W·m⁻²·sr⁻¹\].
    pub(super) fn glass(&mut self, met: &Coated, passage: Passage) -> Vec3 {
        let Passage { distance, share, surfaces, .. } = passage;
        if surfaces >= MOST_SURFACES {
            return Vec3::ZERO;
        }
        // Reflect in the mirror direction, and add the highlights of lamps.
        let reflected = met.mirror_albedo();
        let mut sum = Vec3::ZERO;
        if share * luminance(reflected) >= LEAST_SHARE {
            if met.is_outside() {
                sum += self.sources(met);
            }
            if let Some(direction) = met.mirrored() {
                let origin = met.receiver.position;
                let share = share * luminance(reflected);
                sum += reflected * self.branch(origin, direction, met.is_rough(), Passage { share, ..passage });
            }
        }
        sum += self.base(met, share) + self.refracted(met, met.refracted(), passage);
        // The interior attenuates light between two surfaces.
        sum * met.interior(distance)
    }

    /// Returns the radiance that a pixel's surface transmits toward the viewer \[W·m⁻²·sr⁻¹\]. Its reflections are not
    /// included.
    pub(super) fn transmitted(&mut self, coated: &Coated, points: Points) -> Vec3 {
        if !coated.transmits() {
            return Vec3::ZERO;
        }
        let passage = Passage { distance: 0.0, share: 1.0, surfaces: 0, spread: 0.0 };
        let below = self.below(coated, 1.0);
        if coated.is_clear() {
            return below + self.refracted(coated, coated.refracted(), passage);
        }
        // Rough glass scatters the rays.
        let spread = 2.0 * coated.alpha() / (ROUGH_RAYS as f32).sqrt();
        let mut sum = Vec3::ZERO;
        for point in points.first(ROUGH_RAYS) {
            sum += self.refracted(coated, coated.refracted_at(point), Passage { spread, ..passage });
        }
        below + sum / ROUGH_RAYS as f32
    }

    /// Returns the light along a refracted direction in the shading frame, times the albedo of refraction.
    fn refracted(&mut self, met: &Coated, direction: Option<Vec3>, passage: Passage) -> Vec3 {
        let albedo = met.transmittance();
        let share = passage.share * luminance(albedo);
        match direction.and_then(|local| met.to_far_side(local)) {
            Some(direction) if share >= LEAST_SHARE => {
                albedo * self.branch(met.far_side(), direction, met.is_rough(), Passage { share, ..passage })
            }
            _ => Vec3::ZERO,
        }
    }

    /// Returns the radiance along a ray that leaves a transparent surface. `blurred` is whether the surface is rough.
    fn branch(&mut self, origin: Vec3A, direction: Vec3A, blurred: bool, passage: Passage) -> Vec3 {
        let Passage { share, spread, surfaces, .. } = passage;
        let ray = ReflectedRay { direction, spread, share, rays: 1, is_kept: false };
        self.along_from(origin, ray, blurred, surfaces + 1).0
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
