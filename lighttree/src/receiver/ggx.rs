//! Rough metals and coats: the microfacet model with the GGX (Trowbridge-Reitz) distribution.
//!
//! `[Walter07]` B. Walter, S. R. Marschner, H. Li, K. E. Torrance: Microfacet models for refraction through rough
//! surfaces. EGSR 2007.
//! `[Heitz14]` E. Heitz: Understanding the masking-shadowing function in microfacet-based BRDFs. JCGT 3(2), 2014.
//!
//! ```text
//! M = diffuse/π · cos θ_i + F · D · V · cos θ_i
//!   D = α² / (π (1 − (1 − α²) cos² θ_h)²)                          [Walter07], eq. 33
//!   V = 1 / (2 (cos θ_o s(θ_i) + cos θ_i s(θ_o)))                  [Heitz14], eq. 99, divided by 4 cos θ_o cos θ_i
//!       s(θ) = √(cos² θ (1 − α²) + α²)
//!   F = F₀ + (1 − F₀)(1 − cos θ_d)⁵                                Schlick
//!   θ_h, θ_d  angles of the half vector to normal and view
//! ```
//!
//! # The bound
//!
//! The bound is not from the papers.
//!
//! *D.* Reflection at a half vector h is a rotation by π around h. The light direction l is therefore the mirror
//! direction of the view, rotated first by π around the normal and then by π around h. Together this is a rotation by 2
//! θ_h. It moves no direction by a larger angle, so the angle δ between l and the mirror direction is at most 2 θ_h.
//! Therefore cos² θ_h ≤ (1 + cos δ)/2. D grows with this cosine.
//!
//! *V cos θ_i* equals 1 / (2 (cos θ_o √(1 − α² + α²/cos² θ_i) + s(θ_o))). It grows with cos θ_i.
//!
//! *F* falls with cos θ_d = √((1 + l · view)/2). The smallest cos θ_d follows from the largest cosine to −view.
//!
//! Three maximum cosines over the region therefore bound M. They may belong to different directions. The bound is tight
//! if the lobe is not seen at grazing angles.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::{Bundled, Receiver, ReflectBound};
use crate::bounds::{DirectionCone, Region};
use crate::lanes::{Real, Vector3};

/// Smallest α. Narrower lobes would lose their peak to `f32` rounding, and mirror rays sample them better.
const SMALLEST_ALPHA: f32 = 0.02;

/// Diffuse surface with a rough specular lobe, as in the metallic-roughness materials of glTF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    /// Position \[m\].
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Unit direction to the viewer.
    pub view: Vec3,
    /// Diffuse reflectance, linear RGB, 0 … 1, reduced by the fraction that the specular lobe reflects.
    pub diffuse: Vec3,
    /// Specular reflectance F₀ at normal incidence, linear RGB, 0 … 1.
    pub specular: Vec3,
    /// α, the square of glTF's roughness, 0 … 1. Values below 0.02 count as 0.02.
    pub alpha: f32,
}

/// Evaluator of M from three cosines, or of a bound of M from bounds of these cosines.
struct Lobe {
    diffuse: Vec3,
    specular: Vec3,
    /// Smallest and largest α² of the receivers.
    alpha2: [f32; 2],
    /// Cosine between view and normal, or the smallest of several such cosines.
    cos_view: f32,
}

impl Lobe {
    /// Returns M for cos θ_i, cos² θ_h and cos² θ_d.
    #[inline(always)]
    fn material<F: Real>(&self, cos_light: F, cos2_half: F, cos2_view_half: F) -> Vector3<F> {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let [narrow, wide] = self.alpha2;
        // Bound D from above, with the wide α² in the numerator and the narrow α² in the denominator.
        let spread = one - F::splat(1.0 - narrow) * cos2_half.min(one);
        let d = F::splat(wide * FRAC_1_PI) / (spread * spread);
        // Compute V cos θ_i. Both square roots grow with α² if the cosines are at most one.
        let cos_light = cos_light.max(zero);
        let smith_light = (cos_light * cos_light * F::splat(1.0 - narrow) + F::splat(narrow)).sqrt();
        let smith_view = F::splat((self.cos_view * self.cos_view * (1.0 - narrow) + narrow).sqrt());
        let v = cos_light / (F::splat(2.0) * (F::splat(self.cos_view) * smith_light + cos_light * smith_view));
        // Compute F with Schlick's approximation.
        let away = one - cos2_view_half.max(zero).sqrt().min(one);
        let away5 = away * away * (away * away) * away;
        let f = Vector3::splat(self.specular) + Vector3::splat(Vec3::ONE - self.specular) * away5;
        // Add the diffuse term. Light from below the surface is not reflected.
        let both = Vector3::splat(self.diffuse) * (cos_light * F::splat(FRAC_1_PI)) + f * (d * v);
        Vector3::select(zero.lt(cos_light), both, Vector3::splat(Vec3::ZERO))
    }

