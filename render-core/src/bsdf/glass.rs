//! Glass: reflection and refraction at rough interfaces \[Walter07\], and thin walls.
//!
//! ```text
//! f_r = F D G₂ / (4 cos θ_o cos θ_i)
//! f_t = (1 − F) D G₂ (ω_o·h) |ω_i·h| / (cos θ_o |cos θ_i| (ω_o·h + η ω_i·h)²)        ω_i below
//!   η  index below the surface divided by the index above        h ∝ −(ω_o + η ω_i)
//! ```
//! f_t transports radiance, which is 1/η² times as large below the surface. A thin wall transmits by f_r, mirrored to
//! the other side, with 1 − F in place of F: both of its interfaces together do not deflect light.
//!
//! Light lost by single scattering is scattered repeatedly and leaves on both sides \[Kulla17\]:
//!
//! ```text
//! m_r = x (1 − E(θ_o)) (1 − E(θ_i)) / (π (1 − E_avg))        m_t = (1 − x) (1 − E(θ_o)) (1 − E′(θ_i)) / (π η² (1 − E′_avg))
//!   E, E′  albedo of single scattering seen from above, from below        1 − x = (1 − F_avg) min(1, η² (1 − E′_avg) / (1 − E_avg))
//! ```
//! With this x, light has the same path in reverse.

use super::coat::NOTHING;
use super::film::ThinFilm;
use super::fresnel::dielectric;
use super::ggx::Ggx;
use super::glass_albedo::GlassRow;
use super::schlick::Schlick;
use crate::luminance;
use crate::sampling::cosine_hemisphere;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Minimum difference of two indices: below it, half vectors are inaccurate.
const LEAST_CONTRAST: f32 = 1e-3;

/// Interface between two media, or a thin wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Glass {
    ggx: Ggx,
    /// Index of refraction below the surface divided by the index above.
    eta: f32,
    is_thin: bool,
    /// Whether light passes straight through: only reflection is a lobe.
    is_clear: bool,
    /// Linear RGB factor on refracted light.
    tint: Vec3,
    /// Reflectance at normal and at grazing incidence of light from outside, in place of the exact values.
    schlick: Schlick,
    film: Option<ThinFilm>,
    /// Albedos of single scattering from above and from below.
    rows: [GlassRow; 2],
    /// Fraction x of the repeatedly scattered light that is reflected.
    reflected: f32,
}

/// Properties of an interface.
#[derive(Clone, Copy, Debug)]
pub(super) struct GlassShape {
    pub(super) ggx: Ggx,
    /// Index of refraction below the surface divided by the index above.
    pub(super) eta: f32,
    pub(super) is_thin: bool,
    pub(super) is_clear: bool,
    /// Linear RGB factor on refracted light.
    pub(super) tint: Vec3,
    pub(super) schlick: Schlick,
    pub(super) film: Option<ThinFilm>,
}

impl Glass {
    pub(super) fn new(shape: GlassShape) -> Self {
        let GlassShape { ggx, eta, is_thin, is_clear, tint, schlick, film } = shape;
        let roughness = ggx.mean_roughness();
        // Keep half vectors accurate for equal indices.
        let eta = if (eta - 1.0).abs() < LEAST_CONTRAST { 1.0 + LEAST_CONTRAST } else { eta };
        let rows = if is_thin {
            [GlassRow::thin(roughness); 2]
        } else {
            [GlassRow::new(eta, roughness), GlassRow::new(1.0 / eta, roughness)]
        };
        // The mean reflectance of light from the medium of lower index, so that both sides agree on x.
        let f_mean = mean_reflectance(eta.max(1.0 / eta));
        let [above, below] = rows.map(|row| (1.0 - row.mean()).max(NOTHING));
        let ratio = if is_thin { 1.0 } else { (eta * eta * below / above).min(1.0) };
        Self { ggx, eta, is_thin, is_clear, tint, schlick, film, rows, reflected: 1.0 - (1.0 - f_mean) * ratio }
    }

