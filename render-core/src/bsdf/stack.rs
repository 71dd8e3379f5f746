//! Stack of all lobes: clearcoat over sheen over a mixture of an opaque base and glass.
//!
//! ```text
//! f = c + T_c [ s + T_s ( (1 − τ) opaque + τ glass ) ]
//! opaque = coat + M + ((1 − d) base + d color below) T(θ_o) T(θ_i) / (π T_avg)        T = T_c T_s (1 − C)
//!   c, s  clearcoat and sheen             τ  fraction of glass              d  diffuse transmission
//!   T_c, T_s  light that they transmit, 1 minus their albedo               C  albedo of the coat on the base
//! ```
//! A layer transmits min(T(θ_o), T(θ_i)) to narrow lobes below it. The result is symmetric in both directions and never
//! reflects more light than arrives. Diffuse lobes receive the product over all layers, as in [`coat`](super::coat).

use super::clearcoat::Varnish;
use super::coat::{Coat, NOTHING};
use super::film::{FilmShape, ThinFilm};
use super::fresnel::Reflectance;
use super::ggx::Ggx;
use super::glass::{Glass, GlassShape};
use super::lobes::SurfaceLobes;
use super::quadrature::cosine_mean;
use super::schlick::Schlick;
use super::sheen::Fibers;
use crate::luminance;
use crate::sampling::{cosine_hemisphere, uniform_sphere};
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// All lobes at a point.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stack {
    varnish: Option<Varnish>,
    fibers: Option<Fibers>,
    coat: Option<Coat<Reflectance>>,
    glass: Option<Glass>,
    /// Fraction of glass, τ.
    glassy: f32,
    /// Reflectance of the base, and the transmittance to the other side, each divided by T_avg.
    base: [Vec3; 2],
    through_mean: Vec3,
}

/// Lobes that are sampled separately.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LobeKind {
    Varnish,
    Fibers,
    Coat,
    /// Repeated scattering in the coat, and the base.
    Above,
    /// Diffuse transmission.
    Below,
    Glass,
}

impl LobeKind {
    const ALL: [Self; 6] = [Self::Varnish, Self::Fibers, Self::Coat, Self::Above, Self::Below, Self::Glass];
}

impl Stack {
    /// Lobes of single reflection below the clearcoat.
    const GLOSS: [LobeKind; 3] = [LobeKind::Fibers, LobeKind::Coat, LobeKind::Glass];

    /// Builds the lobes of a surface with the shading `axes`. `eta` is the index of refraction below the surface
    /// divided by the index above.
    pub(super) fn new(lobes: &SurfaceLobes, axes: [Vec3; 3], eta: f32) -> Self {
        let fraction = lobes.glass.factor;
        // A thin wall has the same medium on both sides; its reflectance is the one of its material.
        let eta = if lobes.glass.is_thin { lobes.glass.ior } else { eta };
        // Leave the interior of a volume without the layers on its outside.
        let outside = eta >= 1.0 || lobes.glass.is_thin || fraction <= 0.0;
        let local = |v: Vec3| SurfaceLobes::local(axes, v);
        let varnish = (outside && lobes.clearcoat > 0.0)
            .then(|| Varnish::new(lobes.clearcoat, lobes.clearcoat_roughness, local(lobes.clearcoat_normal)));
        let fibers =
            (outside && lobes.sheen.max_element() > 0.0).then(|| Fibers::new(lobes.sheen, lobes.sheen_roughness));

        // Build the facets of base and glass, whose reflectance a film may change.
        let ggx = Ggx::anisotropic(lobes.roughness, lobes.anisotropy);
        let film = |schlick: Schlick| {
            let shape = FilmShape { factor: lobes.film, ior: lobes.film_ior, thickness: lobes.film_thickness };
            (outside && lobes.film > 0.0).then(|| ThinFilm::new(shape, schlick))
        };
        let schlick = Schlick { f0: lobes.specular, f90: lobes.grazing };
        let has_coat = lobes.specular != Vec3::ZERO || lobes.film > 0.0;
        let coat = (fraction < 1.0 && has_coat).then(|| {
            let fresnel = film(schlick).map_or(Reflectance::Schlick(schlick), Reflectance::Film);
            Coat::new(Vec3::ZERO, fresnel, ggx)
        });
        let glass = (fraction > 0.0).then(|| {
            let schlick = Schlick { f0: lobes.glass.specular, f90: lobes.grazing };
            Glass::new(GlassShape {
                ggx,
                eta,
                is_thin: lobes.glass.is_thin,
                is_clear: lobes.is_clear_wall(),
                tint: lobes.glass.tint,
                schlick,
                film: film(schlick),
            })
        });

        // Divide the base by the mean transmission of all layers over it.
        let mut stack =
            Self { varnish, fibers, coat, glass, glassy: fraction, base: [Vec3::ZERO; 2], through_mean: Vec3::ONE };
        stack.through_mean = cosine_mean(|cos| stack.mean_through(cos)).max(Vec3::splat(NOTHING));
        let transmitted = lobes.diffuse_transmission;
        let base = [lobes.base * (1.0 - transmitted), lobes.diffuse_color * transmitted];
        stack.base = base.map(|base| base * (1.0 - fraction) / stack.through_mean);
        stack
    }