    /// Returns a bound of M from the largest cosines to normal, mirror direction and −view.
    #[inline(always)]
    fn bound<F: Real>(&self, cos_normal: F, cos_mirror: F, cos_away: F) -> Vector3<F> {
        let half = |cosine: F| (F::splat(1.0) + cosine) * F::splat(0.5);
        self.material(cos_normal, half(cos_mirror), half(-cos_away))
    }
}

impl Ggx {
    /// Returns the lobe of the receiver. A viewer behind the shading normal is treated like a viewer at the horizon.
    #[inline(always)]
    fn lobe(&self) -> Lobe {
        let alpha = self.alpha.clamp(SMALLEST_ALPHA, 1.0);
        Lobe {
            diffuse: self.diffuse,
            specular: self.specular,
            alpha2: [alpha * alpha; 2],
            cos_view: self.normal.dot(self.view).max(0.0),
        }
    }

    fn mirror(&self) -> Vec3 {
        self.normal * (2.0 * self.normal.dot(self.view)) - self.view
    }
}

impl Receiver for Ggx {
    #[inline]
    fn position(&self) -> Vec3 {
        self.position
    }

    #[inline(always)]
    fn reflect<F: Real>(&self, direction: Vector3<F>) -> Vector3<F> {
        let lobe = self.lobe();
        let cos_light = Vector3::splat(self.normal).dot(direction);
        let cos_between = Vector3::splat(self.view).dot(direction);
        // The half vector follows from |l + v|² = 2 + 2 l·v.
        let sum2 = (F::splat(2.0) + F::splat(2.0) * cos_between).max(F::splat(1e-12));
        let along = (cos_light + F::splat(self.normal.dot(self.view))).max(F::splat(0.0));
        // If light and view are opposite, the half vector is mostly rounding error, but the bound by the mirror
        // direction is exact.
        let cos_mirror = Vector3::splat(self.mirror()).dot(direction);
        let cos2_half = (along * along / sum2).min((F::splat(1.0) + cos_mirror) * F::splat(0.5));
        lobe.material(cos_light, cos2_half, sum2 * F::splat(0.25))
    }

    #[inline(always)]
    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F> {
        let cos_normal = region.max_cosine_in_front(Vector3::splat(self.normal));
        let cos_mirror = region.max_cosine(Vector3::splat(self.mirror()));
        let cos_away = region.max_cosine(Vector3::splat(-self.view));
        self.lobe().bound(cos_normal, cos_mirror, cos_away)
    }
}

/// Common bounds of [`Ggx`] receivers.
#[derive(Clone, Copy, Debug)]
pub struct GgxBundle {
    normals: DirectionCone,
    mirrors: DirectionCone,
    away: DirectionCone,
    diffuse: Vec3,
    specular: Vec3,
    alpha2: [f32; 2],
    cos_view: f32,
}

impl Bundled for Ggx {
    type Bundle = GgxBundle;

    fn bundle(receivers: &[Self]) -> GgxBundle {
        // Take the extreme of each field over the receivers, so that the bundle bounds each of them.
        let lobes = receivers.iter().map(Ggx::lobe);
        GgxBundle {
            normals: DirectionCone::around(receivers.iter().map(|r| r.normal)),
            mirrors: DirectionCone::around(receivers.iter().map(Ggx::mirror)),
            away: DirectionCone::around(receivers.iter().map(|r| -r.view)),
            diffuse: receivers.iter().fold(Vec3::ZERO, |most, r| most.max(r.diffuse)),
            specular: receivers.iter().fold(Vec3::ZERO, |most, r| most.max(r.specular)),
            alpha2: lobes
                .clone()
                .fold([1.0, 0.0], |[low, high], lobe| [low.min(lobe.alpha2[0]), high.max(lobe.alpha2[1])]),
            cos_view: lobes.fold(1.0, |least, lobe| least.min(lobe.cos_view)),
        }
    }
}

impl ReflectBound for GgxBundle {
    #[inline(always)]
    fn reflect_bound<F: Real>(&self, region: &Region<F>) -> Vector3<F> {
        let Self { diffuse, specular, alpha2, cos_view, .. } = *self;
        let cos_normal = region.max_cosine_of_cone(&self.normals.splat());
        let cos_mirror = region.max_cosine_of_cone(&self.mirrors.splat());
        let cos_away = region.max_cosine_of_cone(&self.away.splat());
        Lobe { diffuse, specular, alpha2, cos_view }.bound(cos_normal, cos_mirror, cos_away)
    }
}