    /// Returns the reflectance of a facet, and the cosine of the refracted ray.
    fn fresnel(&self, cos: f32) -> (Vec3, f32) {
        let (exact, refracted) = dielectric(cos, self.eta);
        if self.eta < 1.0 {
            return (Vec3::splat(exact), refracted);
        }
        if let Some(film) = &self.film {
            return (film.at(cos), refracted);
        }
        // Scale the exact term between the given reflectances.
        let f0 = ((self.eta - 1.0) / (self.eta + 1.0)).powi(2);
        let grazing = ((exact - f0) / (1.0 - f0)).clamp(0.0, 1.0);
        (self.schlick.f0 * (1.0 - grazing) + Vec3::splat(self.schlick.f90 * grazing), refracted)
    }

    /// Returns the half vector of two directions on different sides, and the Jacobian's denominator ω_o·h + η ω_i·h.
    /// Returns `None` if no facet refracts one into the other.
    fn refracting(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
        let h = (wo + wi * self.eta).try_normalize()?;
        let h = if h.z < 0.0 { -h } else { h };
        (wo.dot(h) > 0.0 && wi.dot(h) < 0.0).then(|| (h, wo.dot(h) + self.eta * wi.dot(h)))
    }

    /// Returns the losses of single scattering 1 − E(θ_o), 1 − E(θ_i) and 1 − E_avg of the side of ω_i.
    fn losses(&self, cos_o: f32, cos_i: f32) -> [f32; 3] {
        let row = &self.rows[usize::from(cos_i < 0.0)];
        [self.rows[0].lost(cos_o), row.lost(cos_i.abs()), (1.0 - row.mean()).max(NOTHING)]
    }

