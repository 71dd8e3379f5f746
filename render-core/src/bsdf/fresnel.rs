//! Reflectance of a smooth interface by angle: Schlick's term or a thin film, and the exact term of a dielectric.

use super::albedo::{Albedo, AlbedoRow};
use super::film::ThinFilm;
use super::quadrature::cosine_mean;
use super::schlick::{Fresnel, Schlick};
use glam::Vec3;

/// Maximum error of a film's albedo at the typical cosine. It is added, so that no surface gains energy.
const FILM_ERROR: f32 = 0.025;

/// Schlick's term, or the mean of Schlick's term and a thin film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reflectance {
    Schlick(Schlick),
    Film(ThinFilm),
}

impl Fresnel for Reflectance {
    fn at(&self, cos: f32) -> Vec3 {
        match self {
            Self::Schlick(schlick) => schlick.at(cos),
            Self::Film(film) => film.at(cos),
        }
    }

    fn mean(&self) -> Vec3 {
        match self {
            Self::Schlick(schlick) => schlick.mean(),
            Self::Film(film) => film.mean(),
        }
    }

    fn albedo(&self, split: Albedo) -> Vec3 {
        match self {
            Self::Schlick(schlick) => schlick.albedo(split),
            // The mean reflectance of the facets is about the one at their typical cosine c, with E[(1 − c)⁵] known.
            Self::Film(film) => (film.at(typical_cosine(split)) * split.facing + FILM_ERROR).min(Vec3::ONE),
        }
    }

    fn mean_albedo(&self, row: AlbedoRow) -> Vec3 {
        match self {
            Self::Schlick(schlick) => schlick.mean_albedo(row),
            Self::Film(_) => cosine_mean(|cos| self.albedo(row.at(cos))),
        }
    }
}

/// Returns the cosine between light and facet normal that represents all facets with these albedos.
fn typical_cosine(split: Albedo) -> f32 {
    1.0 - (split.grazing / split.facing.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0).powf(0.2)
}

/// Returns the reflectance of an interface between dielectrics for unpolarised light, and the cosine of the refracted
/// ray. `eta` is the index of refraction below the interface divided by the index above it. A total reflection has a
/// refracted cosine of zero.
///
/// ```text
/// F = (r_s² + r_p²) / 2        r_s = (c − η c′) / (c + η c′)        r_p = (η c − c′) / (η c + c′)        η² (1 − c′²) = 1 − c²
/// ```
pub(super) fn dielectric(cos: f32, eta: f32) -> (f32, f32) {
    let refracted2 = 1.0 - (1.0 - cos * cos) / (eta * eta);
    if refracted2 <= 0.0 {
        return (1.0, 0.0);
    }
    let refracted = refracted2.sqrt();
    let s = (cos - eta * refracted) / (cos + eta * refracted);
    let p = (eta * cos - refracted) / (eta * cos + refracted);
    ((s * s + p * p) / 2.0, refracted)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At normal incidence, both terms equal ((η − 1) / (η + 1))². At grazing incidence, they are 1. Light refracted at
    /// an interface has the same reflectance in reverse.
    #[test]
    fn dielectrics_have_their_closed_forms() {
        for eta in [1.1f32, 1.33, 1.5, 2.4, 3.0] {
            let f0 = ((eta - 1.0) / (eta + 1.0)).powi(2);
            assert!((dielectric(1.0, eta).0 - f0).abs() < 1e-6 && dielectric(0.0, eta).0 > 0.999);
            for cos in [0.05f32, 0.3, 0.7, 0.95] {
                let (there, refracted) = dielectric(cos, eta);
                let (back, again) = dielectric(refracted, 1.0 / eta);
                assert!((there - back).abs() < 1e-4 && (again - cos).abs() < 1e-3, "η {eta}, cosine {cos}");
                // Snell's law.
                let sines = [(1.0 - cos * cos).sqrt(), eta * (1.0 - refracted * refracted).sqrt()];
                assert!((sines[0] - sines[1]).abs() < 1e-5);
            }
            // Beyond the critical angle, all light is reflected.
            let critical = (1.0 - 1.0 / (eta * eta)).sqrt();
            assert_eq!(dielectric(critical * 0.99, 1.0 / eta), (1.0, 0.0));
            assert!(dielectric(critical * 1.01, 1.0 / eta).0 < 1.0);
        }
    }
}