    /// Returns the transmission of all layers over the base, with an untilted clearcoat.
    fn mean_through(&self, cos: f32) -> Vec3 {
        let varnish = self.varnish.as_ref().map_or(1.0, |varnish| varnish.mean_through(cos));
        let fibers = self.fibers.as_ref().map_or(1.0, |fibers| fibers.through(cos));
        let coat = self.coat.as_ref().map_or(Vec3::ONE, |coat| coat.left_over(cos).1);
        coat * (varnish * fibers)
    }

    /// Returns the transmission of the clearcoat for a direction on either side.
    fn through_varnish(&self, w: Vec3) -> f32 {
        self.varnish.as_ref().map_or(1.0, |varnish| varnish.through(Vec3::new(w.x, w.y, w.z.abs())))
    }

    /// Returns the transmission of clearcoat and sheen for a direction on either side.
    fn over(&self, w: Vec3) -> f32 {
        self.through_varnish(w) * self.fibers.as_ref().map_or(1.0, |fibers| fibers.through(w.z.abs()))
    }

    /// Returns the BSDF for ω_o above the surface and ω_i on either side \[sr⁻¹\].
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let glass = self.glass.as_ref().map_or(Vec3::ZERO, |glass| glass.evaluate(wo, wi));
        let below_layers = glass * (self.glassy * self.over(wo).min(self.over(wi)));
        below_layers + self.evaluate_varnish(wo, wi, 0.0) + self.opaque_gloss(wo, wi, 0.0) + self.diffuse(wo, wi)
    }

    /// Returns the reflection of the clearcoat, for light from a disc of `half_angle` radians around ω_i.
    pub(super) fn evaluate_varnish(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        match &self.varnish {
            Some(varnish) if wi.z > 0.0 => varnish.evaluate(wo, wi, half_angle),
            _ => Vec3::ZERO,
        }
    }

    /// Returns the directional albedo of the clearcoat.
    pub(super) fn varnish_albedo(&self, wo: Vec3) -> f32 {
        1.0 - self.through_varnish(wo)
    }

    /// Draws a direction that the clearcoat reflects.
    pub(super) fn sample_varnish(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        self.varnish.as_ref()?.sample(wo, u)
    }

    /// Returns the lobes of single reflection below the clearcoat, for light from a disc of `half_angle` radians around
    /// ω_i.
    pub(super) fn gloss(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        let glass = match &self.glass {
            Some(glass) if wi.z > 0.0 => glass.reflection(wo, wi, half_angle),
            _ => Vec3::ZERO,
        };
        glass * (self.glassy * self.over(wo).min(self.over(wi))) + self.opaque_gloss(wo, wi, half_angle)
    }

    /// Returns sheen and the single reflection of the coat.
    fn opaque_gloss(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        if wi.z <= 0.0 {
            return Vec3::ZERO;
        }
        let mut sum = Vec3::ZERO;
        if let Some(fibers) = &self.fibers {
            sum += fibers.evaluate(wo, wi) * self.through_varnish(wo).min(self.through_varnish(wi));
        }
        if let Some(coat) = &self.coat {
            let coat = if half_angle > 0.0 { coat.widened(half_angle * half_angle / 4.0) } else { *coat };
            sum += coat.single(wo, wi) * ((1.0 - self.glassy) * self.over(wo).min(self.over(wi)));
        }
        sum
    }

    /// Returns the lobes of repeated scattering in the coat, of the base, and of diffuse transmission.
    pub(super) fn diffuse(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let base = self.base[usize::from(wi.z < 0.0)];
        let through = self.through(wo) * self.through(wi);
        let multiple = match &self.coat {
            Some(coat) if wi.z > 0.0 => {
                coat.multiple(wo.z, wi.z) * ((1.0 - self.glassy) * self.over(wo).min(self.over(wi)))
            }
            _ => Vec3::ZERO,
        };
        base * through * FRAC_1_PI + multiple
    }

    /// Returns the transmission of all layers over the base, for a direction on either side.
    fn through(&self, w: Vec3) -> Vec3 {
        self.coat.as_ref().map_or(Vec3::ONE, |coat| coat.left_over(w.z.abs()).1) * self.over(w)
    }

    /// Returns the directional albedo of a lobe. The albedo of glass includes refraction.
    fn albedo(&self, lobe: LobeKind, wo: Vec3) -> Vec3 {
        let opaque = (1.0 - self.glassy) * self.over(wo);
        let coat = |of: fn(&Coat<Reflectance>, f32) -> Vec3| self.coat.as_ref().map_or(Vec3::ZERO, |c| of(c, wo.z));
        match lobe {
            LobeKind::Varnish => Vec3::splat(1.0 - self.through_varnish(wo)),
            LobeKind::Fibers => {
                self.fibers.as_ref().map_or(Vec3::ZERO, |fibers| fibers.albedo(wo.z)) * self.through_varnish(wo)
            }
            LobeKind::Coat => coat(Coat::single_albedo) * opaque,
            LobeKind::Above => {
                coat(Coat::multiple_albedo) * opaque + self.base[0] * self.through(wo) * self.through_mean
            }
            LobeKind::Below => self.base[1] * self.through(wo) * self.through_mean,
            LobeKind::Glass => self.glass_albedos(wo).into_iter().sum(),
        }
    }

    /// Returns the directional albedos of glass: of its single reflection, and of its refraction.
    fn glass_albedos(&self, wo: Vec3) -> [Vec3; 2] {
        let Some(glass) = &self.glass else { return [Vec3::ZERO; 2] };
        let [reflected, refracted] = glass.albedos(wo.z);
        [reflected, refracted * glass.tint()].map(|albedo| albedo * (self.glassy * self.over(wo)))
    }

    /// Returns the directional albedo of all lobes, including transmission.
    pub(super) fn directional_albedo(&self, wo: Vec3) -> Vec3 {
        LobeKind::ALL.map(|lobe| self.albedo(lobe, wo)).into_iter().sum::<Vec3>() + self.straight(wo)
    }

    /// Returns the directional albedo of refraction.
    pub(super) fn refracted_albedo(&self, wo: Vec3) -> Vec3 {
        self.glass_albedos(wo)[1] + self.straight(wo)
    }

    /// Returns the directional albedo of diffuse transmission.
    pub(super) fn below_albedo(&self, wo: Vec3) -> Vec3 {
        self.albedo(LobeKind::Below, wo)
    }

    /// Returns the direction of refraction at the mean surface, or at a facet drawn with `u`.
    pub(super) fn refract(&self, wo: Vec3, u: Option<Vec2>) -> Option<Vec3> {
        let glass = self.glass.as_ref()?;
        glass.refract(wo, u.map_or(Vec3::Z, |u| glass.facet(wo, u)))
    }

    /// Returns the fraction of light that passes straight through clear walls.
    pub(super) fn straight(&self, wo: Vec3) -> Vec3 {
        self.glass.as_ref().map_or(Vec3::ZERO, |glass| glass.straight(wo.z)) * (self.glassy * self.over(wo))
    }

    /// Returns the directional albedo of [`Stack::gloss`].
    pub(super) fn gloss_albedo(&self, wo: Vec3) -> Vec3 {
        self.gloss_albedos(wo).into_iter().sum()
    }

    /// Returns the directional albedos of the lobes in [`Stack::GLOSS`].
    fn gloss_albedos(&self, wo: Vec3) -> [Vec3; 3] {
        let [fibers, coat] = [LobeKind::Fibers, LobeKind::Coat].map(|lobe| self.albedo(lobe, wo));
        [fibers, coat, self.glass_albedos(wo)[0]]
    }

    /// Returns the directional albedo of [`Stack::diffuse`] above the surface.
    pub(super) fn diffuse_albedo(&self, wo: Vec3) -> Vec3 {
        self.albedo(LobeKind::Above, wo)
    }

    /// Returns whether light passes through the surface.
    pub(super) fn transmits(&self) -> bool {
        self.glass.is_some() || self.base[1] != Vec3::ZERO
    }

    /// Returns the probabilities of sampling the lobes in [`LobeKind::ALL`].
    fn shares(&self, wo: Vec3) -> [f32; LobeKind::ALL.len()] {
        shares_of(LobeKind::ALL.map(|lobe| self.albedo(lobe, wo)))
    }

    /// Returns the density of one lobe's samples \[sr⁻¹\].
    fn lobe_pdf(&self, lobe: LobeKind, wo: Vec3, wi: Vec3) -> f32 {
        let above = wi.z > 0.0;
        match lobe {
            LobeKind::Glass => self.glass.as_ref().map_or(0.0, |glass| glass.pdf(wo, wi)),
            LobeKind::Below if !above => -wi.z * FRAC_1_PI,
            LobeKind::Below => 0.0,
            _ if !above => 0.0,
            LobeKind::Varnish => self.varnish.as_ref().map_or(0.0, |varnish| varnish.pdf(wo, wi)),
            LobeKind::Fibers => Fibers::pdf(),
            LobeKind::Coat => self.coat.as_ref().map_or(0.0, |coat| coat.ggx.pdf(wo, (wo + wi).normalize())),
            LobeKind::Above => wi.z * FRAC_1_PI,
        }
    }

    /// Draws a direction of one lobe. `choice` is in 0…1.
    fn lobe_sample(&self, lobe: LobeKind, wo: Vec3, choice: f32, u: Vec2) -> Option<Vec3> {
        match lobe {
            LobeKind::Varnish => self.varnish.as_ref()?.sample(wo, u),
            LobeKind::Fibers => {
                let direction = uniform_sphere(u);
                Some(Vec3::new(direction.x, direction.y, direction.z.abs()))
            }
            LobeKind::Coat => Some(self.coat.as_ref()?.ggx.sample(wo, u)),
            LobeKind::Above => Some(cosine_hemisphere(Vec3::Z, u)),
            LobeKind::Below => Some(-cosine_hemisphere(Vec3::Z, u)),
            LobeKind::Glass => self.glass.as_ref()?.sample(wo, choice, u),
        }
    }

    /// Returns the density of [`Stack::sample`] \[sr⁻¹\].
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let mut sum = 0.0;
        for (lobe, share) in LobeKind::ALL.into_iter().zip(self.shares(wo)) {
            if share > 0.0 {
                sum += share * self.lobe_pdf(lobe, wo, wi);
            }
        }
        sum
    }

    /// Draws a direction of a single reflection; refractions count as `None`.
    pub(super) fn sample_gloss(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        // Use the first coordinate for the choice of the lobe, then stretch it again to 0…1.
        let shares = self.gloss_shares(wo);
        let mut choice = u.x;
        for (lobe, share) in Self::GLOSS.into_iter().zip(shares) {
            if choice < share {
                let u = Vec2::new(choice / share, u.y);
                return match (lobe, &self.glass) {
                    (LobeKind::Glass, Some(glass)) => Some(glass.sample_reflection(wo, u)),
                    _ => self.lobe_sample(lobe, wo, 0.0, u),
                };
            }
            choice -= share;
        }
        None
    }

    /// Returns the density of [`Stack::sample_gloss`] \[sr⁻¹\].
    pub(super) fn gloss_pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let mut sum = 0.0;
        for (lobe, share) in Self::GLOSS.into_iter().zip(self.gloss_shares(wo)) {
            if share > 0.0 {
                sum += share
                    * match (lobe, &self.glass) {
                        (LobeKind::Glass, Some(glass)) => glass.reflection_pdf(wo, wi),
                        _ => self.lobe_pdf(lobe, wo, wi),
                    };
            }
        }
        sum
    }

    /// Returns the probabilities of the lobes in [`Stack::GLOSS`].
    fn gloss_shares(&self, wo: Vec3) -> [f32; 3] {
        shares_of(self.gloss_albedos(wo))
    }

    /// Draws an incident direction on either side of the surface. `choice` and `u` are in 0…1.
    pub(super) fn sample(&self, wo: Vec3, mut choice: f32, u: Vec2) -> Option<Vec3> {
        for (lobe, share) in LobeKind::ALL.into_iter().zip(self.shares(wo)) {
            if choice < share {
                return self.lobe_sample(lobe, wo, choice / share, u);
            }
            choice -= share;
        }
        None
    }
}

/// Returns the probabilities of sampling lobes with these albedos: their fractions of the light.
fn shares_of<const N: usize>(albedos: [Vec3; N]) -> [f32; N] {
    let shares = albedos.map(luminance);
    let sum: f32 = shares.iter().sum();
    if sum > 0.0 { shares.map(|share| share / sum) } else { shares }
}

#[cfg(test)]
mod tests;