    /// Returns the BSDF for ω_o above the surface and ω_i on either side \[sr⁻¹\].
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if self.is_clear {
            return if wi.z > 0.0 { self.reflection(wo, wi, 0.0) } else { Vec3::ZERO };
        }
        let [lost_o, lost_i, lost_mean] = self.losses(wo.z, wi.z);
        let multiple = lost_o * lost_i / lost_mean * FRAC_1_PI;
        if wi.z > 0.0 {
            return self.reflection(wo, wi, 0.0) + Vec3::splat(multiple * self.reflected);
        }
        let eta2 = if self.is_thin { 1.0 } else { self.eta * self.eta };
        (self.refraction(wo, wi) + Vec3::splat(multiple * (1.0 - self.reflected) / eta2)) * self.tint
    }

    /// Returns f_r for light from a disc of `half_angle` radians.
    pub(super) fn reflection(&self, wo: Vec3, wi: Vec3, half_angle: f32) -> Vec3 {
        let h = (wo + wi).normalize();
        let ggx = if half_angle > 0.0 { self.ggx.widened(half_angle * half_angle / 4.0) } else { self.ggx };
        self.fresnel(wo.dot(h)).0 * ggx.reflectance(wo, wi, h)
    }

    /// Returns f_t without the tint.
    fn refraction(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if self.is_thin {
            let mirrored = wi * Vec3::new(1.0, 1.0, -1.0);
            let h = (wo + mirrored).normalize();
            return (Vec3::ONE - self.fresnel(wo.dot(h)).0) * self.ggx.reflectance(wo, mirrored, h);
        }
        let Some((h, denominator)) = self.refracting(wo, wi) else { return Vec3::ZERO };
        let jacobian = wo.dot(h) * -wi.dot(h) / (denominator * denominator);
        (Vec3::ONE - self.fresnel(wo.dot(h)).0) * (self.ggx.transmittance(wo, wi, h) * jacobian)
    }

    /// Returns the directional albedos of reflection and of refraction without tint, at a facet normal to the surface.
    pub(super) fn albedos(&self, cos: f32) -> [Vec3; 2] {
        let reflected = self.fresnel(cos).0;
        [reflected, if self.is_clear { Vec3::ZERO } else { Vec3::ONE - reflected }]
    }

    /// Returns the fraction of light that passes straight through.
    pub(super) fn straight(&self, cos: f32) -> Vec3 {
        if self.is_clear { (Vec3::ONE - self.fresnel(cos).0) * self.tint } else { Vec3::ZERO }
    }

    /// Returns the linear RGB factor on refracted light.
    pub(super) fn tint(&self) -> Vec3 {
        self.tint
    }

    /// Draws an incident direction on either side. `choice` and `u` are in 0…1.
    pub(super) fn sample(&self, wo: Vec3, choice: f32, u: Vec2) -> Option<Vec3> {
        if self.is_clear {
            return Some(self.sample_reflection(wo, u)).filter(|direction| direction.z > 0.0);
        }
        // Sample repeated scattering in proportion to its light.
        let lost = self.rows[0].lost(wo.z);
        if choice < lost {
            let direction = cosine_hemisphere(Vec3::Z, u);
            return Some(if choice < lost * self.reflected { direction } else { -direction });
        }
        let choice = (choice - lost) / (1.0 - lost);

        // Draw a facet, then choose between its reflection and its refraction.
        let h = self.ggx.sample_normal(wo, u);
        let cos = wo.dot(h);
        let (reflectance, refracted) = self.fresnel(cos);
        let mirrored = (h * (2.0 * cos) - wo).normalize();
        if choice < luminance(reflectance) {
            return (mirrored.z > 0.0).then_some(mirrored);
        }
        let direction = if self.is_thin {
            mirrored * Vec3::new(1.0, 1.0, -1.0)
        } else {
            (h * (cos / self.eta - refracted) - wo / self.eta).normalize()
        };
        (direction.z < 0.0).then_some(direction)
    }

    /// Returns the refracted direction of a facet with the normal `h`, or `None` at total reflection.
    pub(super) fn refract(&self, wo: Vec3, h: Vec3) -> Option<Vec3> {
        let cos = wo.dot(h);
        let direction = if self.is_clear {
            -wo
        } else if self.is_thin {
            (h * (2.0 * cos) - wo).normalize() * Vec3::new(1.0, 1.0, -1.0)
        } else {
            let (reflectance, refracted) = dielectric(cos, self.eta);
            if reflectance >= 1.0 {
                return None;
            }
            (h * (cos / self.eta - refracted) - wo / self.eta).normalize()
        };
        (direction.z < 0.0).then_some(direction)
    }

    /// Draws a facet normal visible from `wo`.
    pub(super) fn facet(&self, wo: Vec3, u: Vec2) -> Vec3 {
        self.ggx.sample_normal(wo, u)
    }

    /// Draws a direction of single reflection. It may point below the surface.
    pub(super) fn sample_reflection(&self, wo: Vec3, u: Vec2) -> Vec3 {
        self.ggx.sample(wo, u)
    }

    /// Returns the density of [`Glass::sample_reflection`] \[sr⁻¹\].
    pub(super) fn reflection_pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.ggx.pdf(wo, (wo + wi).normalize())
    }

    /// Returns the density of [`Glass::sample`] \[sr⁻¹\].
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.is_clear {
            return if wi.z > 0.0 { self.reflection_pdf(wo, wi) } else { 0.0 };
        }
        let lost = self.rows[0].lost(wo.z);
        let above = wi.z > 0.0;
        let side = if above { self.reflected } else { 1.0 - self.reflected };
        let broad = lost * side * wi.z.abs() * FRAC_1_PI;

        // Density of facets, times the probability of the event, times the Jacobian to directions.
        let facet = |h: Vec3| self.ggx.normal_pdf(wo, h) * (1.0 - lost);
        let reflected = |h: Vec3| luminance(self.fresnel(wo.dot(h)).0);
        let narrow = if above || self.is_thin {
            let h = (wo + wi * Vec3::new(1.0, 1.0, wi.z.signum())).normalize();
            let event = if above { reflected(h) } else { 1.0 - reflected(h) };
            facet(h) * event / (4.0 * wo.dot(h))
        } else {
            match self.refracting(wo, wi) {
                Some((h, denominator)) => {
                    let jacobian = self.eta * self.eta * -wi.dot(h) / (denominator * denominator);
                    facet(h) * (1.0 - reflected(h)) * jacobian
                }
                None => 0.0,
            }
        };
        broad + narrow
    }
}

/// Returns the cosine-weighted mean reflectance of light from outside a medium of index `eta` ≥ 1: a fit of
/// \[Kulla17\].
fn mean_reflectance(eta: f32) -> f32 {
    (eta - 1.0) / (4.08567 + 1.00071 * eta)
}
