//! Lobes of material extensions at a point, with all textures evaluated.

use crate::sampling::frame;
use glam::Vec3;

/// Lobes at a point of a surface, beyond a Lambert base and a coat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceLobes {
    /// Linear RGB reflectance of the base below all lobes, 0…1.
    pub base: Vec3,
    /// Linear RGB reflectance at normal incidence of the coat on the base, 0…1; zero for no coat.
    pub specular: Vec3,
    /// Perceptual roughness of base and glass, 0…1.
    pub roughness: f32,
    /// Reflectance at grazing incidence, 0…1.
    pub grazing: f32,
    /// Strength of the anisotropy, 0…1.
    pub anisotropy: f32,
    /// Direction of the wider lobe in world space, a unit vector along the surface; zero if unknown.
    pub tangent: Vec3,
    /// Fraction of the surface below a clearcoat, 0…1.
    pub clearcoat: f32,
    /// Perceptual roughness of the clearcoat.
    pub clearcoat_roughness: f32,
    /// Normal of the clearcoat in world space, a unit vector.
    pub clearcoat_normal: Vec3,
    /// Linear RGB color of the sheen, 0…1; zero for no sheen.
    pub sheen: Vec3,
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: f32,
    /// Fraction of the surface below a thin film, 0…1.
    pub film: f32,
    /// Index of refraction of the film.
    pub film_ior: f32,
    /// Thickness of the film \[nm\].
    pub film_thickness: f32,
    /// Glass in place of a fraction of the surface.
    pub glass: GlassLobe,
    /// Fraction of the base's light that is transmitted, 0…1.
    pub diffuse_transmission: f32,
    /// Linear RGB color of the diffusely transmitted light.
    pub diffuse_color: Vec3,
}

/// Glass at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlassLobe {
    /// Fraction of the surface that is glass, 0…1.
    pub factor: f32,
    /// Linear RGB factor on light that passes the surface once.
    pub tint: Vec3,
    /// Linear RGB reflectance at normal incidence, from outside.
    pub specular: Vec3,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// Whether the surface is a thin wall, which does not deflect light.
    pub is_thin: bool,
    /// Attenuation coefficient of the interior in linear RGB \[1/m\].
    pub attenuation: Vec3,
    /// Dispersion, 20 divided by the Abbe number.
    pub dispersion: f32,
}

#[cfg(test)]
impl GlassLobe {
    /// Returns clear, white glass with an interior that attenuates all colors.
    pub(crate) fn of_ior(ior: f32) -> Self {
        let specular = Vec3::splat(((ior - 1.0) / (ior + 1.0)).powi(2));
        let (tint, attenuation) = (Vec3::ONE, Vec3::ONE);
        Self { factor: 1.0, tint, specular, ior, is_thin: false, attenuation, dispersion: 0.0 }
    }
}

impl GlassLobe {
    /// Glass with a perceptual roughness below this value is clear: light passes thin walls without a visible blur.
    pub const CLEAR: f32 = 0.05;
}

impl SurfaceLobes {
    /// Returns whether light passes through the surface.
    #[must_use]
    pub fn transmits(&self) -> bool {
        self.glass.factor > 0.0 || self.diffuse_transmission > 0.0
    }

    /// Returns whether light passes straight through: the surface is a clear thin wall.
    #[must_use]
    pub fn is_clear_wall(&self) -> bool {
        self.glass.factor > 0.0 && self.glass.is_thin && self.roughness < GlassLobe::CLEAR
    }

    /// Returns the index of refraction on the far side of the surface divided by the index on the near side, if air
    /// surrounds the surface. `is_front` is whether the near side is the front.
    #[must_use]
    pub fn eta(&self, is_front: bool) -> f32 {
        if is_front || self.glass.is_thin { self.glass.ior } else { 1.0 / self.glass.ior }
    }

    /// Returns whether single reflections below the clearcoat have more than one width.
    #[must_use]
    pub fn has_several_widths(&self) -> bool {
        self.sheen != Vec3::ZERO || self.anisotropy > 0.0
    }

    /// Returns orthonormal axes of the shading frame in world space, with the unit `normal` as z and the anisotropy's
    /// tangent as x.
    #[must_use]
    pub fn axes(&self, normal: Vec3) -> [Vec3; 3] {
        let along = (self.tangent - normal * normal.dot(self.tangent)).try_normalize();
        match along.filter(|_| self.anisotropy > 0.0) {
            Some(x) => [x, normal.cross(x), normal],
            None => {
                let (x, y) = frame(normal);
                [x, y, normal]
            }
        }
    }

    /// Returns the components of a vector in world space along orthonormal axes.
    pub(super) fn local(axes: [Vec3; 3], v: Vec3) -> Vec3 {
        Vec3::from_array(axes.map(|axis| axis.dot(v)))
    }
}
